"""Runs of scenes: files, a killed run that goes on as if nothing had happened, pictures, plan and comparison."""

import json
import signal
import subprocess
import sys
import textwrap
import time
from dataclasses import replace

import meshio
import numpy as np
import pytest

from mfar_fem.errors import DataFileError, InputError
from mfar_fem.fidelity import LEVELS
from mfar_fem.plan import plan
from mfar_fem.scene_file import load_scene, scene_from_dict
from mfar_fem.simulation import simulate, tradeoff
from mfar_fem.simulation.engines import engine

QUIET = {"vtu": False, "pictures": False, "animation": False}
SWING = {
    "name": "small swing",
    "fabric": "silk-charmeuse",
    "duration": "60 ms",
    "air": {"normal": "0.6 kg/m^3"},
    "sheet": [{"kind": "rectangle", "size": ["0.1 m", "0.1 m"]}],
    "support": [{"where": "left"}, {"where": "right", "release": "20 ms"}],
    "output": QUIET,
}
REST = {
    "name": "hanging",
    "fabric": "silk-charmeuse",
    "to_rest": True,
    "sheet": [{"kind": "rectangle", "size": ["0.1 m", "0.1 m"]}],
    "support": [{"points": [["0 m", "0 m", "0 m"], ["0 m", "0.1 m", "0 m"]]}],
    "output": QUIET,
    "perturbation": {"amplitude": "0.1 mm", "seed": 2},
}

BALL = {
    "name": "cloth on a ball",
    "fabric": "silk-charmeuse",
    "duration": "60 ms",
    "sheet": [{"kind": "rectangle", "size": ["0.1 m", "0.1 m"], "centred": True, "at": ["0 m", "0 m", "0.053 m"]}],
    "body": [{"kind": "sphere", "radius": "0.05 m", "friction": 0.3}],
    "contact": {"distance": "1 mm"},
    "output": QUIET,
}


def small(data, level="standard", cells=4, **more):
    return scene_from_dict(data, level, cells=cells, **more)


@pytest.mark.parametrize("level", ["draft", "standard", "reference"])
def test_one_scene_at_every_level(level):
    """The same file runs at all levels, and they agree on where a released swatch goes."""
    result = simulate(small(SWING, level, 6))
    assert result.converged and result.time == pytest.approx(0.06)
    surface = small(SWING, level, 6).surface(None if level != "draft" else 1)
    edge = result.nodes[surface.nodes_of("right")]
    assert edge[:, 2].mean() == pytest.approx(-0.0078, abs=0.0015)  # ½ g t² = 7.8 mm in 40 ms, less the drag
    held = surface.nodes_of("left")
    np.testing.assert_allclose(result.nodes[held], surface.nodes[held], atol=1e-15)


def test_files_of_a_run(tmp_path):
    scene = small(SWING | {"output": {"every": "20 ms"}})
    result = simulate(scene, tmp_path)
    saved = json.loads((tmp_path / "result.json").read_text())
    assert saved["status"] == "converged" and saved["steps"] == 30 and saved["terms"]["drag"] and not saved["terms"]["self-contact"]
    assert len(list((tmp_path / "frames").glob("*.vtu"))) == 4 and (tmp_path / "last.glb").stat().st_size > 500
    frame = meshio.read(tmp_path / "frames" / "frame-00003.vtu")
    np.testing.assert_allclose(frame.points, result.nodes, rtol=0, atol=1e-15)
    assert {"strain_warp", "membrane_energy", "bending_energy"} <= set(frame.cell_data) and "velocity" in frame.point_data
    index = (tmp_path / "series.pvd").read_text()
    assert index.count("<DataSet") == 4 and 'timestep="0.06"' in index
    from PIL import Image

    picture = np.asarray(Image.open(tmp_path / "pictures" / "frame-00003.png"))
    assert picture.shape == (560, 560, 3) and np.mean(picture[..., 0] > 1.5 * picture[..., 1]) > 0.02  # there is red cloth in it
    assert Image.open(tmp_path / "animation.gif").n_frames == 4
    history = np.genfromtxt(tmp_path / "history.csv", delimiter=",", names=True)
    assert len(history) == 30 and np.all(history["residual_relative"] <= 1e-6)
    total = sum(history[k] for k in ("kinetic", "membrane", "bending", "potential"))
    assert np.all(np.diff(total) < 1e-12)  # drag and implicit Euler only take energy


