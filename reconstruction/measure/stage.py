"""Measurements and votes as a stage of ``mfar fuse``: as soon as the folder of sources, or the output, has keypoints."""

from __future__ import annotations

from typing import Any, Protocol

from reconstruction.keypoints_file import read_keypoints
from reconstruction.measure.garment import measure_images
from reconstruction.measure.vote import DEFAULT_WEIGHTING, vote

FILE = "keypoints.json"


class Fused(Protocol):
    """What the stage needs of a :class:`reconstruction.matching.fusion.Fusion`."""

    @property
    def folder(self) -> Any:
        """Output folder."""

    @property
    def sources(self) -> Any:
        """Sources, with their folder."""


def measurements(fusion: Fused, weighting: str = DEFAULT_WEIGHTING) -> dict[str, Any]:
    """Lengths of every source in one system, the votes on them and the conflicts.

    Parameters
    ----------
    fusion : Fused
    weighting : str
        See :func:`reconstruction.measure.vote.vote`.

    Returns
    -------
    dict
        ``keypoints`` (file, or None with a ``note`` that says how to make one), ``measurements``, ``votes``, ``conflicts``.

    Raises
    ------
    DataFileError
        The file of keypoints is wrong.
    """
    path = next((f / FILE for f in (fusion.folder, fusion.sources.folder) if (f / FILE).is_file()), None)
    if path is None:
        command = f"mfar keypoints {fusion.sources.folder} --out {fusion.folder}"
        note = f"no {FILE} in {fusion.folder} or {fusion.sources.folder}: `{command}` makes one; then run again to measure and vote"
        return {"keypoints": None, "note": note, "measurements": [], "votes": [], "conflicts": []}
    found = read_keypoints(path)
    left_out: dict[str, str] = {}
    lengths = measure_images(found.images, found.garment or "round-collar-robe", left_out=left_out)
    votes, conflicts = vote(lengths, weighting=weighting)
    note = "; ".join(f"not measured: {path}: {reason}" for path, reason in left_out.items())
    return {"keypoints": str(path), "note": note, "measurements": [m.to_dict() for m in lengths],
            "votes": [v.to_dict() for v in votes.values()], "conflicts": [c.to_dict() for c in conflicts]}
