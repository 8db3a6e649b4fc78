"""Scenes: what exists follows from what is declared, and files are read with errors that say where."""

import numpy as np
import pytest

from mfar_fem.contact.body import Cylinder, Sphere
from mfar_fem.errors import DataFileError, InputError, ParameterError, UnknownNameError
from mfar_fem.fidelity import LEVELS, fidelity
from mfar_fem.materials import Fabric
from mfar_fem.scene import Air, Contact, Hold, Scene
from mfar_fem.scene_file import load_scene, scene_from_dict, scene_names
from mfar_fem.sheet import Sheet, build_surface, smooth_noise
from mfar_fem.simulation.engines import FiniteElements
from mfar_fem.simulation.run import identity
from mfar_fem.solve.inertia import Inertia
from mfar_fem.supports import Clamp, Hinge
from mfar_fem.surface.io import write_mesh

SILK = Fabric.load("silk-charmeuse")
SQUARE = Sheet("rectangle", (0.1, 0.1))
COARSE = LEVELS["standard"].override(cells=4)


def scene(**changes):
    return Scene(**({"name": "test", "sheets": (SQUARE,), "fabric": SILK, "holds": (Hold("left"),), "level": COARSE} | changes))


def on(s):
    return {t.name for t in s.explain() if t.on}


def test_a_plain_scene_has_no_more_than_it_needs():
    assert on(scene()) == {"membrane", "bending", "gravity", "inertia"}
    assert scene().barrier(scene().surface()) is None and scene().drag() == []


def test_a_scene_to_rest_has_no_mass_and_no_drag():
    rest = scene(duration=None, air=Air())
    assert "inertia" not in on(rest) and "drag" not in on(rest) and rest.drag() == []


def test_a_membrane_has_no_edge_unknowns():
    run = FiniteElements(scene(bending=False, level=COARSE.override(order=2)))
    shell = run.dynamics.problem.shell
    assert "bending" not in on(scene(bending=False))
    assert shell.n_alpha == 0 and shell.n == 3 * len(run.surface.nodes)


def test_without_bodies_no_contact_energy_is_built(monkeypatch):
    import mfar_fem.contact.barrier as barrier

    def forbidden(*args, **options):
        raise AssertionError("a scene without bodies built a contact energy")

    monkeypatch.setattr(barrier, "Barrier", forbidden)
    assert FiniteElements(scene()).dynamics.contact is None
    with pytest.raises(AssertionError, match="without bodies"):
        FiniteElements(scene(contact=Contact(self_contact=True)))


def test_only_a_moving_scene_has_inertia_in_its_problem():
    loads = FiniteElements(scene()).dynamics.problem.loads
    assert sum(isinstance(load, Inertia) for load in loads) == 1 and len(loads) == 2  # and gravity


def test_supports_by_name_and_by_point():
    surface = scene().surface()
    assert isinstance(Hold("left", "clamp").support(surface), Clamp)
    point = Hold(np.array([[0.0, 0.1, 0.0]])).support(surface)
    assert isinstance(point, Hinge)
    np.testing.assert_allclose(surface.nodes[point.nodes(surface)], [[0.0, 0.1, 0.0]])
    with pytest.raises(InputError, match="away from the nearest vertex"):
        Hold(np.array([[0.0, 0.5, 0.0]])).support(surface)
    with pytest.raises(InputError, match="cannot be clamped"):
        Hold(np.array([[0.0, 0.1, 0.0]]), "clamp").support(surface)


def test_supports_let_go():
    s = scene(holds=(Hold("left"), Hold("right", release=0.3)))
    surface = s.surface()
    assert len(s.supports(surface, 0.0)) == 2 and len(s.supports(surface, 0.3)) == 1
    assert s.releases() == [0.3]


def test_sheets_are_placed_and_keep_their_warp():
    sheet = Sheet("rectangle", (0.2, 0.1), at=(0.0, 0.0, 1.0), turn=(0.0, 0.5 * np.pi, 0.0), centred=True)
    surface = build_surface((sheet,), COARSE, 2)
    np.testing.assert_allclose(surface.nodes[:, 0], 0.0, atol=1e-15)
    assert np.ptp(surface.nodes[:, 2]) == pytest.approx(0.2)
    np.testing.assert_allclose(surface.warp[0], [0.0, 0.0, -1.0], atol=1e-15)


def test_two_sheets_make_one_surface_with_their_own_names():
    other = Sheet("disc", (0.05,), at=(0.0, 0.0, 0.2), name="lid")
    surface = build_surface((SQUARE, other), COARSE, 2)
    assert {"sheet1.left", "lid.outer"} <= set(surface.boundary)
    rim = surface.nodes[surface.nodes_of("lid.outer")] - [0.0, 0.0, 0.2]
    np.testing.assert_allclose(np.linalg.norm(rim, axis=1), 0.05, rtol=1e-12)  # mid-side nodes on the circle too


def test_a_mesh_file_brings_its_warp_and_its_boundaries(tmp_path):
    plain = build_surface((SQUARE,), COARSE, 1)
    angle = np.linspace(0.0, 1.0, len(plain.triangles))
    warp = np.column_stack([np.cos(angle), np.sin(angle), 0.0 * angle])
    left = np.zeros(len(plain.vertices))
    left[plain.boundary["left"]] = 1
    write_mesh(tmp_path / "cloth.vtu", plain.vertices, plain.triangles, {"boundary_left": left}, {"warp": warp})
    sheet = Sheet("mesh", path=str(tmp_path / "cloth.vtu"), turn=(0.0, 0.0, np.pi / 2))
    surface = build_surface((sheet,), COARSE, 2)
    np.testing.assert_allclose(surface.warp, np.column_stack([-warp[:, 1], warp[:, 0], warp[:, 2]]), atol=1e-15)
    np.testing.assert_allclose(surface.nodes[surface.nodes_of("left"), 1], 0.0, atol=1e-15)
    first = identity(scene(sheets=(sheet,)))
    write_mesh(tmp_path / "cloth.vtu", 1.01 * plain.vertices, plain.triangles, {}, {"warp": warp[:, :2]})
    assert identity(scene(sheets=(sheet,))) != first  # a run is not gone on with on another mesh of the same name
    with pytest.raises(DataFileError, match="three finite numbers a triangle"):
        build_surface((sheet,), COARSE, 1)


