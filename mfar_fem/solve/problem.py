"""The discrete problem: shell, loads and supports joined into one potential with one sparsity pattern."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np
from scipy.sparse import coo_matrix, csr_matrix

from mfar_fem.assembly import Pattern
from mfar_fem.errors import InputError
from mfar_fem.shell import Shell, State
from mfar_fem.shell.geometry import edge_points_of_elements, mean_directors
from mfar_fem.shell.tables import tables
from mfar_fem.supports import Clamp, Support
from mfar_fem.surface.mesh import Surface


class InadmissibleStateError(ArithmeticError):
    """The energy is infinite there; solvers catch it and take another step."""


class Problem:
    """Minimise the potential of a supported, loaded shell.

    Parameters
    ----------
    surface : Surface
    fabric : Fabric
    supports : sequence of Support
    loads : sequence
        Loads and foundations of :mod:`mfar_fem.loads`.
    bending, membrane : bool
        Which shell energies exist; without bending there are no edge unknowns.
    """

    def __init__(self, surface: Surface, fabric, supports: Sequence[Support] = (), loads: Sequence = (),
                 bending: bool = True, membrane: bool = True):
        directors = None
        if bending:
            t = tables(surface.order)
            directors = mean_directors(surface, surface.nodes, t, edge_points_of_elements(surface, t.ng)[0])
            for support in supports:
                directors = support.directors(surface, directors)
        self.shell = Shell(surface, fabric, bending, membrane, directors)
        self.surface, self.supports, self.loads = surface, tuple(supports), tuple(loads)
        for load in self.loads:
            load.bind(self.shell)
        self._collect_supports()
        blocks = [load for load in self.loads if load.element_dofs is not None]
        self.pattern = Pattern(self.shell.n, [self.shell.element_dofs] + [b.element_dofs for b in blocks])
        self._positions = dict(zip([id(b) for b in blocks], self.pattern.positions[1:], strict=True))
        self.linear_cache: dict = {}
        self.conservative = all(load.conservative for load in self.loads)
        self.force_scale = 0.0
        """A force, N, that a residual may be compared with where there is no external one (set by the dynamics: inertia)."""
        self._extra: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = []

    def _collect_supports(self) -> None:
        n = self.shell.n
        held, change = np.zeros(n, dtype=bool), np.zeros(n)
        for support in self.supports:
            c = support.constraint(self.surface, self.shell.alpha_offset, self.shell.with_bending)
            clash = held[c.dofs] & (np.abs(change[c.dofs] - c.change) > 1e-15)
            if clash.any():
                raise InputError(f"two supports prescribe different displacements of {int(clash.sum())} unknowns")
            held[c.dofs] = True
            change[c.dofs] = c.change
        self.fixed, self.free, self.change = np.flatnonzero(held), np.flatnonzero(~held), change

    @property
    def n(self) -> int:
        """Number of unknowns, held ones included."""
        return self.shell.n

    def start(self) -> State:
        """Reference state with the directors that clamps prescribe."""
        state = self.shell.reference_state()
        directors = state.directors
        for support in self.supports:
            if isinstance(support, Clamp) and self.shell.with_bending:
                directors = support.clamp_rotation(self.surface, directors)
        return State(state.u, directors)

    def state_at(self, nodes: np.ndarray, lam: float = 1.0) -> State:
        """State with the nodes (nn, 3) in given places, mean directors and no rotations; held unknowns keep their values."""
        surface, start = self.surface, self.start()
        u = np.concatenate([np.asarray(nodes, dtype=float).ravel(), np.zeros(self.shell.n_alpha)])
        u[self.fixed] = self.prescribed(lam)
        if not self.shell.with_bending:
            return State(u, start.directors)
        t, k = tables(surface.order), self.shell.alpha_offset
        directors = mean_directors(surface, u[:k].reshape(-1, 3), t, edge_points_of_elements(surface, t.ng)[0])
        held = self.fixed[self.fixed >= k] - k
        directors[held] = start.directors[held]
        return State(u, directors)

    def prescribed(self, lam: float) -> np.ndarray:
        """Values of the held unknowns at a load factor."""
        return self.shell.reference_state().u[self.fixed] + lam * self.change[self.fixed]

    @cached_property
    def free_block(self):
        """Pattern of the tangent on the free unknowns."""
        return self.pattern.sub(self.free, self.free)

    @cached_property
    def coupling_block(self):
        """Pattern of the tangent, free rows and held columns."""
        return self.pattern.sub(self.free, self.fixed)

    @cached_property
    def rotation_length(self) -> float:
        """Mean edge length, m: divides moments so that they compare with forces."""
        return float(self.surface.edge_lengths.mean())

    def with_fabric(self, fabric) -> Problem:
        """The same problem with another fabric; mesh, pattern and loads are shared."""
        other = object.__new__(Problem)
        other.__dict__.update(self.__dict__)
        other.shell = self.shell.with_fabric(fabric)
        return other

    # -- the potential ---------------------------------------------------------------------------------------------------
    def energy(self, state: State, lam: float) -> float:
        """Potential, J; +inf where inadmissible."""
        W = self.shell.energy(state)
        return W + sum(load.energy(self.shell, state, lam) for load in self.loads) if np.isfinite(W) else np.inf

    def gradient(self, state: State, lam: float) -> np.ndarray:
        """Gradient (n,); on held unknowns it is the reaction."""
        g = np.zeros(self.n)
        self.shell.gradient(state, g)
        for load in self.loads:
            load.gradient(self.shell, state, lam, g)
        return g

    def tangent(self, state: State, lam: float, exact: bool, step: np.ndarray | None = None,
                definite: bool = False) -> tuple[np.ndarray, np.ndarray]:
        """Gradient (n,) and tangent data (pattern.nnz,); ``step`` as in :meth:`mfar_fem.shell.Shell.hessian`.

        ``definite`` makes the part of every contact semi-definite: dear, and seldom needed beside shell and inertia.

        Raises
        ------
        InadmissibleStateError
            Where the energy is infinite.
        """
        g, data = np.zeros(self.n), np.zeros(self.pattern.nnz)
        if not self.shell.hessian(state, g, data, self.pattern.positions[0], exact, step):
            raise InadmissibleStateError("the state is past locking, or an element has collapsed")
        self._extra = []
        for load in self.loads:
            load.gradient(self.shell, state, lam, g)
            if id(load) in self._positions:
                load.hessian(self.shell, state, lam, data, self._positions[id(load)], exact)
            elif hasattr(load, "sparse_hessian"):
                rows, columns, values = load.sparse_hessian(self.shell, state, lam, psd=definite)
                self._extra += self.pattern.scatter(rows, columns, values, data)
        return g, data

    def system(self, data: np.ndarray) -> csr_matrix:
        """Matrix of the free unknowns from the data of the last :meth:`tangent`, couplings outside the pattern included."""
        matrix = self.free_block.matrix(data)
        if self._extra:
            rows, columns, values = (np.concatenate(part) for part in zip(*self._extra, strict=True))
            extra = coo_matrix((values, (rows, columns)), shape=(self.n, self.n)).tocsr()
            matrix = (matrix + extra[self.free][:, self.free]).tocsr()
            matrix.sort_indices()
        return matrix

    def max_step(self, state: State, step: np.ndarray) -> float:
        """Largest fraction of ``step`` that no load forbids (collision-free with contact), in (0, 1]."""
        return min((load.max_step(self.shell, state, step) for load in self.loads if hasattr(load, "max_step")), default=1.0)

    def external_force(self, state: State, lam: float) -> np.ndarray:
        """Minus the gradient of the loads alone (n,); inertia, damping and contact are no external forces."""
        g = np.zeros(self.n)
        for load in self.loads:
            if not getattr(load, "internal", False):
                load.gradient(self.shell, state, lam, g)
        return -g

    def norm(self, g: np.ndarray) -> float:
        """Euclidean norm of a (n,) residual, N; moments are divided by the mean edge length."""
        k = self.shell.alpha_offset
        with np.errstate(over="ignore"):  # forces next to locking may have no finite square
            return float(np.sqrt(np.sum(g[:k] ** 2) + np.sum((g[k:] / self.rotation_length) ** 2)))
