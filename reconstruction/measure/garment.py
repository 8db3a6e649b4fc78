"""All lengths of a garment that one picture shows.

Textiles lie flat: what is seen is what is cut. Figures wear the garment: a width round the trunk is seen as the width of an
elliptic section and turned into a flat width (half its perimeter, :mod:`reconstruction.measure.ellipse`); arms may be
foreshortened, so a segment seen shorter than that of the canonical skeleton has its true length somewhere between the two. The
opening of a worn sleeve cannot be read (on the benchmark it was seen at a third of its width, or not at all) and is left to the
textiles.
"""

from __future__ import annotations

import itertools
import logging
from collections.abc import Iterable

import numpy as np

from mfar_fem.errors import InputError
from reconstruction.keypoints_file import ImageKeypoints
from reconstruction.landmarks import INDEX
from reconstruction.measure import outline
from reconstruction.measure.accessories import measure_hat, measure_ribbon
from reconstruction.measure.ellipse import flat_factor, flat_factor_sigma
from reconstruction.measure.frame import CannotMeasureError, garment_frame, pair
from reconstruction.measure.quantity import Measurement
from reconstruction.measure.scale import Scale, image_scale
from reconstruction.measure.silhouette import contour, read_mask
from reconstruction.measure.skeleton import Skeleton
from reconstruction.measure.spread import NECK_CONTOUR_SPREAD, model_spread

log = logging.getLogger(__name__)
FROM_NECKLINE = ("garment_length", "armhole_depth", "neck_depth", "back_neck_depth")
"""Lengths that begin at the neckline points also where they end on the contour."""
ROUND_TRUNK = ("body_width", "waist_width", "hem_width")
"""Widths that lie round the trunk of a figure."""


def measure_images(images: Iterable[ImageKeypoints], garment: str = "round-collar-robe", progress=None,
                   left_out: dict[str, str] | None = None) -> list[Measurement]:
    """Measurements of all images.

    Parameters
    ----------
    images : iterable of ImageKeypoints
    garment : str
        ``flying-ribbon`` and ``veil-hat`` have lengths of their own (:mod:`reconstruction.measure.accessories`); all others are
        measured as garments with sleeves (:func:`measure_image`).
    progress : callable, optional
        Called once an image.
    left_out : dict, optional
        Gets the images (path: reason) that show too few points or have no scale; without it, or if that is all of them, they raise.

    Raises
    ------
    CannotMeasureError, InputError, DataFileError
        See :func:`measure_image`.
    """
    measure = {"flying-ribbon": measure_ribbon, "veil-hat": measure_hat}.get(garment, measure_image)
    found: list[Measurement] = []
    trouble: CannotMeasureError | None = None
    for image in images:
        try:
            found += measure(image)
        except CannotMeasureError as error:
            if left_out is None:
                raise
            left_out[str(image.path)], trouble = str(error).removeprefix(f"{image.path}: "), error
            log.info("left out: %s", error)
        if progress is not None:
            progress()
    if trouble is not None and not found:
        raise trouble
    return found


