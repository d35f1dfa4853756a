import numpy as np
import pytest

from alphacut.stochastic.particles.radius_laws import LogNormalRadii
from alphacut.stochastic.spheres.packing import SpherePacking
from alphacut.stochastic.spheres.spheres import Spheres
from benchmarks.rve.voxels.voxels import voxels_of


def test_volume_is_exact_whatever_the_grid():
    packing = SpherePacking(20, 0.3, LogNormalRadii(1e-3, 1e-2)).make(np.random.default_rng(4))
    for grid in (9, 21):
        voxels = voxels_of(packing, grid)
        assert voxels.fraction.mean() == pytest.approx(0.3, rel=1e-12)
        assert 0 <= voxels.fraction.min() <= voxels.fraction.max() <= 1


def test_shares_and_normals_are_those_of_fine_points():
    rng = np.random.default_rng(7)
    centre, radius = rng.uniform(0, 1, 3), 0.31
    voxels = voxels_of(Spheres(centre[None], np.array([radius]), 1.0), 9)
    inner = (np.arange(9 * 10) + 0.5) / (9 * 10)
    away = np.stack(np.meshgrid(*(inner - c for c in centre), indexing="ij"))
    away -= np.round(away)
    inside = (np.linalg.norm(away, axis=0) < radius).reshape(9, 10, 9, 10, 9, 10)
    np.testing.assert_allclose(voxels.fraction, inside.mean(axis=(1, 3, 5)), atol=0.04)
    middles = away.reshape(3, 9, 10, 9, 10, 9, 10).mean(axis=(2, 4, 6)).reshape(3, -1)
    outward = (middles / np.linalg.norm(middles, axis=0))[:, voxels.mixed].T
    assert ((outward * voxels.normals).sum(axis=1) > 0.97).mean() > 0.95


@pytest.mark.parametrize(("grid", "words"), [(8, "8 voxels along an edge"), (1, "odd number")])
def test_a_grid_that_is_even_or_too_small_is_refused(grid, words):
    with pytest.raises(ValueError, match=words):
        voxels_of(Spheres(np.full((1, 3), 0.5), np.array([0.3]), 1.0), grid)


def test_a_sphere_wider_than_its_cube_is_refused():
    with pytest.raises(ValueError, match="wider than its periodic cube"):
        voxels_of(Spheres(np.full((1, 3), 0.5), np.array([0.6]), 1.0), 5)
