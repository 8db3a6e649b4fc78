"""From nothing but pictures, masks and cameras to a garment near the true one, through the command line."""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import reconstruction
from reconstruction.restore.pipeline import ORDER
from reconstruction.surface.triangles import TriangleMesh

for module in ("cv2", "embreex", "igl", "networkx", "skimage", "torch"):
    pytest.importorskip(module)


@pytest.mark.slow
def test_a_half_sleeve_garment_from_its_pictures(tmp_path):
    from reconstruction.benchmark.case import TRUTH, make_case
    from reconstruction.metrics.distance import distances

    case, truth, out = tmp_path / "case", tmp_path / TRUTH, tmp_path / "out"
    make_case(case, "half-sleeve", seed=11)
    os.replace(case / TRUTH, truth)  # out of reach
    command = ["restore", str(case), "--out", str(out), "--type", "half-sleeve", "--fidelity", "draft", "--json"]
    ended = subprocess.run([sys.executable, "-m", "mfar_fem.cli.main", *command], cwd=Path(reconstruction.__file__).parents[1],
                           capture_output=True, text=True, timeout=1800)  # fmt: skip
    assert ended.returncode == 0, ended.stderr
    payload = json.loads(ended.stdout)
    assert [row["stage"] for row in payload["stages"]] == list(ORDER) and not any(row["cached"] for row in payload["stages"])
    assert all((out / name / "stage.json").is_file() for name in ORDER) and payload["failure"] is None
    page = Path(payload["report"])
    assert page == out / "report" / "report.html" and "Restored half sleeve" in page.read_text(encoding="utf-8")
    assert payload["peak_MB"] < 6000

    with np.load(truth / "geometry.npz") as true, np.load(out / "points" / "shape.npz") as shape:
        expected = TriangleMesh(true["vertices"], true["faces"])
        axes, origin = shape["axes"], shape["origin"]
    with np.load(out / "surface" / "mesh.npz") as mesh:
        found = TriangleMesh(mesh["vertices"] @ axes + origin, mesh["faces"])
    assert distances(found, expected)["mean"] < 30
