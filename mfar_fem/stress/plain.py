r"""The energy of a flat-cut sheet once more, from plain formulas in complex arithmetic: no derivative of it is written down.

The gradient is the complex step :math:`\partial W/\partial u_j = \operatorname{Im} W(u + i h e_j) / h` with
:math:`h = 10^{-30}`, exact to rounding because nothing is subtracted. Only energies are written here: no stress, no tangent, no
jet. What a flat reference with straight edges allows is used throughout (constant area element, constant frame), which the solver's
kernels do not.

Shared with the solver: the mesh (nodes, elements, edges), the numbering of the unknowns, and the *energy* formula of the law at
``order=0``. Where that formula is not analytic (inverse Langevin) its derivative is a sixth-order central difference of
``law.energy``, and where a thickness belongs to it that is found by bisection. Not shared: kernels, twin, jets, tables of shape
functions, stress and tangent of the laws, loads, mass, integrators.

References
----------
1. W. Squire, G. Trapp, "Using complex variables to estimate derivatives of real functions", SIAM Rev. 40 (1998) 110–112,
   doi 10.1137/S003614459631241X.
"""

from __future__ import annotations

import numpy as np

STEP = 1e-30
_ANALYTIC = {"eight-chain-literal", "eight-chain-silk", "fung", "gasser-ogden-holzapfel", "neo-hookean", "neo-hookean-compressible",
             "st-venant-kirchhoff", "yarn-network"}
_LADDER = 10.0 ** -np.array([1.5, 2.0, 2.5, 3.25, 4.0])
"""Steps of the central differences, relative to C; every point takes the one whose orders four and six agree best."""