KILLED = """
    import sys
    from mfar_fem.scene_file import scene_from_dict
    from mfar_fem.simulation import simulate
    scene = scene_from_dict({data!r}, {level!r}, cells=4, linear_solver={solver!r})
    print("ready", flush=True)
    simulate(scene, {folder!r}, progress=lambda row: print(row["time"], flush=True))
"""


@pytest.mark.parametrize("level, solver", [("draft", "direct"), ("standard", "superlu"), ("standard", "direct")])
def test_a_killed_run_goes_on_as_if_it_had_not_been(tmp_path, level, solver):
    """SIGKILL: at most the step in progress is lost; the end is that of a whole run, bit by bit (PARDISO: to 1e-12 m)."""
    scene = small(SWING, level, linear_solver=solver)
    whole = simulate(scene, tmp_path / "whole")
    folder = tmp_path / "killed"
    script = textwrap.dedent(KILLED.format(data=SWING, level=level, solver=solver, folder=str(folder)))
    with subprocess.Popen([sys.executable, "-c", script], stdout=subprocess.PIPE, text=True) as process:
        reached = 0.0
        for line in process.stdout:
            if line.strip() != "ready":
                reached = float(line)
            if reached > 0.029:
                process.send_signal(signal.SIGKILL)
                break
        assert process.wait(timeout=60) == -signal.SIGKILL
    with np.load(folder / "checkpoint.npz") as checkpoint:
        at = float(checkpoint["motion_time" if level == "standard" else "time"])
    assert at >= reached - 1e-12  # nothing that was reported is lost
    with pytest.raises(InputError, match="unfinished run"):
        simulate(scene, folder)
    resumed = simulate(scene, folder, resume=True)
    assert resumed.payload["resumed_at"] == pytest.approx(at)
    exact = solver == "superlu" or level == "draft"
    np.testing.assert_allclose(resumed.nodes, whole.nodes, rtol=0, atol=0 if exact else 1e-12)
    np.testing.assert_allclose(resumed.velocities, whole.velocities, rtol=0, atol=0 if exact else 1e-9)
    rows = [(f / "history.csv").read_text().splitlines() for f in (folder, tmp_path / "whole")]
    assert len(rows[0]) == len(rows[1]) and (not exact or rows[0] == rows[1])


def test_a_run_with_contact_goes_on_from_its_state():
    """Contact is rebuilt from the state and what the barrier remembers: the same steps, to rounding.

    The whole run stops at 40 ms too: steps are cut to end there, and contact magnifies what a step differs in its last digit
    (to 1e-9 m at the end of this scene).
    """
    scene = scene_from_dict(BALL, "standard", cells=6, linear_solver="superlu")
    whole, first, second = engine(scene), engine(scene), engine(scene)
    rows = {"whole": [], "parts": []}
    for end in (0.04, 0.06):
        whole.advance(end, lambda row: rows["whole"].append((row["iterations"], row.get("contacts", 0))))
    first.advance(0.04, lambda row: rows["parts"].append((row["iterations"], row.get("contacts", 0))))
    second.restore(first.state())
    second.advance(0.06, lambda row: rows["parts"].append((row["iterations"], row.get("contacts", 0))))
    assert rows["whole"] == rows["parts"] and rows["whole"][-1][1] > 10
    np.testing.assert_allclose(second.nodes(), whole.nodes(), rtol=0, atol=1e-12)


