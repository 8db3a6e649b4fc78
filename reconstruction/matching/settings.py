"""Settings of the matching of two pictures, with the silk paper's values as the defaults."""

from __future__ import annotations

from dataclasses import asdict, dataclass

from mfar_fem.errors import ParameterError

DETECTORS = ("sift", "aliked")
ESTIMATORS = ("ransac", "magsac")


@dataclass(frozen=True)
class MatchSettings:
    """How points are found, paired and verified.

    Attributes
    ----------
    detector : str
        ``sift`` (the paper's) or ``aliked`` (learned; needs torch, kornia and a file of weights).
    weights : str or None
        Published ALIKED weights (``aliked-t16.pth`` or ``aliked-n16rot.pth``).
    octaves : int
        Octaves of SIFT's scale space that are used, the doubled picture being the first. OpenCV has no such argument (its
        ``nOctaveLayers`` is layers an octave; it builds as many octaves as the picture allows): points of higher octaves are
        dropped by the octave they carry.
    contrast : float
        OpenCV's ``contrastThreshold``. OpenCV divides it by its 3 layers an octave: the 0.03 of Lowe (2004) would be 0.09 here.
    edge : float
        Largest ratio of principal curvatures.
    root_sift : bool
        Square roots of L1-normalised descriptors (Arandjelovic & Zisserman 2012, doi:10.1109/CVPR.2012.6248018).
    most_features : int
        The strongest so many are kept.
    trees, checks : int
        Randomised k-d trees of FLANN and leaves that a search visits. The paper's branch factor 16 and target precision 0.9 are
        arguments of FLANN's hierarchical k-means and of its autotuned index; a k-d tree has neither. Its precision is measured
        instead (:func:`reconstruction.matching.nearest.flann_precision`).
    quantile : float
        tau of formula (2): this quantile of the distances to the second-nearest neighbour; 1 switches it off.
    ratio : float or None
        Nearest over second-nearest distance must stay below it (Lowe 2004, doi:10.1023/B:VISI.0000029664.99615.94); 1 switches
        it off; None: 0.8 for SIFT, 0.95 for ALIKED, whose distances are more alike.
    mutual : bool
        Each must be the other's nearest.
    estimator : str
        ``ransac`` (the paper's) or ``magsac`` (Barath et al. 2020, doi:10.1109/CVPR42600.2020.00138, OpenCV's USAC_MAGSAC).
    threshold : float
        Largest distance of an inlier to its epipolar line, in both pictures, px.
    iterations : int
        Most samples drawn.
    confidence : float
        Drawing ends earlier once a better model is less probable than 1 - confidence.
    seed : int
        Of the k-d trees and the samples.
    fewest : int
        Fewest inliers of a match.
    log10_nfa : float
        A match needs a smaller logarithm of the number of false alarms (see :func:`reconstruction.matching.chance.log10_nfa`).
    camera_tolerance : float
        Where the cameras are known: largest median Sampson distance of the inliers from them, px.
    """

    detector: str = "sift"
    weights: str | None = None
    octaves: int = 4
    contrast: float = 0.03
    edge: float = 10.0
    root_sift: bool = False
    most_features: int = 8000
    trees: int = 4
    checks: int = 200
    quantile: float = 0.25
    ratio: float | None = None
    mutual: bool = True
    estimator: str = "ransac"
    threshold: float = 3.5
    iterations: int = 5000
    confidence: float = 0.9999
    seed: int = 0
    fewest: int = 15
    log10_nfa: float = -2.0
    camera_tolerance: float = 3.5

    def __post_init__(self):
        _known("detector", self.detector, DETECTORS)
        _known("estimator", self.estimator, ESTIMATORS)
        if self.detector == "aliked" and not self.weights:
            raise ParameterError("the detector 'aliked' needs its published weights: a path of aliked-t16.pth or -n16rot.pth")
        for name, low, high in (
            ("octaves", 1, 12), ("contrast", 0, 1), ("edge", 1, 1000), ("most_features", 8, 1_000_000), ("trees", 1, 16),
            ("checks", 1, 100_000), ("quantile", 1e-6, 1), ("largest_ratio", 0.1, 1), ("threshold", 0.01, 100),
            ("iterations", 1, 10_000_000), ("confidence", 0.5, 1 - 1e-12), ("seed", 0, 2**31 - 1), ("fewest", 8, 1_000_000),
            ("log10_nfa", -1000, 10), ("camera_tolerance", 0.01, 1000),
        ):  # fmt: skip
            if not low <= (value := getattr(self, name)) <= high:
                raise ParameterError(f"{name.removeprefix('largest_')} must be between {low:g} and {high:g}, not {value}")

    @property
    def largest_ratio(self) -> float:
        """The ratio, or the detector's usual one."""
        return self.ratio if self.ratio is not None else {"sift": 0.8, "aliked": 0.95}[self.detector]

    def to_dict(self) -> dict:
        """Plain types, by name."""
        return asdict(self)


def _known(name: str, value: str, known: tuple[str, ...]) -> None:
    if value not in known:
        raise ParameterError(f"{name} must be one of {', '.join(known)}, not '{value}'")
