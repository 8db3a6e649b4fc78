r"""Position-based dynamics, the draft level: formula (15) of the silk paper done right, on a triangle mesh of order 1.

Every constraint :math:`C` with stiffness :math:`k` moves its vertices by :math:`\Delta p_i = w_i \nabla_i C^\top \Delta\lambda`,
:math:`\Delta\lambda = -(\Delta t^2 k\,C + \lambda) / (1 + f \Delta t^2 k\,G)`, :math:`G = \sum_j w_j \|\nabla_j C\|^2` [1]; for
:math:`k \to \infty` that is :math:`\Delta p_i = -w_i \nabla_i C\, C / \sum_j w_j \|\nabla_j C\|^2`. Here

* *strain*: one constraint with three components a triangle, the Green strains in the warp/weft frame; :math:`kC` is area times the
  stress of the law, :math:`k` area times its tangent (positive part).
* *bending*: one constraint a triangle, the angles across its three edges; from them the curvature of the patch
  :math:`\kappa = \sum_e \theta_e\,l_e / (2A)\; n_e \otimes n_e` [2] and the orthotropic energy
  :math:`\tfrac12 A\,\kappa\cdot D\kappa` of the fabric. On a lattice of equal parallelograms every quadratic shape has its exact
  curvature, in all directions (with one stiffness a hinge it has not). A free edge has no angle: the energy is minimised over it
  (no moment there). At a clamp a triangle is added that does not move, and the angle counts twice.
* *edges* (off by default): edge lengths that do not change.

**Step and stiffness.** One Gauss–Seidel sweep a substep, begun at :math:`\lambda = 0`, with :math:`f = 1` (XPBD) has a compliance
of its own in equilibrium: from the order of the sweep, :math:`C = -(\alpha - U)\lambda`, :math:`\alpha = 1 / (\Delta t^2 k)`, U the
strictly upper part of :math:`J M^{-1} J^\top`; and where the net force is smooth, :math:`\lambda^\top U \lambda = -\tfrac12
\lambda^\top \mathrm{diag}(G)\,\lambda`. So the sheet is too soft by the factor :math:`1 + \kappa/2`,
:math:`\kappa = \Delta t^2 k G`, whatever the order. With :math:`f = \max(\tfrac12, 1 - 1/\kappa)` that compliance is taken off the
material's, as long as there is any: for :math:`\kappa \le 2` the static stiffness is that of the law for any step and mesh, in the
mean over neighbouring triangles (one by one the strains scatter with the order of the sweep); above, the sheet is a pure PBD
sheet and too soft by up to :math:`\kappa/2 - 1` (``excess_compliance``). The default number of substeps keeps :math:`\kappa \le 2`.
With more iterations a substep f is 1 and the solution tends to implicit Euler.

Bending is slow: it acts once a block of m substeps, with the impulse of the block. Between, the sheet falls freely on a parabola,
whose mean makes :math:`f = \max((1 - m^{-2})/12 + 1/2m,\; 1 - 1/\kappa)`.

References
----------
1. M. Macklin, M. Müller, N. Chentanez, "XPBD", MIG 2016, doi 10.1145/2994258.2994272; M. Macklin et al., "Small steps in physics
   simulation", SCA 2019, doi 10.1145/3309486.3340247 (substeps rather than iterations).
2. E. Grinspun, Y. Gingold, J. Reisman, D. Zorin, "Computing discrete shape operators on general meshes", Comput. Graph.
   Forum 25 (2006) 547–556, doi 10.1111/j.1467-8659.2006.00974.x.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from mfar_fem.errors import InputError, NotConvergedError
from mfar_fem.materials import Fabric
from mfar_fem.solve import position_kernels as kernels
from mfar_fem.supports import Clamp, Support, Symmetry
from mfar_fem.surface import Surface

CONSTRAINTS = ("strain", "bending", "edges")
BLOCK = 1e-3
"""Longest time, s, between two evaluations of bending, of the bodies' distances and of a law that is not linear."""
MAX_SUBSTEPS = 200
"""Most substeps a step that are chosen by default."""
STIFF = 30.0
"""How much stiffer than at rest a triangle past locking may become (see ``_evaluate_law``)."""


