"""The run behind ``mfar keypoints``: pictures or a folder of sources to ``keypoints.json`` and pictures of what was found."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from mfar_fem.cli.console import check_writable
from mfar_fem.errors import InputError
from reconstruction import images as pictures
from reconstruction.images import LoadedImage
from reconstruction.keypoints_file import ImageKeypoints, KeypointsFile, write_keypoints
from reconstruction.landmarks import KINDS, LANDMARKS

SHIPPED = "shipped"
"""Name of the detector that comes with the package."""
FILE = "keypoints.json"


def entries_of(paths: Sequence[Path], kind: str = "mural") -> tuple[list[tuple[Path, str, dict[str, Any]]], list[LoadedImage]]:
    """Path, kind and what is known of each picture, and the pictures, of a list of files or one folder with a ``sources.toml``.

    Raises
    ------
    InputError
        Unknown kind, or the folder is wrong.
    """
    if len(paths) == 1 and (paths[0].is_dir() or paths[0].suffix.lower() == ".toml"):
        from reconstruction.sources import read

        found = read(paths[0])
        return [(s.path, s.kind, {"figure": None if s.figure == "none" else s.figure, "mask": s.mask, "scale": s.scale_entry()})
                for s in found.sources], [found.load(s) for s in found.sources]
    if kind not in KINDS:
        raise InputError(f"--kind '{kind}' is none of {', '.join(KINDS)}")
    for path in paths:
        if not path.is_file():
            what = "is a folder; give one folder with a sources.toml alone, or pictures" if path.is_dir() else "does not exist"
            raise InputError(f"{path}: {what}{'' if path.is_dir() else '; give pictures, or one folder with a sources.toml'}")
    return [(path, kind, {}) for path in paths], [pictures.load(path) for path in paths]


def locate(
    paths: Sequence[Path], folder: Path, weights: str = SHIPPED, *, kind: str = "mural", least: float = 0.5, flip: bool = True,
    heatmaps: bool = False, garment: str | None = None, progress: Callable[..., None] | None = None,
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
    kind : str
        Of pictures without ``sources.toml``.
    least : float
        Points less likely than this to exist are left out.
    flip : bool
        Look at the mirrored picture too.
    garment : str, optional
        Type, for the file.
    progress : callable, optional
        ``progress(1)`` after each picture, ``progress(total=n)`` at the start.

    Returns
    -------
    dict
        ``out``, ``weights``, ``within_px_of_256x192``, ``landmarks``, ``images`` (``name``, ``points``, ``confidence``,
        ``present``, ``notes``).
    """
    from reconstruction.keypoints.plots import save_heatmaps, save_predictions
    from reconstruction.keypoints.predict import Detector

    entries, loaded = entries_of(paths, kind)
    if progress is not None:
        progress(0, total=len(entries))
    for (path, _, known), image in zip(entries, loaded, strict=True):
        mask = known.get("mask")
        if mask is not None and (size := pictures.load(mask).size) != image.size:
            w, h = image.size
            raise InputError(f"the mask '{mask}' has {size[0]} x {size[1]} px, its picture '{path.name}' {w} x {h}")
    detector = Detector.load(weights)
    detector.flip = flip
    folder = check_writable(folder)
    p = detector.predict([i.rgb for i in loaded], keep_heatmaps=True, progress=progress)
    present, sigma = p.present >= least, p.deviations()
    found = [
        ImageKeypoints.of(path, k, p.points[i], confidence=p.confidence[i], present=present[i], sigma=sigma[i],
                          size=loaded[i].size, **known)
        for i, (path, k, known) in enumerate(entries)
    ]
    write_keypoints(folder / FILE, KeypointsFile(tuple(found), garment))
    names = [path.name for path, _, _ in entries]
    save_predictions([i.rgb for i in loaded], p, folder / "predictions.png", names)
    if heatmaps and p.heatmaps is not None:
        for i, image in enumerate(loaded):
            save_heatmaps(image.rgb, p.matrices[i], p.heatmaps[i], folder / f"heatmaps_{i + 1:03d}_{Path(names[i]).stem}.png")
    return {
        "out": folder, "weights": weights, "within_px_of_256x192": p.within, "landmarks": LANDMARKS,
        "images": [
            {"name": name, "points": p.points[i], "confidence": p.confidence[i], "present": present[i], "notes": loaded[i].notes}
            for i, name in enumerate(names)
        ],
    }
