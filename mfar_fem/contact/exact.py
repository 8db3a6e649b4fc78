r"""Contact with bodies whose distance is a formula: planes, spheres and round cylinders that stand still. No mesh, no pairs.

The barrier of :mod:`mfar_fem.contact.barrier`, taken over the nodes of the sheet instead of pairs of triangles:

.. math:: \sum_i A_i\,\kappa\,\hat d\; b(\phi(x_i) - s_i),\qquad s_i = \sqrt{R^2 + 2\varrho_i^2} - R

with φ the exact distance of the body, :math:`A_i` the area of a node and :math:`s_i` what facets between nodes need: a flat facet
whose corners lie at the distance s from a ball comes as near as :math:`\sqrt{(R + s)^2 - \varrho^2} - R` when its smallest
enclosing circle has the radius ϱ. The factor 2 is what trellis shear at constant yarn length can make of ϱ² at most. Sheets of
order 2 touch with flat quarters of their elements, as with the mesh. That no facet enters a body is checked as such all the same:
the distance of a triangle from a sphere, from a line and from a plane is exact too, and every step of Newton's method is cut
(conservative advancement) to leave a tenth of it.

Every contact acts on one node, so that its second derivative is a block of the diagonal: contact costs a hundredth of what ipctk's
pairs cost, and the body is round. What it cannot do (:func:`why_not`): self-contact, bodies that move, edges of bodies, sheets so
coarse that s exceeds the activation distance.

References: as :mod:`mfar_fem.contact.barrier`; friction as :mod:`mfar_fem.contact.friction`, with the normal of the body.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mfar_fem.contact import exact_kernels as kernels
from mfar_fem.contact.body import Body, Cylinder, Plane, Sphere
from mfar_fem.contact.collision_mesh import subdivide
from mfar_fem.contact.energy import KEPT, ContactEnergy, ContactReport
from mfar_fem.contact.start import TOO_CLOSE, IntersectingStartError, describe
from mfar_fem.contact.stiffness import BarrierStiffness
from mfar_fem.errors import InputError, NotConvergedError
from mfar_fem.shell import Shell, State
from mfar_fem.solve.problem import InadmissibleStateError
from mfar_fem.surface import Surface

SHEARED = 2.0
"""By how much shear may widen the squared radius of a facet."""
KINDS: dict[type, int] = {Plane: kernels.PLANE, Sphere: kernels.SPHERE, Cylinder: kernels.CYLINDER}
CONTACT_END = "the sheet has come to the end of cylinder '{}', where this contact knows no edge: use [contact] bodies = 'mesh'"


def why_not(bodies: Sequence[Body], surface: Surface, dhat: float) -> str | None:
    """Why these bodies have to be met as meshes; None if they need not.

    Parameters
    ----------
    bodies : sequence of Body
    surface : Surface
        The sheet where it starts.
    dhat : float
        Activation distance, m.
    """
    for body in bodies:
        if type(body) not in KINDS:
            return f"'{body.name}' is no plane, sphere or cylinder"
        if body.motion is not None:
            return f"'{body.name}' is on a path"
        if isinstance(body, Cylinder) and _beyond(body, surface.nodes).any():
            return f"the sheet reaches an end of cylinder '{body.name}'"
    needed = _clearance(bodies, surface, *_facets(surface)[1:]).max(initial=0.0)
    if needed > dhat:
        return f"facets between nodes would need {1e3 * needed:.2g} mm, more than the distance at which contact begins"
    return None


def _beyond(body: Cylinder, x: np.ndarray) -> np.ndarray:
    """Which of x (n, 3) lie beside an end of a cylinder, or further out."""
    return np.abs((x - body.centre) @ body.axis) > 0.5 * body.length


def _facets(surface: Surface) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Element (k,), corners (k, 3) and squared radius, m² (k,), of the smallest circle round every flat piece of the sheet."""
    pieces = subdivide(surface, surface.order)
    squared = np.array([np.sum((surface.nodes[pieces.triangles[:, i]] - surface.nodes[pieces.triangles[:, i - 1]]) ** 2, axis=1)
                        for i in range(3)])
    longest, total = squared.max(axis=0), squared.sum(axis=0)
    area16 = total**2 - 2.0 * np.sum(squared**2, axis=0)  # Heron: sixteen times the squared area
    with np.errstate(divide="ignore", invalid="ignore"):
        circle = np.prod(squared, axis=0) / area16
    acute = total > 2.0 * longest
    return pieces.elements, pieces.triangles, np.where(acute, circle, 0.25 * longest)


