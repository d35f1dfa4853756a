"""Maxima of quadratics over boxes against fine grids, blocks of H singular or not."""

import numpy as np
import pytest

from alphacut.frame.calculus.box_quadratic import gain, global_maximum, local_maximum

LOWER, UPPER = np.array([[-1.0, -1.0, -0.3]]), np.array([[1.0, 2.0, 0.3]])
AXES = [np.linspace(low, high, 25) for low, high in zip(LOWER[0], UPPER[0], strict=True)]
GRID = np.stack(np.meshgrid(*AXES), -1).reshape(-1, 3)
SINGULAR = [np.zeros((3, 3)), np.ones((3, 3)), -np.ones((3, 3)), np.diag([0.0, 1.0, -1.0])]


@pytest.mark.parametrize("seed", range(12))
def test_no_point_of_a_grid_is_higher_than_the_global_maximum(seed: int) -> None:
    rng = np.random.default_rng(seed)
    A = rng.normal(size=(3, 3))
    H = SINGULAR[seed] if seed < len(SINGULAR) else A + A.T
    g = rng.normal(size=(1, 3)) * (seed % 3)
    point = global_maximum(g, H[None], LOWER, UPPER)
    highest = gain(np.repeat(g, len(GRID), 0), np.repeat(H[None], len(GRID), 0), GRID).max()
    assert gain(g, H[None], point)[0] >= highest - 1e-12
    near = local_maximum(g, H[None], LOWER, UPPER)
    assert 0 <= gain(g, H[None], near)[0] <= gain(g, H[None], point)[0] + 1e-12
    assert ((point >= LOWER) & (point <= UPPER) & (near >= LOWER) & (near <= UPPER)).all()
