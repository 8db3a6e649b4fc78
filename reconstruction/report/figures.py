"""The paper's Figures 4 to 7 redone on a benchmark: values with intervals, beside what chance or nothing gives."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from mfar_fem.errors import InputError
from reconstruction.report import paper
from reconstruction.report.content import Picture, Section
from reconstruction.report.estimates import Estimate, estimate_table, ordered, time_table
from reconstruction.report.plotting import COLOURS, ROW, height, key, logarithmic, picture, places, points

LOG_FROM = 20.0
"""Ratio of the largest to the least value from which the axis of distances is logarithmic."""


def _note(shown: object) -> str:
    return paper.NOTE if shown else ""


def _beside(rows: Sequence[Estimate], theirs: Mapping[str, Mapping[str, float]]) -> str:
    """The paper's values that a figure shows, in words."""
    things, methods = ordered(rows)
    found = [f"{t}, {m}: {theirs[m][t]:g}" for t in things for m in methods if t in theirs.get(m, {})]
    return f"In the {paper.LABEL}: {'; '.join(found)}." if found else ""


def _words(title: str, rows: Sequence[Estimate], unit: str, more: str = "") -> str:
    return f"{title}. " + "; ".join(r.words(unit) for r in rows) + "." + (f" {more}" if more else "")


def distance_figure(rows: Sequence[Estimate], beside: bool = True) -> Picture:
    """Figure 4: mean distance of the surface by garment and method.

    Parameters
    ----------
    rows : sequence of Estimate
        `of` a garment, mm.
    beside : bool
        The paper's values as hollow marks, where garment and method have its names.

    Raises
    ------
    InputError
        No rows, or two of the same garment and method.
    """
    theirs = paper.DISTANCE_MM if beside else {}

    def draw(ax):
        points(ax, rows, theirs, paper.LABEL)
        shown = [r.value for r in rows] + [r.low for r in rows if r.low is not None and r.low > 0]
        shown += [v for m in {r.method for r in rows} & set(theirs) for v in theirs[m].values()]
        if min(shown) > 0 and max(shown) > LOG_FROM * min(shown):
            logarithmic(ax)
            ax.set_xlabel("mean distance, mm (logarithmic)")
        else:
            ax.set_xlim(left=0)
            ax.set_xlabel("mean distance, mm")

    return picture(draw, height(rows), _words("Mean distance from the true surface, mm", rows, " mm", _beside(rows, theirs)),
                   "Distance from the true surface (the paper's Figure 4), mean and 95 % interval. " + _note(theirs))


def keypoint_figure(rows: Sequence[Estimate], beside: bool = True) -> Picture:
    """Figure 5: root mean square error of every keypoint.

    Parameters
    ----------
    rows : sequence of Estimate
        `of` a keypoint, px of 256 x 192.
    beside : bool
        The paper's range over the points as a hatched band, for methods of its names.
    """
    theirs = {m: v for m, v in paper.KEYPOINTS_PX.items() if beside and m in {r.method for r in rows}}

    def draw(ax):
        points(ax, rows)
        methods = places(rows)[1]
        for method, (_, low, high) in theirs.items():
            colour = COLOURS[methods.index(method) % len(COLOURS)]
            ax.axvspan(low, high, facecolor="none", edgecolor=colour, hatch="////", lw=0.6, alpha=0.5)
        if theirs:
            key(ax, f"range, {paper.LABEL}", hatch="////")
        ax.set_xlim(left=0)
        ax.set_xlabel("root mean square error, px of 256 × 192")

    more = " ".join(f"The paper's range for {m}, other data: {v[1]} to {v[2]} px." for m, v in theirs.items())
    return picture(draw, height(rows), _words("Root mean square error of the keypoints, px", rows, " px", more),
                   "Error of the keypoints (the paper's Figure 5), with 95 % intervals."
                   + (" Hatched: the range that the paper prints for its own data, not comparable." if theirs else ""))


