"""One elastic sphere in a matrix: singular amplitudes from those of the regular field around it.

On |x| = 1 the Lamé solutions 1 and 3 of `translation` have displacements and tractions along x Y
and ∇Y (Y the spherical harmonic), solution 2 along x × ∇Y alone; continuity of both leaves 2 × 2
systems for each degree, whatever the order m.
"""

from __future__ import annotations

import numpy as np

from alphacut.fuzzy.arrays import Array
from alphacut.rve.series.means import Material


def t_matrices(degrees: Array, matrix: Material, inclusion: Material) -> tuple[Array, Array]:
    """T-matrices of a sphere of radius 1: singular amplitudes = T @ regular amplitudes.

    Lamé solutions are numbered as by Kushch (2013): 1 is the gradient of a harmonic, 2 torsional,
    3 the one with dilatation. The inclusion may be as soft as a pore or as stiff as rigid.

    Returns:
        T of the coupled solutions 1 and 3 of k degrees, rows singular, columns regular, (k, 2, 2),
        and of solution 2, (k,).
    """
    n = np.asarray(degrees, float)
    ratio = inclusion.bulk_and_shear[1] / matrix.bulk_and_shear[1]
    # weights of tractions outside and inside, finite for pores and rigid spheres
    outside, inside = 1 / (1 + ratio), ratio / (1 + ratio)
    stiffness = _surface_stiffness(n, inclusion.poisson)

    def traction_mismatch(degree: Array) -> Array:
        displacement, traction = _surface_fields(degree, matrix.poisson)
        return outside * traction - inside * stiffness @ displacement

    singular, regular = traction_mismatch(-n - 1), -traction_mismatch(n)
    is_radial = n == 0  # singular solution 1 and regular solution 3 alone
    singular[is_radial, :, 1], singular[is_radial, 1, :] = 0.0, 0.0
    singular[is_radial, 1, 1], regular[is_radial, 1, :] = 1.0, 0.0
    torsion_sum = np.where(is_radial, 1.0, (n + 2) * outside + (n - 1) * inside)
    torsion = np.where(is_radial, 0.0, (n - 1) * (outside - inside) / torsion_sum)
    return np.asarray(np.linalg.solve(singular, regular)), np.asarray(torsion)


def _surface_stiffness(n: Array, poisson: complex) -> Array:
    """Traction over μ from displacement of the surface of a solid sphere, shape (k, 2, 2)."""
    displacement, traction = _surface_fields(n, poisson)
    displacement[n == 0, 1, 0] = 1.0  # ∇1 is no displacement: keeps the matrix invertible
    return np.asarray(traction @ np.linalg.inv(displacement))


def _surface_fields(degree: Array, poisson: complex) -> tuple[Array, Array]:
    """Displacement and traction over μ along x Y and ∇Y of solutions 1 and 3, (k, 2, 2) each."""
    d, nu = degree, poisson
    alpha, unit = d + 5 - 4 * nu, np.ones_like(d)
    radial = d * alpha - 2 * (3 * d + 1 - 2 * nu * (2 * d + 1))  # α d + c
    dilatation = -4 * nu * (d + 1) * (2 * d + 3)  # λ/μ div u
    displacement = np.array([[d, radial], [unit, alpha]])
    traction = np.array(
        [[2 * (d - 1) * d, dilatation + (2 * d + 2) * radial], [2 * (d - 1), radial + d * alpha]]
    )
    return np.moveaxis(displacement, -1, 0), np.moveaxis(traction, -1, 0)
