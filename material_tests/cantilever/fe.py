"""The cantilever test by finite elements (ASTM D1388): a strip under its own weight, option A and the heart loop.

Order-2 shell with membrane and bending, 25 mm wide, free edges. The strip curves across (anticlastic), off the yarn directions
it twists, and its membrane stretches by the fabric's law: none of which the elastica of `material_tests.elastica` knows. The
elastica gives the first guess, and its exact derivative the next overhang, so that two to four solves reach 41.5 degrees.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from material_tests import elastica, heart_loop
from material_tests.cantilever.model import LOOP_LENGTH, exact
from mfar_fem.errors import InputError, NotConvergedError, ParameterError, UnknownNameError
from mfar_fem.loads import gravity as gravity_load
from mfar_fem.shell import State
from mfar_fem.solve import NewtonOptions, Problem, solve_static
from mfar_fem.solve.newton import newton
from mfar_fem.supports import Clamp, Support, Symmetry
from mfar_fem.surface import Surface, patterns
from mfar_fem.units import STANDARD_GRAVITY

WIDTH = 0.025
"""Width of the standard's strip, m."""

CELLS = {"draft": (8, 2), "standard": (12, 4), "reference": (32, 10)}
"""Cells along and across (two order-2 triangles each)."""

OPTIONS = NewtonOptions(rtol=1e-7)
ANGLE_TOLERANCE = math.radians(1e-4)


@dataclass(frozen=True, eq=False)
class CantileverFE:
    """What the test reads on a finite-element strip.

    Attributes
    ----------
    option : {'A', 'B'}
    angle : float
        Of the strip's axis from the warp, rad.
    weight : float
        Areal density times gravity, N/m².
    narrow_rigidity, wide_rigidity : float
        Rigidity of a narrow strip with free edges and of one bent into a cylinder, N·m: the truth lies between them.
    reading : float
        Overhang at 41.5 degrees (A) or height of the loop (B), m.
    elastica_reading : float
        The same by the exact elastica with `narrow_rigidity`, m.
    rigidity : float
        The reading turned into a rigidity by the exact elastica, N·m: what the strip appears to have.
    standard_bending_length, standard_rigidity : float
        By the standard's formula, m and N·m.
    chord_angle : float or None
        Option A: of the converged strip, rad.
    lateral_sag : float
        Largest height of the edges over the centre line (normal to it), in widths.
    twist : float
        Slope of the line across the strip at its far end, rad.
    stretch : float
        Largest elongation of the centre line.
    status : str
        ``converged``.
    iterations : int
        Newton iterations, all overhangs together; ``solves`` counts the overhangs.
    s, x, y : (n,) arrays
        Centre line (B: half the loop), m: along the strip, outwards, upwards.
    """

    option: str
    angle: float
    weight: float
    narrow_rigidity: float
    wide_rigidity: float
    reading: float
    elastica_reading: float
    rigidity: float
    standard_bending_length: float
    standard_rigidity: float
    chord_angle: float | None
    lateral_sag: float
    twist: float
    stretch: float
    status: str
    iterations: int
    solves: int
    wall_s: float
    s: np.ndarray = field(repr=False)
    x: np.ndarray = field(repr=False)
    y: np.ndarray = field(repr=False)
    problem: Problem = field(repr=False)
    state: State = field(repr=False)

    @property
    def elastica_error_percent(self) -> float:
        """Rigidity read on the finite-element strip against that of a narrow strip, %."""
        return 100.0 * (self.rigidity / self.narrow_rigidity - 1.0)


