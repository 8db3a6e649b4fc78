"""A report for trial: a tube as the garment, rows made up (only their form matters)."""

import functools
import io

import numpy as np

from reconstruction.landmarks import LANDMARKS
from reconstruction.report import paper
from reconstruction.report.content import Cost, Evidence, Model, Picture, ReportContent, Scalar, Section, Table
from reconstruction.report.estimates import Estimate
from reconstruction.report.figures import benchmark_section
from reconstruction.report.strokes import warp_strokes
from reconstruction.surface.triangles import TriangleMesh


def tube(radius=0.3, height=1.5, around=48, along=40):
    """An open cylinder about z, its normals outwards."""
    a = 2 * np.pi * np.arange(around) / around
    z = np.linspace(0, height, along)
    v = np.array([(radius * np.cos(t), radius * np.sin(t), h) for h in z for t in a])
    i = np.arange(along * around).reshape(along, around)
    right = np.roll(i, -1, axis=1)
    p, q, r, s = i[:-1].ravel(), right[:-1].ravel(), right[1:].ravel(), i[1:].ravel()
    return TriangleMesh(v, np.vstack([np.column_stack([p, q, r]), np.column_stack([p, r, s])]))


def invented(seed=0):
    """Arguments of `benchmark_section`, drawn at random."""
    rng = np.random.default_rng(seed)

    def rows(things, means, spread, methods=("MFAR", "MVS", "template only"), n=5):
        out = []
        for t in things:
            for m, mean in zip(methods, means, strict=False):
                v = float(mean + spread * rng.normal())
                out.append(Estimate(t, m, v, v - spread * (1 + rng.random()), v + spread * (1 + rng.random()), n))
        return out

    return {
        "distances": [*rows(paper.GARMENTS, (9, 80, 14), 2), Estimate("veil-hat", "Pix2Vex", 33.0)],
        "keypoints": rows(LANDMARKS, (9, ), 1.5, ("MFAR",), 200),
        "spectra": rows([f"pair {i}" for i in range(1, 5)], (0.8, 0.6), 0.05, ("MFAR", "MVS")),
        "nulls": {"phases shuffled": (0.55, 0.7), "smooth surface": (0.2, 0.35)},
        "features": rows(paper.GROUPS, (75, 60), 5, ("MFAR", "template only")),
        "chance": dict(zip(paper.GROUPS, (50.0, 55.0, 48.0, 70.0, 30.0), strict=True)),
        "times": {"MFAR": (41.7, 300.0), "MVS": (62.0, None)},
        "machine": "2 cores, invented",
        "text": "All rows of this section are invented.",
    }  # fmt: skip


def photograph(size=(40, 30), form="JPEG"):
    """Noise as a picture file."""
    from PIL import Image

    out = io.BytesIO()
    Image.fromarray(np.random.default_rng(0).integers(0, 255, (size[1], size[0], 3), dtype=np.uint8)).save(out, form)
    return out.getvalue()


@functools.cache
def benchmark():
    """The section of the benchmark with invented rows."""
    return benchmark_section(**invented())


def content(**change):
    """A report of everything; some of it changed."""
    mesh = tube()
    z = mesh.vertices[:, 2].copy()
    z[:100] = np.nan
    up = np.tile([0, 0, 1.0], (len(mesh.faces), 1))
    values = {
        "title": "Trial", "garment": "tube", "summary": "First.\n\nSecond.", "facts": {"distance": "3 mm"},
        "sections": [
            Section("Sources", "Text.", [Picture(photograph(), "noise", "A caption")],
                    [Table(["a", "b"], [["x", 1.0], ["y", None]])], ["A note."]),
            benchmark(),
        ],
        "models": [
            Model("Start", tube(0.36)), Model("Final", mesh, [Scalar("height", z, "m")], warp_strokes(mesh, up, 400), "warp"),
        ],
        "backdrop": tube(0.15),
        "costs": [Cost("fuse", 23.26, 31.0, 480.0), Cost("template", 8.0, None, 300.0, True)],
        "evidence": [Evidence("hem", 0.8, "evidence", "textile 1"), Evidence("hem", 0.15, "prior"), Evidence("slit", 1.0, "prior")],
        "notes": ["Rows are invented."], "provenance": {"seed": "3"},
    }  # fmt: skip
    return ReportContent(**(values | change))
