r"""The shell energy: membrane and bending of a Koiter shell with finite membrane strain.

Unknowns are the deformed nodes ``x`` and, where bending is on, one rotation ``α`` at each edge point (one point an edge at order 1,
two at order 2). Bending moments are eliminated in every element (Hellan–Herrmann–Johnson), so that

.. math:: W = \int \Psi(C)\,dA + \tfrac12 \sum_T |R_T (c(x, α) - c_0)|^2

is an energy of displacement-like unknowns only: symmetric tangent, no saddle point. Order 2 replaces the membrane strain by
its Regge interpolant, which removes membrane locking.

References
----------
1. M. Neunteufel, J. Schöberl, "The Hellan–Herrmann–Johnson method for nonlinear shells", Comput. Struct. 225 (2019) 106109,
   doi 10.1016/j.compstruc.2019.106109.
2. M. Neunteufel, J. Schöberl, "Avoiding membrane locking with Regge interpolation", Comput. Methods Appl. Mech. Engrg. 373
   (2021) 113524, doi 10.1016/j.cma.2020.113524.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from mfar_fem import threads
from mfar_fem.errors import NotConvergedError
from mfar_fem.shell.geometry import reference_geometry
from mfar_fem.surface.mesh import Surface


@dataclass(frozen=True)
class State:
    """A configuration: unknowns and the directors they are measured from.

    Attributes
    ----------
    u : (n,) array
        Deformed nodes, m, row by row, then the edge rotations α, rad: *minus* the rotation of the director about the edge
        (from its low to its high vertex) since ``directors``.
    directors : (na, 3) array
        Unit directors of the edge points at the last accepted state (empty without bending).
    """

    u: np.ndarray
    directors: np.ndarray

    def with_u(self, u: np.ndarray) -> State:
        """The same directors with other unknowns."""
        return replace(self, u=u)


@dataclass(frozen=True)
class Viscosity:
    r"""Stiffness-proportional (Kelvin–Voigt) damping of one time step, as an energy: :math:`\tfrac12 k\,(e - e^*) D (e - e^*)`.

    ``e`` are strains and curvatures, ``D`` their stiffness at rest, so no rigid motion is damped.

    Attributes
    ----------
    factor : float
        k = β c_v: damping time (s) times the factor of the integrator (1/s).
    strain : (nt, nq, 3) array
        e* of the Green strain [E11, E22, 2 E12].
    interior, edge : (nt, nq, 3), (nt, nk) arrays
        e* of the curvature samples, as :meth:`Shell.curvature_samples` gives them.
    """

    factor: float
    strain: np.ndarray
    interior: np.ndarray
    edge: np.ndarray


class Shell:
    """Membrane and bending energy of a surface made of a fabric.

    Parameters
    ----------
    surface : Surface
        Reference mid-surface; its order (1 or 2) is the order of the shell.
    fabric : Fabric
        Membrane law, thickness and bending stiffness; anything with ``law``, ``membrane_scale`` and ``bending``.
    bending, membrane : bool
        Which energies exist. Without bending there are no edge unknowns.
    directors : (na, 3) array, optional
        Directors of the reference where a support prescribes them.
    """

    def __init__(self, surface: Surface, fabric, bending: bool = True, membrane: bool = True, directors=None):
        self.surface, self.fabric = surface, fabric
        self.with_bending, self.with_membrane = bending, membrane
        self.geometry = reference_geometry(surface, fabric.bending.matrix if bending else None, directors)
        nodes = 3 * surface.elements[:, :, None] + np.arange(3)
        self.alpha_offset = 3 * len(surface.nodes)
        self.n_alpha = len(self.geometry.directors)
        self.n = self.alpha_offset + self.n_alpha
        nodes = nodes.reshape(len(nodes), -1)
        self.element_dofs = np.hstack([nodes, self.alpha_offset + self.geometry.edge_director]) if bending else nodes
        t = self.geometry.tables
        self._shape_tables = (t.dN, t.second, t.edge_dN, t.edge_ds)
        self._no_alpha = np.zeros(max(self.n_alpha, 1))
        self.viscosity: Viscosity | None = None

    # -- states ---------------------------------------------------------------------------------------------------------
    def reference_state(self) -> State:
        """The undeformed state."""
        return State(np.concatenate([self.surface.nodes.ravel(), np.zeros(self.n_alpha)]), self.geometry.directors)

    def positions(self, state: State) -> np.ndarray:
        """Deformed nodes (nn, 3), m."""
        return state.u[: self.alpha_offset].reshape(-1, 3)

    def alpha(self, state: State) -> np.ndarray:
        """Edge rotations (na,), rad."""
        return state.u[self.alpha_offset:]

    def accept(self, state: State) -> State:
        """The same configuration with its rotations moved into the directors: α becomes 0, and no energy changes.

        Where an element would then stand more than half a turn from its director (cloth that has passed through itself at a
        fold), the angle would jump by a whole turn: there the rotation stays.
        """
        if not self.with_bending:
            return state
        moved = ~self._beyond_half_turn(state)
        t = self.edge_tangents(state)
        d = state.directors - np.sum(state.directors * t, axis=1, keepdims=True) * t
        d /= np.linalg.norm(d, axis=1, keepdims=True)
        alpha = np.where(moved, self.alpha(state), 0.0)[:, None]
        directors = np.cos(alpha) * d - np.sin(alpha) * np.cross(t, d)
        u = state.u.copy()
        u[self.alpha_offset:][moved] = 0.0
        return State(u, directors)

    def _beyond_half_turn(self, state: State) -> np.ndarray:
        """Edge points (na,) an element of which is more than half a turn from its director, rotation included."""
        g, alpha = self.geometry, self.alpha(state)
        out = np.zeros(len(alpha), dtype=bool)
        if alpha.any():
            out[g.edge_director[np.abs(self.curvature_samples(state)[1] + g.c0_edge) > np.pi]] = True
        return out

    def edge_tangents(self, state: State) -> np.ndarray:
        """Unit tangents (na, 3) of the deformed edges at the edge points, from the low to the high vertex."""
        x, s, t = self.positions(state), self.surface, self.geometry.tables
        a, b = x[s.edges[:, 0]], x[s.edges[:, 1]]
        if s.order == 1:
            tangent = b - a
        else:
            mid = x[len(s.vertices):]
            xi = 0.5 + np.array([-0.5, 0.5]) / np.sqrt(3.0)
            tangent = ((4 * xi - 3)[:, None] * a[:, None] + (4 * xi - 1)[:, None] * b[:, None]
                       + (4 - 8 * xi)[:, None] * mid[:, None])
            tangent = tangent.reshape(-1, 3)
        assert len(tangent) == len(s.edges) * t.ng
        return tangent / np.linalg.norm(tangent, axis=1, keepdims=True)

    # -- membrane -------------------------------------------------------------------------------------------------------
    def right_cauchy_green(self, state: State) -> np.ndarray:
        """C = [C11, C22, C12] in the warp/weft frame at the interior points, shape (nt, nq, 3)."""
        from mfar_fem.shell import kernels

        g, t = self.geometry, self.geometry.tables
        C = np.empty((*g.area_weights.shape, 3))
        kernels.strain(kernels.SHAPES[t.order], self.positions(state), self.surface.elements, t.edge_ds, t.mean,
                       g.samples, t.interpolation, g.push, C)
        return C

    def law_response(self, state: State, order: int):
        """Energy (nt, nq), stress (nt, nq, 3) and tangent (nt, nq, 3, 3) per reference area (N/m), as far as ``order`` asks.

        Where a law finds no thickness or no wrinkle (:class:`~mfar_fem.errors.NotConvergedError`) the energy is infinite: a state
        that solvers turn away from.
        """
        shape = self.geometry.area_weights.shape
        scale = self.fabric.membrane_scale
        C = self.right_cauchy_green(state).reshape(-1, 3)
        try:
            W, S, D = self.fabric.law.evaluate(C, order)
        except NotConvergedError:
            W, S, D = np.full(len(C), np.inf), np.zeros((len(C), 3)), np.zeros((len(C), 3, 3))
        return (scale * W.reshape(shape), None if S is None else scale * S.reshape(*shape, 3),
                None if D is None else scale * D.reshape(*shape, 3, 3))

    def green_strain(self, state: State) -> np.ndarray:
        """Green strain [E11, E22, 2 E12] in the warp/weft frame at the interior points, shape (nt, nq, 3)."""
        return (self.right_cauchy_green(state) - np.array([1.0, 1.0, 0.0])) * np.array([0.5, 0.5, 1.0])

    def _response(self, state: State, order: int):
        """:meth:`law_response` with the viscous part of a time step, where there is one."""
        W, S, D = self.law_response(state, order)
        if self.viscosity is not None:
            stiffness = self.viscosity.factor * self.fabric.membrane_scale * self.fabric.law.tangent_at_rest()
            e = self.green_strain(state) - self.viscosity.strain
            s = e @ stiffness
            W = W + 0.5 * np.sum(s * e, axis=-1)
            S = None if S is None else S + s
            D = None if D is None else D + stiffness
        return W, S, D

    def _bending_tables(self):
        """Factors and reference samples of the bending energy; viscosity is a stiffer sheet with another reference."""
        g, v = self.geometry, self.viscosity
        if v is None:
            return g.R_interior, g.R_edge, g.c0_interior, g.c0_edge
        root, share = np.sqrt(1.0 + v.factor), v.factor / (1.0 + v.factor)
        return root * g.R_interior, root * g.R_edge, g.c0_interior + share * v.interior, g.c0_edge + share * v.edge

    def curvature_samples(self, state: State) -> tuple[np.ndarray, np.ndarray]:
        """Curvature change at the interior points (nt, nq, 3; zero at order 1) and rotation at the edge points (nt, nk)."""
        from mfar_fem.shell import kernels

        g = self.geometry
        shape = kernels.SHAPES[g.tables.order]
        interior, edge = np.zeros((len(g.area_weights), g.tables.nq, 3)), np.zeros(g.edge_sign.shape)
        if self.with_bending:
            x, alpha, elements = self.positions(state), self.alpha(state), self.surface.elements

            def work(part: slice) -> None:
                kernels.curvature(shape, x, alpha, state.directors, elements[part], g.edge_director[part], g.edge_sign[part],
                                  *self._shape_tables, g.c0_interior[part], g.c0_edge[part], interior[part], edge[part])

            threads.run(work, threads.shares(len(elements)))
        return interior, edge

    # -- energy, gradient, tangent ------------------------------------------------------------------------------------------
    def energies(self, state: State) -> tuple[float, float]:
        """Membrane and bending energy, J; +inf where the state is inadmissible (locking, collapsed element)."""
        membrane = bending = 0.0
        if self.with_membrane:
            membrane = float(np.sum(self.geometry.area_weights * self.law_response(state, 0)[0]))
        if self.with_bending and np.isfinite(membrane):
            bending = float(np.sum(self.bending_energy_by_element(state)))
        return membrane, bending

    def bending_energy_by_element(self, state: State) -> np.ndarray:
        """Bending energy (nt,), J."""
        from mfar_fem.shell import kernels

        g, elements = self.geometry, self.surface.elements
        out = np.empty(len(elements))
        x, alpha = self.positions(state), self.alpha(state)

        def work(part: slice) -> None:
            kernels.bending_energy(kernels.SHAPES[g.tables.order], x, alpha, state.directors, elements[part],
                                   g.edge_director[part], g.edge_sign[part], *self._shape_tables, g.R_interior[part],
                                   g.R_edge[part], g.c0_interior[part], g.c0_edge[part], out[part])

        threads.run(work, threads.shares(len(elements)))
        return out

    def energy(self, state: State) -> float:
        """Total energy, J; in a time step with its viscous part."""
        total = sum(self.energies(state))
        if self.viscosity is not None and np.isfinite(total):
            v = self.viscosity
            stiffness = v.factor * self.fabric.membrane_scale * self.fabric.law.tangent_at_rest()
            if self.with_membrane:
                e = self.green_strain(state) - v.strain
                total += 0.5 * float(np.sum(self.geometry.area_weights * np.sum((e @ stiffness) * e, axis=-1)))
            if self.with_bending:
                g = self.geometry
                ci, ce = self.curvature_samples(state)
                b = np.einsum("ek,eqrk->eqr", ce - v.edge, g.R_edge, optimize=True)
                if g.tables.order == 2:
                    b += np.einsum("eqa,eqra->eqr", ci - v.interior, g.R_interior, optimize=True)
                total += 0.5 * v.factor * float(np.sum(b * b))
        return total

    def gradient(self, state: State, out: np.ndarray) -> bool:
        """Add dW/du to ``out`` (n,): N for positions, N·m for rotations; False if the state is inadmissible."""
        return self._assemble(state, out, np.zeros(0), np.zeros((1, 0), dtype=np.int32), exact=False, tangent=False)

    def hessian(self, state: State, gradient: np.ndarray, data: np.ndarray, positions: np.ndarray, exact: bool,
                step: np.ndarray | None = None) -> bool:
        """Add gradient and tangent in one pass.

        Parameters
        ----------
        gradient : (n,) array
        data, positions
            Matrix data of a :class:`mfar_fem.assembly.Pattern` and the positions of this shell's element blocks.
        exact : bool
            True: second derivative of the energy; False: the positive semi-definite approximation of it.
        step : (n,) array, optional
            The Newton step that led here. Then the tangent takes its membrane stress from the *linearised* strain of that step
            (the mixed-integration-point iteration of Magisano, Leonetti, Garcea, CMAME 313 (2017) 986, doi
            10.1016/j.cma.2016.10.023): the stretch that a linearised rotation leaves behind is gone after the next step, and
            would only spoil the tangent. The gradient is not affected.

        Returns
        -------
        bool
            False if the state is inadmissible (locked, or an element without a normal): its energy is infinite.
        """
        return self._assemble(state, gradient, data, positions, exact, tangent=True, step=step)

    def _linearised_response(self, state: State, step: np.ndarray):
        """Stress and tangent at the strain linearised over ``step``: the strain less its part quadratic in the step.

        None where that part is negligible, or where the linearised strain is inadmissible.
        """
        from mfar_fem.shell import kernels

        g, t = self.geometry, self.geometry.tables
        quadratic = np.empty((*g.area_weights.shape, 3))
        kernels.strain(kernels.SHAPES[t.order], step[: self.alpha_offset].reshape(-1, 3), self.surface.elements, t.edge_ds, t.mean,
                       np.zeros_like(g.samples), t.interpolation, g.push, quadratic)
        quadratic -= np.array([1.0, 1.0, 0.0])
        if np.abs(quadratic).max(initial=0.0) < 1e-7:
            return None
        C = (self.right_cauchy_green(state) - quadratic).reshape(-1, 3)
        try:
            W, S, D = self.fabric.law.evaluate(C, 2)
        except NotConvergedError:
            return None
        if not np.all(np.isfinite(W)):
            return None
        shape, scale = g.area_weights.shape, self.fabric.membrane_scale
        S, D = scale * S.reshape(*shape, 3), scale * D.reshape(*shape, 3, 3)
        if self.viscosity is not None:
            stiffness = self.viscosity.factor * scale * self.fabric.law.tangent_at_rest()
            e = (C.reshape(*shape, 3) - np.array([1.0, 1.0, 0.0])) * np.array([0.5, 0.5, 1.0])
            S, D = S + (e - self.viscosity.strain) @ stiffness, D + stiffness
        return S, D

    def _assemble(self, state, gradient, data, positions, exact, tangent, step=None):
        from mfar_fem.shell import kernels

        g, t = self.geometry, self.geometry.tables
        if self.with_membrane:
            W, S, D = self._response(state, 2 if tangent else 1)
            admissible = bool(np.all(np.isfinite(W)))
        else:
            S, D, admissible = np.zeros((*g.area_weights.shape, 3)), None, True
        S_geometric = S
        if self.with_membrane and tangent and step is not None:
            linearised = self._linearised_response(state, step)
            if linearised is not None:
                S_geometric, D = linearised
        if D is None:
            D = np.zeros((1, 1, 3, 3)) if not tangent else np.zeros((*S.shape, 3))
        if not tangent:
            positions = np.zeros((1, 1), dtype=np.int32)
        alpha = self.alpha(state) if self.with_bending else self._no_alpha
        directors = state.directors if self.with_bending else np.zeros((1, 3))
        x, elements = self.positions(state), self.surface.elements
        R_interior, R_edge, c0_interior, c0_edge = self._bending_tables()
        S, S_geometric, D = (np.ascontiguousarray(a) for a in (S, S_geometric, D))

        def work(part: slice) -> tuple[int, np.ndarray, np.ndarray]:
            own = part.start > 0  # sums of the parts are added in order: the same to the last bit in every run
            to, into = (np.zeros_like(gradient), np.zeros_like(data)) if own else (gradient, data)
            bad = kernels.assemble(
                kernels.SHAPES[t.order], x, alpha, directors, elements[part], g.edge_director[part], g.edge_sign[part],
                *self._shape_tables, t.mean, t.interpolation, g.push[part], g.area_weights[part], S[part], S_geometric[part],
                D[part] if tangent and self.with_membrane else D, self.with_membrane, self.with_bending,
                R_interior[part], R_edge[part], c0_interior[part], c0_edge[part], exact, tangent, self.alpha_offset,
                positions[part] if tangent else positions, to, into)
            return bad, to, into

        without_normal = 0
        for bad, to, into in threads.run(work, threads.shares(len(elements))):
            without_normal += bad
            if to is not gradient:
                gradient += to
                data += into
        return admissible and not without_normal

    # -- parameters -----------------------------------------------------------------------------------------------------------
    def with_fabric(self, fabric) -> Shell:
        """The same shell made of another fabric; the geometry is shared when only the membrane law changes."""
        same = not self.with_bending or np.array_equal(fabric.bending.matrix, self.fabric.bending.matrix)
        if not same:
            return Shell(self.surface, fabric, self.with_bending, self.with_membrane, self.geometry.directors)
        other = object.__new__(Shell)
        other.__dict__.update(self.__dict__)
        other.fabric = fabric
        return other
