"""Training: Adam, steps of the learning rate, a checkpoint an epoch from which a run goes on as if it had never stopped."""

from __future__ import annotations

import csv
import logging
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from mfar_fem.errors import DataFileError, ParameterError
from mfar_fem.files import replace_file
from reconstruction.keypoints.crops import Augmentation
from reconstruction.keypoints.data import Batch, Dataset, Sample
from reconstruction.keypoints.heatmaps import SIGMA, decode, to_input
from reconstruction.keypoints.hrnet import Architecture, HRNet, architecture, build
from reconstruction.keypoints.knowledge import Knowledge
from reconstruction.keypoints.loss import ARMS, LAMBDA, heatmap_loss, knowledge_loss, soft_argmax
from reconstruction.state_dict import save_state
from reconstruction.torch_library import torch

logger = logging.getLogger(__name__)

CHECKPOINT, BEST, LOG = "checkpoint.pt", "best.pt", "log.csv"
COLUMNS = ("epoch", "rate", "loss", "mse", "knowledge", "validation_mse", "validation_rmse_px", "seconds", "images_per_second")


@dataclass(frozen=True)
class TrainSettings:
    """Everything a run depends on besides its data; the defaults are the paper's where it gives any.

    Attributes
    ----------
    arch : Architecture
    epochs, batch_size, learning_rate, milestones, decay
        Paper: 120, 32, 1e-4, (80, 100), 0.1. Milestones at or beyond `epochs` do nothing.
    sigma : float
        Of the heat maps, heat-map pixels.
    arm : str
        The knowledge term (:data:`reconstruction.keypoints.loss.ARMS`); the paper's weight `knowledge_weight` is 0.8.
    gate : bool
        Constraints weigh as much as the heights of the peaks of their points: what is not found yet is told nothing.
    frame : str
        Whose axis and size the graph measures with: of the "true" figure or of the "predicted" one, which can blow itself up to
        please the graph. On stick figures (64 pictures, 10 epochs) the validation RMSE was 3.6 and 4.3 px for two seeds with
        gate and true frame, 6.6 and 13 px with gate and predicted frame, 60 px without the gate, 27 px for the shuffled graph,
        7 px for formula (6) as printed (the figures do not stand in the middle), and 2.8 and 3.3 px **without any knowledge term**.
    hidden_weight, absent_weight : float
        Weights in the heat-map error of present points that cannot be seen and of points that are not there (whose map is zero).
    augmentation : Augmentation
    seed : int
        Of weights, order and augmentation.
    patience : int
        Epochs without a better validation error after which the run ends; 0 for never.
    precision : str
        "float32", or "bfloat16" for mixed precision (1.5 to 2.5 times faster on CPUs that have it, 10 times
        slower on those that have not: see :func:`fast_precision`).
    threads : int
        Of torch; 0 leaves them as they are. One is *faster* than two on a machine that others use too.
    max_seconds : float
        Stops after the epoch in which this time is over; 0 for never.
    """

    arch: Architecture = field(default_factory=lambda: architecture("small"))
    epochs: int = 120
    batch_size: int = 32
    learning_rate: float = 1e-4
    milestones: tuple[int, ...] = (80, 100)
    decay: float = 0.1
    sigma: float = SIGMA
    arm: str = "graph"
    knowledge_weight: float = LAMBDA
    gate: bool = True
    frame: str = "true"
    hidden_weight: float = 1.0
    absent_weight: float = 1.0
    augmentation: Augmentation = field(default_factory=Augmentation)
    seed: int = 0
    margin: float = 0.0
    patience: int = 0
    precision: str = "float32"
    threads: int = 0
    max_seconds: float = 0.0

    def __post_init__(self):
        if self.arm not in ARMS:
            raise ParameterError(f"no knowledge term is called '{self.arm}'; there are {', '.join(ARMS)}")
        if self.precision not in ("float32", "bfloat16"):
            raise ParameterError(f"precision '{self.precision}' is not known; it is float32 or bfloat16")
        if self.frame not in ("true", "predicted"):
            raise ParameterError(f"frame '{self.frame}' is not known; it is true or predicted")
        for name in ("epochs", "batch_size", "learning_rate", "sigma"):
            if not getattr(self, name) > 0:
                raise ParameterError(f"{name} is {getattr(self, name)}; it must be positive")
        if self.batch_size < 2:
            raise ParameterError("batch_size is 1; batch normalisation needs at least 2 images")

    def to_dict(self) -> dict[str, Any]:
        """Plain values."""
        return {**asdict(self), "arch": self.arch.to_dict(), "milestones": list(self.milestones)}

    @classmethod
    def from_dict(cls, values: dict[str, Any]) -> TrainSettings:
        """The inverse of :meth:`to_dict`."""
        return cls(**{**values, "arch": Architecture.from_dict(values["arch"]), "milestones": tuple(values["milestones"]),
                      "augmentation": Augmentation(**values["augmentation"])})


