"""The run behind ``mfar keypoints``: pictures or a folder of sources to ``keypoints.json`` and pictures of what was found."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from mfar_fem.cli.console import check_writable
from mfar_fem.errors import InputError
from reconstruction import images as pictures
from reconstruction.images import LoadedImage
from reconstruction.keypoints.baselines import mask_box
from reconstruction.keypoints.framing import frame
from reconstruction.keypoints.weights_file import SHIPPED
from reconstruction.keypoints_file import ImageKeypoints, KeypointsFile, write_keypoints
from reconstruction.landmarks import KINDS, LANDMARKS, STATURE, points_of
from reconstruction.sources import Source, read
from reconstruction.template.dimensions import garment_type

if TYPE_CHECKING:
    from reconstruction.keypoints.predict import Detector

FILE = "keypoints.json"


UNSURE = 0.6
"""Mean confidence of a picture's points from which on down its framing is worth a look (0.93 on pictures framed as in training)."""


@dataclass(frozen=True, eq=False)
class Entry:
    """A picture whose points are to be found.

    Attributes
    ----------
    path : Path
    kind : str
    image : LoadedImage
    box : (x0, y0, x1, y1) or None
        Where to look (:mod:`reconstruction.keypoints.framing`).
    known : mapping
        What else the file of keypoints keeps: ``figure``, ``height``, ``mask``, ``scale``.
    """

    path: Path
    kind: str
    image: LoadedImage
    box: tuple[float, float, float, float] | None = None
    known: Mapping[str, Any] = field(default_factory=dict)


def entries_of(paths: Sequence[Path], kind: str = "mural", figure: str | None = None, garment: str | None = None,
               progress: Callable[..., None] | None = None) -> list[Entry]:
    """The pictures of a list of files, or of one folder with a ``sources.toml``.

    Parameters
    ----------
    paths : sequence of Path
    kind, figure : str
        Of pictures without ``sources.toml``.
    garment : str, optional
        Type: how pictures of it are framed.
    progress : callable, optional
        ``progress(total=n)`` when their number is known, ``progress(1)`` after each.

    Raises
    ------
    InputError
        Unknown kind or figure, or the folder or a picture is wrong.
    """
    report = progress or (lambda *number, **more: None)
    if len(paths) == 1 and (paths[0].is_dir() or paths[0].suffix.lower() == ".toml"):
        found, entries = read(paths[0]), []
        report(0, total=2 * len(found.sources))

        def use(source: Source, image: LoadedImage, mask: np.ndarray | None) -> None:
            box = frame(source.kind, image.size, None if mask is None else mask_box(mask), source.box, garment)
            known = {"figure": None if source.figure == "none" else source.figure, "height": source.height, "mask": source.mask,
                     "scale": source.scale_entry()}
            entries.append(Entry(source.path, source.kind, image, box, known))
            report(1)

        found.load_each(use)
        return entries
    if kind not in KINDS:
        raise InputError(f"--kind '{kind}' is none of {', '.join(KINDS)}")
    if figure not in (None, *STATURE):
        raise InputError(f"--figure '{figure}' is none of {', '.join(STATURE)}")
    for path in paths:
        if not path.is_file():
            what = "is a folder; give one folder with a sources.toml alone, or pictures" if path.is_dir() else "does not exist"
            raise InputError(f"{path}: {what}{'' if path.is_dir() else '; give pictures, or one folder with a sources.toml'}")
    report(0, total=2 * len(paths))
    entries = []
    for path in paths:
        entries.append(Entry(path, kind, pictures.load(path), known={"figure": figure}))
        report(1)
    return entries