def option_a(fabric, angle: float = 0.0, width: float = WIDTH, fidelity: str = "standard", free: bool = True,
             cells: tuple[int, int] | None = None, gravity: float = STANDARD_GRAVITY,
             chord: float = elastica.STANDARD_ANGLE, max_solves: int = 12) -> CantileverFE:
    """Overhang at which the chord of the strip has drooped to ``chord``.

    Parameters
    ----------
    fabric : Fabric
    angle : float
        Of the strip's axis from the warp, rad.
    width : float
        m.
    fidelity : {'draft', 'standard', 'reference'}
        Mesh, see `CELLS`; ``cells`` overrides it.
    free : bool
        False: the long edges lie on mirror planes, so that the strip bends into a cylinder.
    chord : float
        rad.

    Raises
    ------
    NotConvergedError
        A shape or the overhang was not found.
    """
    clock = time.perf_counter()
    weight = fabric.areal_density * gravity
    narrow, wide = fabric.bending.along(angle, True), fabric.bending.along(angle, False)
    rigidity = narrow if free else wide
    expected = elastica.overhang(rigidity, weight, chord)
    length, state, iterations = expected, None, 0
    tried: list[tuple[float, float]] = []
    for _ in range(max_solves):
        problem = _strip(fabric, length, width, angle, _cells(fidelity, cells), free, gravity)
        gamma = weight * length**3 / rigidity

        def guess(s, length=length, gamma=gamma):
            shape = elastica.shape(gamma)
            return np.interp(s / length, shape.s, length * shape.x), -np.interp(s / length, shape.s, length * shape.drop)

        state, used = _solve(problem, _bent(problem, guess), f"overhang {1e3 * length:.4g} mm")
        iterations += used
        reached = _chord_angle(problem, state)
        if abs(reached - chord) < ANGLE_TOLERANCE:
            break
        tried.append((length, reached))
        length = _next_length(tried, chord, rigidity, weight, 2.0 * expected)
    else:
        raise NotConvergedError(f"no overhang found whose chord droops to {math.degrees(chord):.4g} degrees: "
                                f"{math.degrees(reached):.5g} degrees at {1e3 * length:.4g} mm")
    standard = elastica.standard_bending_length(length)
    return CantileverFE(
        "A", angle, weight, narrow, wide, length, expected, elastica.rigidity(length, weight, chord), standard,
        weight * standard**3, reached, *_measures(problem, state), "converged", iterations, len(tried) + 1,
        time.perf_counter() - clock,
        *_centre_line(problem, state), problem, state)


def option_b(fabric, angle: float = 0.0, loop_length: float = LOOP_LENGTH, width: float = WIDTH,
             fidelity: str = "standard", gravity: float = STANDARD_GRAVITY) -> CantileverFE:
    """Heart loop: half of it, from the clamp (heading up) to the lowest point (heading back, on a mirror plane).

    Raises
    ------
    InputError
        A strip off the yarn directions: it twists, and half a loop is not enough.
    ParameterError
        The loop is too limp or too stiff for the standard's formula.
    NotConvergedError
        The shape was not found.
    """
    turns = angle / (0.5 * math.pi)
    if abs(turns - round(turns)) > 1e-9:
        raise InputError("the heart loop by finite elements is for strips along warp or weft; use the exact level")
    if not (math.isfinite(loop_length) and loop_length > 0):
        raise ParameterError(f"the loop length must be positive, not {loop_length} m")
    clock = time.perf_counter()
    weight, half = fabric.areal_density * gravity, 0.5 * loop_length
    narrow, wide = fabric.bending.along(angle, True), fabric.bending.along(angle, False)
    loop = heart_loop.solve(loop_length / elastica.bending_length(narrow, weight))
    nx, ny = _cells(fidelity, None)
    surface = _surface(half, width, angle, (4 * nx, ny))  # it turns by 270 degrees
    supports = [Clamp("left", normal=(-1.0, 0.0, 0.0)),
                Clamp("right", displacement=(-half, 0.0, 0.0), normal=(0.0, 0.0, -1.0), components=(0,))]
    problem = Problem(surface, fabric, supports, [gravity_load(fabric.areal_density, (0.0, 0.0, -gravity))])
    s, x, y = (loop_length * v for v in (loop.s, loop.x, loop.y))

    from scipy.interpolate import CubicSpline

    state, iterations = _solve(problem, _bent(problem, CubicSpline(s, np.column_stack([x, y]))), "heart loop")
    along, out, up = _centre_line(problem, state)
    reading = -float(up[-1])
    standard = heart_loop.standard_bending_length(loop_length, reading)
    return CantileverFE(
        "B", angle, weight, narrow, wide, reading, loop_length * loop.height,
        weight * heart_loop.bending_length(loop_length, reading) ** 3, standard, weight * standard**3, None,
        *_measures(problem, state), "converged", iterations, 1, time.perf_counter() - clock, along, out, up, problem, state)