def spectrum_figure(rows: Sequence[Estimate], nulls: Mapping[str, tuple[float, float]], beside: bool = True) -> Picture:
    """Figure 6: similarity of the spectra of folds, with what comes out where nothing is similar.

    Parameters
    ----------
    rows : sequence of Estimate
        `of` a pair.
    nulls : mapping of str to (float, float)
        Bands of null comparisons by name (phases shuffled, smooth surface): a similarity in one of them says nothing.
    beside : bool
        The paper's range by method as hollow bars in a row of its own.

    Raises
    ------
    InputError
        No rows; no nulls are given.
    """
    if not nulls:
        raise InputError("a similarity of spectra without a null band cannot be read; give at least one, such as shuffled phases")
    theirs = {m: v for m, v in paper.SPECTRUM.items() if beside and m in {r.method for r in rows}}

    def draw(ax):
        points(ax, rows)
        _, methods, at, _ = places(rows)
        for k, (name, (low, high)) in enumerate(nulls.items()):
            ax.axvspan(low, high, facecolor=("#bbbbbb", "#d9c9a3", "#c3d3dd")[k % 3], alpha=0.6, lw=0, label=f"null: {name}")
        floor = max(at.values())
        for k, (method, (low, high)) in enumerate(theirs.items()):
            ax.barh(floor + 2 + k, high - low, 0.7, low, facecolor="none", edgecolor=COLOURS[methods.index(method) % len(COLOURS)])
        if theirs:
            key(ax, f"range, {paper.LABEL}")
        ax.set_ylim(floor + 2 + len(theirs), -0.9)
        ax.set_xlabel("similarity of spectra")

    more = " ".join(f"Null, {name}: {low:.3g} to {high:.3g}." for name, (low, high) in nulls.items())
    inside = [r for r in rows if any(low <= r.value <= high for low, high in nulls.values())]
    more += f" {len(inside)} of {len(rows)} values lie in a null band."
    caption = (f"Similarity of the spectra of folds (the paper's Figure 6). Bands: what unrelated surfaces reach; {len(inside)} of "
               f"{len(rows)} values lie in one and say nothing. {_note(theirs)}")  # fmt: skip
    return picture(draw, height(rows) + ROW * (1 + len(theirs)), _words("Similarity of fold spectra", rows, "", more), caption)


def feature_figure(rows: Sequence[Estimate], chance: Mapping[str, float], beside: bool = True) -> Picture:
    """Figure 7: share of the features of each group that agree.

    Parameters
    ----------
    rows : sequence of Estimate
        `of` a group, %.
    chance : mapping of str to float
        By group: agreement of unrelated garments, %.

    Raises
    ------
    InputError
        A group without its chance level.
    """
    missing = [r.of for r in rows if r.of not in chance]
    if missing:
        raise InputError(f"no chance level is given for {', '.join(dict.fromkeys(missing))}; without it a rate cannot be read")
    theirs = paper.FEATURES_PERCENT if beside else {}

    def draw(ax):
        points(ax, rows, theirs, paper.LABEL)
        things, methods, _, middle = places(rows)
        for k, t in enumerate(things):
            half = 0.5 * len(methods)
            ax.plot([chance[t]] * 2, [middle[t] - half, middle[t] + half], color="black", lw=1.6, ls=(0, (2, 1)),
                    label="chance" if k == 0 else None)  # fmt: skip
        ax.set_xlim(0, 102)
        ax.set_xlabel("features that agree, %")

    more = " ".join(f"Chance, {g}: {chance[g]:.3g} %." for g in dict.fromkeys(r.of for r in rows)) + " " + _beside(rows, theirs)
    return picture(draw, height(rows), _words("Features that agree, %", rows, " %", more),
                   "Features of the garment (the paper's Figure 7), with 95 % intervals; dashed: agreement of unrelated garments. "
                   + _note(theirs))


def benchmark_section(distances: Sequence[Estimate] = (), keypoints: Sequence[Estimate] = (), spectra: Sequence[Estimate] = (),
                      nulls: Mapping[str, tuple[float, float]] | None = None, features: Sequence[Estimate] = (),
                      chance: Mapping[str, float] | None = None, times: Mapping[str, tuple[float, float | None]] | None = None,
                      machine: str = "", text: str = "", notes: Sequence[str] = (), title: str = "Benchmark") -> Section:
    """Figures and tables of a benchmark; what is empty is left out.

    Parameters
    ----------
    distances, keypoints, spectra, features : sequence of Estimate
        See the functions of the figures.
    nulls, chance : mapping
        The same.
    times, machine
        See :func:`reconstruction.report.estimates.time_table`.
    """
    pictures, tables = [], []
    if distances:
        pictures.append(distance_figure(distances))
        caption = "Distance from the true surface (Figure 4)"
        tables.append(estimate_table(distances, "mean distance, mm", paper.DISTANCE_MM, caption))
    if keypoints:
        pictures.append(keypoint_figure(keypoints))
        tables.append(estimate_table(keypoints, "RMSE, px", None, "Error of the keypoints (Figure 5)"))
    if spectra:
        pictures.append(spectrum_figure(spectra, nulls or {}))
        tables.append(estimate_table(spectra, "similarity", None, "Similarity of fold spectra (Figure 6)"))
    if features:
        pictures.append(feature_figure(features, chance or {}))
        tables.append(estimate_table(features, "agree, %", paper.FEATURES_PERCENT, "Features that agree (Figure 7)"))
    if times:
        tables.append(time_table(times, machine))
    return Section(title, text, pictures, tables, notes)
