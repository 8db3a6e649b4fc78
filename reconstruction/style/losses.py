r"""Formula (4), as printed and as it can be used.

As printed,

.. math::
    L = \lambda_1 \sum_{l \in C} \|\phi_l(I_A) - \phi_l(I_B^{syn})\|_2^2 + \lambda_2 \log(1 - D(I_B^{syn}))

compares the result with I_A alone. Nothing in it holds the content of B: its minimum is a copy of A (the first term is then zero),
and with pairs that show different things it asks for A's shapes at A's places. It makes sense only if the two pictures of a pair
show the same thing, registered to the pixel, which is what the alignment is meant to arrive at. The second term has almost no
slope while D tells the result apart (D near 0). ``Literal`` keeps all that; ``Usable`` compares content with B, look with A by
statistics that have no places, and uses the non-saturating adversarial term.

References
----------
Gatys, Ecker, Bethge: Image style transfer using convolutional neural networks. CVPR 2016, doi:10.1109/CVPR.2016.265 (Gram).
Huang, Belongie: doi:10.1109/ICCV.2017.167 (means and deviations).
Goodfellow et al.: Generative adversarial nets. NeurIPS 2014, arXiv:1406.2661 (section 3: why log(1 - D) is not used).
"""

from __future__ import annotations

from dataclasses import dataclass

from mfar_fem.errors import ParameterError
from reconstruction.torch_library import functional

_EPS = 1e-6


@dataclass(frozen=True)
class Literal:
    """Formula (4) as printed.

    Attributes
    ----------
    perceptual, adversarial : float
        λ1 and λ2.
    """

    perceptual: float = 1.0
    adversarial: float = 0.01
    name = "literal"

    def __call__(self, features_a: dict, features_b: dict, features_syn: dict, logits_syn) -> tuple:
        """Loss and its terms.

        Parameters
        ----------
        features_a, features_b, features_syn : dict of (n, c, h, w) tensors
            Activations by layer of I_A, I_B (not used) and I_B^syn; sizes of A's and the result's must agree.
        logits_syn : tensor
            Logits of D on I_B^syn; D is their sigmoid.

        Returns
        -------
        (tensor, dict of tensors)
            Squared norms are sums over channels and places, averaged over the batch alone.
        """
        _same_size(features_a, features_syn)
        perceptual = sum((syn - features_a[layer]).square().flatten(1).sum(1).mean() for layer, syn in features_syn.items())
        adversarial = functional.logsigmoid(-logits_syn).mean()  # log(1 - D), saturating
        terms = {"perceptual": perceptual, "adversarial": adversarial}
        return self.perceptual * perceptual + self.adversarial * adversarial, terms


@dataclass(frozen=True)
class Usable:
    """Content from B, look from A, non-saturating adversarial term.

    Attributes
    ----------
    content, style, adversarial : float
        Weights of the terms.
    statistics : str
        What look is: "moments" (channel means and deviations) or "gram" (Gram matrices).
    """

    content: float = 1.0
    style: float = 5.0
    adversarial: float = 0.01
    statistics: str = "moments"
    name = "usable"

    def __post_init__(self):
        if self.statistics not in ("moments", "gram"):
            raise ParameterError(f"statistics '{self.statistics}' are not known; they are 'moments' or 'gram'")

    def __call__(self, features_a: dict, features_b: dict, features_syn: dict, logits_syn) -> tuple:
        """Loss and its terms (see :meth:`Literal.__call__`).

        Content is compared after instance norm, so that a change of contrast or colour is not a change of content, and the
        finest layer is left to style. All terms are means.
        """
        _same_size(features_b, features_syn)
        layers = list(features_syn)
        held = layers[1:] or layers
        content = sum((_whitened(features_syn[k]) - _whitened(features_b[k])).square().mean() for k in held) / len(held)
        style = sum(style_distance(features_a[k], features_syn[k], self.statistics).mean() for k in layers) / len(layers)
        adversarial = functional.softplus(-logits_syn).mean()
        terms = {"content": content, "style": style, "adversarial": adversarial}
        return self.content * content + self.style * style + self.adversarial * adversarial, terms


def style_distance(a, b, statistics: str = "moments"):
    """Distance in look of two maps (n, c, ., .) of any sizes, for each of the batch: (n,).

    "moments": squared differences of channel means and deviations over A's mean square deviation, averaged over channels.
    "gram": squared Frobenius distance of the Gram matrices over that of A's.
    """
    if statistics == "gram":
        gram_a, gram_b = gram(a), gram(b)
        return (gram_a - gram_b).square().sum((1, 2)) / (gram_a.square().sum((1, 2)) + _EPS)
    (mean_a, std_a), (mean_b, std_b) = moments(a), moments(b)
    scale = std_a.square().mean(1) + _EPS
    return ((mean_a - mean_b).square() + (std_a - std_b).square()).mean(1) / scale


def moments(x) -> tuple:
    """Means and deviations (n, c) over the places of (n, c, h, w)."""
    return x.mean((2, 3)), (x.var((2, 3), unbiased=False) + _EPS).sqrt()


def gram(x):
    """Gram matrices (n, c, c) of (n, c, h, w), divided by the number of places."""
    flat = x.flatten(2)
    return flat @ flat.transpose(1, 2) / flat.shape[2]


def discriminator_loss(logits_real, logits_syn):
    """Cross entropy of D, which should say 1 of real pictures and 0 of made ones."""
    return 0.5 * (functional.softplus(-logits_real).mean() + functional.softplus(logits_syn).mean())


def _whitened(x):
    mean, std = moments(x)
    return (x - mean[:, :, None, None]) / std[:, :, None, None].clamp_min(0.01)


def _same_size(a: dict, b: dict) -> None:
    for layer, value in b.items():
        if a[layer].shape != value.shape:
            raise ParameterError(f"maps of layer '{layer}' differ in shape: {tuple(a[layer].shape)} and {tuple(value.shape)}")
