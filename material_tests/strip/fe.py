"""The strip test by finite elements: a membrane between two grips, at any angle to the warp (ASTM D5035).

Order 2, no bending, held in its plane: the sheet may be compressed in the plane but does not wrinkle out of it. One grip
stands, the other moves along the strip; both hold the width. Strips along the yarns of an orthotropic law are solved on a
quarter. The force is the reaction of the moving grip, so it needs no stress interpolation.

*The mesh must follow the yarns.* Nearly inextensible yarns that cross an element at an angle to all its edges lock it
(tension locking, refs. 1, 2). The bias strip therefore has square cells with both diagonals, which lie along the two yarn
families. For the cupro SU-1098 bias strip (8 x 5 cm, yarn-network) the force on the standard mesh is then 11 % above that of
4100 triangles at 12 % strain and 0.5 % at 16 %; with one diagonal a cell it is 82 and 44 % above (`mfar study mesh`). At other
angles than 0, 45 and 90 degrees no edges follow both families (`StripTest.follows_yarns`): the same fabric at 30 degrees is 30 %
too stiff on the standard mesh and 9 % on the reference one.

A `StripTest` keeps its mesh, sparsity pattern and last states: the next fabric starts from them, corrected by their
derivatives with respect to the parameters, which takes Newton's method two or three iterations a level.

References
----------
1. R. H. W. ten Thije, R. Akkerman, "Solutions to intra-ply shear locking in finite element analyses of fibre reinforced
   materials", Composites A 39 (2008) 1167–1176, doi 10.1016/j.compositesa.2008.03.014.
2. N. Hamila, P. Boisse, "Locking in simulation of composite reinforcement deformations. Analysis and treatment",
   Composites A 53 (2013) 109–117, doi 10.1016/j.compositesa.2013.06.001.
"""

from __future__ import annotations

import logging
import math
import time
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from material_tests.strip.field import StrainField
from mfar_fem.errors import InputError, UnknownNameError
from mfar_fem.shell import State
from mfar_fem.solve import NewtonOptions, Problem, solve_static
from mfar_fem.solve.linear import SingularMatrixError
from mfar_fem.solve.newton import newton
from mfar_fem.solve.sensitivity import sensitivity
from mfar_fem.supports import Hinge, Support
from mfar_fem.surface import Surface, patterns

logger = logging.getLogger(__name__)

TRIANGLES = {"draft": 60, "standard": 160, "reference": 1000}
"""Order-2 triangles on the whole strip, about."""

OPTIONS = NewtonOptions(rtol=1e-9, atol=1e-12)


@dataclass(frozen=True, eq=False)
class StripResult:
    """What a strip test gives; ``m`` levels, ``p`` parameters.

    Attributes
    ----------
    strain : (m,) array
        Engineering strain of the grips: displacement over gauge.
    line_force : (m,) array
        Reaction over the undeformed width, N/m; NaN where not reached.
    reached : (m,) bool array
    status, message : str
        ``converged`` or the named failure of :class:`mfar_fem.result.StaticResult`.
    names : tuple of str
    sensitivity : (m, p) array
        d(line force)/d(parameter), SI; 0 where not reached.
    width : float
        m.
    iterations : int
        Newton iterations of all levels.
    wall_s : float
    states : tuple of State
        One a level reached.
    """

    strain: np.ndarray
    line_force: np.ndarray
    reached: np.ndarray
    status: str
    message: str
    names: tuple[str, ...]
    sensitivity: np.ndarray
    width: float
    iterations: int
    wall_s: float
    states: tuple[State, ...] = field(repr=False, default=())
    test: StripTest | None = field(repr=False, default=None)
    problem: Problem | None = field(repr=False, default=None)

    @property
    def converged(self) -> bool:
        """Whether every level was reached."""
        return bool(self.reached.all())

    @property
    def force(self) -> np.ndarray:
        """Force on the grip, N, (m,)."""
        return self.line_force * self.width

    def field(self, level: int = -1) -> StrainField:
        """Strain field at a level that was reached (index as in `strain`; -1: the last one reached)."""
        assert self.test is not None and self.problem is not None
        shell, surface = self.problem.shell, self.problem.surface
        state = self.states[level]
        strain = float(self.strain[level] if level >= 0 else self.strain[len(self.states) + level])
        return StrainField(strain, shell.right_cauchy_green(state), surface.nodes, shell.positions(state),
                           surface.triangles, shell.geometry.area_weights, self.test.angle)

    def lateral_strain(self) -> np.ndarray:
        """Engineering strain of the width half way between the grips, (levels reached,)."""
        assert self.test is not None and self.problem is not None
        return np.array([self.test.waist(self.problem, s) for s in self.states])


