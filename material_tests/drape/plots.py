"""Pictures of a drape: the branches, the outlines, and the cloth itself."""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from material_tests.drape.geometry import DrapeTest
from material_tests.drape.measure import flat_triangles
from mfar_fem.simulation.pictures import vertex_normals

LIGHT = np.array([-0.45, -0.55, 0.75])


def plot_branches(rows: Sequence[Mapping[str, Any]], title: str = ""):
    """Energy against nodes, every branch labelled with its coefficient; a matplotlib Figure."""
    from matplotlib.figure import Figure
    from matplotlib.ticker import MaxNLocator

    figure = Figure(figsize=(6.6, 4.4), layout="constrained")
    axes = figure.add_subplot()
    styles = {"folds": ("C0", "o", "from n folds"), "flat": ("C1", "s", "relaxed from flat"),
              "fall": ("C2", "^", "fallen from flat")}
    for kind, (colour, marker, label) in styles.items():
        part = [row for row in rows if row["kind"] == kind]
        if not part:
            continue
        fill = [colour if row["physical"] else "none" for row in part]
        axes.scatter([row["nodes"] for row in part], [1e3 * row["energy_J"] for row in part], c=fill, edgecolors=colour,
                     marker=marker, label=label, s=42, zorder=3)
    labels = {(row["nodes"], f"{row['drape_coefficient_percent']:.0f} %"): 1e3 * row["energy_J"] for row in rows}
    for (nodes, text), energy in labels.items():  # branches that read the same lie on each other
        axes.annotate(text, (nodes, energy), fontsize=8, xytext=(6, 3), textcoords="offset points")
    axes.set_xlabel("nodes")
    axes.set_ylabel("energy at rest, mJ (flat: 0)")
    locator = axes.xaxis.get_major_locator()
    assert isinstance(locator, MaxNLocator)
    locator.set_params(integer=True)
    axes.margins(x=0.12, y=0.1)
    axes.set_title(title, fontsize=10)
    axes.grid(alpha=0.3)
    axes.legend(fontsize=8)
    return figure


def plot_outlines(rows: Sequence[Mapping[str, Any]], test: DrapeTest, measured: Mapping[str, Any] | None = None, title: str = "",
                  band: np.ndarray | None = None):
    """Outlines (polar), the first row bold; the circle of the ``measured`` coefficient; ``band`` (k, 180): measured outlines, m."""
    from matplotlib.figure import Figure
    from matplotlib.projections.polar import PolarAxes

    figure = Figure(figsize=(5.6, 5.6), layout="constrained")
    axes = figure.add_subplot(projection="polar")
    assert isinstance(axes, PolarAxes)
    closed = np.radians(np.arange(0.0, 362.0, 2.0))
    for radius, style in ((test.disc_radius, "k-"), (test.specimen_radius, "k:")):
        axes.plot(closed, np.full_like(closed, 1e3 * radius), style, lw=0.9)
    if band is not None:
        low, high = (1e3 * np.r_[v, v[0]] for v in np.percentile(band, [5, 95], axis=0))
        axes.fill_between(closed, low, high, color="0.85", label="measured, 5 to 95 %")
    if measured and measured.get("drape_coefficient_percent") is not None:
        share = np.array([measured.get(k) if measured.get(k) is not None else measured["drape_coefficient_percent"]
                          for k in ("lower", "drape_coefficient_percent", "upper")]) / 100.0
        ring = test.specimen_radius**2 - test.disc_radius**2
        low, mid, high = 1e3 * np.sqrt(test.disc_radius**2 + share * ring)
        if high > low:
            axes.fill_between(closed, low, high, color="C3", alpha=0.15)
        axes.plot(closed, np.full_like(closed, mid), "C3--", lw=1, label="circle of the measured area")
    for k, row in enumerate(rows):
        r = 1e3 * np.r_[row["outline_m"], row["outline_m"][0]]
        label = f"{row['seed']}: {row['drape_coefficient_percent']:.1f} %, {row['nodes']} nodes" if k < 5 else None
        axes.plot(closed, r, color="C0" if k == 0 else f"C{k}" if k < 5 else "0.6", lw=2.2 if k == 0 else 0.8, label=label,
                  zorder=4 if k == 0 else 2)
    axes.set_rlim(0, 1.05e3 * test.specimen_radius)
    axes.set_rticks([])
    axes.set_title(title, fontsize=10)
    axes.legend(fontsize=7, loc="lower left", bbox_to_anchor=(-0.08, -0.1))
    return figure


