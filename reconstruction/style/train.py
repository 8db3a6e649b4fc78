"""Training of generator and discriminator, which goes on after a kill exactly as if there had been none."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from mfar_fem.errors import DataFileError, NotConvergedError, ParameterError
from reconstruction.landmarks import KINDS
from reconstruction.state_dict import save_state
from reconstruction.style.align import save_aligner
from reconstruction.style.checkpoint import CsvLog, load_checkpoint
from reconstruction.style.data import Batch, Pool
from reconstruction.style.discriminator import PatchDiscriminator
from reconstruction.style.features import load_features
from reconstruction.style.generator import Generator
from reconstruction.style.losses import Literal, Usable, discriminator_loss
from reconstruction.torch_library import torch

_LOG = logging.getLogger(__name__)
CHECKPOINT, WEIGHTS, LOG = "checkpoint.pt", "aligner.pt", "log.csv"
"""Names of the files in the output folder."""


@dataclass(frozen=True)
class Settings:
    """All that decides a run.

    Attributes
    ----------
    loss : str
        "usable" or "literal" (see :mod:`losses`).
    registered : bool
        Draw pairs from the same window of registered pictures.
    features : str
        Feature network (see :func:`features.load_features`).
    layers : tuple of str or None
        The set C of formula (4).
    encoder, skips, encoder_weights
        Of the generator (see :class:`generator.Generator`); the file of ResNet-50.
    content, style, adversarial : float
        Weights of the usable loss; the literal one has the paper's.
    statistics : str
        "moments" or "gram", of the usable loss.
    steps, batch : int
    rate : float
        Of Adam, for both networks.
    average : float
        Decay of the running mean of the generator's weights, which is what is saved for use.
    seed : int
    """

    loss: str = "usable"
    registered: bool = False
    features: str = "small"
    layers: tuple[str, ...] | None = None
    encoder: str = "small"
    skips: bool = True
    encoder_weights: str | None = None
    content: float = 1.0
    style: float = 5.0
    adversarial: float = 0.01
    statistics: str = "moments"
    steps: int = 400
    batch: int = 4
    rate: float = 5e-4
    average: float = 0.98
    seed: int = 0

    def __post_init__(self):
        if self.loss not in ("usable", "literal"):
            raise ParameterError(f"loss '{self.loss}' is not known; it is 'usable' or 'literal'")
        if min(self.steps, self.batch) < 1 or not self.rate > 0 or not 0 <= self.average < 1:
            raise ParameterError(f"steps and batch are at least 1, the rate is positive and the average within [0, 1): {self}")


class Trainer:
    """One run.

    Parameters
    ----------
    settings : Settings
    pool : Pool
    out : pathlib.Path
        Folder of checkpoint, log and weights.
    resume : bool
        Go on from the checkpoint if there is one.

    Raises
    ------
    DataFileError
        The checkpoint is of other settings (steps aside) or other pictures.
    """

    def __init__(self, settings: Settings, pool: Pool, out: Path, resume: bool = True):
        self.settings, self.pool, self.out = settings, pool, Path(out)
        self.out.mkdir(parents=True, exist_ok=True)
        torch.manual_seed(settings.seed)
        self.features = load_features(settings.features, settings.layers)
        self.generator = Generator(settings.encoder, settings.skips)
        if settings.encoder == "resnet50":
            if settings.encoder_weights is None:
                raise ParameterError("the encoder 'resnet50' needs torchvision's published file; the encoder 'small' needs none")
            self.generator.encoder.load(settings.encoder_weights)
        self.discriminator = PatchDiscriminator(len(KINDS))
        self.loss: Any = Literal() if settings.loss == "literal" else Usable(
            settings.content, settings.style, settings.adversarial, settings.statistics)
        learnt = [p for p in self.generator.parameters() if p.requires_grad]
        self.optimizers = [torch.optim.Adam(learnt, settings.rate, betas=(0.5, 0.99)),
                           torch.optim.Adam(self.discriminator.parameters(), settings.rate, betas=(0.5, 0.99))]
        self.mean = {name: value.clone() for name, value in self.generator.state_dict().items()}
        self.step, self.seconds = 0, 0.0
        path = self.out / CHECKPOINT
        if resume and path.is_file():
            self._restore(load_checkpoint(path), path)
        names = ("perceptual", "adversarial") if settings.loss == "literal" else ("content", "style", "adversarial")
        self.log = CsvLog(self.out / LOG, ("loss", *names, "discriminator"), self.step)

    def run(self, checkpoint_every: int = 50, sheet_every: int = 100, progress: Callable[[int, dict], None] | None = None) -> dict:
        """Train up to ``settings.steps`` and write the weights.

        Parameters
        ----------
        checkpoint_every, sheet_every : int
            Steps between checkpoints, and between sheets ``sample-STEP.png`` of A, B and the result (0: none).
        progress : callable, optional
            ``progress(steps done, terms of the loss)``.

        Returns
        -------
        dict
            Steps, seconds, parameters of the generator, path of the weights.
        """
        began = time.perf_counter() - self.seconds
        while self.step < self.settings.steps:
            values = self.advance()
            self.seconds = time.perf_counter() - began
            if self.step % checkpoint_every == 0 or self.step == self.settings.steps:
                save_state(self._state(), self.out / CHECKPOINT)
            if sheet_every and (self.step % sheet_every == 0 or self.step == self.settings.steps):
                self.sheet(self.out / f"sample-{self.step:06d}.png")
            if progress is not None:
                progress(self.step, values)
        about = {**asdict(self.settings), "layers": list(self.features.layers), "trained_steps": self.step}
        save_aligner(self.mean, self.settings.encoder, self.settings.skips, self.out / WEIGHTS, about)
        count = sum(p.numel() for p in self.generator.parameters())
        _LOG.info("trained %d steps in %.0f s", self.step, self.seconds)
        return {"steps": self.step, "seconds": self.seconds, "parameters": count, "weights": self.out / WEIGHTS}

    def advance(self) -> dict[str, float]:
        """One step of both networks; its pairs follow from seed and number of the step alone."""
        rng = np.random.default_rng([self.settings.seed, self.step])
        batch = self.pool.batch(rng, self.settings.batch, self.settings.registered)
        like, image, kind = tensor(batch.like), tensor(batch.image), torch.from_numpy(batch.kind_like)
        made = self.generator(like, image)
        with torch.no_grad():
            features_a = self.features(like)
            features_b = self.features(image)
        self.discriminator.requires_grad_(False)
        loss, terms = self.loss(features_a, features_b, self.features(made), self.discriminator(made, kind))
        if not torch.isfinite(loss):
            raise NotConvergedError(f"the loss is not finite at step {self.step}; use a lower rate than {self.settings.rate:g}")
        self.optimizers[0].zero_grad(set_to_none=True)
        loss.backward()
        self.optimizers[0].step()
        self.discriminator.requires_grad_(True)
        judged = discriminator_loss(self.discriminator(like, kind), self.discriminator(made.detach(), kind))
        self.optimizers[1].zero_grad(set_to_none=True)
        judged.backward()
        self.optimizers[1].step()
        for name, value in self.generator.state_dict().items():
            if value.is_floating_point():
                self.mean[name].lerp_(value, 1.0 - self.settings.average)
        values = {"loss": loss.item(), **{k: v.item() for k, v in terms.items()}, "discriminator": judged.item()}
        self.log.write(self.step, values)
        self.step += 1
        return values

    def sheet(self, path: Path, pairs: int = 6) -> None:
        """A picture of pairs that do not change from sheet to sheet: A, B and what is made of B."""
        from reconstruction.style.sheet import save_sheet

        batch: Batch = self.pool.batch(np.random.default_rng([self.settings.seed, 2**31]), pairs, self.settings.registered)
        with torch.no_grad():
            made = self.generator(tensor(batch.like), tensor(batch.image))
        made_pictures = np.rint(255 * made.permute(0, 2, 3, 1).numpy()).astype(np.uint8)
        rows = [list(row) for row in zip(batch.like, batch.image, made_pictures, strict=True)]
        save_sheet(rows, ["A", "B", "B, aligned"], path)

    def _state(self) -> dict:
        return {"settings": _comparable(self.settings), "data": self.pool.digest, "step": self.step, "seconds": self.seconds,
                "generator": self.generator.state_dict(), "discriminator": self.discriminator.state_dict(), "mean": self.mean,
                "optimizers": [o.state_dict() for o in self.optimizers]}

    def _restore(self, state: dict, path: Path) -> None:
        now = _comparable(self.settings)
        if state.get("settings") != now:
            differ = ", ".join(k for k in now if state.get("settings", {}).get(k) != now[k])
            raise DataFileError(f"is of a run with other settings ({differ}); use them, another folder, or --fresh", path=path)
        if state["data"] != self.pool.digest:
            raise DataFileError("is of a run on other pictures; use another folder, or --fresh", path=path)
        self.generator.load_state_dict(state["generator"])
        self.discriminator.load_state_dict(state["discriminator"])
        for optimizer, saved in zip(self.optimizers, state["optimizers"], strict=True):
            optimizer.load_state_dict(saved)
        self.mean = state["mean"]
        self.step, self.seconds = state["step"], state["seconds"]


def tensor(pictures: np.ndarray):
    """(n, h, w, 3) uint8 pictures as an (n, 3, h, w) float32 tensor in [0, 1]."""
    return torch.from_numpy(np.array(pictures)).permute(0, 3, 1, 2).float().div(255.0).contiguous()


def _comparable(settings: Settings) -> dict:
    """Settings as plain values; the number of steps may grow."""
    values = asdict(settings)
    del values["steps"]
    if values["layers"] is not None:
        values["layers"] = list(values["layers"])
    return values