@dataclass(frozen=True)
class TrainResult:
    """A finished run: the best network by validation error, its epoch, one row (:data:`COLUMNS`) an epoch, and why it ended."""

    model: HRNet
    best_epoch: int
    history: tuple[dict[str, float], ...]
    reason: str


def fast_precision() -> str:
    """"bfloat16" where the processor computes with it, else "float32": there it is imitated, at a tenth of the speed."""
    known = getattr(torch.ops.mkldnn, "_is_mkldnn_bf16_supported", None)
    return "bfloat16" if known is not None and known() else "float32"


def point_weights(batch: Batch, settings: TrainSettings):
    """Weights (b, 12) of the points in the heat-map error."""
    weight = np.where(batch.present, np.where(batch.visible, 1.0, settings.hidden_weight), settings.absent_weight)
    return torch.from_numpy(weight.astype(np.float32))


class Trainer:
    """One run: the network, its optimiser, and what has happened so far."""

    def __init__(self, settings: TrainSettings, knowledge: Knowledge | None = None):
        self.settings = settings
        self.model = build(settings.arch, settings.seed)
        self.knowledge = knowledge_loss(settings.arm, knowledge, settings.seed)
        self.optimiser = torch.optim.Adam(self.model.parameters(), lr=settings.learning_rate)
        self.history: list[dict[str, float]] = []
        self.best: tuple[float, int, dict] = (float("inf"), -1, {})

    def rate(self, epoch: int) -> float:
        """Learning rate of an epoch (from 0)."""
        s = self.settings
        return s.learning_rate * s.decay ** sum(epoch >= m for m in s.milestones)

    def forward(self, batch: Batch):
        """Heat-map error, knowledge term and heat maps of a batch."""
        s = self.settings
        images = torch.from_numpy(batch.images).contiguous(memory_format=torch.channels_last)
        with torch.autocast("cpu", dtype=torch.bfloat16, enabled=s.precision == "bfloat16"):
            maps = self.model(images)
        maps = maps.float()
        mse = heatmap_loss(maps, torch.from_numpy(batch.targets(s.sigma)), point_weights(batch, s), s.sigma)
        if self.knowledge is None:
            return mse, torch.zeros(()), maps
        peak = maps.detach().amax(dim=(-1, -2))
        # a low peak must stand out from the background as much as a full one
        points = 4.0 * soft_argmax(maps / peak.clamp_min(0.1)[..., None, None]) + 1.5  # heat-map to input pixels
        trust = peak.clamp(0.0, 1.0) if s.gate else None
        truth = torch.from_numpy(batch.points).float() if s.frame == "true" else None
        return mse, self.knowledge(points, torch.from_numpy(batch.present).float(), trust, truth), maps

    def train_epoch(self, data: Dataset, epoch: int, step: Callable[[], None] | None = None) -> dict[str, float]:
        """One pass over the training data; mean errors over its images."""
        self.model.train()
        for group in self.optimiser.param_groups:
            group["lr"] = self.rate(epoch)
        total = np.zeros(3)
        for batch in data.epoch(epoch, self.settings.batch_size):
            mse, knowledge, _ = self.forward(batch)
            loss = mse + self.settings.knowledge_weight * knowledge
            self.optimiser.zero_grad(set_to_none=True)
            loss.backward()
            self.optimiser.step()
            total += len(batch.images) * np.array([loss.item(), mse.item(), knowledge.item()])
            if not np.isfinite(total[0]):
                raise ParameterError(f"the loss is not finite in epoch {epoch}; lower the learning rate ({self.rate(epoch):g})")
            if step is not None:
                step()
        return dict(zip(("loss", "mse", "knowledge"), (total / len(data)).tolist(), strict=True))

    @torch.no_grad()
    def validate(self, data: Dataset) -> dict[str, float]:
        """Heat-map error, and root mean square distance of the present points in input pixels."""
        self.model.eval()
        total, squares, count = 0.0, 0.0, 0
        for batch in data.plain(self.settings.batch_size):
            mse, _, maps = self.forward(batch)
            total += len(batch.images) * mse.item()
            points = to_input(decode(maps.numpy(), sigma=self.settings.sigma)[0])
            squares += float((((points - batch.points) ** 2).sum(-1) * batch.present).sum())
            count += int(batch.present.sum())
        return {"validation_mse": total / len(data), "validation_rmse_px": (squares / max(count, 1)) ** 0.5}

    def state(self) -> dict[str, Any]:
        """What a checkpoint holds."""
        return {"format": "mfar-keypoints-run-1", "settings": self.settings.to_dict(), "model": self.model.state_dict(),
                "optimiser": self.optimiser.state_dict(), "history": self.history, "best": list(self.best)}

    def restore(self, path: Path) -> None:
        """Go on from a checkpoint.

        Raises
        ------
        DataFileError
            It cannot be read, or was made with other settings (epochs, patience, threads and max_seconds may differ).
        """
        try:
            state = torch.load(path, map_location="cpu", weights_only=True)
            before = TrainSettings.from_dict(state["settings"])
        except Exception as error:
            raise DataFileError(f"is no checkpoint of a run: {str(error).splitlines()[0]}", path=path) from error
        free: dict[str, Any] = {"epochs": 1, "patience": 0, "threads": 0, "max_seconds": 0.0}
        old, new = replace(before, **free).to_dict(), replace(self.settings, **free).to_dict()
        if old != new:
            key = next(k for k in new if old[k] != new[k])
            raise DataFileError(f"belongs to a run with {key} = {old[key]}, not {new[key]}; use those or another folder", path=path)
        self.model.load_state_dict(state["model"])
        self.optimiser.load_state_dict(state["optimiser"])
        self.history, self.best = state["history"], tuple(state["best"])