def plot_cloth(x: np.ndarray, test: DrapeTest, title: str = "", parts: int = 5, elevation: float = 24.0, azimuth: float = -62.0):
    """The draped cloth with the disc's cloth, smoothly shaded, from above and from the side; a matplotlib Figure."""
    from matplotlib.figure import Figure
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    surface = test.surface()
    points, triangles = flat_triangles(surface, np.asarray(x, dtype=float), parts)
    normals = vertex_normals(points, triangles)
    light = LIGHT / np.linalg.norm(LIGHT)
    angle = np.radians(np.arange(360.0))
    disc = test.disc_radius * np.column_stack([np.cos(angle), np.sin(angle), 0.0 * angle])
    figure = Figure(figsize=(10.0, 4.6), layout="constrained")
    for k, (elev, azim) in enumerate(((elevation, azimuth), (90.0, -90.0))):
        axes = figure.add_subplot(1, 2, k + 1, projection="3d", computed_zorder=False)
        axes.set_proj_type("persp" if k == 0 else "ortho")
        axes.view_init(elev, azim)
        e, a = np.radians([elev, azim])
        eye = np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
        colours = _shade(normals[triangles].mean(axis=1), light, eye)
        top = _shade(np.array([[0.0, 0.0, 1.0]]), light, eye)
        for faces, colour, order in ((points[triangles], colours, 1), (disc[None], top, 2)):  # nothing hangs before the disc's top
            axes.add_collection3d(Poly3DCollection(1e3 * faces, facecolors=colour, edgecolors=colour, linewidths=0.2,
                                                   antialiased=False, zorder=order))
        low, high = 1e3 * points.min(axis=0), 1e3 * points.max(axis=0)
        axes.set_xlim(low[0], high[0])
        axes.set_ylim(low[1], high[1])
        axes.set_zlim(low[2], high[2])
        axes.set_box_aspect(high - low, zoom=1.3 if k == 0 else 1.25)
        axes.set_axis_off()
    figure.suptitle(title, fontsize=10)
    return figure


def _shade(normal: np.ndarray, light: np.ndarray, eye: np.ndarray, colour=(0.62, 0.13, 0.20),
           back=(0.42, 0.10, 0.16)) -> np.ndarray:
    """Colours (m, 3): diffuse light on the side that faces the eye, and a soft gloss."""
    normal = normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
    towards = np.sign(normal @ eye)[:, None]
    towards[towards == 0] = 1.0
    n = normal * towards
    base = np.where(towards > 0, colour, back)
    diffuse = np.clip(n @ light, 0.0, 1.0)[:, None]
    half = light + eye
    half = half / np.linalg.norm(half)
    gloss = np.clip(n @ half, 0.0, 1.0)[:, None] ** 18
    return np.clip(base * (0.32 + 0.85 * diffuse) + 0.28 * gloss, 0.0, 1.0)


def save(folder: Path, payload: Mapping[str, Any], rows: Sequence[Mapping[str, Any]], test: DrapeTest) -> list[str]:
    """Write ``drape_branches.csv``, ``drape_outline.csv`` and the pictures; returns the paths. The headline branch leads."""
    folder.mkdir(parents=True, exist_ok=True)
    head = next(row for row in rows if row["seed"] == payload["seed"])
    order = [head, *(row for row in rows if row is not head)]
    columns = ("seed", "drape_coefficient_percent", "nodes", "depth_m", "energy_J", "membrane_J", "bending_J", "gravity_J",
               "converged", "stable", "intersecting", "iterations", "wall_s")
    with (folder / "drape_branches.csv").open("w", newline="", encoding="utf-8") as stream:
        csv.writer(stream).writerows([columns, *([row[c] for c in columns] for row in rows)])
    with (folder / "drape_outline.csv").open("w", newline="", encoding="utf-8") as stream:
        angles = payload["outline"]["theta_deg"]
        data = zip(angles, *(row["outline_m"] for row in order), strict=True)
        csv.writer(stream).writerows([["theta_deg", *(f"radius_m {row['seed']}" for row in order)], *data])
    size = f"{1e3 * payload['specimen_diameter_m']:.0f}/{1e3 * payload['disc_diameter_m']:.0f} mm"
    name = f"{payload['fabric']}, {size}"
    text = f"{name}: {head['drape_coefficient_percent']:.1f} %, {head['nodes']} nodes ({head['seed']})"
    figures = {"drape_outlines.png": plot_outlines(order, test, payload["measured"], name),
               "drape.png": plot_cloth(np.array(head["x_m"]), test, text)}
    if len(rows) > 1:
        figures["drape_branches.png"] = plot_branches(rows, name)
    for file, figure in figures.items():
        figure.savefig(folder / file, dpi=150)
    return [str(folder / file) for file in ("drape_branches.csv", "drape_outline.csv", *figures)]