def test_a_checkpoint_of_another_scene_is_refused(tmp_path):
    simulate(small(SWING), tmp_path)
    (tmp_path / "result.json").unlink()
    with pytest.raises(DataFileError, match="another scene"):
        simulate(small(SWING | {"gravity": ["0 m/s^2", "0 m/s^2", "-1.6 m/s^2"]}), tmp_path, resume=True)
    (tmp_path / "checkpoint.npz").write_bytes(b"broken")
    with pytest.raises(DataFileError, match="not a readable checkpoint"):
        simulate(small(SWING), tmp_path, resume=True)
    with pytest.raises(DataFileError, match="no checkpoint"):
        simulate(small(SWING), tmp_path / "empty", resume=True)


def test_to_rest_is_a_stable_equilibrium(tmp_path):
    result = simulate(small(REST), tmp_path)
    payload = json.loads((tmp_path / "result.json").read_text())
    assert result.converged and payload["stable"] is True and payload["residual_relative"] < 1e-6
    assert payload["perturbation"] == {"amplitude": 1e-4, "seed": 2} and not payload["terms"]["inertia"]
    assert result.nodes[:, 2].min() == pytest.approx(-0.1, abs=0.002)  # hangs down by its length


def test_a_failed_run_keeps_what_it_had(tmp_path):
    """A strip pulled past locking: a named failure, the last state, finite everywhere."""
    data = SWING | {
        "fabric": "cupro-su1098",
        "support": [{"where": "left"}, {"where": "right", "move": ["30 mm", "0 m", "0 m"]}],
        "schedule": {"times": ["0 s", "40 ms"], "factors": [0, 1]},
        "numerics": {"dt": "5 ms"},
    }
    result = simulate(small(data), tmp_path)
    assert not result.converged and result.status in ("LockingReached", "StepTooSmall", "Diverged")
    assert 0 < result.time < 0.06 and np.all(np.isfinite(result.nodes))
    assert json.loads((tmp_path / "result.json").read_text())["status"] == result.status


def test_the_plan_says_what_is_on_and_off():
    found = plan(small(SWING), measure=False)
    terms = {t["name"]: t for t in found["terms"]}
    assert (
        terms["drag"]["on"] and not terms["contact with bodies"]["on"] and "no search tree" in terms["contact with bodies"]["why"]
    )
    assert found["seconds"] is None and found["edge_unknowns"] > 0
    assert plan(replace(small(SWING), bending=False), measure=False)["edge_unknowns"] == 0
    assert plan(small(REST), measure=False)["steps"] is None
    s = found["scales"]
    assert s["bending_length"] == pytest.approx(0.01578, rel=1e-3) and s["terminal_speed"] == pytest.approx(1.1647, rel=1e-3)


def test_the_tradeoff_compares_with_the_finest_and_recommends(tmp_path):
    scene = replace(small(SWING), holds=small(SWING).holds[:1], duration=0.03)
    levels = [
        LEVELS["standard"].override(cells=2, dt=1e-2),
        LEVELS["standard"].override(cells=2, dt=2e-3),
        LEVELS["standard"].override(cells=4),
    ]
    payload = tradeoff.tradeoff(scene, 2e-3, levels, cache=tmp_path)
    errors = [row["error_m"] for row in payload["rows"]]
    assert errors[2] == 0.0 and errors[0] > errors[1] > 0
    assert all(row["memory_MB"] > 50 and row["wall_s"] > 0 for row in payload["rows"])
    assert payload["recommended"]["error_m"] <= 2e-3
    begin = time.perf_counter()
    again = tradeoff.tradeoff(scene, 2e-3, levels, cache=tmp_path)  # finished runs are kept
    assert [r["wall_s"] for r in again["rows"]] == [r["wall_s"] for r in payload["rows"]] and time.perf_counter() - begin < 5
    assert tradeoff.plot(payload, tmp_path / "plot.png").stat().st_size > 10_000
    assert tradeoff.recommend(payload["rows"], None) is None


def test_the_example_swings(tmp_path):
    scene = replace(load_scene("swing", cells=6), duration=0.02)
    assert simulate(scene).converged
