"""Generator and discriminator: what they promise before any training."""

import pytest

torch = pytest.importorskip("torch")

from mfar_fem.errors import ParameterError  # noqa: E402
from reconstruction.style.discriminator import PatchDiscriminator  # noqa: E402
from reconstruction.style.generator import Generator, adaptive_instance_norm  # noqa: E402
from reconstruction.style.published import count_parameters  # noqa: E402


def pictures(n=2, size=32, seed=0):
    torch.manual_seed(seed)
    return 0.4 + 0.2 * torch.rand(n, 3, size, size), 0.3 + 0.1 * torch.rand(n, 3, size, size)


def test_adaptive_instance_norm_takes_over_the_moments():
    a, b = pictures()
    made = adaptive_instance_norm(b, a)
    assert torch.allclose(made.mean((2, 3)), a.mean((2, 3)), atol=1e-5)
    assert torch.allclose(made.std((2, 3)), a.std((2, 3)), rtol=0.01)
    assert torch.allclose(adaptive_instance_norm(b, a, 0.0), b)
    assert torch.allclose(adaptive_instance_norm(b, b), b, atol=1e-5)


@pytest.mark.parametrize("skips", [True, False])
def test_before_training_it_is_a_transfer_of_moments_in_rgb(skips):
    a, b = pictures()
    made = Generator(skips=skips)(a, b)
    assert torch.allclose(made, adaptive_instance_norm(b, a).clamp(0.02, 0.98), atol=1e-5)


class Pointwise(torch.nn.Module):
    """Means over blocks and a mixing of channels: maps that move with the blocks of a picture."""

    channels, strides = (16, 32, 64, 128), (1, 2, 4, 8)

    def __init__(self):
        super().__init__()
        self.mix = torch.nn.ModuleList([torch.nn.Conv2d(3, c, 1) for c in self.channels])

    def forward(self, image):
        pooled = [torch.nn.functional.avg_pool2d(image, s) for s in self.strides]
        return [mix(x).relu() for mix, x in zip(self.mix, pooled, strict=True)]


def test_a_cannot_be_copied_only_its_statistics_pass():
    """Blocks of A in another order have the same statistics: the result is the same, though A shows something else."""
    a, b = pictures(1)
    generator = Generator()
    generator.encoder = Pointwise()
    torch.nn.init.normal_(generator.last.weight, std=0.1)
    blocks = a.reshape(1, 3, 4, 8, 4, 8).permute(0, 1, 2, 4, 3, 5).flatten(2, 3)
    order = torch.randperm(16, generator=torch.Generator().manual_seed(1))
    shuffled = blocks[:, :, order].unflatten(2, (4, 4)).permute(0, 1, 2, 4, 3, 5).reshape(a.shape)
    assert (shuffled - a).abs().max() > 0.1
    assert torch.allclose(generator(shuffled, b), generator(a, b), atol=1e-5)
    assert (generator(a**2, b) - generator(a, b)).abs().max() > 0.01  # other statistics do pass


def test_sizes_may_differ_but_must_fit_the_encoder():
    a, b = pictures()
    assert Generator()(a[..., :24, :16], b).shape == b.shape
    with pytest.raises(ParameterError, match="multiples of 8"):
        Generator()(a, b[..., :30, :])
    with pytest.raises(ParameterError, match="resnet50"):
        Generator("resnet18")


def test_all_weights_are_reached_by_the_gradient():
    a, b = pictures()
    generator = Generator()
    torch.nn.init.normal_(generator.last.weight, std=0.1)
    generator(a, b).square().sum().backward()
    assert all(p.grad is not None and p.grad.abs().sum() > 0 for p in generator.parameters())
    assert count_parameters(generator) * 4 < 5e6  # bytes: small enough to ship


def test_resnet_encoder_is_frozen_and_u_shaped():
    a, b = pictures(1, 64)
    generator = Generator("resnet50")
    torch.nn.init.normal_(generator.last.weight, std=0.1)
    generator(a, b).sum().backward()
    assert all(p.grad is None for p in generator.encoder.parameters())
    assert all(p.grad is not None for p in generator.decoder.parameters()) and generator.multiple == 16


@pytest.mark.parametrize(("layers", "field"), [(1, 16), (2, 34), (3, 70)])
def test_field_of_the_discriminator(layers, field):
    """A logit changes with the pixels of its patch and no others (instance norm, which sees everything, put aside)."""
    torch.manual_seed(0)
    critic = PatchDiscriminator(3, width=8, layers=layers)
    critic.body = torch.nn.Sequential(*[m for m in critic.body if not isinstance(m, torch.nn.InstanceNorm2d)])
    image = torch.rand(1, 3, 160, 160, requires_grad=True)
    logits = critic(image, torch.tensor([1]))
    logits[0, 0, logits.shape[2] // 2, logits.shape[3] // 2].backward()
    touched = image.grad.abs().sum((0, 1))
    assert critic.field == field
    assert int((touched.sum(1) > 0).sum()) == field and int((touched.sum(0) > 0).sum()) == field


def test_discriminator_judges_by_kind():
    critic, image = PatchDiscriminator(3), torch.rand(1, 3, 64, 64)
    maps = critic.head(critic.body(2 * image - 1))
    for kind in range(3):
        assert torch.equal(critic(image, torch.tensor([kind])), maps[:, kind : kind + 1])