def run(fabric, direction=0.0, option: str = "A", free: bool = True, loop_length: float = LOOP_LENGTH,
        fidelity: str = "standard") -> dict:
    """The payload of ``mfar test cantilever --level fe``: the keys of the exact level, and how far the two are apart."""
    from mfar_fem.materials.homogeneous import direction_angle

    angle = direction_angle(direction)
    if option not in ("A", "B"):
        raise InputError(f"ASTM D1388 has the options A (cantilever) and B (heart loop), not '{option}'")
    if option == "B" and not free:
        raise InputError("the heart loop by finite elements has free edges: --wide is for option A or the exact level")
    r = (option_a(fabric, angle, fidelity=fidelity, free=free) if option == "A"
         else option_b(fabric, angle, loop_length, fidelity=fidelity))
    went_in = r.narrow_rigidity if free else r.wide_rigidity
    payload = {
        "test": "cantilever",
        "standard": f"ASTM D1388 option {option}",
        "option": option,
        "level": "fe",
        "fabric": fabric.name,
        "angle_deg": math.degrees(angle),
        "edges": "free" if free else "cylinder",
        "width_m": WIDTH,
        "weight_N_per_m2": r.weight,
        "rigidity_Nm": went_in,
        "overhang_m" if option == "A" else "loop_height_m": r.reading,
        "bending_length_m": elastica.bending_length(r.rigidity, r.weight),
        "standard_bending_length_m": r.standard_bending_length,
        "exact_rigidity_Nm": r.rigidity,
        "standard_rigidity_Nm": r.standard_rigidity,
        "standard_rigidity_mg_cm": r.standard_rigidity / STANDARD_GRAVITY * 1e8,
        "standard_error_percent": 100.0 * (r.standard_rigidity / went_in - 1.0),
        "narrow_strip_rigidity_Nm": r.narrow_rigidity,
        "cylinder_rigidity_Nm": r.wide_rigidity,
        "elastica_reading_m": r.elastica_reading,
        "elastica_error_percent": r.elastica_error_percent,
        "lateral_sag_in_widths": r.lateral_sag,
        "twist_deg": math.degrees(r.twist),
        "largest_stretch": r.stretch,
        "newton_iterations": r.iterations,
        "wall_s": r.wall_s,
        "shape": {"s_m": r.s, "x_m": r.x, "y_m": r.y},
    }
    if option == "A":
        assert r.chord_angle is not None
        payload["chord_angle_deg"] = math.degrees(r.chord_angle)
    else:
        payload["loop_length_m"] = loop_length
        payload["exact_level"] = exact(fabric, angle, "B", True, loop_length).reading
    return payload


# -- the parts -----------------------------------------------------------------------------------------------------------
def _cells(fidelity: str, cells: tuple[int, int] | None) -> tuple[int, int]:
    if fidelity not in CELLS:
        raise UnknownNameError(f"unknown fidelity '{fidelity}'; known: {', '.join(CELLS)}")
    nx, ny = cells or CELLS[fidelity]
    return nx, ny


def _surface(length: float, width: float, angle: float, cells: tuple[int, int]) -> Surface:
    warp = np.array([math.cos(angle), -math.sin(angle), 0.0])  # the strip lies along x
    return Surface.from_pattern(patterns.strip(length, width, *cells, "union"), 2, warp)