def train(
    training: Sequence[Sample],
    validation: Sequence[Sample],
    out: str | Path,
    settings: TrainSettings | None = None,
    *,
    knowledge: Knowledge | None = None,
    start_from: str | Path | None = None,
    resume: bool = False,
    progress: Callable[..., None] | None = None,
) -> TrainResult:
    """Train a network.

    Parameters
    ----------
    training, validation : sequence of Sample
        No identity may be in both.
    out : path-like
        Folder for ``checkpoint.pt`` (every epoch, replaced atomically), ``best.pt`` (a detector), ``log.csv`` and ``curves.png``.
    settings : TrainSettings
    knowledge : Knowledge, optional
        The graph; the shipped one without it.
    start_from : path-like, optional
        Published weights to begin with (see :mod:`reconstruction.keypoints.published`).
    resume : bool
        Go on from the folder's checkpoint if there is one; the losses are those of a run that never stopped.
    progress : callable, optional
        ``progress(steps, description=...)`` after every batch.

    Raises
    ------
    ParameterError
        No samples, or an identity in both sets, or a loss that is not finite.
    """
    from reconstruction.keypoints.plots import save_curves
    from reconstruction.keypoints.predict import Detector

    settings = settings or TrainSettings()
    _check(training, validation)
    out = Path(out)
    out.mkdir(parents=True, exist_ok=True)
    if settings.threads:
        torch.set_num_threads(settings.threads)
    run = Trainer(settings, knowledge)
    if start_from is not None:
        from reconstruction.keypoints.published import load_published

        logger.info("%s", load_published(start_from, run.model))
    if resume and (out / CHECKPOINT).exists():
        run.restore(out / CHECKPOINT)
    data = Dataset(training, settings.augmentation, settings.seed, settings.margin)
    held_out = Dataset(validation, settings.augmentation, settings.seed, settings.margin)
    begin, reason = time.perf_counter(), "all epochs done"
    for epoch in range(len(run.history), settings.epochs):
        if settings.patience and epoch - 1 - run.best[1] >= settings.patience:
            reason = f"no better validation error for {settings.patience} epochs"
            break
        start = time.perf_counter()
        step = None if progress is None else (lambda e=epoch: progress(1, description=f"epoch {e + 1} of {settings.epochs}"))
        row = {"epoch": epoch, "rate": run.rate(epoch), **run.train_epoch(data, epoch, step)}
        trained = time.perf_counter() - start
        row |= run.validate(held_out)
        row |= {"seconds": time.perf_counter() - start, "images_per_second": len(data) / trained}
        run.history.append(row)
        if row["validation_mse"] < run.best[0]:
            run.best = (row["validation_mse"], epoch, {k: v.clone() for k, v in run.model.state_dict().items()})
        save_state(run.state(), out / CHECKPOINT)
        _write_log(run.history, out / LOG)
        logger.info("epoch %d: loss %.4f, validation %.4f, RMSE %.2f px, %.1f s (%.1f images/s)", epoch + 1, row["loss"],
                    row["validation_mse"], row["validation_rmse_px"], row["seconds"], row["images_per_second"])
        if settings.max_seconds and time.perf_counter() - begin > settings.max_seconds:
            reason = f"time is up ({settings.max_seconds:g} s)"
            break
    if run.best[2]:
        run.model.load_state_dict(run.best[2])
    Detector(run.model, settings.sigma, settings.margin).save(out / BEST)
    if run.history:
        save_curves(run.history, out / "curves.png", run.best[1])
    return TrainResult(run.model.eval(), run.best[1], tuple(run.history), reason)


def _check(training: Sequence[Sample], validation: Sequence[Sample]) -> None:
    if len(training) < 2 or not validation:
        raise ParameterError(f"{len(training)} training and {len(validation)} validation samples; at least 2 and 1 are needed")
    shared = {s.identity for s in training if s.identity} & {s.identity for s in validation}
    if shared:
        raise ParameterError(f"identity '{min(shared)}' is in both training and validation ({len(shared)} such); split by identity")


def _write_log(history: Sequence[dict[str, float]], path: Path) -> None:
    def write(partial: Path) -> None:
        with partial.open("w", newline="", encoding="utf-8") as file:
            writer = csv.DictWriter(file, COLUMNS)
            writer.writeheader()
            writer.writerows(history)

    replace_file(path, write)