def measure_image(image: ImageKeypoints, scale: Scale | None = None, skeleton: Skeleton | None = None) -> list[Measurement]:
    """Every length of :data:`reconstruction.measure.quantity.NAMES` that an image shows.

    Parameters
    ----------
    image : ImageKeypoints
        With a mask, widths and ends are taken from its contour; without it only from the points.
    scale : Scale, optional
        By default :func:`reconstruction.measure.scale.image_scale`.
    skeleton : Skeleton, optional
        For foreshortening; by default the canonical one of the figure.

    Raises
    ------
    TooFewPointsError, NoScaleError
        The picture shows too few of the landmarks, or nothing sets its scale.
    InputError, DataFileError
        The mask cannot be read or does not fit the points.
    """
    scale = scale or image_scale(image)
    polygon = None
    if image.mask is not None:
        polygon = contour(read_mask(image.mask, image.size))
        _check_inside(image, polygon)
    frame = garment_frame(image.points, image.path, polygon)
    seen = _from_points(image)
    if polygon is not None:
        edge = outline.lengths(image.points, frame, polygon, flat=image.kind == "textile")
        neck = float(np.sqrt(np.sum(image.sigma[[INDEX["left_neckline"], INDEX["right_neckline"]]] ** 2)) / 2)
        start = neck if image.kind != "textile" else 0.0
        for name, length in edge.items():
            spread = np.hypot(outline.CONTOUR_SIGMA * np.sqrt(2), start if name in FROM_NECKLINE else 0.0)
            seen[name] = (length, float(spread), "contour")
        if "neck_depth" in edge and (found := outline.neck_width(image.points, frame, polygon, edge["neck_depth"])) is not None:
            width, spread = found[0], float(np.hypot(found[1], NECK_CONTOUR_SPREAD * found[0]))
            seen["neck_width"] = _combined(image, seen["neck_width"], (width, spread, "contour"))
    worn = image.kind != "textile"
    result = []
    for name, (length, sigma, method) in seen.items():
        value, point_sigma, model_sigma = length * scale.metres_per_pixel, sigma * scale.metres_per_pixel, 0.0
        if worn and name in ROUND_TRUNK:
            model_sigma = value * flat_factor_sigma()
            value, point_sigma = value * flat_factor(), point_sigma * flat_factor()
            method += ", elliptic section"
        model_sigma = float(np.hypot(model_sigma, model_spread(image.kind, name) * value))
        result.append(Measurement(name, value, point_sigma, value * scale.relative_sigma, model_sigma, image.name, image.kind,
                                  f"{method}; {scale.method}"))
    if worn:
        result = [_unforeshorten(m, image, scale, skeleton) if m.name == "sleeve_length" else m for m in result]
    result += _derived(result, worn)
    log.info("%s: %d lengths measured", image.name, len(result))
    return result


def _from_points(image: ImageKeypoints) -> dict[str, tuple[float, float, str]]:
    """Lengths in pixels, their standard deviations and how they were found, from the landmarks alone."""
    points, sigma, found = image.points, image.sigma, {}

    def distance(a: str, b: str) -> tuple[float, float]:
        i, j = INDEX[a], INDEX[b]
        return float(np.linalg.norm(points[i] - points[j])), float(np.hypot(sigma[i], sigma[j]))

    widths = {"shoulder_width": "shoulder", "neck_width": "neckline", "waist_width": "waist", "hem_width": "ankle"}
    for name, part in widths.items():
        if pair(points, part) is not None:
            found[name] = (*distance(f"left_{part}", f"right_{part}"), "points")
    sleeves = []
    for side in ("left", "right"):
        chain = [f"{side}_shoulder", f"{side}_elbow", f"{side}_wrist"]
        if image.present[[INDEX[c] for c in chain]].all():
            (a, sa), (b, sb) = distance(*chain[:2]), distance(*chain[1:])
            sleeves.append((a + b, np.hypot(sa, sb)))
    if sleeves:
        length, spread = np.array(sleeves).T
        found["sleeve_length"] = (float(length.mean()), float(np.linalg.norm(spread) / len(sleeves)), "points")
    top, bottom = pair(points, "neckline") or pair(points, "shoulder"), pair(points, "ankle")
    if top is not None and bottom is not None:
        reach = float(np.linalg.norm(np.mean(bottom, axis=0) - np.mean(top, axis=0)))
        found["garment_length"] = (reach, float(np.sqrt(np.mean(sigma**2))), "points")
    if "lapel" in image.curves and top is not None:
        edge = garment_frame(points, image.path).coordinates(image.curves["lapel"])
        high, low = edge[np.argmin(edge[:, 1]), 0], edge[np.argmax(edge[:, 1]), 0]
        spread = float(np.sqrt(np.mean(sigma**2)))
        found |= {"overlap_neck": (float(abs(high)), spread, "lapel"), "overlap_hem": (float(abs(low)), spread, "lapel")}
    wrists = pair(points, "wrist")
    if image.kind == "textile" and wrists is not None:
        found["cross_sleeve_width"] = (*distance("left_wrist", "right_wrist"), "points")
    return found


