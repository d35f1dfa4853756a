"""One elastic sphere in a matrix: singular amplitudes from those of the regular field around it.

On |x| = 1 the Lamé solutions 1 and 3 of `translation` have displacements and tractions along x Y
and ∇Y (Y the spherical harmonic), solution 2 along x × ∇Y alone; continuity of both leaves 2 × 2
systems for each degree, whatever the order m.
"""

from __future__ import annotations

import numpy as np

from alphacut.fuzzy.arrays import Array
from alphacut.rve.cell import Phase


def scattering(degrees: Array, matrix: Phase, inclusion: Phase) -> tuple[Array, Array]:
    """Singular per regular amplitudes of a sphere of radius 1.

    Args:
        degrees: n, shape (k,).
        matrix: Material outside.
        inclusion: Material inside; its modulus may be so low or high that it is a pore or rigid.

    Returns:
        Of solutions 1 and 3, shape (k, 2, 2), and of solution 2, shape (k,).
    """
    n = np.asarray(degrees, float)
    ratio = float(inclusion.bulk_and_shear[1] / matrix.bulk_and_shear[1])
    soft, stiff = 1 / (1 + ratio), ratio / (1 + ratio)  # of one scale, pores and rigid alike
    stiffness = _surface_stiffness(n, inclusion.poisson)

    def unbalanced(degree: Array) -> Array:
        moved, pulled = _on_sphere(degree, matrix.poisson)
        return soft * pulled - stiff * stiffness @ moved

    singular, regular = unbalanced(-n - 1), -unbalanced(n)
    centre = n == 0  # one solution each, radial: 1 outside, 3 inside
    singular[centre, :, 1], singular[centre, 1, :] = 0.0, 0.0
    singular[centre, 1, 1], regular[centre, 1, :] = 1.0, 0.0
    balance = np.where(centre, 1.0, (n + 2) * soft + (n - 1) * stiff)  # degree 0 has no torsion
    torsion = np.where(centre, 0.0, (n - 1) * (soft - stiff) / balance)
    return np.asarray(np.linalg.solve(singular, regular)), np.asarray(torsion)


def _surface_stiffness(n: Array, poisson: float) -> Array:
    """Traction over μ from displacement of the surface of a solid sphere, shape (k, 2, 2)."""
    moved, pulled = _on_sphere(n, poisson)
    centre = n == 0
    moved[centre, 1, 0] = 1.0  # ∇1 is no displacement
    return np.asarray(pulled @ np.linalg.inv(moved))


def _on_sphere(degree: Array, poisson: float) -> tuple[Array, Array]:
    """Displacement and traction over μ on |x| = 1 of h of a degree.

    Returns:
        Shape (k, 2, 2) each: along x Y and ∇Y, by solutions 1 and 3.
    """
    d, nu = degree, poisson
    alpha, unit = d + 5 - 4 * nu, np.ones_like(d)
    radial = d * alpha - 2 * (3 * d + 1 - 2 * nu * (2 * d + 1))  # α d + c
    dilating = -4 * nu * (d + 1) * (2 * d + 3)  # λ/μ div u
    moved = np.array([[d, radial], [unit, alpha]])
    pulled = np.array(
        [[2 * (d - 1) * d, dilating + (2 * d + 2) * radial], [2 * (d - 1), radial + d * alpha]]
    )
    return np.moveaxis(moved, -1, 0), np.moveaxis(pulled, -1, 0)
