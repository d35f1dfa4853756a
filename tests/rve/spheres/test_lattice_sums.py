from itertools import product

import numpy as np
import pytest

from alphacut.rve.spheres.lattice_sums import harmonics, lattice_sums


def test_sums_of_rayleigh():
    """Rayleigh (1892) summed Y_4 over the cube: 3.108; Σ P^-n of the six nearest at high n."""
    harmonic, _ = lattice_sums(60)
    assert harmonic[4, 0] == pytest.approx(3.1082, abs=5e-5)
    assert harmonic[60, 0] == pytest.approx(
        2 + 4 * harmonics(np.eye(3)[:1], 60, 0)[60, 0], rel=1e-8
    )


def test_ewald_sums_agree_with_direct_ones():
    points = np.array([p for p in product(range(-9, 10), repeat=3) if 0 < np.dot(p, p) <= 81.0])
    radius = np.linalg.norm(points, axis=1)
    harmonic, biharmonic = lattice_sums(44)
    for order in (0, 4, 8, 12):
        angular = harmonics(points.astype(float), 44, order)
        for n in (12, 16, 22, 40, 42):
            assert harmonic[n, order] == pytest.approx(angular[n] @ radius ** (-n - 1.0), abs=1e-10)
            assert biharmonic[n, order] == pytest.approx(angular[n] @ radius ** (1.0 - n), abs=1e-9)