class StripTest:
    """A strip specimen between two grips, meshed once.

    Parameters
    ----------
    gauge, width : float
        Free length between the grips and width, m.
    angle : float
        Of the strip's axis from the warp, rad.
    fidelity : {'draft', 'standard', 'reference'}
        Mesh, see `TRIANGLES`.
    cells : (nx, ny), optional
        Cells along and across the whole strip instead; even numbers where a quarter is solved.
    quarter : bool, optional
        Solve a quarter; default: along warp or weft, if the law is even in the shear C12.
    order : {1, 2}
        Of the elements.

    Raises
    ------
    InputError
        Gauge or width not positive, odd cells, or a quarter of an oblique strip.
    """

    def __init__(self, gauge: float, width: float, angle: float = 0.0, fidelity: str = "standard",
                 cells: tuple[int, int] | None = None, quarter: bool | None = None, order: int = 2,
                 options: NewtonOptions = OPTIONS):
        for name, value in (("gauge", gauge), ("width", width)):
            if not (math.isfinite(value) and value > 0):
                raise InputError(f"the {name} of a strip must be positive, not {value} m")
        if fidelity not in TRIANGLES:
            raise UnknownNameError(f"unknown fidelity '{fidelity}'; known: {', '.join(TRIANGLES)}")
        self.gauge, self.width, self.angle, self.order, self.options = gauge, width, float(angle), order, options
        turns = self.angle / (0.5 * math.pi)
        self.aligned = abs(turns - round(turns)) < 1e-9
        self.follows_yarns = abs(2 * turns - round(2 * turns)) < 1e-9
        self.pattern = "union" if self.aligned else "criss"
        total = TRIANGLES[fidelity] // (2 if self.aligned else 4)
        self.cells = cells or strip_cells(gauge, width, total, 2 if self.aligned else 1)
        if quarter and not self.aligned:
            raise InputError(f"a strip at {math.degrees(angle):.4g}° from the warp has no mirror planes: quarter=False")
        if quarter and (self.cells[0] % 2 or self.cells[1] % 2):
            raise InputError(f"a quarter needs even numbers of cells, not {self.cells[0]} x {self.cells[1]}")
        self._quarter = quarter
        self._problem: Problem | None = None
        self._problem_quarter = False
        self._symmetric: dict[type, bool] = {}
        self._last: tuple | None = None

    def mesh_note(self) -> str:
        """What to beware of with this mesh, or ''."""
        if self.follows_yarns:
            return ""
        return (f"no element edges follow the yarns at {math.degrees(self.angle):.4g} degrees: with nearly inextensible yarns "
                "the strip is too stiff (tens of per cent on the standard mesh); compare with fidelity 'reference'")

    # -- the mesh ------------------------------------------------------------------------------------------------------
    def quarter(self, law) -> bool:
        """Whether a fabric of this law is solved on a quarter."""
        if self._quarter is not None:
            return self._quarter
        if not self.aligned or self.cells[0] % 2 or self.cells[1] % 2:
            return False
        if type(law) not in self._symmetric:
            C = np.array([[1.01, 0.99, 0.02], [1.02, 1.01, 0.05], [0.98, 1.03, 0.01]])
            mirrored = law.energy(C * [1.0, 1.0, -1.0])
            self._symmetric[type(law)] = bool(np.allclose(law.energy(C), mirrored, rtol=1e-12, atol=0.0, equal_nan=True))
        return self._symmetric[type(law)]

    def problem(self, fabric) -> Problem:
        """The boundary-value problem; the load factor is the engineering strain of the grips."""
        quarter = self.quarter(fabric.law)
        if self._problem is None or self._problem_quarter != quarter:
            self._problem, self._problem_quarter, self._last = self._build(fabric, quarter), quarter, None
        return self._problem.with_fabric(fabric)

    def _build(self, fabric, quarter: bool) -> Problem:
        part = 2 if quarter else 1
        nx, ny = self.cells[0] // part, self.cells[1] // part
        length, width = self.gauge / part, self.width / part
        warp = np.array([math.cos(self.angle), -math.sin(self.angle), 0.0])  # the strip lies along x
        surface = Surface.from_pattern(patterns.strip(length, width, nx, ny, self.pattern), self.order, warp)
        moved = Hinge("right", displacement=(length, 0.0, 0.0))
        plane = Support(np.arange(len(surface.nodes)), (2,), by_node=True)
        still = [Support("left", (0,)), Support("bottom", (1,))] if quarter else [Hinge("left")]
        self._grip = 3 * surface.nodes_of("right")
        self._factor = part / self.width
        return Problem(surface, fabric, [moved, *still, plane], bending=False)

    def waist(self, problem: Problem, state: State) -> float:
        """Engineering strain of the width half way between the grips."""
        nodes = problem.surface.nodes
        middle = 0.0 if self._problem_quarter else 0.5 * self.gauge
        top = np.flatnonzero(np.abs(nodes[:, 1] - nodes[:, 1].max()) < 1e-9 * self.width)
        bottom = np.flatnonzero(np.abs(nodes[:, 1]) < 1e-9 * self.width)
        x = problem.shell.positions(state)
        ends = []
        for side in (top, bottom):
            order = side[np.argsort(nodes[side, 0])]
            ends.append(np.interp(middle, nodes[order, 0], x[order, 1]))
        return (ends[0] - ends[1]) / nodes[:, 1].max() - 1.0

    # -- the test ------------------------------------------------------------------------------------------------------
    def run(self, fabric, strain: Sequence[float] | np.ndarray, names: Sequence[str] = (), warm: bool = True) -> StripResult:
        """Pull the strip to each strain.

        Parameters
        ----------
        fabric : Fabric
        strain : (m,) array_like
            Engineering strains of the grips, strictly increasing, at least 0.
        names : sequence of str
            ``law.<parameter>`` to differentiate the force by (``bending.*`` gives 0).
        warm : bool
            Start from the states of the previous call at the same strains.

        Returns
        -------
        StripResult
            A strip that locks or does not converge returns what was reached, with the named status.

        Raises
        ------
        InputError
            Strains not increasing, negative or not finite.
        """
        strain, names, clock = self._strains(strain), tuple(names), time.perf_counter()
        problem = self.problem(fabric)
        guesses = self._guesses(fabric, strain) if warm else [[] for _ in strain]
        states, forces, slopes, moves = [], [], [], []
        state, lam, iterations, status, message = problem.start(), 0.0, 0, "converged", "equilibrium reached at every level"
        for level, guess in zip(strain, guesses, strict=True):
            found, used = self._warm(problem, guess, level)
            iterations += used
            if found is None:
                result = solve_static(problem, [level], self.options, state, lam, min_step=1e-6)
                iterations += result.newton_iterations + result.wasted_iterations
                if not result.converged:
                    status, message = result.status, f"{result.status}: strain {result.lam:.5g} of {strain[-1]:.5g} reached"
                    break
                found = result.state
            state, lam = found, float(level)
            states.append(state)
            if names:
                try:
                    s = sensitivity(problem, state, lam, names)
                except SingularMatrixError:
                    status, message = "SingularTangent", f"SingularTangent: no derivatives at strain {lam:.5g}"
                    states.pop()
                    break
                slopes.append(self._factor * s.reaction[self._grip].sum(axis=0))
                moves.append(s.state)
            forces.append(self._factor * problem.gradient(state, lam)[self._grip].sum())
        n = len(states)
        if n == len(strain):
            self._last = (strain, states, dict(fabric.law.values), names, moves)
        pad = len(strain) - n
        return StripResult(
            strain, np.concatenate([forces, np.full(pad, np.nan)]), np.arange(len(strain)) < n, status, message, names,
            np.vstack([np.reshape(slopes, (n if names else 0, len(names))), np.zeros((pad if names else len(strain), len(names)))]),
            self.width, iterations, time.perf_counter() - clock, tuple(states), self, problem)

    def _strains(self, strain) -> np.ndarray:
        strain = np.atleast_1d(np.asarray(strain, dtype=float))
        if strain.ndim != 1 or not np.isfinite(strain).all() or (strain < 0).any() or (np.diff(strain) <= 0).any():
            raise InputError("the strains of a strip test must be finite, not negative and strictly increasing")
        return strain

    def _guesses(self, fabric, strain) -> list[list[State]]:
        """For every level the states to start from, best first: the last ones moved along their derivatives, then as they are."""
        if self._last is None or not np.array_equal(self._last[0], strain) or set(self._last[2]) != set(fabric.law.values):
            return [[] for _ in strain]
        _, states, values, names, moves = self._last
        change = np.array([fabric.law.values[n[4:]] - values[n[4:]] if n.startswith("law.") else 0.0 for n in names])
        if not moves:
            return [[s] for s in states]
        return [[s.with_u(s.u + du @ change), s] for s, du in zip(states, moves, strict=True)]

    def _warm(self, problem: Problem, guesses: Sequence[State], level: float) -> tuple[State | None, int]:
        energies = [problem.energy(g, level) for g in guesses]
        if not guesses or not np.isfinite(min(energies)):
            return None, 0
        result = newton(problem, guesses[int(np.argmin(energies))], level, self.options)
        return (problem.shell.accept(result.state) if result.converged else None), result.iterations


def strip_cells(gauge: float, width: float, total: int, multiple: int = 1) -> tuple[int, int]:
    """Numbers of cells along and across, multiples of ``multiple``: nearly square and about ``total`` of them."""
    def cost(nx, ny):
        return abs(math.log(gauge * ny / (width * nx))) + 0.3 * abs(math.log(nx * ny / total))

    pairs = ((nx, ny) for ny in range(2, total, multiple) for nx in range(2, total, multiple) if nx * ny <= 3 * total)
    return min((abs(cost(*p)), p) for p in pairs)[1]


def run(fabric, gauge: float, width: float, angle: float, strains, fidelity: str = "standard") -> dict:
    """The payload of ``mfar test strip --level fe``, see :func:`material_tests.strip.compare.run`."""
    from material_tests.strip import compare

    return compare.run(fabric, gauge, width, angle, strains, fidelity)
