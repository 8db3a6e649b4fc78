r"""Contact without intersection: the barrier of incremental potential contact, through ipctk (extra ``contact``).

Every pair of vertex and triangle, or of two edges, nearer than ``dhat`` adds

.. math:: w\,\kappa\,\hat d\; b(d), \qquad b = -\left(\frac{d^2}{\hat d^2} - 1\right)^2 \ln\frac{d^2}{\hat d^2}

to the potential (d without ``min_distance``), with w the area the pair stands for and κ a pressure (Pa). It is infinite at
contact, so that a minimiser whose steps stop short of the first collision (:meth:`Barrier.max_step`) never intersects. Areas as
weights and the subtraction of pairs counted twice (Li et al. 2023) make κ mean the same on every mesh: the force between a flat
sheet and a plane half of d̂ away varies by about 2 when both are remeshed (by 7 between a plane of two triangles and one finer
than the sheet), where the unweighted sum grows with the number of pairs. The gap at rest varies accordingly.

References
----------
1. M. Li, Z. Ferguson, T. Schneider, et al., "Incremental potential contact", ACM Trans. Graph. 39 (2020) 49, doi
   10.1145/3386569.3392425.
2. M. Li, D. M. Kaufman, C. Jiang, "Codimensional incremental potential contact", ACM Trans. Graph. 40 (2021) 170, doi
   10.1145/3450626.3459767 (thickness; additive continuous collision detection).
3. M. Li, Z. Ferguson, T. Schneider, et al., "Convergent incremental potential contact", arXiv:2307.15908 (2023).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from mfar_fem.contact.advance import MAX_PIECES, BodyAdvance, carried
from mfar_fem.contact.collision_mesh import CollisionMesh, ipctk, threads
from mfar_fem.contact.energy import KEPT, ContactEnergy, ContactReport
from mfar_fem.contact.friction import LaggedFriction
from mfar_fem.contact.start import (
    TOO_CLOSE,
    IntersectingStartError,
    close_pairs,
    describe,
    encloses,
    inside_pairs,
    intersecting_pairs,
)
from mfar_fem.contact.stiffness import BarrierStiffness
from mfar_fem.errors import InputError
from mfar_fem.shell import Shell, State
from mfar_fem.solve.problem import InadmissibleStateError

BROAD_PHASES = {"lbvh": "LBVH", "hash-grid": "HashGrid", "spatial-hash": "SpatialHash", "sweep-and-prune": "SweepAndPrune",
                "brute-force": "BruteForce"}
COLLISION_DETECTION = {"additive": "AdditiveCCD", "tight-inclusion": "TightInclusionCCD"}
SEGMENT, MAX_SEGMENTS = 8.0, 64
"""A step is searched for collisions in parts of this many mean edges, at most so many of them."""


@dataclass
class _Snapshot:
    """The contacts of one set of positions."""

    x: np.ndarray
    placement: int
    vertices: np.ndarray
    collisions: Any
    distance: float
    free: bool | None = field(default=None)


def _longest(step: np.ndarray) -> float:
    return float(np.sqrt(np.sum(step * step, axis=1).max(initial=0.0)))


class Barrier(ContactEnergy):
    """Contact of a sheet with bodies and with itself.

    Parameters
    ----------
    bodies : sequence of Body
        Obstacles; their meshes are what is touched.
    self_contact : bool
        Whether the sheet can touch itself; without it such pairs are never built.
    dhat : float
        Activation distance, m: pairs further apart do not act.
    stiffness : float, optional
        κ, Pa. Default: what carries the sheet's weight, stops it within ``dhat`` in one step and bears a strain of 1e-3 in a sheet
        that curves once over its length, ``max(ρ g, ρ dhat/Δt², 1e-3 D/L)``; doubled after a step that ended with contacts nearer
        than a tenth of ``dhat`` and approaching (the rule of ipctk). Sheets pulled hard over a body (p = T/R) want a stiffer one.
    friction : float or sequence of float, optional
        Coulomb coefficients against the bodies; default: each body's own.
    self_friction : float
        Of the sheet against itself.
    eps_v : float
        Speed, m/s, from which friction is fully developed; sticking contacts creep slower than that.
    min_distance : float
        Distance that surfaces keep, m (half a thickness against bodies, a whole one in self-contact).
    subdivision : int, optional
        Flat parts of an element's edge; default: the order of the surface.
    body_size : float, optional
        Edge length of the bodies' meshes, m; default: 1.5 times that of the sheet's elements, less on bodies so round that flat
        facets would deviate from them by more than a quarter of ``dhat``.
    friction_iterations : int
        How often a driver should solve a step, calling :meth:`refresh_friction` in between. With 1, the usual choice, normal forces
        and directions of friction are those at the start of the step.
    broad_phase : {'lbvh', 'hash-grid', 'spatial-hash', 'sweep-and-prune', 'brute-force'}
    collision_detection : {'additive', 'tight-inclusion'}
        Both stop short of contact; the first is several times faster.

    Raises
    ------
    MissingDependencyError
        Without ipctk.
    InputError
        For values that make no sense.
    """

    def __init__(self, bodies: Sequence = (), self_contact: bool = False, dhat: float = 1e-3, stiffness: float | None = None,
                 friction=None, self_friction: float = 0.0, eps_v: float = 1e-3, min_distance: float = 0.0,
                 subdivision: int | None = None, body_size: float | None = None, friction_iterations: int = 1,
                 broad_phase: str = "lbvh", collision_detection: str = "additive"):
        self._ipc = ipctk()
        super().__init__(bodies, dhat, stiffness, friction, eps_v, min_distance=min_distance, self_friction=self_friction)
        if broad_phase not in BROAD_PHASES or collision_detection not in COLLISION_DETECTION:
            raise InputError(f"barrier contact: broad_phase is one of {', '.join(BROAD_PHASES)}, collision_detection one of "
                             f"{', '.join(COLLISION_DETECTION)}; got {broad_phase!r}, {collision_detection!r}")
        self.self_contact, self.min_distance, self.self_friction = bool(self_contact), float(min_distance), float(self_friction)
        self.subdivision, self.body_size, self.friction_iterations = subdivision, body_size, int(friction_iterations)
        self._phase = getattr(self._ipc, BROAD_PHASES[broad_phase])
        self._ccd = getattr(self._ipc, COLLISION_DETECTION[collision_detection])()
        self.margin = 0.5 * self.dhat
        """How far vertices may move, m, before candidate pairs are searched again; further while there are none."""

    # -- set up ---------------------------------------------------------------------------------------------------------
    def bind(self, shell: Shell) -> None:
        """Build the collision mesh.

        Raises
        ------
        IntersectingStartError
            With self-contact, where parts of the flat reference sheet that do not adjoin are nearer than ``dhat``.
        """
        self.mesh = CollisionMesh(shell.surface, self.bodies, self.self_contact, self.subdivision, self.body_size,
                                  0.25 * self.dhat)
        self._motion = BodyAdvance(self.mesh, 0.0)
        self._friction = LaggedFriction(self.mesh, self.friction, self.self_friction, self.eps_v)
        self._recent: list[_Snapshot] = []
        self._candidates: Any = None
        self._covered: np.ndarray | None = None
        self._margin = self.margin
        self._segments: list[tuple[int, np.ndarray, np.ndarray]] = []
        self._kappa = BarrierStiffness(shell, self.dhat, self._given)
        self._potential = self._solved = self._barrier(self._kappa.value)
        if self.self_contact:
            self._check_reference()

    def _barrier(self, stiffness: float):
        return self._ipc.BarrierPotential(self.dhat, stiffness, True)

    def _check_reference(self) -> None:
        vertices = self.mesh.rest.copy(order="F")
        vertices[self.mesh.n_sheet:] += 10.0 * self._size(vertices)  # bodies do not count here
        reach = self.dhat + self.min_distance
        candidates = self._search(vertices, 0.0)
        if len(self._collisions(vertices, candidates)):
            near = close_pairs(self.mesh, vertices, candidates, reach)
            pairs, least = [p[1:] for p in near], near[0][0]
            raise IntersectingStartError(
                f"self-contact: parts of the reference sheet that do not adjoin are {least * 1e3:.4g} mm apart, within dhat + "
                f"min_distance = {reach * 1e3:.4g} mm, in {len(near)} pairs: {describe(pairs)}; use dhat <= "
                f"{max(0.0, 0.9 * least - self.min_distance) * 1e3:.4g} mm or a coarser mesh", pairs, least)

    @staticmethod
    def _size(vertices: np.ndarray) -> float:
        return float(np.linalg.norm(np.ptp(vertices, axis=0)))

    def _search(self, vertices: np.ndarray, margin: float):
        """Pairs that can come within reach while no vertex moves further than ``margin``."""
        candidates = self._ipc.Candidates()
        candidates.build(self.mesh.mesh, vertices, 0.5 * (self.dhat + self.min_distance) + margin, self._phase())
        return candidates

    def _collisions(self, vertices: np.ndarray, candidates):
        collisions = self._ipc.NormalCollisions()
        collisions.use_area_weighting = True
        collisions.collision_set_type = self._ipc.NormalCollisions.IMPROVED_MAX_APPROX
        with threads(1):  # with more, ipctk 1.6.1 leaves parallel edges out at random: the energy jumps by parts in a thousand
            collisions.build(candidates, self.mesh.mesh, vertices, self.dhat, self.min_distance)
        return collisions

    # -- contacts of a state -----------------------------------------------------------------------------------------------
    def _at(self, shell: Shell, state: State) -> _Snapshot:
        x = state.u[: shell.alpha_offset]
        for i, s in enumerate(self._recent):
            if s.placement == self._motion.placement and np.array_equal(x, s.x):
                self._recent.insert(0, self._recent.pop(i))
                return s
        vertices = self._vertices(x)
        if not np.all(np.isfinite(vertices)):
            return _Snapshot(x, -1, vertices, None, -np.inf, False)
        if self._away(vertices) > self._margin:
            self._renew(vertices)
        collisions = self._collisions(vertices, self._candidates)
        squared = collisions.compute_minimum_distance(self.mesh.mesh, vertices) if len(collisions) else np.inf
        distance = float(np.sqrt(squared)) - self.min_distance
        s = _Snapshot(x.copy(), self._motion.placement, vertices, collisions, distance)
        self._recent = [s, *self._recent[: KEPT - 1]]
        return s

    def _away(self, vertices: np.ndarray) -> float:
        """How far the farthest of ``vertices`` is from where candidate pairs were searched, m."""
        return np.inf if self._covered is None else float(np.sqrt(np.sum((vertices - self._covered) ** 2, axis=1).max()))

    def _renew(self, vertices: np.ndarray) -> None:
        """Search candidate pairs about ``vertices``; the farther everything is apart, the longer they will do."""
        candidates = self._search(vertices, self._margin)
        if len(candidates) and self._margin > self.margin:
            self._margin = self.margin
            candidates = self._search(vertices, self._margin)
        self._candidates, self._covered = candidates, vertices
        while len(candidates) == 0 and self._margin < SEGMENT * self.mesh.edge_length:
            wider = self._search(vertices, 4.0 * self._margin)
            if len(wider):
                break
            self._margin *= 4.0

    def _vertices(self, x: np.ndarray) -> np.ndarray:
        return self.mesh.vertices(x.reshape(-1, 3), self._motion.vertices)

    def _is_free(self, s: _Snapshot) -> bool:
        """Whether the state is further than ``min_distance`` from everything and intersects nothing."""
        if s.free is None:
            s.free = s.distance > 0.0 and (self._reached_freely(s.x) or not self._intersects(s.vertices))
        return s.free

    def _reached_freely(self, x: np.ndarray) -> bool:
        """Whether ``x`` lies on a path that :meth:`max_step` found free."""
        rounding = 8.0 * np.finfo(float).eps * max(np.abs(x).max(initial=0.0), 1e-300)
        for placement, start, step in self._segments:
            if placement != self._motion.placement:
                continue
            away, square = x - start, float(step @ step)
            t = float(away @ step) / square if square > 0 else 0.0
            if -1e-12 <= t <= 1.0 + 1e-12 and np.abs(away - t * step).max() <= rounding:
                return True
        return False

    def _intersects(self, vertices: np.ndarray) -> bool:
        return bool(self._ipc.has_intersections(self.mesh.mesh, vertices, self._phase())
                    or encloses(self.mesh, vertices, self._motion.time))

    def has_intersections(self, shell: Shell, state: State) -> bool:
        """Whether the sheet intersects a body or itself, or lies inside a body: looked up afresh, nothing remembered."""
        vertices = self._vertices(state.u[: shell.alpha_offset])
        return not np.all(np.isfinite(vertices)) or self._intersects(vertices)

    def check_start(self, shell: Shell, state: State, t: float = 0.0) -> None:
        """Refuse a start, with the bodies where they are at ``t`` (s), that intersects, touches or is inside a body.

        Raises
        ------
        IntersectingStartError
            With the pairs and the distance that would do.
        """
        self._motion.start(t, t)
        s = self._at(shell, state)
        if s.collisions is None:
            raise InputError("barrier contact: the start is not finite")
        clearance = self.min_distance + self.dhat
        pairs = intersecting_pairs(self.mesh, s.vertices)
        inside = inside_pairs(self.mesh, s.vertices, self._motion.time)
        if pairs or inside:
            text = [describe(pairs)] if pairs else []
            text += [f"the sheet is up to {d * 1e3:.4g} mm inside body '{b}' (element {e}): move it by at least "
                     f"{(d + clearance) * 1e3:.4g} mm" for e, b, d in inside]
            raise IntersectingStartError(
                f"the start intersects: {'; '.join(text)}; leave at least dhat + min_distance = {clearance * 1e3:.4g} mm between "
                "surfaces", pairs + [i[:2] for i in inside if i[:2] not in pairs])
        if s.distance < TOO_CLOSE * self.dhat:
            near = close_pairs(self.mesh, s.vertices, self._candidates, self.min_distance + TOO_CLOSE * self.dhat)
            nearest, touching = near[0][0], [p[1:] for p in near]
            smaller = f", or dhat <= {nearest * 1e3:.4g} mm" if nearest > 1e-9 and self.min_distance == 0 else ""
            raise IntersectingStartError(
                f"the start touches: least distance {nearest * 1e3:.4g} mm with min_distance {self.min_distance * 1e3:.4g} mm, in "
                f"{len(near)} pairs: {describe(touching)}; move them {(clearance - nearest) * 1e3:.4g} mm apart{smaller}",
                touching, nearest)
        s.free = True

    # -- the potential -------------------------------------------------------------------------------------------------------
    def energy(self, shell: Shell, state: State, lam: float) -> float:
        """Barrier and friction, J; +inf where the state intersects or is nearer than ``min_distance``."""
        s = self._at(shell, state)
        if not self._is_free(s):
            return np.inf
        total = self._potential(s.collisions, self.mesh.mesh, s.vertices) if len(s.collisions) else 0.0
        if self._friction.active:
            total += self._friction.energy(s.vertices)
        return float(total) if np.isfinite(total) else np.inf

    def gradient(self, shell: Shell, state: State, lam: float, out: np.ndarray) -> None:
        """Add the gradient, N; nothing where the energy is infinite."""
        s = self._at(shell, state)
        if not s.distance > 0.0 or not (len(s.collisions) or self._friction.active):
            return
        out[: shell.alpha_offset] += self.mesh.nodal_gradient(self._full_gradient(s))

    def _full_gradient(self, s: _Snapshot) -> np.ndarray:
        g = self._potential.gradient(s.collisions, self.mesh.mesh, s.vertices)
        return g + self._friction.gradient(s.vertices) if self._friction.active else g

    def sparse_hessian(self, shell: Shell, state: State, lam: float,
                       psd: bool = True) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Rows, columns (int32) and values, N/m, of the second derivative, both halves; ``psd``: each pair's made semi-definite.

        Raises
        ------
        InadmissibleStateError
            Where the energy is infinite.
        """
        s = self._at(shell, state)
        if not s.distance > 0.0:
            raise InadmissibleStateError("the sheet touches a body or itself")
        projection = getattr(self._ipc.PSDProjectionMethod, "CLAMP" if psd else "NONE")
        if not (len(s.collisions) or self._friction.active):
            return np.zeros(0, dtype=np.int32), np.zeros(0, dtype=np.int32), np.zeros(0)
        H = self._potential.hessian(s.collisions, self.mesh.mesh, s.vertices, projection)
        if self._friction.active:
            H = H + self._friction.hessian(s.vertices, projection)
        return self.mesh.nodal_triplets(H)

    # -- steps ---------------------------------------------------------------------------------------------------------------
    def max_step(self, shell: Shell, state: State, step: np.ndarray) -> float:
        """Largest fraction of ``step`` (n,) without collision, at most 1.

        A fraction below 1 leaves at least a tenth of the distances there are. Long steps are searched in at most ``MAX_SEGMENTS``
        parts of ``SEGMENT`` mean edges; what lies beyond is not granted.

        Raises
        ------
        InadmissibleStateError
            If ``state`` itself intersects or touches.
        """
        s = self._at(shell, state)
        if not self._is_free(s):
            raise InadmissibleStateError("a step from a state that intersects or touches")
        k = shell.alpha_offset
        move = self.mesh.vertices(step[:k].reshape(-1, 3), np.zeros(3))
        if 2.0 * _longest(move) < min(s.distance, self.dhat):  # even head on, two parts cannot meet
            fraction = 1.0
        else:
            fraction = self._free_fraction(s.vertices, move)
        self._remember(s.x, fraction * step[:k])
        return fraction

    def _remember(self, x: np.ndarray, step: np.ndarray) -> None:
        """The way from ``x`` along ``step`` is free where the bodies are now."""
        self._segments = [(self._motion.placement, x, step), *self._segments[:3]]

    def _free_fraction(self, vertices: np.ndarray, step: np.ndarray) -> float:
        """Fraction of the displacement ``step`` (n, 3) of all collision vertices that is free of collisions."""
        longest = _longest(step)
        if not np.isfinite(longest):
            raise InadmissibleStateError("a step that is not finite")
        if longest + self._away(vertices) <= self._margin:
            return self._first_collision(self._candidates, vertices, np.asfortranarray(vertices + step))
        parts = max(1, int(np.ceil(min(longest / (SEGMENT * self.mesh.edge_length), 1e9))))
        for part in range(min(parts, MAX_SEGMENTS)):
            a = np.asfortranarray(vertices + (part / parts) * step)
            b = np.asfortranarray(vertices + ((part + 1) / parts) * step)
            candidates = self._ipc.Candidates()
            candidates.build(self.mesh.mesh, a, b, 0.5 * self.min_distance, self._phase())
            free = self._first_collision(candidates, a, b)
            if free < 1.0:
                return (part + free) / parts
        return min(1.0, MAX_SEGMENTS / parts)

    def _first_collision(self, candidates, a: np.ndarray, b: np.ndarray) -> float:
        if len(candidates) == 0:
            return 1.0
        return float(candidates.compute_collision_free_stepsize(self.mesh.mesh, a, b, self.min_distance, self._ccd))

    def lifted(self, x: np.ndarray, base: np.ndarray) -> np.ndarray:
        """Nodes ``x`` (nn, 3) moved out of the bodies, one by one, to where contact begins or no closer than they were at ``base``.

        A start for Newton's method: :meth:`limit` would hold back all nodes where a single one runs into a body.
        """
        x, reach = x.copy(), self.min_distance + self.dhat
        for body in self.bodies:
            d, n = body.signed_distance(x, self._motion.time)
            near = np.flatnonzero(d < reach)
            if len(near):
                now = body.signed_distance(base[near], self._motion.time)[0]
                wanted = np.clip(now, self.min_distance + 0.3 * self.dhat, self.min_distance + 0.7 * self.dhat)
                x[near] += np.maximum(wanted - d[near], 0.0)[:, None] * n[near]
        return x

    def begin_step(self, shell: Shell, state: State, predicted: State | None, t0: float, t1: float, dt: float) -> float:
        """Start a time step at the accepted ``state``, with the bodies at ``t0``, and move them towards ``t1``.

        Friction takes its normal forces from ``state``. ``predicted`` is not needed (other contacts want it).

        Returns
        -------
        float
            Fraction of the bodies' way that the sheet, held where it is, leaves free; below 1, call :meth:`advance`.
        """
        self._motion.start(t0, t1)
        s = self._at(shell, state)
        if not self._is_free(s):
            raise IntersectingStartError(f"the step from t = {t0:.6g} s starts from a state that intersects or touches")
        if self._kappa.choose(dt):
            self._potential = self._solved = self._barrier(self.stiffness)
        self._friction.begin(s.vertices, dt)
        self._friction.lag(s.vertices, s.collisions, self._solved)
        return self._move_bodies(s.x)

    def _move_bodies(self, x: np.ndarray) -> float:
        """Move the bodies as far as a sheet that stays at ``x`` (3 nn,), free where they are now, lets them."""
        vertices, step = self._vertices(x), np.zeros(self.mesh.rest.shape)

        def free(target, share):
            vertices[self.mesh.n_sheet:] = self._motion.vertices
            step[self.mesh.n_sheet:] = target - self._motion.vertices
            return self._free_fraction(vertices, step) if step.any() else 1.0

        fraction = self._motion.advance(free)
        self._remember(x, np.zeros_like(x))
        return fraction

    def advance(self, shell: Shell, state: State, held: np.ndarray | None = None) -> tuple[float, State]:
        """Move the bodies further in the present step and push the sheet along where they meet it.

        Parameters
        ----------
        state : State
            Free of collisions with the bodies where they are now.
        held : array of int, optional
            Unknowns that must keep their values.

        Returns
        -------
        fraction : float
            Of the bodies' way in this step done in all; unchanged where the sheet cannot give way (solve for equilibrium, then
            call again).
        state : State
            The pushed sheet, the start of the next Newton solve.
        """
        k = shell.alpha_offset
        held_nodes = np.zeros(k // 3, dtype=bool)
        if held is not None:
            held_nodes[np.asarray(held)[np.asarray(held) < k] // 3] = True
        x, reach = shell.positions(state).copy(), self.min_distance + self.dhat
        for _ in range(MAX_PIECES):
            before = self._motion.fraction
            if before == 1.0:
                break
            goal, target = self._motion.piece(self.mesh.edge_length)
            move = carried(shell.surface, self.mesh, x, held_nodes, self._motion.vertices, target, goal, reach)

            def free(target, share, move=move, x=x):
                step = self.mesh.vertices(share * move, target - self._motion.vertices)
                return self._free_fraction(self._vertices(x), step)

            gone = self._motion.try_piece(goal, target, free)
            x = x + gone * move
            if gone == 0.0:
                self._move_bodies(x.ravel())
            if self._motion.fraction - before < 1e-3 * (1.0 - before):
                break
        self._remember(x.ravel(), np.zeros(k))
        u = state.u.copy()
        u[:k] = x.ravel()
        return self._motion.fraction, state.with_u(u)

    def refresh_friction(self, shell: Shell, state: State) -> None:
        """Take friction's normal forces and directions from ``state``: the next of ``friction_iterations``."""
        s = self._at(shell, state)
        self._friction.lag(s.vertices, s.collisions, self._potential)

    def end_step(self, shell: Shell, state: State) -> None:
        """After an accepted step: make the barrier stiffer where it lets contacts come too near."""
        s = self._at(shell, state)
        self._solved = self._potential  # friction of the next step takes its normal forces from what was in balance
        self._kappa.end_step(s.distance)
        if self._kappa.value != self._kappa.solved:
            self._potential = self._barrier(self.stiffness)

    def restore(self, memory: dict[str, float]) -> None:
        """Take up what :meth:`memory` gave."""
        super().restore(memory)
        self._potential, self._solved = self._barrier(self.stiffness), self._barrier(self._kappa.solved)

    # -- results ---------------------------------------------------------------------------------------------------------------
    @property
    def body_time(self) -> float:
        """Time, s, for which the bodies are placed."""
        return self._motion.time

    def summary(self) -> tuple[int, float | None]:
        """Active pairs and least distance (m; None without pairs) of the positions seen last."""
        if not self._recent or len(self._recent[0].collisions) == 0:
            return 0, None
        s = self._recent[0]
        return len(s.collisions), s.distance

    def touches(self, shell: Shell, state: State) -> bool:
        """Whether any pair is active."""
        s = self._at(shell, state)
        return s.collisions is not None and len(s.collisions) > 0

    def report(self, shell: Shell, state: State) -> ContactReport:
        """Active pairs, least distance and the force on each body."""
        s = self._at(shell, state)
        forces = np.zeros((len(self.bodies), 3))
        if s.distance > 0.0 and (len(s.collisions) or self._friction.active):
            g = -self._full_gradient(s).reshape(-1, 3)
            forces = np.array([g[part].sum(axis=0) for part in self.mesh.body_vertices]).reshape(-1, 3)
        return ContactReport(0 if s.collisions is None else len(s.collisions), s.distance, forces, self.stiffness)