def locate(
    paths: Sequence[Path], folder: Path, weights: str = SHIPPED, *, kind: str = "mural", figure: str | None = None,
    least: float = 0.5, flip: bool = True, heatmaps: bool = False, garment: str | None = None,
    progress: Callable[..., None] | None = None,
) -> dict[str, Any]:
    """Find the twelve points of pictures.

    Parameters
    ----------
    paths : sequence of Path
        Pictures, or one folder with a ``sources.toml``.
    folder : Path
        Made when all pictures are read; gets ``keypoints.json``, ``predictions.png``, with `heatmaps` one picture more for
        each.
    weights : str
        A detector's file, or "shipped".
    kind, figure : str
        Of pictures without ``sources.toml``.
    least : float
        Points less likely than this to exist are left out.
    flip : bool
        Look at the mirrored picture too.
    garment : str, optional
        Type, for the file; of a type that the detector knows, points have to agree with known postures.
    progress : callable, optional
        ``progress(1)`` after each picture that was read or looked at, ``progress(0, total=2 n)`` at the start.

    Returns
    -------
    dict
        ``out``, ``weights``, ``within_px_of_256x192``, ``landmarks``, ``notes`` (what a user of the points should know),
        ``images`` (``name``, ``points``, ``confidence``, ``present``, ``box``, ``notes``).
    """
    from reconstruction.keypoints.plots import save_heatmaps, save_predictions
    from reconstruction.keypoints.predict import Detector

    garment = None if garment is None else garment_type(garment)
    entries = entries_of(paths, kind, figure, garment, progress)
    detector = Detector.load(weights)
    detector.flip = flip
    folder = check_writable(folder)
    loaded = [e.image for e in entries]
    there = None if garment is None or _unseen(detector, garment) else [points_of(garment)] * len(entries)
    p = detector.predict([i.rgb for i in loaded], [e.box for e in entries], present=there, batch_size=4, keep_heatmaps=True,
                         progress=progress)  # fmt: skip
    present, sigma = p.present >= least, p.deviations()
    found = [
        ImageKeypoints.of(e.path, e.kind, p.points[i], confidence=p.confidence[i], present=present[i], sigma=sigma[i],
                          size=e.image.size, **e.known)
        for i, e in enumerate(entries)
    ]
    notes = _notes(found, detector, garment, p.moved)
    write_keypoints(folder / FILE, KeypointsFile(tuple(found), garment, notes))
    names = [e.path.name for e in entries]
    save_predictions([i.rgb for i in loaded], p, folder / "predictions.png", names)
    if heatmaps and p.heatmaps is not None:
        for i, image in enumerate(loaded):
            save_heatmaps(image.rgb, p.matrices[i], p.heatmaps[i], folder / f"heatmaps_{i + 1:03d}_{Path(names[i]).stem}.png")
    return {
        "out": folder, "weights": weights, "within_px_of_256x192": p.within, "landmarks": LANDMARKS, "notes": notes,
        "images": [
            {"name": e.path.name, "points": p.points[i], "confidence": p.confidence[i], "present": present[i], "box": e.box,
             "notes": e.image.notes}
            for i, e in enumerate(entries)
        ],
    }


def _unseen(detector: Detector, garment: str | None) -> bool:
    """Whether it is known that a detector was never trained on a type."""
    seen = detector.notes.get("types")
    return bool(garment is not None and seen and garment not in seen)


def _notes(found: Sequence[ImageKeypoints], detector: Detector, garment: str | None, moved) -> tuple[str, ...]:
    """What makes points doubtful: a type that the detector was never trained on, points that no training figure has there, pictures
    framed otherwise than in training."""
    notes = []
    if _unseen(detector, garment):
        notes.append(f"the detector was never trained on a {garment} (only on {', '.join(detector.notes['types'])}): check its "
                     f"points, or set them by hand in {FILE}")
    if moved is not None and moved.any():
        listed = ", ".join(f"{found[i].name} {LANDMARKS[k]}" for i, k in np.argwhere(moved & [i.present for i in found]))
        if listed:
            notes.append("points whose highest peak no figure of the training has there were put where known postures or a lower "
                         f"peak have them, check them: {listed}")
    means = {i.name: float(i.confidence[i.present].mean()) for i in found if i.present.any()}
    unsure = {name: mean for name, mean in means.items() if mean < UNSURE}
    if unsure:
        listed = ", ".join(f"{name} {mean:.2f}" for name, mean in unsure.items())
        notes.append(f"points of {len(unsure)} of {len(found)} pictures are uncertain (mean confidence: {listed}). The detector "
                     "knows pictures framed on one figure, head to feet: give 'mask' or 'box' in sources.toml where they are not, "
                     f"or set the points by hand in {FILE}")
    return tuple(notes)