class PositionsNotFiniteError(NotConvergedError):
    """A position is no longer a finite number; the state of the step before is kept."""


class PositionBased:
    """Position-based dynamics of one sheet.

    Parameters
    ----------
    surface : Surface
        Of order 2 its vertices and triangles are taken.
    fabric : Fabric
    supports : sequence of Support
        Held components of vertices; displacements are reached at time ``ramp``, linearly. A ``Clamp`` holds the direction of the
        sheet too. ``Symmetry`` is refused.
    gravity : (3,) array
        m/s².
    bodies : sequence of bodies
        See :mod:`mfar_fem.contact.body`.
    dt : float
        Time step, s.
    substeps : int, optional
        Default: as many as keep the static stiffness right (see the module), adapted to the present tangent of the law, at most
        ``MAX_SUBSTEPS``.
    iterations : int
        Sweeps a substep.
    thickness : float
        Contact offset from the bodies, m (of the mid-surface).
    drag_normal, drag_tangential : float
        Quadratic drag per reference area, N·s²/m⁴, relative to the air; normals of the step's start.
    air_velocity : (3,) array or callable
        m/s; constant or ``air(x (n, 3), t) -> (n, 3)``.
    mass_damping : float
        1/s: ``v' = -mass_damping v``.
    self_contact : bool
        Vertices keep ``self_distance`` (default: ``thickness``, else 1 mm) from triangles they do not belong to. Coarse: edges may
        cross edges, a vertex that has passed stays on the other side, there is no friction.
    bending : bool
        False takes the bending constraints off.
    constraints : sequence of {'strain', 'bending', 'edges'}
    pins : sequence of (vertices, callable)
        Vertices (ids or a boundary's name) held at their reference positions plus ``callable(t) -> (3,) or (m, 3)``, m.
    ramp : float
        Time in which the supports' displacements are reached, s.
    start : (nv, 3) array, optional
        Positions at time 0; default: the reference.
    velocity : (3,) or (nv, 3) array
        Velocities at time 0, m/s.

    Attributes
    ----------
    time : float
        s.
    substeps, blocks : int
        Substeps a step, and blocks (of substeps) a step: see ``BLOCK``.

    Raises
    ------
    InputError
        Numbers out of range, an unknown constraint, a support that this level has not.
    """

    def __init__(self, surface: Surface, fabric: Fabric, supports: Sequence[Support] = (), gravity=(0.0, 0.0, -9.80665),
                 bodies: Sequence = (), dt: float = 2e-3, substeps: int | None = None, iterations: int = 1,
                 thickness: float = 0.0, drag_normal: float = 0.0, drag_tangential: float = 0.0,
                 air_velocity: Sequence | np.ndarray | Callable = (0.0, 0.0, 0.0), mass_damping: float = 0.0,
                 self_contact: bool = False, self_distance: float | None = None, bending: bool = True,
                 constraints: Sequence[str] = ("strain", "bending"), pins: Sequence = (), ramp: float = 0.1, start=None,
                 velocity=(0.0, 0.0, 0.0)):
        self._check(dt=(dt, 0.0, True), thickness=(thickness, 0.0, False), drag_normal=(drag_normal, 0.0, False),
                    drag_tangential=(drag_tangential, 0.0, False), mass_damping=(mass_damping, 0.0, False), ramp=(ramp, 0.0, False))
        unknown = [name for name in constraints if name not in CONSTRAINTS]
        if unknown or int(iterations) < 1 or (substeps is not None and int(substeps) < 1):
            raise InputError(f"constraints must be among {', '.join(CONSTRAINTS)}, iterations and substeps at least 1; "
                             f"got {list(constraints)}, {iterations}, {substeps}")
        self.surface, self.fabric, self.bodies, self.dt = surface, fabric, tuple(bodies), float(dt)
        self.gravity, self.iterations, self.thickness = np.asarray(gravity, dtype=float), int(iterations), float(thickness)
        self.drag = (float(drag_normal) / fabric.areal_density, float(drag_tangential) / fabric.areal_density)
        self.air, self.mass_damping, self.ramp = air_velocity, float(mass_damping), float(ramp)
        self.self_distance = self_distance if self_distance is not None else (self.thickness or 1e-3)
        self.self_contact = bool(self_contact)
        active = {name for name in constraints if name != "bending" or bending}
        self._nv = len(surface.vertices)
        self._build_strain("strain" in active)
        self._hold(supports, pins)
        self._build_bending("bending" in active, supports)
        self._build_edges("edges" in active)
        self._set_start(start, velocity)
        self._choose_substeps(substeps)

    @staticmethod
    def _check(**values) -> None:
        for name, (value, low, strict) in values.items():
            if not (np.isfinite(value) and (value > low if strict else value >= low)):
                raise InputError(f"{name} must be a finite number {'>' if strict else '>='} {low:g}, got {value!r}")

    # -- setting up ------------------------------------------------------------------------------------------------------
    def _build_strain(self, active: bool) -> None:
        """Reference frames, masses and colours of the triangles."""
        surface, tri = self.surface, self.surface.triangles
        p, q = (surface.vertices[tri[:, i]] - surface.vertices[tri[:, 0]] for i in (1, 2))
        normal = np.cross(p, q)
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        a = surface.warp - np.sum(surface.warp * normal, axis=1, keepdims=True) * normal
        a /= np.linalg.norm(a, axis=1, keepdims=True)
        self._frames = np.stack([a, np.cross(normal, a)], axis=1)  # (nt, 2, 3)
        edges = np.stack([np.einsum("eac,ec->ea", self._frames, v) for v in (p, q)], axis=2)
        self._normals = normal
        areas = surface.areas
        self.masses = self.fabric.areal_density / 3.0 * np.bincount(tri.ravel(), np.repeat(areas, 3), self._nv)
        self.triangle_colours = kernels.colour(tri, self._nv)
        order = np.argsort(self.triangle_colours, kind="stable")
        self._tri = np.ascontiguousarray(tri[order] if active else tri[:0])
        n = len(self._tri)
        self._B = np.ascontiguousarray(np.linalg.inv(edges[order[:n]]).reshape(-1, 4))
        self._areas = areas[order[:n]]
        self._K, self._inverse = np.empty((n, 3, 3)), np.empty((n, 3, 3))
        self._h, self._lam, self._E, self._E_made = (np.zeros((n, 3)) for _ in range(4))
        self._limit = np.empty((n, 2))
        self._read_law(n)

    def _read_law(self, n: int) -> None:
        """Tangent at rest, and whether it is the same everywhere (then the law is never called again)."""
        law, scale = self.fabric.law, self.fabric.membrane_scale
        probes = np.array([[1.0, 1.0, 0.0], [1.01, 0.98, 0.004], [0.9, 1.02, -0.02], [1.03, 1.04, 0.03]])
        tangents = law.evaluate(probes, 2)[2]
        self._linear = bool(np.allclose(tangents, tangents[0], rtol=1e-10, atol=1e-12 * np.abs(tangents).max()))
        self._D = _positive(np.repeat(scale * tangents[:1], n, axis=0))
        self._rest_trace = scale * float(np.trace(tangents[0]))
        self._S, self._at = np.zeros((n, 3)), np.zeros((n, 3))  # stress, N/m, and strain where the law was last evaluated
        self._tolerance = 0.05 if self._linear else 2e-3  # change of strain after which the local matrices are made anew

    def _hold(self, supports, pins) -> None:
        """Inverse masses (nv, 3), zero where held, and what moves the held ones."""
        self._w = np.repeat(1.0 / self.masses[:, None], 3, axis=1)
        self._moves: list[tuple[np.ndarray, Callable[[float], np.ndarray]]] = []
        for support in supports:
            if isinstance(support, Symmetry):
                raise InputError("position-based dynamics has no mirror planes: model the whole sheet")
            nodes = support.nodes(self.surface)
            keep = nodes < self._nv
            ids = nodes[keep]
            self._w[np.ix_(ids, list(support.components))] = 0.0
            change = np.broadcast_to(support.displacement, (len(nodes), 3))[keep]
            if np.any(change):
                self._moves.append((ids, self._ramped(change)))
        for where, path in pins:
            ids = self.surface.nodes_of(where) if isinstance(where, str) else np.asarray(where, dtype=np.int64)
            ids = ids[ids < self._nv]
            self._w[ids] = 0.0
            self._moves.append((ids, path))

    def _ramped(self, change: np.ndarray) -> Callable[[float], np.ndarray]:
        return lambda t: change * (min(1.0, t / self.ramp) if self.ramp > 0 else 1.0)

    def _build_bending(self, active: bool, supports) -> None:
        """Patches (triangle and the tips across its edges), their stiffness in the angles, and the fixed tips of clamps."""
        surface, tri = self.surface, self.surface.triangles
        nt = len(tri)
        tips, weight = np.full((nt, 3), -1), np.ones((nt, 3))
        across = np.where(surface.edge_elements[:, ::-1][surface.element_edges] == np.arange(nt)[:, None, None], -1,
                          surface.edge_elements[surface.element_edges][:, :, ::-1]).max(axis=2)
        e, r = np.nonzero(across >= 0)
        a, b = tri[e, r], tri[e, (r + 1) % 3]
        tips[e, r] = tri[across[e, r]].sum(axis=1) - a - b
        ghosts: list[np.ndarray] = []
        owners: list[int] = []
        for support in supports if active else ():
            if not isinstance(support, Clamp) or len(support.components) < 3:
                continue
            for edge in surface.edges_of(support.where):
                el = int(surface.edge_elements[edge, 0])
                side = int(np.flatnonzero(surface.element_edges[el] == edge)[0])
                normal = self._normals[el] if support.normal is None else support.normal
                low, high, tip = (surface.vertices[tri[el, (side + i) % 3]] for i in range(3))
                along = (high - low) / np.linalg.norm(high - low)
                outward = np.cross(along, normal)
                foot = low + (tip - low) @ along * along
                tips[el, side], weight[el, side] = self._nv + len(ghosts), 2.0
                ghosts.append(foot + np.linalg.norm(tip - foot) * outward / np.linalg.norm(outward))
                owners.append(int(tri[el, side]))
        self._owners = np.array(owners, dtype=np.int64)
        self._reference = np.vstack([surface.vertices, *([ghosts] if ghosts else [])])
        self._w = np.vstack([self._w, np.zeros((len(ghosts), 3))])
        patches = np.hstack([tri, tips])
        self.patch_colours = kernels.colour(np.where(patches < self._nv, patches, -1), self._nv)
        order = np.argsort(self.patch_colours, kind="stable")[: nt if active else 0]
        self._patches = np.ascontiguousarray(patches[order])
        self._Q = self._angle_stiffness(tips >= 0, weight)[order]
        areas = np.where(across >= 0, surface.areas[across], np.inf).min(axis=1)
        self._floor = (2.0 * 0.85 * np.minimum(surface.areas, areas)[order]) ** 2
        self._rest = np.zeros((len(order), 3))
        kernels.angles(self._reference, self._patches, self._floor, self._rest)
        for k in np.flatnonzero((weight[order] > 1.0).any(axis=1)):  # a clamp with a normal of its own bends the sheet
            self._rest[k, weight[order[k]] > 1.0] = 0.0
        self._H, self._inverse_b, self._lam_b = np.empty_like(self._Q), np.empty_like(self._Q), np.zeros((len(order), 3))

    def _angle_stiffness(self, present: np.ndarray, weight: np.ndarray) -> np.ndarray:
        """Q (nt, 3, 3), N·m: energy ½ θ·Qθ of a patch, minimised over the angles of edges that are not ``present``."""
        surface = self.surface
        v = surface.vertices[surface.triangles]
        edge = np.roll(v, -1, axis=1) - v
        length = np.linalg.norm(edge, axis=2)
        n = np.cross(edge, self._normals[:, None]) / length[:, :, None]
        n1, n2 = np.einsum("eac,erc->aer", self._frames, n)
        R = np.stack([n1 * n1, n2 * n2, 2.0 * n1 * n2], axis=1) * (weight * length / (2.0 * surface.areas[:, None]))[:, None]
        Q = surface.areas[:, None, None] * np.einsum("eir,ij,ejs->ers", R, self.fabric.bending.matrix, R)
        for e in np.flatnonzero(~present.all(axis=1)):
            free, has = np.flatnonzero(~present[e]), np.flatnonzero(present[e])
            reduced = np.zeros((3, 3))
            reduced[np.ix_(has, has)] = Q[e][np.ix_(has, has)] - Q[e][np.ix_(has, free)] @ np.linalg.solve(
                Q[e][np.ix_(free, free)], Q[e][np.ix_(free, has)])
            Q[e] = reduced
        return np.ascontiguousarray(Q)

    def _build_edges(self, active: bool) -> None:
        surface = self.surface
        self.edge_colours = kernels.colour(surface.edges, self._nv)
        order = np.argsort(self.edge_colours, kind="stable")[: len(surface.edges) if active else 0]
        self._edges = (np.ascontiguousarray(surface.edges[order]), surface.edge_lengths[order])

    def _set_start(self, start, velocity) -> None:
        self.time, self.steps = 0.0, 0
        self._x, self._v = self._reference.copy(), np.zeros_like(self._reference)
        if start is not None:
            self._x[: self._nv] = start
        self._v[: self._nv] = velocity
        self._v[self._w == 0.0] = 0.0
        if not (np.isfinite(self._x).all() and np.isfinite(self._v).all()):
            raise InputError("start and velocity must be finite")
        self._normals_v, self._wind = np.zeros_like(self._x), np.zeros_like(self._x)

    def _choose_substeps(self, substeps: int | None) -> None:
        """Substeps and blocks from the largest frequencies of the constraints at rest."""
        self.substeps = self.blocks = 1
        self._adaptive = substeps is None
        bending = self._bending_matrices(1.0, 1.0)
        self._least_blocks = max(1, math.ceil(self.dt / BLOCK - 1e-9), math.ceil(self.dt * math.sqrt(2.0 * bending)))
        if substeps is None:
            self._set_substeps(self._needed(self._local_matrices(self._areas * self.dt**2, self._reference)))
        else:
            n = self.substeps = int(substeps)
            self.blocks = next(b for b in range(1, n + 1) if n % b == 0 and (b >= self._least_blocks or b == n))
            self._set_bending()
        self._make(self._x)

    def _needed(self, ratio: float) -> int:
        """Substeps that bring the stiffness ratio, now ``ratio``, down to 2."""
        return math.ceil(self.substeps * math.sqrt(0.5 * min(ratio, 1e12)) - 1e-9)

    def _set_substeps(self, n: int) -> None:
        self.blocks = min(self._least_blocks, MAX_SUBSTEPS)
        self.substeps = self.blocks * max(1, math.ceil(min(n, MAX_SUBSTEPS) / self.blocks))
        self._set_bending()

    def _set_bending(self) -> None:
        block = self.dt / self.blocks
        self._bending_matrices(block * self.dt / self.substeps, block**2)

    def _bending_matrices(self, impulse: float, ratio: float) -> float:
        """Made once, at the reference: the sheet hardly stretches, and bending hardly changes them."""
        m = self.substeps // self.blocks
        least = (1.0 - 1.0 / m**2) / 12.0 + 0.5 / m if self.iterations == 1 else 1.0
        return kernels.prepare_bending(self._reference, self._patches, self._floor, self._w, self._Q, impulse, ratio, least,
                                       self._H, self._inverse_b)

    @property
    def excess_compliance(self) -> float:
        """``max(0, κ/2 - 1)`` of the stiffest triangle: by how much, relatively, one sweep a substep makes it too soft."""
        return max(0.0, 0.5 * self._ratio - 1.0)

    # -- state -----------------------------------------------------------------------------------------------------------
    @property
    def positions(self) -> np.ndarray:
        """(nv, 3), m; a view that may be written to."""
        return self._x[: self._nv]

    @property
    def velocities(self) -> np.ndarray:
        """(nv, 3), m/s; a view that may be written to."""
        return self._v[: self._nv]

    def state_dict(self) -> dict:
        """All that a later :meth:`load_state_dict` needs to go on bit by bit."""
        arrays = {name: own.copy() for name, own in self._state_arrays().items()}
        return {"time": self.time, "steps": self.steps, "substeps": self.substeps, **arrays}

    def _state_arrays(self) -> dict[str, np.ndarray]:
        return {"positions": self._x, "velocities": self._v, "stress": self._S, "tangent": self._D, "strain": self._at,
                "made": self._x_made}

    def load_state_dict(self, state: Mapping) -> None:
        """Take up a state of the same model.

        Raises
        ------
        InputError
            The arrays are those of another mesh.
        """
        arrays = self._state_arrays()
        for name, own in arrays.items():
            if np.shape(state[name]) != own.shape:
                raise InputError(f"state: '{name}' has shape {np.shape(state[name])}, the model needs {own.shape}")
        for name, own in arrays.items():
            own[...] = state[name]
        self.time, self.steps = float(state["time"]), int(state["steps"])
        if self._adaptive and self.substeps != state["substeps"]:
            self._set_substeps(int(state["substeps"]))
        self._make(self._x_made)

    def energies(self) -> dict[str, float]:
        """``kinetic``, ``membrane``, ``bending``, ``gravity`` (zero at the origin's height), J; membrane ``inf`` past locking."""
        x, v, m = self.positions, self.velocities, self.masses
        kernels.strains(self._x, self._tri, self._B, self._E)
        membrane = self.fabric.membrane_scale * (self._areas @ self.fabric.law.energy(_metric(self._E))) if len(self._E) else 0.0
        theta = np.zeros_like(self._rest)
        kernels.angles(self._x, self._patches, self._floor, theta)
        theta -= self._rest
        return {"kinetic": 0.5 * float(m @ np.sum(v * v, axis=1)), "membrane": float(membrane),
                "bending": 0.5 * float(np.einsum("ea,eab,eb->", theta, self._Q, theta)), "gravity": -float(m @ (x @ self.gravity))}

    # -- stepping --------------------------------------------------------------------------------------------------------
    def run(self, duration: float, on_step: Callable[[PositionBased], None] | None = None) -> PositionBased:
        """Whole steps, as many as come nearest to ``duration`` (s); ``on_step(self)`` after each."""
        for _ in range(round(duration / self.dt)):
            self.step()
            if on_step is not None:
                on_step(self)
        return self

    def step(self) -> None:
        """One step of ``dt``.

        Raises
        ------
        PositionsNotFiniteError
            The numbers ran away; the state is that of the step before.
        """
        kept = self.state_dict()
        self._refresh(not self._linear)
        if self._adaptive and not 0.7 * self.substeps <= (n := self._needed(self._ratio)) <= self.substeps:
            before = self.substeps
            self._set_substeps(n)
            if self.substeps != before:
                self._make(self._x)
        x, v, tau = self._x, self._v, self.dt / self.blocks
        if any(self.drag):
            kernels.vertex_normals(x[: self._nv], self.surface.triangles, self._normals_v[: self._nv])
            air = self.air(self.positions, self.time) if callable(self.air) else self.air
            self._wind[: self._nv] = air
        pairs, near = self._self_pairs(), self._near_bodies()
        n = self.substeps // self.blocks
        bending = (self._patches, self._floor, self._rest, self._H, self._inverse_b, self._lam_b)
        for block in range(self.blocks):
            t = self.time + block * tau
            if block > 0:
                self._refresh(False)
            pull = (self._targets(t + tau) - x) / tau
            strain = (self._tri, self._B, self._K, self._h, self._inverse, self._limit, self._lam)
            kernels.advance(n, self.iterations, tau / n, x, v, self._w, pull, self.gravity, self.drag,
                            math.exp(-self.mass_damping * tau / n), self._normals_v, self._wind, strain, bending, self._edges,
                            self._planes(near, t, tau), (self.surface.triangles, pairs, float(self.self_distance)))
        self.steps += 1
        self.time = self.steps * self.dt if kept["time"] == kept["steps"] * self.dt else self.time + self.dt
        self._leave_bodies(kept["positions"], near)
        if not (np.isfinite(x).all() and np.isfinite(v).all()):
            self.load_state_dict(kept)
            raise PositionsNotFiniteError(f"positions are not finite after t = {self.time:g} s: smaller dt or more substeps")

    def _targets(self, t: float) -> np.ndarray:
        """Where held components are at time t: reference plus what supports and pins ask for."""
        target = self._reference.copy()
        for ids, path in self._moves:
            target[ids] = self._reference[ids] + path(t)
        if len(self._owners):
            target[self._nv :] += (target - self._reference)[self._owners]
        return target

    def _local_matrices(self, scale: np.ndarray, x: np.ndarray) -> float:
        least = 0.5 if self.iterations == 1 else 1.0
        return kernels.prepare_strain(x, self._tri, self._B, self._w, scale, self._D, self._S, self._at, least, self._K, self._h,
                                      self._inverse, self._limit)

    def _refresh(self, always: bool) -> None:
        """Evaluate the law and the local matrices anew, at the start of a step or when a strain has changed much."""
        kernels.strains(self._x, self._tri, self._B, self._E)
        if not always and not np.abs(self._E - self._E_made).max(initial=0.0) > self._tolerance:
            return
        if not self._linear:
            self._evaluate_law()
        self._make(self._x)

    def _make(self, x: np.ndarray) -> None:
        """Local matrices of the strain constraints at positions ``x``."""
        self._x_made = x.copy()
        kernels.strains(x, self._tri, self._B, self._E_made)
        self._ratio = self._local_matrices(self._areas * (self.dt / self.substeps) ** 2, x)

    def _evaluate_law(self) -> None:
        """Stress and tangent at the present strains; where the law has none (past locking), at the last strain that had.

        That one is moved half the way to the end of the law, found by bisection, until the tangent is ``STIFF`` times that at rest:
        so the triangle is pulled back by a stress that is linear in the strain and steep.
        """
        law, scale = self.fabric.law, self.fabric.membrane_scale
        E = self._E
        energy, S, D = law.evaluate(_metric(E), 2)
        bad = np.flatnonzero(~np.isfinite(energy))
        if len(bad):
            steep = np.trace(self._D[bad], axis1=1, axis2=2) > STIFF * self._rest_trace
            low, high = np.zeros(len(bad)), np.where(steep, 0.0, 1.0)
            way = E[bad] - self._at[bad]
            for _ in range(8):
                middle = 0.5 * (low + high)
                fine = np.isfinite(law.energy(_metric(self._at[bad] + middle[:, None] * way)))
                low, high = np.where(fine, middle, low), np.where(fine, high, middle)
            E = E.copy()
            E[bad] = self._at[bad] + 0.5 * low[:, None] * way
            S[bad], D[bad] = law.evaluate(_metric(E[bad]), 2)[1:]
        self._at[...], self._S[...], self._D[...] = E, scale * S, _positive(scale * D)

    # -- contact ---------------------------------------------------------------------------------------------------------
    def _near_bodies(self) -> list[tuple[Any, np.ndarray, float]]:
        """For every body the vertices that may reach it in this step (a distance changes by no more than the way), and that way."""
        out = []
        free = np.flatnonzero(self._w[: self._nv].any(axis=1))
        x = self.positions[free]
        fastest = math.sqrt(float(np.max(np.sum(self._v**2, axis=1), initial=0.0))) + self.dt * float(np.linalg.norm(self.gravity))
        for body in self.bodies:
            way = 1.5 * fastest * self.dt + 0.1 * self.thickness + 1e-5
            body_way = 1.5 * self.dt * max(float(np.linalg.norm(body.velocity(x, self.time + s * self.dt), axis=1).max(initial=0.0))
                                           for s in (0.0, 0.5, 1.0))
            distance = body.signed_distance(x, self.time)[0]
            out.append((body, free[distance < self.thickness + way + body_way], way))
        return out

    def _planes(self, near, t: float, tau: float):
        """Tangent planes of the bodies at the near vertices; those that are inside are put on the surface, at no speed."""
        ids, normals, offsets, velocity, friction = [], [], [], [], []
        for body, some, _ in near:
            if len(some) == 0:
                continue
            distance, normal = body.signed_distance(self._x[some], t)
            self._push(some, distance, normal)
            ids.append(some)
            normals.append(normal)
            offsets.append(np.sum(normal * self._x[some], axis=1) - np.maximum(distance, self.thickness))
            velocity.append(body.velocity(self._x[some], t + 0.5 * tau))
            friction.append(np.full(len(some), float(body.friction)))
        if not ids:
            return np.empty(0, dtype=np.int64), np.empty((0, 3)), np.empty(0), np.empty((0, 3)), np.empty(0), self.thickness
        return (np.concatenate(ids), np.concatenate(normals), np.concatenate(offsets), np.concatenate(velocity),
                np.concatenate(friction), self.thickness)

    def _push(self, ids: np.ndarray, distance: np.ndarray, normal: np.ndarray) -> None:
        depth = np.maximum(self.thickness - distance, 0.0)[:, None]
        self._x[ids] += np.where(self._w[ids] > 0.0, depth * normal, 0.0)

    def _leave_bodies(self, before: np.ndarray, near) -> None:
        """At the end of a step no free vertex is inside: the exact distance, for all where one went farther than expected."""
        moved = math.sqrt(float(np.nanmax(np.sum((self._x - before) ** 2, axis=1), initial=0.0)))
        free = np.flatnonzero(self._w[: self._nv].any(axis=1))
        for _ in range(4 if len(near) > 1 else 1):  # overlapping bodies: more than once
            for body, some, way in near:
                ids = some if moved <= way else free
                if len(ids) and np.isfinite(self._x[ids]).all():
                    self._push(ids, *body.signed_distance(self._x[ids], self.time))

    def _self_pairs(self) -> np.ndarray:
        """Vertices and triangles (k, 2) that may come within ``self_distance`` during this step."""
        if not self.self_contact:
            return np.empty((0, 2), dtype=np.int64)
        from scipy.spatial import cKDTree

        tri, x, X = self.surface.triangles, self.positions, self.surface.vertices
        centres = x[tri].mean(axis=1)
        size = float(np.linalg.norm(x[tri] - centres[:, None], axis=2).max())
        spread = float(np.linalg.norm(self.velocities - self.velocities.mean(axis=0), axis=1).max())
        reach = size + self.self_distance + min(2.0 * spread * self.dt, 4.0 * self.self_distance)
        found = cKDTree(x).sparse_distance_matrix(cKDTree(centres), reach, output_type="ndarray")
        pairs = np.column_stack([found["i"], found["j"]])
        Xc = X[tri].mean(axis=1)
        rim = np.linalg.norm(X[tri] - Xc[:, None], axis=2).max(axis=1)
        apart = np.linalg.norm(X[pairs[:, 0]] - Xc[pairs[:, 1]], axis=1) > rim[pairs[:, 1]] + 2.0 * self.self_distance
        pairs = pairs[apart]
        return np.ascontiguousarray(pairs[np.lexsort((pairs[:, 1], pairs[:, 0]))])


def _metric(E: np.ndarray) -> np.ndarray:
    """C = [C11, C22, C12] from [E11, E22, 2 E12]."""
    return np.column_stack([1.0 + 2.0 * E[:, 0], 1.0 + 2.0 * E[:, 1], E[:, 2]])


def _positive(D: np.ndarray) -> np.ndarray:
    """Positive semi-definite part of symmetric matrices (n, 3, 3)."""
    minor = D[:, 0, 0] * D[:, 1, 1] - D[:, 0, 1] ** 2
    bad = np.flatnonzero(~((D[:, 0, 0] > 0) & (minor > 0) & (np.linalg.det(D) > 0)))
    if len(bad):
        values, vectors = np.linalg.eigh(D[bad])
        D[bad] = np.einsum("nij,nj,nkj->nik", vectors, np.maximum(values, 0.0), vectors)
    return np.ascontiguousarray(D)
