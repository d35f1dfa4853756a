"""Finite elements on one eighth of the cell against the exact series."""

import numpy as np
import pytest

from alphacut.rve import Phase
from alphacut.rve.mesh.curved import TouchingError
from alphacut.rve.solver.krylov import ConvergenceError
from alphacut.rve.spheres.bounds import bulk_and_shear
from alphacut.rve.spheres.fem import multigrid
from alphacut.rve.spheres.fem.octant import octant
from alphacut.rve.spheres.fem.stiffness import OctantCell
from alphacut.rve.spheres.series.stiffness import cubic_stiffness

MATRIX = Phase(20e9)


def exact(radius, matrix, inclusion):
    cell = cubic_stiffness([radius], matrix, [inclusion])
    return np.array([cell.bulk[0, 0], cell.deviator[0, 0], cell.shear[0, 0]])


def test_homogeneous_cell_is_the_matrix():
    bulk, shear = bulk_and_shear(MATRIX)
    found = OctantCell(0.5, size=0.6).solve(MATRIX, MATRIX)
    np.testing.assert_allclose(found.moduli, [bulk, shear, shear], rtol=1e-9)


@pytest.mark.slow
def test_elements_and_series_agree_to_1e_4_in_fourth_order():
    inclusion = Phase(80e9, 0.2)
    reference = exact(0.6, MATRIX, inclusion)
    coarse, fine = (OctantCell(0.6, size=h).solve(MATRIX, inclusion) for h in (0.16, 0.11))
    errors = [abs(found.moduli / reference - 1).max() for found in (coarse, fine)]
    assert errors[1] < 1e-4
    edge = (fine.unknowns / coarse.unknowns) ** (1 / 3)
    assert np.log(errors[0] / errors[1]) / np.log(edge) > 2.7


@pytest.mark.parametrize("size", [0.25, pytest.param(0.09, marks=pytest.mark.slow)])
def test_iterations_hardly_depend_on_mesh_and_contrast(size):
    cell = OctantCell(0.6, size=size)
    for contrast in (1e-2, 1, 1e2):
        counts = cell.solve(MATRIX, Phase(20e9 * contrast)).iterations
        assert min(counts) >= 8
        assert max(counts) <= 16


@pytest.mark.parametrize("radius", [0.1, 0.95])
def test_iterations_are_few_at_small_and_nearly_touching_spheres(radius):
    assert max(OctantCell(radius, size=0.4).solve(MATRIX, Phase(2e12)).iterations) <= 20


def test_no_curved_element_is_folded_on_a_coarse_mesh():
    """At this size Gmsh folds three elements unless the mesh is made finer."""
    reference = exact(0.6, MATRIX, Phase(2e8))
    found = OctantCell(0.6, size=0.4).solve(MATRIX, Phase(2e8))
    assert max(found.iterations) <= 16
    assert (abs(found.moduli / reference - 1) < 4e-3).all()


def test_an_iteration_that_does_not_converge_is_an_error(monkeypatch):
    monkeypatch.setattr(multigrid, "_MOST", 3)
    with pytest.raises(ConvergenceError, match=r"end after 3 iterations .* take --method series"):
        OctantCell(0.6, size=0.6).solve(MATRIX, Phase(80e9))


def test_meshes_out_of_range_are_refused():
    with pytest.raises(ValueError, match=r"the radius is 1\.2"):
        octant(1.2, size=0.2)
    with pytest.raises(ValueError, match="the mesh size is 2"):
        octant(0.5, size=2)
    with pytest.raises(TouchingError, match=r"meshes of spheres end at 0\.97"):
        octant(0.99, size=0.2)
