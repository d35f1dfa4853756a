import numpy as np
import pytest

from alphacut.rve import Phase
from alphacut.rve.spheres.bounds import bulk_and_shear
from alphacut.rve.spheres.series.stiffness import cubic_stiffness
from alphacut.stochastic.spheres.spheres import Spheres
from benchmarks.rve.many_random_cells import limit_of_grids
from benchmarks.rve.voxels import stiffness
from benchmarks.rve.voxels.laminate import voxel_stiffness
from benchmarks.rve.voxels.stiffness import stiffness_of
from benchmarks.rve.voxels.voxels import Voxels, voxels_of

MATRIX, STIFF = Phase(20e9), Phase(80e9)


def one(radius, place):
    """The cell of the series, of side 2."""
    return Spheres(np.asarray(place, float)[None], np.array([radius]), 2.0)


def exact(radius, matrix, inclusion):
    cell = cubic_stiffness([radius], matrix, [inclusion])
    return np.array([cell.bulk[0, 0], cell.deviator[0, 0], cell.shear[0, 0]])


def test_homogeneous_cell_is_the_matrix():
    found = stiffness_of(voxels_of(one(0.7, (0.3, 1.1, 0.2)), 9), MATRIX, MATRIX)
    bulk, shear = bulk_and_shear(MATRIX)
    np.testing.assert_allclose(found.moduli, [bulk, shear, shear], rtol=1e-12)


def test_equal_shear_moduli_give_hills_bulk_modulus():
    """Hill (1963), exact on any grid: laminates of such phases are isotropic."""
    shear, bulks, share = 8e9, (12e9, 60e9), np.pi / 6 * 0.7**3
    phases = [
        Phase(9 * k * shear / (3 * k + shear), (3 * k - 2 * shear) / (6 * k + 2 * shear))
        for k in bulks
    ]
    hill = 1 / ((1 - share) / (bulks[0] + 4 / 3 * shear) + share / (bulks[1] + 4 / 3 * shear))
    voxels = voxels_of(one(0.7, (0.3, 1.1, 0.2)), 9)
    found = stiffness_of(voxels, *phases, accuracy=1e-11).moduli
    np.testing.assert_allclose(found, [hill - 4 / 3 * shear, shear, shear], rtol=1e-9)


@pytest.mark.parametrize("share", [0.0, 0.37])
def test_layers_are_a_laminate_of_backus(share):
    """Layers across axis 3, one of them of both phases: C33 and C44 harmonic (Backus 1962)."""
    fraction = np.zeros((3, 3, 3))
    fraction[..., 0], fraction[..., 1] = 1, share
    normals = np.tile([0.0, 0.0, 1.0], (9 if share else 0, 1))
    phases, accuracy = (Phase(20e9), Phase(90e9, 0.1)), 1e-12
    material = voxel_stiffness(Voxels(fraction, normals), *phases)
    space = stiffness.FourierGrid.of(3, 3e9, 7e9)
    total, ends = (1 + share) / 3, [bulk_and_shear(phase) for phase in phases]

    def harmonic(first, second):
        return 1 / ((1 - total) / first + total / second)

    normal = harmonic(*(k + 4 / 3 * g for k, g in ends))
    for strain, modulus in (
        ((0, 0, 1, 0, 0, 0), normal),
        ((0, 0, 0, 0.5, 0, 0), harmonic(*(g for _, g in ends))),
        ((0, 0, 0, 0, 0, 0.5), (1 - total) * ends[0][1] + total * ends[1][1]),
    ):
        energy, _ = stiffness._energy(space, material, np.array(strain, float), accuracy)
        assert energy == pytest.approx(modulus, rel=1e-10)


@pytest.mark.parametrize("inclusion", [STIFF, Phase(4e9, 0.15)])
def test_grids_reach_the_series_within_the_declared_error(inclusion):
    rng = np.random.default_rng(int(inclusion.modulus % 997))
    radii = rng.uniform(0.5, 0.8, 4)
    cells, grids = [one(r, rng.uniform(0, 2, 3)) for r in radii], (9, 13, 17)
    found = [
        [stiffness_of(voxels_of(c, n), MATRIX, inclusion).moduli for n in grids] for c in cells
    ]
    truth = np.mean([exact(r, MATRIX, inclusion) for r in radii], axis=0)
    means = np.mean(found, axis=0)
    limit, declared = limit_of_grids(means, grids)
    errors = abs(means / truth - 1).max(axis=1)
    assert abs(limit / truth - 1).max() <= declared <= 4e-3
    assert errors[2] < 0.5 * errors[0]
    assert abs(limit / truth - 1).max() < 0.7 * errors[2]


def test_the_solver_lacks_no_more_than_it_says():
    sphere = one(0.8, (0.4, 0.9, 1.3))
    rough = stiffness_of(voxels_of(sphere, 7), MATRIX, Phase(20e11), accuracy=0.03)
    fine = stiffness_of(voxels_of(sphere, 7), MATRIX, Phase(20e11), accuracy=1e-10)
    excess = rough.moduli / fine.moduli - 1
    assert (excess >= 0).all()
    assert 1e-6 < excess.max() <= rough.solver_error


def test_a_solver_that_does_not_end_raises(monkeypatch):
    monkeypatch.setattr(stiffness, "LIMIT", 2)
    fraction = np.random.default_rng(1).integers(0, 2, (5, 5, 5)).astype(float)
    with pytest.raises(RuntimeError, match="after 2 iterations: take a lower contrast"):
        stiffness_of(Voxels(fraction, np.zeros((0, 3))), MATRIX, STIFF)


@pytest.mark.parametrize("accuracy", [0, 0.2, np.nan])
def test_an_accuracy_out_of_range_is_refused(accuracy):
    with pytest.raises(ValueError, match=r"it must lie in \(0, 0\.1\]"):
        stiffness_of(voxels_of(one(0.5, (1, 1, 1)), 5), MATRIX, STIFF, accuracy=accuracy)
