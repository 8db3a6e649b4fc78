"""Formula (4) by hand, its degenerate minimum, and gradients checked by differences."""

import math

import pytest

torch = pytest.importorskip("torch")

from mfar_fem.errors import ParameterError  # noqa: E402
from reconstruction.style.losses import Literal, Usable, discriminator_loss, gram, style_distance  # noqa: E402


def maps(seed, n=2, size=6, dtype=torch.float64):
    rng = torch.Generator().manual_seed(seed)
    return {"fine": torch.rand(n, 3, size, size, generator=rng, dtype=dtype), "coarse": torch.rand(n, 5, size // 2, size // 2,
                                                                                                    generator=rng, dtype=dtype)}


A, B, SYN = maps(0), maps(1), maps(2)
LOGITS = torch.tensor([[0.3, -1.2], [2.0, 0.1]], dtype=torch.float64)


def test_literal_is_the_printed_sum():
    loss, terms = Literal()(A, B, SYN, LOGITS)
    norm = sum(float(((A[k] - SYN[k]) ** 2).sum()) / 2 for k in A)  # two pairs
    log = sum(math.log(1 - 1 / (1 + math.exp(-float(x)))) for x in LOGITS.flatten()) / 4
    assert float(loss) == pytest.approx(1.0 * norm + 0.01 * log) and float(terms["perceptual"]) == pytest.approx(norm)


def test_literal_knows_nothing_of_b_and_is_least_for_a_copy_of_a():
    assert float(Literal()(A, B, SYN, LOGITS)[0]) == float(Literal()(A, maps(9), SYN, LOGITS)[0])
    assert float(Literal()(A, B, A, LOGITS)[1]["perceptual"]) == 0.0
    assert float(Literal()(A, B, B, LOGITS)[1]["perceptual"]) > 1.0


def test_usable_asks_for_content_of_b_and_look_of_a():
    kept = Usable()(A, B, B, LOGITS)[1]
    copied = Usable()(A, B, A, LOGITS)[1]
    assert float(kept["content"]) == 0.0 < float(copied["content"])
    assert float(copied["style"]) == pytest.approx(0.0, abs=1e-12) and float(kept["style"]) > 0


@pytest.mark.parametrize("statistics", ["moments", "gram"])
def test_look_has_no_places(statistics):
    order = torch.randperm(36, generator=torch.Generator().manual_seed(3))
    shuffled = A["fine"].flatten(2)[:, :, order].unflatten(2, (6, 6))
    assert style_distance(A["fine"], shuffled, statistics).abs().max() < 1e-12
    assert (style_distance(A["fine"], 0.5 * A["fine"], statistics) > 0.05).all()


def test_gram_by_hand():
    x = torch.arange(8.0).reshape(1, 2, 2, 2)
    assert gram(x)[0].tolist() == [[14 / 4, 38 / 4], [38 / 4, 126 / 4]]


def test_printed_adversarial_term_saturates_and_the_usable_one_does_not():
    """While D is sure that the result is made (logit -8), the printed term has next to no slope."""
    slopes = []
    for loss in (Literal(), Usable()):
        logit = torch.tensor([-8.0], requires_grad=True)
        loss(A, B, SYN, logit)[1]["adversarial"].backward()
        slopes.append(float(logit.grad))
    assert slopes[0] == pytest.approx(-1 / (1 + math.exp(8)), rel=1e-3)
    assert slopes[1] == pytest.approx(-1.0, abs=1e-3)  # both push the logit up


@pytest.mark.parametrize("loss", [Literal(), Usable(), Usable(statistics="gram")])
def test_gradients(loss):
    keys = list(SYN)
    inputs = [SYN[k].clone().requires_grad_() for k in keys] + [LOGITS.clone().requires_grad_()]
    assert torch.autograd.gradcheck(lambda *x: loss(A, B, dict(zip(keys, x[:-1], strict=True)), x[-1])[0], inputs)


def test_discriminator_loss_is_log_2_when_undecided_and_falls_when_right():
    zero = torch.zeros(4)
    assert float(discriminator_loss(zero, zero)) == pytest.approx(math.log(2))
    assert float(discriminator_loss(zero + 3, zero - 3)) < 0.06 < 2 < float(discriminator_loss(zero - 3, zero + 3))


def test_shapes_and_names_are_checked():
    with pytest.raises(ParameterError, match="fine"):
        Literal()(A, B, maps(3, size=8), LOGITS)
    with pytest.raises(ParameterError, match="moments"):
        Usable(statistics="mean")
