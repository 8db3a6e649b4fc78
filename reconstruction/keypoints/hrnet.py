"""High-resolution networks for keypoints: parallel branches at 1/4, 1/8, 1/16 and 1/32 of the input that exchange what they know.

References
----------
Sun, Xiao, Liu, Wang: Deep high-resolution representation learning for human pose estimation. CVPR 2019,
doi:10.1109/CVPR.2019.00584 (head "v1": the finest branch alone, one 1×1 convolution).
Wang et al.: Deep high-resolution representation learning for visual recognition. IEEE TPAMI 43 (2021) 3349,
doi:10.1109/TPAMI.2020.2983686 (head "v2": the four branches brought to 1/4, concatenated, mixed).
The names of the weights are those of the authors' published checkpoints (see :mod:`reconstruction.keypoints.published`).
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace

from mfar_fem.errors import ParameterError, UnknownNameError
from mfar_fem.tomlfile import suggest
from reconstruction.landmarks import LANDMARKS
from reconstruction.torch_library import functional, nn, torch


@dataclass(frozen=True)
class Architecture:
    """What a network is made of.

    Attributes
    ----------
    width : int
        Channels of the finest branch; the next ones have 2, 4 and 8 times as many.
    modules : tuple of int
        Exchange modules in the stages 2, 3 and 4.
    blocks : int
        Residual blocks of a branch between two exchanges.
    stem, stem_blocks : int
        Channels of the two stride-2 convolutions and of the bottlenecks (which put out 4 times as many), and how many bottlenecks.
    head : str
        "v1" or "v2" (see the references of the module).
    joints : int
        Number of heat maps.
    """

    width: int
    modules: tuple[int, int, int] = (1, 4, 3)
    blocks: int = 4
    stem: int = 64
    stem_blocks: int = 4
    head: str = "v2"
    joints: int = len(LANDMARKS)

    def __post_init__(self):
        if self.head not in ("v1", "v2"):
            raise ParameterError(f"head '{self.head}' is not known; it is v1 (finest branch) or v2 (all branches concatenated)")
        if min(self.width, *self.modules, self.blocks, self.stem, self.stem_blocks, self.joints) < 1 or len(self.modules) != 3:
            raise ParameterError(f"every number of an architecture is at least 1, and there are three stages of modules: {self}")

    def to_dict(self) -> dict:
        """Plain values, from which ``Architecture.from_dict`` makes the same again."""
        return {**asdict(self), "modules": list(self.modules)}

    @classmethod
    def from_dict(cls, values: dict) -> Architecture:
        """The inverse of :meth:`to_dict`."""
        return cls(**{**values, "modules": tuple(values["modules"])})


ARCHITECTURES = {
    "tiny": Architecture(8, modules=(1, 1, 1), blocks=1, stem=12, stem_blocks=1),
    "small": Architecture(12, modules=(1, 1, 1), blocks=2, stem=24, stem_blocks=1),
    "w18": Architecture(18),
    "w32": Architecture(32),
    "w48": Architecture(48),
    "pose-w32": Architecture(32, head="v1", joints=17),
    "pose-w48": Architecture(48, head="v1", joints=17),
}
"""Networks by name. "tiny" (0.24 million parameters, for comparisons that need many runs) and "small" (0.85 million) are this
project's own, for two CPU cores; "pose-…" are the published ones for COCO's 17 points (28.5 and 63.6 million parameters in Sun et
al. 2019, Table 1)."""


def architecture(name: str, **changes) -> Architecture:
    """An architecture by name, with some of its numbers changed; :class:`UnknownNameError` lists the names."""
    if name not in ARCHITECTURES:
        raise UnknownNameError(f"no network is called '{name}'{suggest(name, ARCHITECTURES)}")
    return replace(ARCHITECTURES[name], **changes)


def _convolution(into: int, out: int, kernel: int = 1, stride: int = 1) -> list:
    """Convolution without bias and its normalisation."""
    return [nn.Conv2d(into, out, kernel, stride, kernel // 2, bias=False), nn.BatchNorm2d(out)]


def _step(into: int, out: int, stride: int, active: bool = True) -> nn.Sequential:
    """3×3 convolution, normalisation, and a ReLU if active."""
    return nn.Sequential(*_convolution(into, out, 3, stride), *([nn.ReLU(inplace=True)] if active else []))


class BasicBlock(nn.Module):
    """Two 3×3 convolutions beside an identity."""

    def __init__(self, channels: int):
        super().__init__()
        self.conv1, self.bn1 = _convolution(channels, channels, 3)
        self.conv2, self.bn2 = _convolution(channels, channels, 3)

    def forward(self, x):
        """(b, c, h, w) to the same shape."""
        y = functional.relu(self.bn1(self.conv1(x)), inplace=True)
        return functional.relu(self.bn2(self.conv2(y)) + x, inplace=True)


class Bottleneck(nn.Module):
    """1×1, 3×3, 1×1 convolutions that put out four times `planes` channels, beside an identity or a projection."""

    def __init__(self, into: int, planes: int):
        super().__init__()
        out = 4 * planes
        self.conv1, self.bn1 = _convolution(into, planes)
        self.conv2, self.bn2 = _convolution(planes, planes, 3)
        self.conv3, self.bn3 = _convolution(planes, out)
        self.downsample = nn.Sequential(*_convolution(into, out)) if into != out else None

    def forward(self, x):
        """(b, into, h, w) to (b, 4 planes, h, w)."""
        y = functional.relu(self.bn1(self.conv1(x)), inplace=True)
        y = functional.relu(self.bn2(self.conv2(y)), inplace=True)
        aside = x if self.downsample is None else self.downsample(x)
        return functional.relu(self.bn3(self.conv3(y)) + aside, inplace=True)


class ExchangeModule(nn.Module):
    """Residual blocks in every branch, then every output is the sum of all branches brought to its resolution."""

    def __init__(self, channels: list[int], blocks: int, outputs: int, mode: str):
        super().__init__()
        self.mode = mode
        self.branches = nn.ModuleList(nn.Sequential(*(BasicBlock(c) for _ in range(blocks))) for c in channels)
        self.fuse_layers = nn.ModuleList(
            nn.ModuleList(_exchange(channels, j, i, mode) for j in range(len(channels))) for i in range(outputs)
        )

    def forward(self, x: list) -> list:
        """List of (b, c_i, h / 2^i, w / 2^i), one a branch, to such a list of the outputs."""
        x = [branch(value) for branch, value in zip(self.branches, x, strict=True)]
        out = []
        for i, row in enumerate(self.fuse_layers):
            total = x[i]
            for j, layer in enumerate(row):  # type: ignore[arg-type, var-annotated]
                if j != i:
                    part = layer(x[j])
                    if j > i and self.mode == "bilinear":
                        part = functional.interpolate(part, size=x[i].shape[2:], mode="bilinear", align_corners=False)
                    total = total + part
            out.append(functional.relu(total))
        return out


def _exchange(channels: list[int], source: int, target: int, mode: str):
    """Layer that brings branch `source` to the channels (and, except for bilinear upsampling, the resolution) of `target`."""
    if source == target:
        return None
    if source > target:
        up = [nn.Upsample(scale_factor=2 ** (source - target), mode="nearest")] if mode == "nearest" else []
        return nn.Sequential(*_convolution(channels[source], channels[target]), *up)
    halvings = target - source
    steps = [_step(channels[source], channels[source], 2) for _ in range(halvings - 1)]
    return nn.Sequential(*steps, _step(channels[source], channels[target], 2, active=False))


def _transition(before: list[int], after: list[int]) -> nn.ModuleList:
    """To the branches of the next stage: changed channels, and new branches from the coarsest one."""
    layers: list = []
    for i, channels in enumerate(after):
        if i < len(before):
            layers.append(_step(before[i], channels, 1) if before[i] != channels else None)
        else:
            layers.append(nn.Sequential(_step(before[-1], channels, 2)))
    return nn.ModuleList(layers)


class HRNet(nn.Module):
    """The network: images (b, 3, h, w), normalised, to heat maps (b, joints, h / 4, w / 4); h and w multiples of 32."""

    def __init__(self, arch: Architecture):
        super().__init__()
        self.arch = arch
        mode = "nearest" if arch.head == "v1" else "bilinear"  # as published, each with its head
        self.conv1, self.bn1 = _convolution(3, arch.stem, 3, 2)
        self.conv2, self.bn2 = _convolution(arch.stem, arch.stem, 3, 2)
        wide = 4 * arch.stem
        self.layer1 = nn.Sequential(*(Bottleneck(wide if i else arch.stem, arch.stem) for i in range(arch.stem_blocks)))
        before = [wide]
        for stage, count in zip((2, 3, 4), arch.modules, strict=True):
            channels = [arch.width * 2**i for i in range(stage)]
            modules = []
            for m in range(count):
                last = stage == 4 and m == count - 1 and arch.head == "v1"
                modules.append(ExchangeModule(channels, arch.blocks, 1 if last else stage, mode))
            setattr(self, f"transition{stage - 1}", _transition(before, channels))
            setattr(self, f"stage{stage}", nn.Sequential(*modules))
            before = channels
        if arch.head == "v1":
            self.final_layer = nn.Conv2d(arch.width, arch.joints, 1)
            last_layer = self.final_layer
        else:
            total = sum(before)
            last_layer = nn.Conv2d(total, arch.joints, 1)
            self.head = nn.Sequential(nn.Conv2d(total, total, 1), nn.BatchNorm2d(total), nn.ReLU(inplace=True), last_layer)
        for module in self.modules():
            if isinstance(module, nn.Conv2d):
                nn.init.kaiming_normal_(module.weight, mode="fan_out", nonlinearity="relu")
        nn.init.normal_(last_layer.weight, std=1e-3)
        last_layer.bias.data.zero_()  # type: ignore[union-attr]

    def forward(self, x):
        """(b, 3, h, w) to (b, joints, h / 4, w / 4)."""
        x = functional.relu(self.bn1(self.conv1(x)), inplace=True)
        x = functional.relu(self.bn2(self.conv2(x)), inplace=True)
        branches = [self.layer1(x)]
        for stage in (2, 3, 4):
            layers = getattr(self, f"transition{stage - 1}")
            known = len(branches)
            old = branches
            branches = [
                (old[i] if layer is None else layer(old[i])) if i < known and stage > 2 else layer(old[-1])
                for i, layer in enumerate(layers)
            ]
            branches = getattr(self, f"stage{stage}")(branches)
        if self.arch.head == "v1":
            return self.final_layer(branches[0])
        size = branches[0].shape[2:]
        fine = [functional.interpolate(b, size=size, mode="bilinear", align_corners=False) for b in branches[1:]]
        return self.head(torch.cat([branches[0], *fine], dim=1))


def build(arch: Architecture | str = "small", seed: int | None = None) -> HRNet:
    """A network with random weights (repeatable with a seed), in the memory layout that is fastest on a CPU."""
    if isinstance(arch, str):
        arch = architecture(arch)
    with torch.random.fork_rng():
        if seed is not None:
            torch.manual_seed(seed)
        return channels_last(HRNet(arch))


def channels_last(model: HRNet) -> HRNet:
    """The network with its weights in the memory layout that is fastest on a CPU."""
    return model.to(memory_format=torch.channels_last)  # type: ignore[call-overload]


def parameter_count(model: nn.Module) -> int:
    """Number of trained numbers."""
    return sum(p.numel() for p in model.parameters())
