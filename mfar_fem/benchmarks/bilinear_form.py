"""The membrane tangent by scikit-fem's ``BilinearForm``: oracle and yardstick of our own kernel.

On a flat sheet in an affine deformation the raw P2 strain increment is linear in the element, so its Regge interpolation changes
nothing: the two codes compute the same matrix. At order 1 they do in any state.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_matrix

from mfar_fem.shell import Shell, State


class MembraneForm:
    """Membrane tangent of a flat shell (in the plane z = 0, warp along x) as a scikit-fem form.

    Parameters
    ----------
    shell : Shell
        Flat, without bending.
    intorder : int, optional
        Degree of the quadrature; 2 suffices for the matrix, scikit-fem's own choice for P2 is 4.
    """

    def __init__(self, shell: Shell, intorder: int | None = 2):
        from skfem import Basis, BilinearForm, ElementTriP1, ElementTriP2, ElementVector, MeshTri

        surface = shell.surface
        mesh = MeshTri(surface.vertices.T[:2].copy(), surface.triangles.T.copy())
        element = ElementTriP1() if surface.order == 1 else ElementTriP2()
        self.shell = shell
        self.basis = Basis(mesh, ElementVector(element, 3), intorder=intorder)
        dofs = self.basis.nodal_dofs if surface.order == 1 else np.hstack([self.basis.nodal_dofs, self.basis.facet_dofs])
        self.numbering = np.empty(self.basis.N, dtype=np.int64)
        self.numbering[dofs.T.ravel()] = np.arange(self.basis.N)

        def form(u, v, w):
            du, dv, F = u.grad, v.grad, [[w[f"F{c}{a}"] for a in range(2)] for c in range(3)]

            def strain(d):
                return [sum(F[c][0] * d[c][0] for c in range(3)), sum(F[c][1] * d[c][1] for c in range(3)),
                        sum(F[c][0] * d[c][1] + F[c][1] * d[c][0] for c in range(3))]

            eu, ev = strain(du), strain(dv)
            material = sum(w[f"D{i}{j}"] * ev[i] * eu[j] for i in range(3) for j in range(3))
            return material + sum(w["S0"] * dv[c][0] * du[c][0] + w["S1"] * dv[c][1] * du[c][1]
                                  + w["S2"] * (dv[c][0] * du[c][1] + dv[c][1] * du[c][0]) for c in range(3))

        self.form = BilinearForm(form)

    def fields(self, state: State) -> dict[str, np.ndarray]:
        """Deformation gradient, stress and tangent at scikit-fem's points, (nt, points) each.

        Stress and tangent are taken as constant in the element, as they are in the states where the codes agree.
        """
        x = np.empty(self.basis.N)
        x[np.argsort(self.numbering)] = state.u[: self.shell.alpha_offset]
        gradient = np.asarray(self.basis.interpolate(x).grad)
        _, S, D = self.shell.law_response(state, 2)
        points = gradient.shape[-1]
        fields = {f"F{c}{a}": gradient[c, a] for c in range(3) for a in range(2)}
        fields |= {f"S{i}": np.repeat(S[:, :1, i], points, axis=1) for i in range(3)}
        return fields | {f"D{i}{j}": np.repeat(D[:, :1, i, j], points, axis=1) for i in range(3) for j in range(3)}

    def matrix(self, fields: dict[str, np.ndarray]) -> csr_matrix:
        """The assembled matrix in scikit-fem's numbering."""
        return self.form.assemble(self.basis, **fields)

    def renumbered(self, matrix: csr_matrix) -> csr_matrix:
        """That matrix in the shell's numbering."""
        order = np.argsort(self.numbering)
        return matrix.tocsr()[order][:, order]