def plot_study(result: Mapping[str, Any]):
    """What every unknown does to coefficient and nodes: a bar a variant, beside the measured values; a Figure."""
    from matplotlib.figure import Figure

    rows = [row for row in result["rows"] if row["dc"]]
    figure = Figure(figsize=(9.0, 1.4 + 0.27 * len(rows)), layout="constrained")
    sizes = list(dict.fromkeys(row["size"] for row in rows))
    for axes, key, unit in zip(figure.subplots(1, 2, sharey=True), ("dc", "nodes"), ("drape coefficient, %", "nodes"), strict=True):
        for i, row in enumerate(rows):
            colour = f"C{sizes.index(row['size'])}"
            axes.plot(row[key], (i, i), color=colour, lw=5, alpha=0.45, solid_capstyle="butt")
            for which, marker in (("lowest", "o"), ("flat", "|")):
                if row[which] is not None:
                    axes.plot(row[which][int(key == "nodes")], i, marker, color=colour, ms=6 if marker == "o" else 12, mew=2)
        known = (result["measured"] or {}).get(key)
        if known is not None:
            axes.axvline(known, color="k", lw=1.2)
            axes.annotate(f"measured {known:g}", (known, 1.0), xycoords=("data", "axes fraction"), xytext=(0, 3), ha="center",
                          textcoords="offset points", fontsize=8, annotation_clip=False)
        axes.set_xlabel(unit)
        axes.grid(axis="x", alpha=0.3)
    axes = figure.axes[0]
    axes.set_yticks(range(len(rows)), [f"{row['label']}  ({row['size']})" for row in rows], fontsize=8)
    axes.invert_yaxis()
    figure.suptitle(f"{result['fabric']}, {result['fidelity']}: bar: physical branches, dot: lowest energy, tick: lowest from flat",
                    fontsize=10)
    return figure


def plot_inverse(rows: Sequence[Mapping[str, Any]], population: np.ndarray):
    """Rigidities found over areal mass, among the measured fabrics ``population`` (n, 2) in kg/m² and N·m; a Figure."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(6.8, 4.6), layout="constrained")
    axes = figure.add_subplot()
    mass, rigidity = 1e3 * population[:, 0], 1e6 * population[:, 1]
    axes.loglog(mass, rigidity, ".", color="0.75", ms=4, label=f"{len(population)} measured fabrics")
    found = [row for row in rows if "failure" not in row]
    shears = sorted({row["shear"] for row in found})
    for i, G in enumerate(shears):
        part = [row for row in found if row["shear"] == G]
        axes.plot([1e3 * row["areal_density"] for row in part], [1e6 * row["rigidity_Nm"] for row in part], "ov^sD"[i % 5],
                  color=f"C{i}", ms=7, label=f"explains the drape, shear {G:g} N/m")
    for name in dict.fromkeys(row["name"] for row in found):
        top = max((row for row in found if row["name"] == name), key=lambda row: row["rigidity_Nm"])
        axes.annotate(name, (1e3 * top["areal_density"], 1e6 * top["rigidity_Nm"]), fontsize=8, ha="center", xytext=(0, 8),
                      textcoords="offset points")
    axes.set_xlabel("areal mass, g/m²")
    axes.set_ylabel("bending rigidity, µN·m")
    axes.grid(alpha=0.3, which="both", lw=0.4)
    axes.legend(fontsize=8, loc="upper left")
    return figure