def _combined(image: ImageKeypoints, a: tuple[float, float, str], b: tuple[float, float, str]) -> tuple[float, float, str]:
    """Inverse-variance mean of two readings of one length (value, standard deviation, method); the first if they disagree."""
    if abs(a[0] - b[0]) > 3 * np.hypot(a[1], b[1]):
        message = "%s: the neckline's contour (%.1f px) disagrees with its points (%.1f px), which are used"
        log.warning(message, image.name, b[0], a[0])
        return a
    p, q = a[1] ** -2, b[1] ** -2
    return (p * a[0] + q * b[0]) / (p + q), float((p + q) ** -0.5), f"{a[2]} and {b[2]}"


def _unforeshorten(m: Measurement, image: ImageKeypoints, scale: Scale, skeleton: Skeleton | None) -> Measurement:
    """Sleeve length of a figure: uniform between what is seen and the canonical arm, segment by segment; longer segments stay.

    All segments are taken as foreshortened alike (fully correlated): both arms usually do the same.
    """
    skeleton = skeleton or Skeleton.canonical(image.stature)
    total, spread, sides = 0.0, 0.0, 0
    for side in ("left", "right"):
        ids = [INDEX[f"{side}_{part}"] for part in ("shoulder", "elbow", "wrist")]
        if not image.present[ids].all():
            continue
        sides += 1
        for (a, b), limb in zip(itertools.pairwise(ids), ("upper_arm", "forearm"), strict=True):
            seen = float(np.linalg.norm(image.points[a] - image.points[b])) * scale.metres_per_pixel
            full = max(skeleton.length(f"{side}_{limb}"), seen)
            total += (seen + full) / 2
            spread += (full - seen) / np.sqrt(12)
    value, spread = total / sides, spread / sides
    model_sigma = float(np.hypot(spread, model_spread(image.kind, m.name) * value))
    method = m.method if spread < 1e-9 else f"{m.method}; foreshortening between seen and canonical arm"
    return Measurement(m.name, value, m.point_sigma, value * scale.relative_sigma, model_sigma, m.source, m.kind, method)


def _derived(found: list[Measurement], worn: bool) -> list[Measurement]:
    """Lengths made of others: the waist all round; cuff to cuff of a figure from its shoulders and sleeves."""
    by_name, extra = {m.name: m for m in found}, []
    if (waist := by_name.get("waist_width")) is not None:
        extra.append(Measurement("waist_circumference", 2 * waist.value, 2 * waist.point_sigma, 2 * waist.scale_sigma,
                                 2 * waist.model_sigma, waist.source, waist.kind, f"twice the flat width; {waist.method}"))
    if worn and {"shoulder_width", "sleeve_length"} <= set(by_name):
        a, b = by_name["shoulder_width"], by_name["sleeve_length"]
        extra.append(Measurement("cross_sleeve_width", a.value + 2 * b.value, float(np.hypot(a.point_sigma, 2 * b.point_sigma)),
                                 a.scale_sigma + 2 * b.scale_sigma, a.model_sigma + 2 * b.model_sigma, a.source, a.kind,
                                 f"shoulder width and both sleeves; {b.method}"))
    return extra


def _check_inside(image: ImageKeypoints, polygon: np.ndarray) -> None:
    """A mask of another picture, or of another size, is found out here."""
    low, high = polygon.min(axis=0), polygon.max(axis=0)
    size = high - low
    points = image.points[image.present]
    outside = ((points < low - 0.25 * size) | (points > high + 0.25 * size)).any(axis=1)
    if outside.mean() > 0.25:
        raise InputError(f"{image.mask}: {int(outside.sum())} of {len(points)} points lie far outside the mask; is it of another "
                         f"image or size than {image.path}?")
