"""Field of the series on the faces of the cell: what periodicity and symmetry ask of it."""

import numpy as np
import pytest

from alphacut.rve import Phase
from alphacut.rve.spheres.series import stiffness as series
from alphacut.rve.spheres.series.lattice_sums import harmonics
from alphacut.rve.spheres.series.translation import Multipoles, couplings

MATRIX, DEGREE, RADIUS = Phase(3.0, 0.2), 40, 0.7


def amplitudes(inclusion, *, shear):
    """Regular and singular amplitudes (N, loads) in the matrix, at r = 1 scale of `couplings`."""
    poles = Multipoles.of(DEGREE, shear=shear)
    inward, outward = (RADIUS**power for power in series._powers(poles))
    images = couplings(DEGREE, MATRIX.poisson, shear=shear)
    spheres = series.scatterers(DEGREE, MATRIX, inclusion, shear=shear)
    far = np.zeros((poles.n.size, 1))
    far[poles.place(1, 2, 2 if shear else 0)] = 1.0
    scaled = images * inward[:, None] * outward
    singular = outward[:, None] * np.linalg.solve(
        np.eye(poles.n.size) - spheres.answer(scaled), spheres.answer(inward[:, None] * far)
    )
    return poles, far + images @ singular, singular


def solid(points, n, m, *, inside, imaginary):
    """One real solid harmonic of Racah's at points (k, 3)."""
    turned = points  # sin mφ = cos (mφ − π/2): seen in axes turned by π/2m
    radius = np.linalg.norm(points, axis=1)
    if imaginary:
        angle = -np.pi / (2 * m)
        c, s = np.cos(angle), np.sin(angle)
        turned = points @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1.0]])
    return harmonics(turned, n, m)[n] * radius ** (n if inside else -n - 1.0)


def displacement(points, poles, regular, singular, *, shear):
    """Sum of all Lamé solutions at points (k, 3)."""
    total = np.zeros_like(points)
    nu, square = MATRIX.poisson, (points**2).sum(axis=1)[:, None]
    for inside, values in ((True, regular), (False, singular)):
        for n, m, kind, value in zip(poles.n, poles.m, poles.kind, values[:, 0], strict=True):
            if abs(value) * 1.8**n < 1e-13 and inside:
                continue
            d = n if inside else -n - 1
            # f^m ± f^-m: 2 cos mφ or 2i sin mφ; i x × ∇ turns one into the other
            imaginary = (kind == 2) != shear
            factor = 1.0 if m == 0 else 2.0
            factor *= -1.0 if kind == 2 and not shear else 1.0

            def h(x, n=n, m=m, inside=inside, imaginary=imaginary):
                return solid(x, n, m, inside=inside, imaginary=imaginary)

            gradient = np.zeros_like(points)
            for axis, step in enumerate(np.eye(3)):
                for size, weight in ((1, 8 / 12), (2, -1 / 12)):
                    e = 2e-3 * size * step
                    gradient[:, axis] += weight * (h(points + e) - h(points - e)) / 2e-3
            if kind == 1:
                field = gradient
            elif kind == 2:
                field = np.cross(points, gradient)
            else:
                c = -2 * (3 * d + 1 - 2 * nu * (2 * d + 1))
                field = (d + 5 - 4 * nu) * square * gradient + c * points * h(points)[:, None]
            total += factor * value * field
    return total


@pytest.mark.slow
@pytest.mark.parametrize("inclusion", [Phase(40.0, 0.35), Phase(0.01, 0.1)])
def test_faces_of_the_cell_stay_planes(inclusion):
    """Under axial strain a face moves as one; it would not if any coupling were wrong."""
    spots = np.array([[1, 0, 0], [1, 0.3, 0.2], [1, -0.4, 0.1], [1, 0.2, 0.5]])
    poles, regular, singular = amplitudes(inclusion, shear=False)
    side = displacement(spots, poles, regular, singular, shear=False)
    top = displacement(spots[:, [1, 2, 0]], poles, regular, singular, shear=False)
    # unit amplitude of ∇ĝ_2^0: ε33 = 2, ε11 = ε22 = −1
    np.testing.assert_allclose(side[:, 0], -1, atol=2e-7)
    np.testing.assert_allclose(top[:, 2], 2, atol=2e-7)


@pytest.mark.slow
def test_faces_under_shear_glide_as_one():
    """Under ε12 the face x1 = 1 has u2 constant and u3 = 0, the face x3 = 1 has u3 = 0."""
    spots = np.array([[1, 0, 0], [1, 0.3, 0.2], [1, -0.4, 0.1], [1, 0.2, 0.5]])
    poles, regular, singular = amplitudes(Phase(40.0, 0.35), shear=True)
    side = displacement(spots, poles, regular, singular, shear=True)
    top = displacement(spots[:, [1, 2, 0]], poles, regular, singular, shear=True)
    np.testing.assert_allclose(side[:, 1], side[0, 1], atol=2e-7)
    np.testing.assert_allclose(side[:, 2], 0, atol=2e-7)
    np.testing.assert_allclose(top[:, 2], 0, atol=2e-7)
    assert abs(side[0, 1]) > 0.5