class PlainSheet:
    """Membrane and bending energy of a flat sheet with straight edges, element by element.

    Parameters
    ----------
    surface : mfar_fem.surface.Surface
        Flat (z constant), straight-sided; warp along a constant direction in each element.
    fabric : mfar_fem.materials.Fabric
    """

    def __init__(self, surface, fabric):
        self.surface, self.fabric, self.order = surface, fabric, surface.order
        X = surface.nodes[surface.elements]
        if np.ptp(surface.nodes[:, 2]) > 0 or (self.order == 2 and np.abs(
                X[:, 3:] - 0.5 * (X[:, [0, 1, 2]] + X[:, [1, 2, 0]])).max() > 1e-12 * np.abs(X).max()):
            raise ValueError("the plain energy is that of a flat sheet with straight edges")
        a, b = X[:, 1] - X[:, 0], X[:, 2] - X[:, 0]
        twice = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
        self.side = np.sign(twice)
        self.area = 0.5 * np.abs(twice)
        warp = surface.warp / np.linalg.norm(surface.warp, axis=1, keepdims=True)
        weft = self.side[:, None] * np.stack([-warp[:, 1], warp[:, 0], np.zeros(len(warp))], axis=1)
        frame = np.stack([warp, weft], axis=1)
        edges = np.stack([a, b], axis=1)
        self.L = np.einsum("efc,eac->efa", frame, edges)  # columns: the two sides of the triangle in the warp/weft frame
        self.K = np.linalg.inv(self.L)
        self.points = np.array([[1 / 3, 1 / 3]]) if self.order == 1 else np.array([[1, 1], [4, 1], [1, 4]]) / 6.0
        s = np.array([0.5]) if self.order == 1 else 0.5 + np.array([-0.5, 0.5]) / np.sqrt(3.0)
        corner, along = np.array([[0, 0], [1, 0], [0, 1.0]]), np.array([[1, 0], [-1, 1], [0, -1.0]])
        self.edge_points = np.concatenate([corner[k] + s[:, None] * along[k] for k in range(3)])
        self.along = np.repeat(along, len(s), axis=0)
        self.n_edge = len(s)
        self._edge_numbers(s)
        self._moments(X, along)
        if self.order == 2:
            self._regge()
        self.membrane_samples0 = self._metric(X.astype(complex)).real

    # -- set-up ----------------------------------------------------------------------------------------------------------
    def _edge_numbers(self, s) -> None:
        """Unknown rotation behind each edge point of an element, counted from the low to the high vertex of the edge."""
        surface, n = self.surface, len(s)
        start, end = surface.triangles, np.roll(surface.triangles, -1, axis=1)
        self.edge_side = np.repeat(np.where(start < end, 1.0, -1.0), n, axis=1)
        count = np.where((start < end)[:, :, None], np.arange(n), np.arange(n)[::-1])
        self.rotation = (n * surface.element_edges[:, :, None] + count).reshape(len(start), -1)

    def _moments(self, X, along) -> None:
        """``Q`` (nt, nc, nc): moments of one degree less than the sheet, eliminated from ½ σ·D⁻¹σ - σ·(curvature)."""
        points, nq = self.points, len(self.points)
        weight = np.repeat(self.area[:, None] / nq, nq, axis=1)
        compliance = np.linalg.inv(self.fabric.bending.matrix)
        nt, nk = len(X), len(self.edge_points)
        A = np.zeros((nt, 3 * nq, 3 * nq))
        for q in range(nq):
            A[:, 3 * q:3 * q + 3, 3 * q:3 * q + 3] = weight[:, q, None, None] * compliance
        B = np.zeros((nt, 3 * nq, 3 * nq * (self.order == 2) + nk))
        if self.order == 2:  # interior: σ11 b11 + σ22 b22 + 2 σ12 b12 at the points, b already in the warp/weft frame
            for q in range(nq):
                for c, double in enumerate((1.0, 1.0, 2.0)):
                    B[:, 3 * q + c, 3 * q + c] = double * weight[:, q]
            basis = np.linalg.inv(np.column_stack([np.ones(3), points]))
            at_edges = np.column_stack([np.ones(nk), self.edge_points]) @ basis
        else:
            at_edges = np.ones((nk, 1))
        sides = np.einsum("efa,ka->ekf", self.L, along)
        length = np.linalg.norm(sides, axis=2)
        normal = np.stack([sides[..., 1], -sides[..., 0]], axis=-1) / length[..., None]
        mm = np.stack([normal[..., 0] ** 2, normal[..., 1] ** 2, 2 * normal[..., 0] * normal[..., 1]], axis=-1)
        for k in range(nk):
            e = k // self.n_edge
            for q in range(nq):
                B[:, 3 * q:3 * q + 3, k - nk] = (length[:, e] / self.n_edge * at_edges[k, q])[:, None] * mm[:, e]
        self.Q = np.einsum("eik,eil->ekl", B, np.linalg.solve(A, B))

    def _regge(self) -> None:
        """Linear strain from its tangential parts at two points of each edge and its mean (covariant, 11, 22, 12 doubled)."""
        def rows(t, p):
            return np.outer(np.array([t[0] ** 2, t[1] ** 2, t[0] * t[1]]), np.array([1.0, *p])).ravel()

        M = np.zeros((9, 9))
        for k in range(6):
            M[k] = rows(self.along[k], self.edge_points[k])
        for c in range(3):
            M[6 + c] = np.outer(np.eye(3)[c], [1.0, 1 / 3, 1 / 3]).ravel()
        inverse = np.linalg.inv(M).reshape(3, 3, 9)
        self.regge = np.einsum("cmk,qm->qck", inverse, np.column_stack([np.ones(3), self.points]))

    # -- formulas in the unknowns of the elements ------------------------------------------------------------------------------
    def _slopes(self, x, p):
        """∂x/∂ξ and ∂x/∂η (nt, 3) at the parametric point ``p`` of nodes x (nt, nn, 3)."""
        if self.order == 1:
            return x[:, 1] - x[:, 0], x[:, 2] - x[:, 0]
        xi, eta = p
        a, b, c, ab, bc, ca = (x[:, i] for i in range(6))
        zeta = 1 - xi - eta
        to_xi = (1 - 4 * zeta) * a + (4 * xi - 1) * b + 4 * (zeta - xi) * ab + 4 * eta * bc - 4 * eta * ca
        to_eta = (1 - 4 * zeta) * a + (4 * eta - 1) * c - 4 * xi * ab + 4 * xi * bc + 4 * (zeta - eta) * ca
        return to_xi, to_eta

    def _metric(self, x):
        """Half the metric: tangential at the edge points (order 2), then its mean over the element (nt, 3), 12 doubled."""
        x = x - x[:, :1]
        mean = 0.0
        for p in self.points:
            g, h = self._slopes(x, p)
            mean = mean + np.stack([0.5 * _dot(g, g), 0.5 * _dot(h, h), _dot(g, h)], axis=1) / len(self.points)
        if self.order == 1:
            return mean
        edge = []
        for p, t in zip(self.edge_points, self.along, strict=True):
            g, h = self._slopes(x, p)
            v = t[0] * g + t[1] * h
            edge.append(0.5 * _dot(v, v))
        return np.concatenate([np.stack(edge, axis=1), mean], axis=1)

    def cauchy_green(self, x):
        """C (nt, nq, 3) in the warp/weft frame of nodes x (nt, nn, 3)."""
        change = self._metric(x) - self.membrane_samples0
        E = change[:, None] if self.order == 1 else np.einsum("qck,ek->eqc", self.regge, change)
        K = self.K[:, None]
        C = []
        for f, g in ((0, 0), (1, 1), (0, 1)):
            C.append(2 * (E[..., 0] * K[..., 0, f] * K[..., 0, g] + E[..., 1] * K[..., 1, f] * K[..., 1, g])
                     + E[..., 2] * (K[..., 0, f] * K[..., 1, g] + K[..., 1, f] * K[..., 0, g]))
        return np.stack(C, axis=-1) + np.array([1.0, 1.0, 0.0])

    def membrane(self, x, stress=None):
        """Membrane energy (nt,), J, complex; ``stress`` as :meth:`difference_stress` gives it, where the law is not analytic."""
        C = self.cauchy_green(x)
        flat = C.reshape(-1, 3)
        law = self.fabric.law
        if stress is None:
            density = analytic_energy(law, flat)
        else:
            density = law.energy(flat.real) + 1j * np.sum(stress.reshape(-1, 3) * flat.imag, axis=1)
        return self.fabric.membrane_scale * self.area / len(self.points) * density.reshape(C.shape[:2]).sum(axis=1)

    def bending(self, x, alpha, directors):
        """Bending energy (nt,), J, complex: nodes x (nt, nn, 3), rotations alpha (nt, nk), directors (nt, nk, 3)."""
        x = x - x[:, :1]
        samples = []
        if self.order == 2:
            second = (4 * (x[:, 0] + x[:, 1] - 2 * x[:, 3]), 4 * (x[:, 0] + x[:, 2] - 2 * x[:, 5]),
                      4 * (x[:, 0] - x[:, 3] + x[:, 4] - x[:, 5]))
            K = self.K
            for p in self.points:
                n = _unit(np.cross(*self._slopes(x, p)))
                b = [_dot(part, n) for part in second]
                for f, g in ((0, 0), (1, 1), (0, 1)):
                    samples.append(b[0] * K[:, 0, f] * K[:, 0, g] + b[1] * K[:, 1, f] * K[:, 1, g]
                                   + b[2] * (K[:, 0, f] * K[:, 1, g] + K[:, 1, f] * K[:, 0, g]))
        for k, p in enumerate(self.edge_points):
            g, h = self._slopes(x, p)
            n, t = _unit(np.cross(g, h)), _unit(self.along[k][0] * g + self.along[k][1] * h)
            d = _unit(directors[:, k] - _dot(directors[:, k], t)[:, None] * t)
            samples.append(_angle(_dot(n, d), _dot(n, np.cross(t, d))) + self.edge_side[:, k] * alpha[:, k])
        c = np.stack(samples, axis=1)  # the flat reference has none
        return 0.5 * np.einsum("ek,ekl,el->e", c, self.Q, c)

    # -- energy and gradient of the whole sheet ----------------------------------------------------------------------------------
    def _gather(self, u, directors):
        k = 3 * len(self.surface.nodes)
        x = u[:k].reshape(-1, 3)[self.surface.elements].astype(complex)
        return x, u[k:][self.rotation].astype(complex), directors[self.rotation]

    def energy(self, u, directors) -> tuple[float, float]:
        """Membrane and bending energy, J; +inf past locking."""
        x, alpha, d = self._gather(u, directors)
        density = self.fabric.law.energy(self.cauchy_green(x).real.reshape(-1, 3)).reshape(len(x), -1)
        membrane = self.fabric.membrane_scale * self.area / len(self.points) * density.sum(axis=1)
        return float(membrane.sum()), float(self.bending(x, alpha, d).real.sum())

    def gradient(self, u, directors) -> np.ndarray:
        """Gradient (n,): N, N·m for the rotations."""
        x, alpha, d = self._gather(u, directors)
        nn = x.shape[1]
        stress = None
        if self.fabric.law.name not in _ANALYTIC:
            C = self.cauchy_green(x).real
            stress = difference_derivative(self.fabric.law, C.reshape(-1, 3)).reshape(C.shape)
        out, offset = np.zeros(len(u)), 3 * len(self.surface.nodes)
        for i in range(nn):
            for c in range(3):
                x[:, i, c] += 1j * STEP
                slope = (self.membrane(x, stress) + self.bending(x, alpha, d)).imag / STEP
                np.add.at(out, 3 * self.surface.elements[:, i] + c, slope)
                x[:, i, c] -= 1j * STEP
                x[:, i, c] = x[:, i, c].real
        for k in range(alpha.shape[1]):
            alpha[:, k] += 1j * STEP
            np.add.at(out, offset + self.rotation[:, k], self.bending(x, alpha, d).imag / STEP)
            alpha[:, k] = alpha[:, k].real
        return out

    # -- mass and weight ---------------------------------------------------------------------------------------------------------
    def mass_matrix(self, kind: str) -> np.ndarray:
        """Nodal mass matrix (nn, nn), kg: consistent from the closed form, or lumped on its scaled diagonal."""
        if self.order == 1:
            unit = (np.ones((3, 3)) + np.eye(3)) / 12.0
        else:  # vertices, then the middles of 01, 12, 20
            unit = np.array([[6, -1, -1, 0, -4, 0], [-1, 6, -1, 0, 0, -4], [-1, -1, 6, -4, 0, 0],
                             [0, 0, -4, 32, 16, 16], [-4, 0, 0, 16, 32, 16], [0, -4, 0, 16, 16, 32]]) / 180.0
        if kind == "lumped":
            unit = np.diag(np.diag(unit) / np.trace(unit))
        elements, n = self.surface.elements, len(self.surface.nodes)
        M = np.zeros((n, n))
        np.add.at(M, (elements[:, :, None], elements[:, None, :]),
                  self.fabric.areal_density * self.area[:, None, None] * unit)
        return M

    def weight(self, g) -> np.ndarray:
        """Nodal weights (3 nn,), N, under an acceleration g (3,), m/s²: thirds at the vertices, or at the middles of order 2."""
        columns = self.surface.elements[:, :3] if self.order == 1 else self.surface.elements[:, 3:]
        share = np.repeat(self.area / 3, 3)
        nodal = np.bincount(columns.ravel(), share, minlength=len(self.surface.nodes))
        return (self.fabric.areal_density * nodal[:, None] * np.asarray(g)).ravel()