def _strip(fabric, length, width, angle, cells, free, gravity) -> Problem:
    supports: list[Support] = [Clamp("left")]
    if not free:
        supports += [Symmetry("bottom", 1), Symmetry("top", 1)]
    load = gravity_load(fabric.areal_density, (0.0, 0.0, -gravity))
    return Problem(_surface(length, width, angle, cells), fabric, supports, [load])


def _bent(problem: Problem, curve: Callable) -> State:
    """The strip bent without stretch into the curve ``s -> (x, z)``, directors included."""
    nodes = problem.surface.nodes.copy()
    values = curve(nodes[:, 0])
    values = np.column_stack(values) if isinstance(values, tuple) else values
    nodes[:, 0], nodes[:, 2] = values[:, 0], values[:, 1]
    return problem.state_at(nodes)


def _solve(problem: Problem, guess: State, what: str) -> tuple[State, int]:
    """Equilibrium from a guess, else from the flat strip by load steps."""
    result = newton(problem, guess, 1.0, OPTIONS)
    if result.converged:
        return problem.shell.accept(result.state), result.iterations
    steps = solve_static(problem, 4, OPTIONS)
    if not steps.converged:
        raise NotConvergedError(f"cantilever test, {what}: {steps.message}")
    return steps.state, result.iterations + steps.newton_iterations


def _next_length(tried, chord: float, rigidity: float, weight: float, limit: float) -> float:
    """Secant where there are two tries, else Newton with the elastica's derivative; kept inside a sensible range."""
    (length, angle) = tried[-1]
    slope = elastica.overhang_sensitivity(rigidity, weight, angle)["angle"]
    if len(tried) > 1 and abs(angle - tried[-2][1]) > 1e-9:
        slope = (length - tried[-2][0]) / (angle - tried[-2][1])
    return float(np.clip(length + slope * (chord - angle), max(0.5 * length, 0.05 * limit), min(1.5 * length, limit)))


def _tip(problem: Problem) -> np.ndarray:
    nodes = problem.surface.nodes_of("right")
    return nodes[np.argsort(problem.surface.nodes[nodes, 1])]


def _chord_angle(problem: Problem, state: State) -> float:
    """Angle below the horizontal of the line from the clamp to the middle of the tip, rad."""
    x = problem.shell.positions(state)[_tip(problem)]
    middle = x[len(x) // 2]
    return math.atan2(-middle[2], middle[0])


def _rows(problem: Problem) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Nodes of the centre line and of both edges, in order along the strip (the pattern has even cells across)."""
    nodes = problem.surface.nodes
    width = nodes[:, 1].max()
    rows = []
    for y in (0.5 * width, 0.0, width):
        ids = np.flatnonzero(np.abs(nodes[:, 1] - y) < 1e-6 * width)
        rows.append(ids[np.argsort(nodes[ids, 0])])
    return rows[0], rows[1], rows[2]


def _centre_line(problem: Problem, state: State) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    ids = _rows(problem)[0]
    x = problem.shell.positions(state)[ids]
    return problem.surface.nodes[ids, 0], x[:, 0], x[:, 2]


def _measures(problem: Problem, state: State) -> tuple[float, float, float]:
    """Lateral sag (in widths), twist at the tip (rad) and largest elongation of the centre line."""
    centre, low, high = _rows(problem)
    x, nodes = problem.shell.positions(state), problem.surface.nodes
    width = nodes[:, 1].max()
    tangent = np.gradient(x[centre], axis=0)
    across = x[high] - x[low]
    normal = np.cross(tangent, across)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    sag = np.sum((0.5 * (x[low] + x[high]) - x[centre]) * normal, axis=1) / width
    tip = x[_tip(problem)]
    edge = tip[-1] - tip[0]
    length = np.linalg.norm(np.diff(x[centre][::2], axis=0), axis=1) / np.diff(nodes[centre][::2, 0])
    return float(sag[np.argmax(np.abs(sag))]), math.atan2(edge[2], math.hypot(edge[0], edge[1])), float(length.max() - 1.0)
