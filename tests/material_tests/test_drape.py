"""Drape by finite elements: limits, trends, branches kept through a kill, the inverse, and a pinned branch."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest

from material_tests.drape import branches, inverse, plots, study
from material_tests.drape.compare import error_against, render, run
from material_tests.drape.fe import Seed, drape, self_intersection
from material_tests.drape.geometry import DrapeTest
from material_tests.drape.targets import measured, targets
from mfar_fem.errors import DataFileError, InputError, ParameterError
from mfar_fem.materials import Fabric

TINY = DrapeTest(cells=(3, 24))
FAILLE = Fabric.load("faille")


@pytest.fixture(scope="module")
def six():
    return drape(FAILLE, TINY, Seed("folds", 6))


def test_stiff_sheet_stays_flat():
    d = drape(study.with_bending(FAILLE, 1e5), TINY, Seed("flat", 1))
    assert d.rest.converged and d.rest.stable and d.intersecting in (False, None)
    assert 99.8 < d.reading.drape_coefficient < 100.001 and d.reading.nodes == 0
    assert d.reading.depth == pytest.approx(_plate(9.80665 * FAILLE.areal_density / (1e5 * FAILLE.bending.warp)), rel=0.02)


def _plate(load: float, a: float = 0.09, b: float = 0.15) -> float:
    """Rim deflection, m, of Kirchhoff's ring clamped inside, free outside, Poisson 0 (Huber's twist), under load over rigidity."""
    from scipy.integrate import cumulative_trapezoid

    r = np.linspace(a, b, 2001)
    shear = -0.5 * load * (b * b * np.log(r) - 0.5 * r * r)  # what w'' + w'/r is but for a constant
    slopes = [cumulative_trapezoid(r * part, r, initial=0.0) / r for part in (shear, np.ones_like(r))]
    moments = [part[-1] - slope[-1] / b for part, slope in zip((shear, np.ones_like(r)), slopes, strict=True)]
    return float(np.trapezoid(slopes[0] - moments[0] / moments[1] * slopes[1], r))


def test_coefficient_grows_with_the_rigidity():
    dc = [drape(study.with_bending(FAILLE, f), TINY, Seed("folds", 4)).reading.drape_coefficient for f in (2, 10, 100)]
    assert np.all(np.diff(dc) > 3.0)


def test_rest_state_is_an_equilibrium_with_its_energies(six):
    assert six.rest.converged and six.rest.stable and six.physical
    assert six.rest.residual_relative < 1e-6
    assert six.rest.energy == pytest.approx(six.rest.membrane + six.rest.bending + six.gravity, rel=1e-9)
    assert six.gravity < 0.0 < six.rest.bending
    problem, state = TINY.problem(FAILLE), six.rest.state
    problem.loads[-1].factor = 0.0  # no inertia: the residual anew, apart from the relaxation's own bookkeeping
    g = problem.gradient(state, 1.0)
    g[problem.fixed] = 0.0
    assert problem.norm(g) < 1e-5 * problem.norm(problem.external_force(state, 1.0))


def test_pinned_branch_and_determinism(six):
    again = drape(FAILLE, TINY, Seed("folds", 6))
    assert np.array_equal(again.x, six.x) and again.rest.iterations == six.rest.iterations
    assert six.reading.nodes == PIN["nodes"]
    assert six.reading.drape_coefficient == pytest.approx(PIN["dc"], abs=0.05)
    assert six.rest.energy == pytest.approx(PIN["energy"], rel=1e-4)
    assert six.rest.iterations <= 1.3 * PIN["iterations"]


PIN = {"nodes": 6, "dc": 23.423, "energy": -1.0096961e-3, "iterations": 92}


@pytest.fixture
def tiny(monkeypatch):
    """The draft mesh made tiny, and two starts in the table."""
    from material_tests.drape import geometry

    monkeypatch.setitem(geometry.CELLS, "draft", TINY.cells)
    monkeypatch.setattr(branches, "FOLDS", (6,))
    two = [Seed("folds", 6), Seed("flat", 1)]
    monkeypatch.setattr(branches, "default_seeds", lambda: two)


def test_payload_rendering_and_files(tiny, tmp_path):
    from rich.console import Console

    from mfar_fem.cli.console import jsonable

    payload = run(FAILLE, fidelity="draft", table=True, out=tmp_path, workers=1)
    for key in ("drape_coefficient_percent", "nodes", "wall_s", "stable", "intersecting", "energy_J", "outline", "amplitudes_m"):
        assert key in payload
    assert payload["measured"]["drape_coefficient_percent"] == 28.3 and payload["measured"]["nodes"] == 7
    assert json.loads(json.dumps(jsonable(payload), allow_nan=False))["test"] == "drape"
    energies = {row["seed"]: row["energy_J"] for row in payload["branches"] if row["physical"]}
    assert payload["lowest"] == min(energies, key=energies.get) == payload["seed"] and payload["fallen"] == "flat 1"
    console = Console(width=140, record=True, quiet=True)
    for item in render(payload):
        console.print(item)
    assert {path.rsplit("/")[-1] for path in payload["files"]} == {path.name for path in tmp_path.iterdir()} - {"branches.jsonl"}
    for path in tmp_path.iterdir():
        assert path.stat().st_size > 200
    again = run(FAILLE, fidelity="draft", table=True, out=tmp_path, workers=1)  # all reused
    assert all(row["reused"] for row in again["branches"]) and again["table_wall_s"] < 1.0
    assert again["drape_coefficient_percent"] == payload["drape_coefficient_percent"]


def test_killed_table_loses_only_what_was_in_progress(tmp_path):
    starts = [Seed("folds", 6), Seed("folds", 4)]

    class Killed(Exception):
        pass

    def stop(done, total, row):
        raise Killed

    with pytest.raises(Killed):
        branches.branch_table(FAILLE, TINY, starts, tmp_path, workers=1, progress=stop)
    path = tmp_path / "branches.jsonl"
    with path.open("a") as stream:
        stream.write('{"key": "cut sho')  # a write cut by the kill
    table = branches.branch_table(FAILLE, TINY, starts, tmp_path, workers=1)
    assert [row["reused"] for row in table.rows] == [True, False]
    assert len(branches.read_branches(path)) == 2
    other = branches.branch_key(study.with_shear(FAILLE, 10.0), TINY, starts[0])
    assert other not in branches.read_branches(path)


def test_sheet_that_passes_through_itself_is_found_and_not_physical(six):
    surface = TINY.surface()
    if self_intersection(surface, six.x) is None:
        pytest.skip("ipctk is not installed")
    assert not self_intersection(surface, six.x)
    x = six.x.copy()
    rim = np.argmax(np.hypot(surface.nodes[:, 0], surface.nodes[:, 1]) + surface.nodes[:, 0])
    x[rim] = [-0.16, 0.0, -0.02]  # one corner pulled right through
    assert self_intersection(surface, x)


def test_finer_mesh_keeps_the_branch():
    stiff = study.with_bending(FAILLE, 10.0)  # folds that 24 cells resolve
    coarse = drape(stiff, TINY, Seed("folds", 4))
    found = error_against(stiff, TINY, coarse.x, coarse.row(), cells=(4, 48))
    assert found["converged"] and found["same_branch"] and found["nodes"] == 4
    assert abs(found["error_points"]) < 3.0 and abs(found["energy_error"]) < 0.05  # measured: 2.2 points, 3.3 %


def test_study_changes_what_it_says():
    assert study.with_shear(FAILLE, 12.0).law.G * FAILLE.thickness == pytest.approx(12.0)
    stiff = study.with_bending(FAILLE, 2.0, twist=3.0)
    assert stiff.bending.warp == pytest.approx(2 * FAILLE.bending.warp)
    assert stiff.bending.twist == pytest.approx(6 * FAILLE.bending.twist)
    coupled = study.with_bending(FAILLE, coupling=0.3).bending
    assert coupled.coupling + 2 * coupled.twist == pytest.approx(coupled.warp)  # Huber
    with pytest.raises(ParameterError, match="no shear stiffness"):
        study.with_shear(Fabric.load("silk-charmeuse").replace(law=_without_shear()), 5.0)


def _without_shear():
    from mfar_fem.materials import get_law

    return get_law("neo-hookean")


def test_hysteresis_stiffens_by_its_moment_over_the_curvature(six):
    stiff, factor = study.hysteretic(FAILLE, TINY, 6.865e-5, Seed("folds", 6), rounds=2)
    kappa = study.mean_curvature(FAILLE, TINY, six.rest.bending)
    assert 10.0 < kappa < 200.0
    assert 1.0 < factor < 1.0 + 6.865e-5 / (FAILLE.bending.warp * kappa)
    assert stiff.bending.warp == pytest.approx(factor * FAILLE.bending.warp)
    # a shape of constant curvature has that curvature
    area = math.pi * (0.15**2 - 0.09**2)
    assert study.mean_curvature(FAILLE, TINY, 0.5 * FAILLE.bending.warp * 40.0**2 * area) == pytest.approx(40.0)


@pytest.mark.slow
def test_rigidity_is_recovered_from_its_own_drape():
    B, G, w = 8e-6, 20.0, 0.12
    start = (Seed("folds", 4),)
    target = drape(inverse.woven(w, B, G), TINY, start[0]).reading.drape_coefficient
    found = inverse.rigidity_from_drape(target, w, G, TINY, start)
    assert found.rigidity == pytest.approx(B, rel=0.25)
    assert found.bracket[0] < found.rigidity < found.bracket[1]


def test_percentile_among_like_fabrics(tmp_path):
    table = np.column_stack([np.full(10, 0.1), np.arange(1.0, 11.0)])
    table = np.vstack([table, [1.0, 1e-9]])
    assert inverse.percentile(5.5, 0.1, table) == {"percentile": 50.0, "count": 10, "median": 5.5}
    assert inverse.percentile(5.5, 5.0, table)["count"] == 0
    with pytest.raises(DataFileError, match=r"absent\.csv"):
        inverse.population(tmp_path / "absent.csv")
    with pytest.raises(InputError, match="between 2 and 98"):
        inverse.rigidity_from_drape(99.9, 0.1, 10.0, TINY)


def test_targets_are_cited_and_consistent():
    for target in targets():
        assert target.source and target.kind
        if target.value is not None and target.lower is not None:
            assert target.lower <= target.value <= target.upper
    assert measured("polyester faille", "nodes").value == 7 and measured("no such cloth") is None


def test_bad_starts_are_refused():
    with pytest.raises(InputError, match="folds, flat or fall"):
        Seed("round")
    with pytest.raises(InputError, match="amplitude"):
        Seed("flat", 1, 0.0)
    with pytest.raises(InputError, match="worker"):
        branches.branch_table(FAILLE, TINY, [Seed()], workers=0)


@pytest.mark.slow
def test_workers_give_the_same_branches_as_one_process():
    starts = [Seed("folds", 6), Seed("folds", 4)]
    one, two = (branches.branch_table(FAILLE, TINY, starts, workers=n) for n in (1, 2))
    for a, b in zip(one.rows, two.rows, strict=True):
        assert a["energy_J"] == pytest.approx(b["energy_J"], rel=1e-6) and a["nodes"] == b["nodes"]


@pytest.mark.slow
def test_self_contact_keeps_the_sheet_out_of_itself():
    pytest.importorskip("ipctk")
    d = drape(FAILLE, TINY, Seed("folds", 6), self_contact=True)
    assert d.intersecting is False and d.rest.energy < 0.0


def test_pictures_of_the_studies():
    row = {"label": "G 5 N/m", "size": "iso-30", "lowest": (25.0, 7), "flat": None, "dc": (25.0, 31.0), "nodes": (6, 9)}
    known = {"dc": 28.3, "nodes": 7}
    figure = plots.plot_study({"fabric": "faille", "fidelity": "draft", "rows": [row, row | {"dc": None}], "measured": known})
    assert [len(axes.lines) for axes in figure.axes] == [3, 3]  # bar, dot, measured
    found = {"name": "wool", "areal_density": 0.27, "shear": 15.0, "rigidity_Nm": 4e-5}
    figure = plots.plot_inverse([found, found | {"failure": "none"}], np.array([[0.1, 1e-5], [0.3, 2e-5]]))
    assert "shear 15 N/m" in figure.axes[0].get_legend().get_texts()[1].get_text()


@pytest.mark.parametrize("carried", [True, False])
def test_a_branch_over_the_meshes(carried):
    stiff = study.with_bending(FAILLE, 20)
    rows = study.mesh_convergence(stiff, TINY, Seed("folds", 4), ((2, 24), (3, 32)), carried)
    assert [row["cells"] for row in rows] == [[2, 24], [3, 32]] and all(row["same_branch"] for row in rows)
    assert rows[1]["drape_coefficient_percent"] == pytest.approx(rows[0]["drape_coefficient_percent"], abs=3.0)
    assert "between the two finest" in study.render_convergence(rows)[-1]