def test_the_perturbation_is_a_field_of_the_sheet_not_of_the_mesh():
    coarse, fine = (build_surface((SQUARE,), LEVELS["standard"].override(cells=c), 1) for c in (4, 8))
    a, b = smooth_noise(coarse, 3), smooth_noise(fine, 3)
    same = [int(np.argmin(np.linalg.norm(fine.nodes - p, axis=1))) for p in coarse.nodes]
    ratio = b[same, 2] / a[:, 2]
    np.testing.assert_allclose(ratio, ratio[0], rtol=1e-9)  # the same up to the common scale
    assert np.abs(a).max() == pytest.approx(1.0) and not np.allclose(a, smooth_noise(coarse, 4))


def test_schedule_and_levels():
    s = scene(schedule=((0.0, 0.0), (0.5, 1.0)))
    assert s.factor(0.25) == pytest.approx(0.5) and s.factor(2.0) == 1.0
    assert fidelity("draft", cells=7).cells == 7
    with pytest.raises(UnknownNameError, match="draft, standard, reference"):
        fidelity("best")
    with pytest.raises(ParameterError, match="no setting 'mesh'"):
        fidelity("draft", mesh=1)


@pytest.mark.parametrize("name", scene_names())
def test_every_example_scene_is_read(name):
    s = load_scene(name)
    assert s.surface().order == s.level.order and s.explain()


BASE = {"fabric": "faille", "duration": "1 s", "sheet": [{"kind": "rectangle", "size": ["0.1 m", "100 mm"]}]}


def test_a_scene_from_a_dict():
    s = scene_from_dict(
        BASE
        | {
            "body": [
                {"kind": "sphere", "radius": "5 cm", "centre": ["0 m", "0 m", "-0.1 m"], "friction": 0.3},
                {
                    "kind": "cylinder",
                    "radius": "1 cm",
                    "length": "20 cm",
                    "axis": [1, 0, 0],
                    "motion": {"times": ["0 s", "1 s"], "translations": [["0 m", "0 m", "0 m"], ["0 m", "0 m", "5 cm"]]},
                },
            ],
            "numerics": {"order": 2, "cells": 8, "dt": "5 ms"},
        },
        cells=10,
    )
    assert isinstance(s.bodies[0], Sphere) and s.bodies[0].friction == 0.3
    assert isinstance(s.bodies[1], Cylinder) and s.bodies[1].moving
    assert (s.level.order, s.level.cells, s.level.dt) == (2, 10, 5e-3)  # the option wins over the file


DISC = "fabric = 'faille'\nduration = '1 s'\n[[sheet]]\nkind = 'disc'\nradius = '1 m'\n"
WRONG = [
    ("fabric = 'faille'\nduration = '1 s'\n", "no [[sheet]]", None),
    ("fabric = 'fail'\nduration = '1 s'\n[[sheet]]\nkind = 'disc'\nradius = '1 m'\n", "did you mean 'faille'", 1),
    ("fabric = 'faille'\nduration = '1'\n[[sheet]]\nkind = 'disc'\nradius = '1 m'\n", "unit missing", 2),
    ("fabric = 'faille'\nduration = '1 s'\n[[sheet]]\nkind = 'disk'\n", "did you mean 'disc'", 4),
    (
        DISC + "[[sheet]]\nkind = 'disc'\nradius = '-1 m'\n",
        "needs a radius",
        6,
    ),
    ("fabric = 'faille'\nto_rest = true\nduration = '1 s'\n[[sheet]]\nkind = 'disc'\nradius = '1 m'\n", "not both", 3),
    (
        DISC + "[[body]]\nkind = 'sphere'\nradius = '1 m'\n[[body]]\n"
        "kind = 'sphere'\nradios = '1 m'\n",
        "did you mean 'radius'",
        11,
    ),
    ("fabric = 'faille'\nduration = '1 s'\n[[sheet]]\nkind = 'mesh'\nfile = 'no.obj'\n", "no file 'no.obj'", 5),
    ("fabric = 'faille'\nduration = '1 s'\nfidelity = 'best'\n[[sheet]]\nkind = 'disc'\nradius = '1 m'\n", "unknown fidelity", 3),
    (
        "fabric = 'faille'\nduration = '1 s'\n[[sheet]]\nkind = 'disc'\nradius = '1 m'\n[[support]]\nkind = 'clamp'\n",
        "give either where",
        6,
    ),
    (
        "fabric = 'faille'\nduration = '1 s'\n[[sheet]]\nkind = 'disc'\nradius = '1 m'\n[numerics]\nmethod = 'rk4'\n",
        "unknown time integrator",
        6,
    ),
]


@pytest.mark.parametrize("text, message, line", WRONG)
def test_a_wrong_scene_file_says_what_and_where(tmp_path, text, message, line):
    path = tmp_path / "scene.toml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(DataFileError) as caught:
        load_scene(path)
    assert message in str(caught.value) and "scene.toml" in str(caught.value)
    if line is not None:
        assert caught.value.line == line


def test_an_unknown_scene_lists_the_examples():
    with pytest.raises(UnknownNameError, match="drape-sphere"):
        load_scene("drape-spere")
