"""Pictures of the documentation, computed and drawn: ``python docs/make_images.py`` (some minutes).

The measured strips of cupro SU-1098 in three directions against the calibrated fabric by finite elements, and the strain
of the bias strip at 18 %: where the grips hold the yarns the weave cannot shear.
"""

from __future__ import annotations

import math
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.collections import PolyCollection

from calibration import datasets
from calibration.plots import COLOURS, STYLE
from material_tests.strip.fe import StripTest
from mfar_fem.materials import Fabric

FOLDER = Path(__file__).parent / "images"
BIAS_STRAIN = 0.18


def curves(axes, fabric, strips) -> None:
    """Measured readings and the computed curve of every strip; warp and weft share a panel."""
    for e in strips:
        ax = axes[int(e.direction_name == "bias")]
        grid = np.linspace(0.0, e.x.max(), 41)[1:]
        found = StripTest(e.gauge, e.width, e.direction, "reference").run(fabric, grid)
        colour = COLOURS[e.direction_name]
        ax.plot(100 * e.x, e.y, "o", ms=4, mfc="white", mec=colour, zorder=3)
        ax.plot(100 * found.strain, found.line_force, "-", color=colour, label=e.direction_name)
    for ax in axes:
        ax.set(xlabel="engineering strain (%)", ylabel="force by width (N/m)", xlim=(0, None), ylim=(0, 120))
        ax.legend(loc="upper left")


def field(ax, fabric, strip):
    """Angle lost between warp and weft over the deformed bias strip, by element."""
    test = StripTest(strip.gauge, strip.width, strip.direction, "reference")
    result = test.run(fabric, np.linspace(0.0, BIAS_STRAIN, 10)[1:])
    state = result.field(-1)
    shear = np.degrees(np.abs(state.mean(state.engineering[..., 2])))
    elements, x = result.problem.surface.elements, 1e3 * state.deformed[:, :2]
    outline = x[elements[:, [0, 3, 1, 4, 2, 5]]][..., ::-1]
    drawn = PolyCollection(outline, array=shear, cmap="viridis", edgecolors="white", linewidths=0.15)
    ax.add_collection(drawn)
    ax.autoscale_view()
    ax.set_aspect("equal")
    ax.axis("off")
    ax.set_title(f"bias strip at {100 * BIAS_STRAIN:.0f} %", fontsize=9)
    return drawn


SCENES = (("swing", "standard", 0.18, None), ("drape-sphere", "draft", 1.0, None), ("drape-body", "draft", 0.35, None),
          ("cusick", None, None, None))
"""Scene, level (None: its own), time shown (None: at rest), cells."""


def scenes() -> None:
    """Write ``docs/images/scenes.png``: four of the example scenes side by side."""
    from dataclasses import replace

    from mfar_fem.scene_file import load_scene
    from mfar_fem.simulation import simulate
    from mfar_fem.simulation.pictures import Camera, render

    tiles = []
    for name, level, time, cells in SCENES:
        scene = load_scene(name, level, cells=cells)
        if time is not None:
            scene = replace(scene, duration=time)
        result = simulate(scene)
        bodies = [(b.placed(v, result.time), t) for b in scene.bodies for v, t in [b.mesh()]]
        points, triangles = result.nodes, result.triangles
        if name == "cusick":  # the cloth on the disc, which does not move
            angle = np.linspace(0, 2 * np.pi, 120, endpoint=False)
            disc = np.vstack([[[0, 0, 0]], 0.09 * np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])])
            fan = np.column_stack([np.zeros(120, int), 1 + np.arange(120), 1 + (np.arange(120) + 1) % 120])
            triangles = np.vstack([triangles, fan + len(points)])
            points = np.vstack([points, disc])
        near = [np.clip(v, points.min(axis=0) - 0.1, points.max(axis=0) + 0.1) for v, _ in bodies]
        tiles.append(render(Camera([points, *near], scene.output.view), (points, triangles), bodies, 400))
    plt.imsave(FOLDER / "scenes.png", np.hstack(tiles), metadata={"Software": None})


def main() -> None:
    """Write ``docs/images/cupro.png`` and ``scenes.png``."""
    scenes()
    fabric = Fabric.load("cupro-su1098")
    strips = datasets.load("cupro-su1098").select(role="fit")
    bias = next(e for e in strips if math.isclose(e.direction, math.pi / 4))
    with plt.rc_context(STYLE):
        figure, axes = plt.subplots(1, 3, figsize=(9.6, 3.2), layout="constrained", width_ratios=(1, 1, 0.75))
        curves(axes[:2], fabric, strips)
        axes[0].set_title("along the yarns: measured (o), computed (—)", fontsize=9)
        axes[1].set_title("at 45°", fontsize=9)
        drawn = field(axes[2], fabric, bias)
        figure.colorbar(drawn, ax=axes[2], shrink=0.85, label="shear angle of the yarns (°)")
        FOLDER.mkdir(exist_ok=True)
        figure.savefig(FOLDER / "cupro.png", dpi=110, metadata={"Software": None})
    plt.close(figure)


if __name__ == "__main__":
    main()