def analytic_energy(law, C):
    """Energy density (m,) of a law's formula at complex C (m, 3).

    A compressible law has its thickness where the energy is stationary, so that the real one gives the derivative too.
    """
    c11, c22, c12 = C[:, 0], C[:, 1], C[:, 2]
    det = c11 * c22 - c12 * c12

    def at(c33, det=det, trace=c11 + c22):
        q = {"C11": c11, "C22": c22, "C12": c12, "C33": c33, "I1": trace + c33, "J2": det * c33}
        with np.errstate(invalid="ignore", divide="ignore"):
            return law.potential(q, 0)[0]

    if "J2" not in law.invariants:
        return at(1.0 / det)
    low, high = np.full(len(C), np.log(1e-8)), np.full(len(C), np.log(1e8))
    for _ in range(64):
        middle = 0.5 * (low + high)
        c33 = np.exp(middle) / det.real
        rising = at(c33 * (1 + 1j * STEP), det.real, (c11 + c22).real).imag > 0
        low, high = np.where(rising, low, middle), np.where(rising, middle, high)
    return at(np.exp(0.5 * (low + high)) / det.real)


def difference_derivative(law, C) -> np.ndarray:
    """dΨ/dC (m, 3) by central differences of ``law.energy`` of order six, the step chosen point by point."""
    best, error = np.zeros(C.shape), np.full(C.shape, np.inf)
    for column in range(3):
        for h in _LADDER:
            def at(shift, column=column, h=h):
                moved = C.copy()
                moved[:, column] += shift * h * C[:, :2].min(axis=1)
                return law.energy(moved)

            with np.errstate(invalid="ignore"):
                d1, d2, d3 = (at(s) - at(-s) for s in (1, 2, 3))
                scale = h * C[:, :2].min(axis=1)
                four, six = (8 * d1 - d2) / (12 * scale), (45 * d1 - 9 * d2 + d3) / (60 * scale)
                wrong = np.abs(six - four)
            better = np.isfinite(wrong) & (wrong < error[:, column])
            best[better, column], error[better, column] = six[better], wrong[better]
    return best


def _dot(a, b):
    return np.sum(a * b, axis=-1)


def _unit(v):
    return v / np.sqrt(_dot(v, v))[..., None]


def _angle(c, s):
    """atan2(s, c), analytic."""
    real = np.arctan2(s.real, c.real)
    return real + 1j * (c.real * s.imag - s.real * c.imag) / (c.real**2 + s.real**2)
