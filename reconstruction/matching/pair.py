"""One pair of pictures: from features to a verdict."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np

from reconstruction.matching import cameras as known_cameras
from reconstruction.matching.chance import of_model
from reconstruction.matching.degenerate import EXPLAINED, examine
from reconstruction.matching.epipolar import epipolar_distance, sampson_distance
from reconstruction.matching.features import Features
from reconstruction.matching.nearest import Putative, putative
from reconstruction.matching.robust import fundamental_matrix, homography
from reconstruction.matching.settings import MatchSettings

WIDE_BASELINE = math.radians(30)
"""Angle between viewing directions from which on descriptors of patches are known to fail (K. Mikolajczyk et al., A comparison of
affine region detectors, Int. J. Comput. Vis. 65 (2005) 43, doi:10.1007/s11263-005-3848-x: beyond 30 to 40 degrees)."""
_NONE = np.zeros((0, 4))


@dataclass(frozen=True, eq=False)
class PairResult:
    """What became of a pair.

    Attributes
    ----------
    a, b : str
        Names of the pictures.
    status : str
        ``matched``, ``degenerate: name`` or ``failed: name``; ``reason`` says it in words.
    features : (int, int)
        Points of A and B.
    putative, inliers : int
        Size of M_0, and those within the threshold of their epipolar lines.
    tau : float
        Threshold of formula (2).
    log10_nfa : float
        See :func:`reconstruction.matching.chance.log10_nfa`.
    sampson : float
        Median Sampson distance of the inliers to the estimated F, px: self-consistency only.
    sampson_cameras : float
        The same to the F of the given cameras, px: correctness. NaN if no cameras are known.
    right_putative : float
        Share of putative matches within the threshold of the given cameras' epipolar lines; NaN if no cameras are known.
    angle : float
        Between the viewing directions of the given cameras, rad; NaN if no cameras are known.
    homography_share, gric_difference : float
        See :class:`reconstruction.matching.degenerate.Degeneracy`; GRIC of H less that of F.
    fundamental, homography : (3, 3) array or None
        Models, x_B' F x_A = 0 and x_B ~ H x_A.
    points : (m, 4) array
        Putative matches, x and y in A and in B, px.
    mask : (m,) bool array
        The inliers among them.
    """

    a: str
    b: str
    status: str
    reason: str = ""
    features: tuple[int, int] = (0, 0)
    putative: int = 0
    inliers: int = 0
    tau: float = math.nan
    log10_nfa: float = math.inf
    sampson: float = math.nan
    sampson_cameras: float = math.nan
    right_putative: float = math.nan
    angle: float = math.nan
    homography_share: float = math.nan
    gric_difference: float = math.nan
    fundamental: np.ndarray | None = None
    homography: np.ndarray | None = None
    points: np.ndarray = field(default_factory=lambda: _NONE)
    mask: np.ndarray = field(default_factory=lambda: np.zeros(0, bool))

    @property
    def matched(self) -> bool:
        """Whether an epipolar geometry was found and stood all tests."""
        return self.status == "matched"

    @property
    def rate(self) -> float:
        """Inliers among the putative matches; NaN without any."""
        return self.inliers / self.putative if self.putative else math.nan

    def row(self) -> dict:
        """Numbers and words of the result, without the points."""
        return {
            "a": self.a, "b": self.b, "status": self.status, "features_a": self.features[0], "features_b": self.features[1],
            "putative": self.putative, "inliers": self.inliers, "rate": self.rate, "tau": self.tau, "log10_nfa": self.log10_nfa,
            "median_sampson_px": self.sampson, "median_sampson_cameras_px": self.sampson_cameras,
            "right_putative": self.right_putative, "angle_deg": math.degrees(self.angle), "homography_share": self.homography_share,
            "gric_difference": self.gric_difference, "reason": self.reason,
        }  # fmt: skip


def match_pair(a: Features, b: Features, settings: MatchSettings, names: tuple[str, str] = ("A", "B"),
               cameras: tuple[np.ndarray, np.ndarray] | None = None) -> PairResult:
    """Match two pictures, estimate their epipolar geometry and judge it.

    Parameters
    ----------
    a, b : Features
        Of the two pictures.
    settings : MatchSettings
    names : (str, str)
        Their names.
    cameras : ((3, 4) array, (3, 4) array), optional
        Known projection matrices: the judge of correctness.

    Returns
    -------
    PairResult
        Never an error: what failed is its status; its reason names a wide baseline where the cameras show one.
    """
    result = _match(a, b, settings, names, cameras)
    if cameras is None:
        return result
    angle = known_cameras.baseline_angle(*cameras)
    wide = f"a wide baseline, the cameras look {math.degrees(angle):.0f} degrees apart"
    reason = result.reason if result.matched or angle < WIDE_BASELINE else "; ".join(filter(None, (result.reason, wide)))
    return replace(result, angle=angle, reason=reason)


def _match(a: Features, b: Features, settings: MatchSettings, names: tuple[str, str],
           cameras: tuple[np.ndarray, np.ndarray] | None) -> PairResult:
    facts: dict = {"features": (len(a), len(b))}
    for features, name in ((a, names[0]), (b, names[1])):
        if len(features) == 0:
            return PairResult(*names, "failed: no features", f"'{name}' has no feature points", **facts)
    found = putative(a, b, settings)
    first, second = a.points[found.index[:, 0]], b.points[found.index[:, 1]]
    facts |= _putative_facts(found, first, second)
    truth, problem = _true_matrix(cameras)
    if truth is not None and len(found):
        facts["right_putative"] = float((epipolar_distance(truth, first, second) <= settings.threshold).mean())
    if len(found) == 0:
        return PairResult(*names, "failed: no matches", "no descriptor of one is near one of the other", **facts)
    if len(found) < settings.fewest:
        return PairResult(*names, "failed: too few matches", f"{len(found)} putative; {settings.fewest} are needed", **facts)
    model = fundamental_matrix(first, second, settings)
    plane = homography(first, second, settings)
    if model is None:
        return PairResult(*names, "failed: no model", "no sample of the matches gives a fundamental matrix", **facts)
    inside = model.inliers
    nfa = of_model(model.matrix, first, second, (a.size, b.size), settings.threshold)
    facts |= {"inliers": int(inside.sum()), "mask": inside, "fundamental": model.matrix, "log10_nfa": nfa}
    if inside.any():
        facts["sampson"] = float(np.median(sampson_distance(model.matrix, first[inside], second[inside])))
        if truth is not None:
            facts["sampson_cameras"] = float(np.median(sampson_distance(truth, first[inside], second[inside])))
    if inside.sum() < settings.fewest:
        return PairResult(*names, "failed: too few inliers", f"{inside.sum()} inliers; {settings.fewest} are needed", **facts)
    if nfa >= settings.log10_nfa:
        return PairResult(*names, "failed: chance", f"{inside.sum()} inliers of {len(found)} may come about by chance: the number "
                          f"of false alarms is 10^{nfa:.1f}, at most 10^{settings.log10_nfa:g} is taken", **facts)  # fmt: skip
    looked = examine(model, plane, first, second)
    facts |= {"homography_share": looked.homography_share, "gric_difference": looked.gric_homography - looked.gric_fundamental}
    if plane is not None:
        facts["homography"] = plane.matrix / np.linalg.norm(plane.matrix)
    if looked.name is not None:
        return PairResult(*names, f"degenerate: {looked.name}", EXPLAINED[looked.name], **facts)
    if facts.get("sampson_cameras", 0.0) > settings.camera_tolerance:
        return PairResult(*names, "failed: against the cameras", f"the inliers lie {facts['sampson_cameras']:.1f} px (median) off "
                          f"the given cameras' lines; {settings.camera_tolerance:g} px are allowed", **facts)  # fmt: skip
    return PairResult(*names, "matched", problem, **facts)


def _putative_facts(found: Putative, first: np.ndarray, second: np.ndarray) -> dict:
    return {"putative": len(found), "tau": found.tau, "points": np.hstack([first, second]), "mask": np.zeros(len(found), bool)}


def _true_matrix(cameras: tuple[np.ndarray, np.ndarray] | None) -> tuple[np.ndarray | None, str]:
    """F of the given cameras, or why there is none."""
    if cameras is None:
        return None, ""
    from mfar_fem.errors import InputError

    try:
        return known_cameras.fundamental(*cameras), ""
    except InputError as error:
        return None, f"not checked against the cameras: {error}"
