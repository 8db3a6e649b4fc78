r"""Coulomb friction of one time step as a potential, with normal forces and contact directions of an earlier state (lagged).

.. math:: D(x) = \Delta t \sum_k \mu_k \lambda_k\, f_0(|T_k^T v|), \qquad v = (x - x_n)/\Delta t

with ipctk's smooth :math:`f_0`: its slope goes from 0 to 1 over speeds up to ``eps_v``, so sticking contacts creep slower than
that. :math:`x_n` is the start of the step, for the sheet and for the bodies: their own motion enters as relative velocity. The
velocity is the backward difference whatever the integrator.

Reference: M. Li et al., "Incremental potential contact", ACM Trans. Graph. 39 (2020) 49, doi 10.1145/3386569.3392425, section 5.
"""

from __future__ import annotations

import numpy as np

from mfar_fem.contact.collision_mesh import CollisionMesh, ipctk


class LaggedFriction:
    """Friction of one step.

    Parameters
    ----------
    mesh : CollisionMesh
    coefficients : (nb,) array
        Coulomb coefficient of each body against the sheet.
    self_coefficient : float
        Of the sheet against itself.
    eps_v : float
        Speed, m/s, from which friction is fully developed.
    """

    def __init__(self, mesh: CollisionMesh, coefficients, self_coefficient: float, eps_v: float):
        ipc = ipctk()
        self._mesh = mesh
        self._potential, self._contacts = ipc.FrictionPotential(eps_v), ipc.TangentialCollisions()
        # ipctk takes the mean of two vertices' coefficients; these make it the body's, and the sheet's own in self-contact
        self._mu = np.full(len(mesh.rest), float(self_coefficient))
        for part, mu in zip(mesh.body_vertices, coefficients, strict=True):
            self._mu[part] = 2.0 * mu - self_coefficient
        self.on = bool(np.any(self._mu != 0.0))
        self._start, self._dt = mesh.rest, 0.0

    def begin(self, vertices: np.ndarray, dt: float) -> None:
        """Start a step of ``dt`` s at the collision vertices (n, 3); friction is nil until :meth:`lag`."""
        self._start, self._dt = vertices, dt
        self._contacts.clear()

    def lag(self, vertices: np.ndarray, collisions, potential) -> None:
        """Take normal forces and directions from the contacts at ``vertices`` (n, 3)."""
        if self.on and self._dt > 0:
            self._contacts.build(self._mesh.mesh, vertices, collisions, potential, self._mu, self._mu)

    @property
    def active(self) -> bool:
        """Whether any contact rubs."""
        return len(self._contacts) > 0

    def _velocity(self, vertices: np.ndarray) -> np.ndarray:
        return np.asfortranarray((vertices - self._start) / self._dt)

    def energy(self, vertices: np.ndarray) -> float:
        """D, J."""
        return self._dt * self._potential(self._contacts, self._mesh.mesh, self._velocity(vertices))

    def gradient(self, vertices: np.ndarray) -> np.ndarray:
        """dD/dx (3 n,), N."""
        return self._potential.gradient(self._contacts, self._mesh.mesh, self._velocity(vertices))

    def hessian(self, vertices: np.ndarray, projection):
        """d²D/dx² (3 n, 3 n), sparse, N/m."""
        return self._potential.hessian(self._contacts, self._mesh.mesh, self._velocity(vertices), projection) / self._dt