def _clearance(bodies: Sequence[Body], surface: Surface, triangles: np.ndarray, squared: np.ndarray) -> np.ndarray:
    """s (nn, nb), m."""
    widest = np.zeros(len(surface.nodes))
    for i in range(3):
        np.maximum.at(widest, triangles[:, i], squared)
    radii = np.array([getattr(body, "radius", np.inf) for body in bodies])
    with np.errstate(invalid="ignore"):
        out = np.sqrt(radii**2 + SHEARED * widest[:, None]) - radii
    return np.where(np.isinf(radii), 0.0, out)


@dataclass(frozen=True)
class _Contacts:
    """Positions (nn, 3); of the nodes distances (nn, nb), normals (nn, nb, 3) and what is left beyond s; of the facets (k, nb)."""

    x: np.ndarray
    distance: np.ndarray
    normal: np.ndarray
    room: np.ndarray
    facets: np.ndarray

    @cached_property
    def free(self) -> bool:
        """Whether no node is nearer than it may be and no facet touches."""
        return bool(np.all(self.room > 0) and np.all(self.facets > 0))


class ExactBarrier(ContactEnergy):
    """Contact of a sheet with planes, spheres and cylinders that stand still.

    Parameters
    ----------
    bodies : sequence of Body
    dhat : float
        Activation distance, m.
    stiffness : float, optional
        κ, Pa; default: :class:`mfar_fem.contact.stiffness.BarrierStiffness`.
    friction : float or sequence of float, optional
        Coulomb coefficients; default: each body's own.
    eps_v : float
        Speed, m/s, from which friction is fully developed.

    Raises
    ------
    InputError
        For values that make no sense.
    """

    self_contact = False

    def __init__(self, bodies: Sequence[Body], dhat: float = 1e-3, stiffness: float | None = None, friction=None,
                 eps_v: float = 1e-3):
        super().__init__(bodies, dhat, stiffness, friction, eps_v)
        self.body_time = 0.0

    def bind(self, shell: Shell) -> None:
        """Prepare for a sheet.

        Raises
        ------
        InputError
            Bodies that this contact cannot do.
        """
        surface, bodies = shell.surface, self.bodies
        reason = why_not(bodies, surface, np.inf)
        if reason is not None:
            raise InputError(f"exact contact: {reason}; use mfar_fem.contact.barrier.Barrier ([contact] bodies = 'mesh')")
        self._elements, self._triangles, squared = _facets(surface)
        self._clearance = _clearance(bodies, surface, self._triangles, squared)
        x = surface.nodes[self._triangles]
        area = 0.5 * np.linalg.norm(np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0]), axis=1)
        self._weights = np.bincount(self._triangles.ravel(), np.repeat(area / 3.0, 3), minlength=len(surface.nodes))
        zero = np.zeros(3)
        self._kinds = np.array([KINDS[type(b)] for b in bodies])
        self._centres = np.array([getattr(b, "point" if isinstance(b, Plane) else "centre") for b in bodies]).reshape(-1, 3)
        self._axes = np.array([b.normal if isinstance(b, Plane) else getattr(b, "axis", zero) for b in bodies]).reshape(-1, 3)
        self._radii = np.array([getattr(b, "radius", 0.0) for b in bodies])
        self._kappa = BarrierStiffness(shell, self.dhat, self._given)
        self._pressed = np.zeros(self._clearance.shape)
        self._normals = np.zeros((*self._clearance.shape, 3))
        self._start, self._dt = surface.nodes, 0.0
        self._recent: list[_Contacts] = []
        self._seen: tuple[int, float | None] = (0, None)

    @property
    def _shape(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        return self._kinds, self._centres, self._axes, self._radii

    # -- a state -----------------------------------------------------------------------------------------------------------
    def _at(self, shell: Shell, state: State) -> _Contacts:
        x = np.ascontiguousarray(shell.positions(state))
        for i, known in enumerate(self._recent):
            if np.array_equal(x, known.x):
                self._recent.insert(0, self._recent.pop(i))
                return known
        found = self._look(x.copy())
        self._recent = [found, *self._recent[: KEPT - 1]]
        return found

    def _look(self, x: np.ndarray) -> _Contacts:
        shape = self._clearance.shape
        distance, normal, facets = np.empty(shape), np.empty((*shape, 3)), np.empty((len(self._triangles), len(self.bodies)))
        kernels.node_distances(*self._shape, x, distance, normal)
        kernels.facet_distances(*self._shape, x, self._triangles, distance, self.dhat, facets)
        return _Contacts(x, distance, normal, distance - self._clearance, facets)

    def has_intersections(self, shell: Shell, state: State) -> bool:
        """Whether a facet of the sheet touches or enters a body."""
        return not np.all(self._look(np.ascontiguousarray(shell.positions(state))).facets > 0)

    def check_start(self, shell: Shell, state: State, t: float = 0.0) -> None:
        """Refuse a start that intersects or touches.

        Raises
        ------
        IntersectingStartError
            With the pairs and the distance that would do.
        """
        c = self._at(shell, state)
        if not np.all(np.isfinite(c.x)):
            raise InputError("contact: the start is not finite")
        facets, room = c.facets, c.room[self._triangles].min(axis=1, initial=np.inf)
        f, b = np.nonzero(~((facets > 0) & (room >= TOO_CLOSE * self.dhat)))
        if len(f):
            worst = np.argmin(room[f, b])
            pairs = sorted({(int(self._elements[i]), self.bodies[j].name) for i, j in zip(f, b, strict=True)})
            enters = bool(np.any(facets <= 0))
            needed = self.dhat + float(self._clearance.max())
            raise IntersectingStartError(
                f"the start {'intersects' if enters else 'touches'}: {describe(pairs)}; move the sheet by at least "
                f"{1e3 * (self.dhat - room[f[worst], b[worst]]):.4g} mm: its nodes should start {1e3 * needed:.4g} mm from a body "
                f"(dhat {1e3 * self.dhat:.4g} mm and what flat facets of this size need)",
                pairs, max(0.0, float(facets.min())))

    # -- the potential -------------------------------------------------------------------------------------------------------
    def energy(self, shell: Shell, state: State, lam: float) -> float:
        """Barrier and friction, J; +inf where a facet touches or a node is too near."""
        c = self._at(shell, state)
        if not c.free:
            return np.inf
        total = kernels.potential(c.room, self.dhat, self._weights, self.stiffness)
        return float(total + self._rubbing(c.x)[0])

    def _rubbing(self, x: np.ndarray, body: int | None = None) -> tuple[float, np.ndarray, np.ndarray]:
        """Energy, gradient (nn, 3) and blocks (nn, 3, 3) of friction, on all bodies or on one."""
        total, g, H = np.zeros(1), np.zeros_like(x), np.zeros((*x.shape, 3))
        if self._dt > 0 and self._pressed.any():
            which = slice(None) if body is None else slice(body, body + 1)
            kernels.friction(self._pressed[:, which], self._normals[:, which], x - self._start, self.eps_v, self._dt, total, g, H)
        return float(total[0]), g, H

    def _derivatives(self, shell: Shell, state: State, definite: bool) -> tuple[np.ndarray, np.ndarray]:
        c = self._at(shell, state)
        _, g, H = self._rubbing(c.x)
        kernels.derivatives(self._kinds, self._radii, self._axes, c.distance, c.normal, c.room, self.dhat, self._weights,
                            self.stiffness, definite, g, H)
        return g, H

    def gradient(self, shell: Shell, state: State, lam: float, out: np.ndarray) -> None:
        """Add the gradient, N."""
        out[: shell.alpha_offset] += self._derivatives(shell, state, True)[0].ravel()

    def sparse_hessian(self, shell: Shell, state: State, lam: float,
                       psd: bool = True) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Rows, columns (int32) and values, N/m, of the second derivative; ``psd``: without the bodies' curvature.

        Raises
        ------
        InadmissibleStateError
            Where the energy is infinite.
        """
        if not self._at(shell, state).free:
            raise InadmissibleStateError("the sheet touches a body")
        _, H = self._derivatives(shell, state, psd)
        nodes = np.flatnonzero(H.any(axis=(1, 2)))
        dofs = (3 * nodes[:, None] + np.arange(3)).astype(np.int32)
        return np.repeat(dofs, 3, axis=1).ravel(), np.tile(dofs, 3).ravel(), H[nodes].ravel()

    # -- steps ---------------------------------------------------------------------------------------------------------------
    def max_step(self, shell: Shell, state: State, step: np.ndarray) -> float:
        """Largest fraction of ``step`` (n,), at most 1, that leaves at least a tenth of the distances there are.

        Raises
        ------
        InadmissibleStateError
            If ``state`` itself touches, or the step is not finite.
        """
        c = self._at(shell, state)
        if not c.free:
            raise InadmissibleStateError("a step from a state that intersects or touches")
        move = np.ascontiguousarray(step[: shell.alpha_offset].reshape(-1, 3))
        if not np.all(np.isfinite(move)):
            raise InadmissibleStateError("a step that is not finite")
        return float(kernels.free_fraction(*self._shape, c.x, move, self._triangles, c.distance, self._clearance))

    def lifted(self, x: np.ndarray, base: np.ndarray) -> np.ndarray:
        """Nodes x (nn, 3) moved out of the bodies to where contact begins, or no closer than they were at ``base``."""
        x, now, before = np.array(x), self._look(x), self._look(np.ascontiguousarray(base))
        short = np.maximum(np.clip(before.room, 0.3 * self.dhat, 0.7 * self.dhat) - now.room, 0.0)
        return x + np.einsum("ib,ibc->ic", short, now.normal)

    def begin_step(self, shell: Shell, state: State, predicted: State | None, t0: float, t1: float, dt: float) -> float:
        """Start a time step at the accepted ``state``: friction takes its normal forces from there. Bodies stand still: 1.

        Raises
        ------
        NotConvergedError
            Where the sheet has come to the end of a cylinder.
        """
        c = self._at(shell, state)
        if not c.free:
            raise IntersectingStartError(f"the step from t = {t0:.6g} s starts from a state that intersects or touches")
        for body, room in zip(self.bodies, c.room.T, strict=True):
            if isinstance(body, Cylinder) and np.any(_beyond(body, c.x[room < self.dhat])):
                raise NotConvergedError(CONTACT_END.format(body.name))
        self._kappa.choose(dt)
        self._start, self._dt, self.body_time = c.x, dt, t1
        self._lag(c, self._kappa.solved)
        return 1.0

    def _lag(self, c: _Contacts, stiffness: float) -> None:
        if self.friction.any():
            self._pressed = self.friction * kernels.forces(c.room, self.dhat, self._weights, stiffness)
            self._normals = c.normal

    def advance(self, shell: Shell, state: State, held: np.ndarray | None = None) -> tuple[float, State]:
        """Nothing: the bodies stand still."""
        return 1.0, state

    def refresh_friction(self, shell: Shell, state: State) -> None:
        """Take friction's normal forces and directions from ``state``."""
        self._lag(self._at(shell, state), self.stiffness)

    def end_step(self, shell: Shell, state: State) -> None:
        """After an accepted step: make the barrier stiffer where it lets contacts come too near."""
        c = self._at(shell, state)
        active = int(np.count_nonzero(c.room < self.dhat))
        self._seen = active, float(c.facets.min()) if active else None
        self._kappa.end_step(float(c.room.min()) if active else np.inf)

    # -- results ---------------------------------------------------------------------------------------------------------------
    def summary(self) -> tuple[int, float | None]:
        """Nodes in contact after the last step, and the least distance of a facet (m; None without contact)."""
        return self._seen

    def touches(self, shell: Shell, state: State) -> bool:
        """Whether any node is in contact."""
        return bool(np.any(self._at(shell, state).room < self.dhat))

    def report(self, shell: Shell, state: State) -> ContactReport:
        """Nodes in contact, least distance of a facet, and the force of the sheet on each body, N."""
        c = self._at(shell, state)
        active = int(np.count_nonzero(c.room < self.dhat))
        on_bodies = -np.einsum("ib,ibc->bc", kernels.forces(c.room, self.dhat, self._weights, self.stiffness), c.normal)
        for b in range(len(self.bodies)):
            on_bodies[b] += self._rubbing(c.x, b)[1].sum(axis=0)
        return ContactReport(active, float(c.facets.min()) if active else np.inf, on_bodies, self.stiffness)
