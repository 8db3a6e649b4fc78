"""HRNet: published parameter counts and names, shapes, published weights in and out."""

from __future__ import annotations

import pytest

torch = pytest.importorskip("torch")

from mfar_fem.errors import DataFileError, ParameterError, UnknownNameError  # noqa: E402
from reconstruction.keypoints.hrnet import ARCHITECTURES, Architecture, architecture, build, parameter_count  # noqa: E402
from reconstruction.keypoints.predict import Detector  # noqa: E402
from reconstruction.keypoints.published import load_published  # noqa: E402

TINY = Architecture(4, (1, 1, 1), 1, 8, 1)


@pytest.mark.parametrize(
    ("name", "changes", "millions"),
    [
        ("pose-w32", {}, 28.5),  # Sun et al. 2019, Table 1
        ("pose-w48", {}, 63.6),
        ("w18", {"joints": 98}, 9.66),  # OpenVINO's conversion of HRNetV2-W18 for the 98 points of WFLW
    ],
)
def test_published_parameter_counts(name, changes, millions):
    with torch.device("meta"):
        count = sum(p.numel() for p in build_on_meta(name, changes).parameters())
    assert count / 1e6 == pytest.approx(millions, abs=0.06 if millions > 20 else 0.006)


def build_on_meta(name, changes):
    from reconstruction.keypoints.hrnet import HRNet

    return HRNet(architecture(name, **changes))


def test_the_small_network_fits_into_the_package():
    assert parameter_count(build("small")) * 2 < 20e6 / 4  # bytes in float16


@pytest.mark.parametrize("head", ["v1", "v2"])
def test_shapes_and_that_every_weight_is_used(head):
    model = build(Architecture(4, (1, 1, 1), 1, 8, 1, head), seed=0)
    out = model(torch.randn(2, 3, 256, 192))
    assert out.shape == (2, 12, 64, 48)
    assert model(torch.randn(2, 3, 64, 96)).shape == (2, 12, 16, 24)
    out.square().sum().backward()
    assert all(p.grad is not None and p.grad.abs().sum() > 0 for p in model.parameters())


def test_names_are_the_published_ones():
    names = set(build("pose-w32").state_dict())
    for name in (
        "conv1.weight", "bn2.running_var", "layer1.0.downsample.1.weight", "layer1.3.conv3.weight", "transition1.0.0.weight",
        "transition1.1.0.0.weight", "transition2.2.0.1.bias", "stage2.0.branches.1.3.bn2.weight",
        "stage2.0.fuse_layers.0.1.0.weight",
        "stage3.3.fuse_layers.2.0.0.0.weight", "stage3.3.fuse_layers.2.0.1.1.weight", "stage4.2.branches.3.0.conv1.weight",
        "stage4.2.fuse_layers.0.3.1.running_mean", "final_layer.weight", "final_layer.bias",
    ):
        assert name in names
    assert not any(n.startswith(("stage4.2.fuse_layers.1", "transition2.0", "transition3.2", "head")) for n in names)
    assert {"head.0.weight", "head.1.weight", "head.3.bias"} <= set(build(TINY).state_dict())


def test_a_seed_repeats_and_leaves_torch_alone():
    before = torch.random.get_rng_state()
    a, b, c = (build(TINY, seed).state_dict()["conv1.weight"] for seed in (1, 1, 2))
    assert torch.equal(a, b) and not torch.equal(a, c)
    assert torch.equal(torch.random.get_rng_state(), before)


def tiny(head="v1", joints=17, width=4):
    return build(Architecture(width, (1, 1, 1), 1, 8, 1, head, joints), seed=3)


def test_published_weights_load_and_the_last_layer_is_swapped(tmp_path):
    source, target = tiny(), tiny(joints=12)
    torch.save({"state_dict": {f"module.{k}": v for k, v in source.state_dict().items()}}, tmp_path / "coco.pth")
    report = load_published(tmp_path / "coco.pth", target)
    assert set(report.swapped) == {"final_layer.weight", "final_layer.bias"}
    assert report.missing == () and report.unexpected == ()
    x = torch.randn(1, 3, 64, 64)
    features = {}
    for name, model in (("source", source), ("target", target)):
        model.eval()
        model.stage4.register_forward_hook(lambda m, i, o, name=name: features.__setitem__(name, o[0]))
        model(x)
    assert torch.equal(features["source"], features["target"])
    assert target(x).shape[1] == 12


def test_a_detector_can_be_begun_with(tmp_path):
    source, target = tiny("v2", 12), tiny("v2", 12, width=4)
    with torch.no_grad():
        source.conv1.weight += 1.0
    Detector(source, 3.0).save(tmp_path / "detector.pt")
    report = load_published(tmp_path / "detector.pt", target)
    assert report.missing == () and report.unexpected == () and report.swapped == ()
    assert torch.allclose(target.conv1.weight, source.conv1.weight, atol=2e-3)  # convolutions are kept in 16 bits


def test_what_is_missing_and_unexpected_is_said(tmp_path, caplog):
    torch.save(tiny("v1").state_dict(), tmp_path / "pose.pth")
    report = load_published(tmp_path / "pose.pth", tiny("v2", 12))
    assert "head.0.weight" in report.missing and "stage4.0.fuse_layers.1.0.0.0.weight" in report.missing
    assert set(report.unexpected) == {"final_layer.weight", "final_layer.bias"}
    assert "missing" in str(report) and "missing" in caplog.text


def test_wrong_files_are_named(tmp_path):
    with pytest.raises(DataFileError, match=r"nowhere\.pth.*no such file"):
        load_published(tmp_path / "nowhere.pth", tiny())
    (tmp_path / "text.pth").write_text("hello")
    with pytest.raises(DataFileError, match="can be read safely"):
        load_published(tmp_path / "text.pth", tiny())
    torch.save(tiny(width=8).state_dict(), tmp_path / "wide.pth")
    with pytest.raises(DataFileError, match="does not fit a network of width 4"):
        load_published(tmp_path / "wide.pth", tiny())
    torch.save({"a": torch.zeros(2)}, tmp_path / "other.pth")
    with pytest.raises(DataFileError, match="none of the network's weights"):
        load_published(tmp_path / "other.pth", tiny())


def test_architectures():
    assert Architecture.from_dict(architecture("w18").to_dict()) == ARCHITECTURES["w18"]
    with pytest.raises(UnknownNameError, match="did you mean 'w48'"):
        architecture("w47")
    with pytest.raises(ParameterError, match="v1"):
        Architecture(18, head="v3")
    with pytest.raises(ParameterError, match="at least 1"):
        Architecture(18, blocks=0)
