"""An interphase around the particle: against cells without it, thin limits, and proved bounds."""

import numpy as np
import pytest

pytest.importorskip("alphacut.rve.fenicsx")

from alphacut.fuzzy.refused import RefusedError
from alphacut.rve import Ellipse, Interphase, MeshModel, Phase, PrismModel, SeriesModel, SlicesModel
from alphacut.rve.mesh.file import write
from alphacut.stochastic import HermiteMap

SOFT, HARD, RING = Phase(20e9), Phase(80e9), Phase(40e9, 0.25)
CONE, STRAIGHT = HermiteMap(0.2, 0.1, 0.7, 0.1), HermiteMap(0.5, 0, 0.5, 0)


def by_slices(thickness, phase=RING, **options):
    return SlicesModel(**options).solve(STRAIGHT, SOFT, [HARD], Interphase(thickness, phase))[0]


@pytest.mark.parametrize(("phase", "name"), [(SOFT, "matrix"), (HARD, "inclusion")])
def test_a_ring_of_its_neighbour_is_the_cell_of_two_phases_on_the_same_mesh(tmp_path, phase, name):
    model = PrismModel(0.5, 4, stiffness=True, estimate=False)
    ring = Interphase(0.1, phase)
    result = model.solve(CONE, SOFT, [HARD], ring)[0]
    grid = model.problem(CONE, ring.thickness).grid
    two = np.where(grid.phase == 2, grid.names.index(name), grid.phase)
    points = grid.positions(CONE, ring.thickness)
    write(tmp_path / "two.msh", points, grid.cells, two, grid.names[:2])
    phases = {"matrix": SOFT, "inclusion": HARD}
    right = MeshModel(tmp_path / "two.msh").solve(CONE.distribution, phases)[0]
    assert result.modulus == pytest.approx(right.modulus, rel=1e-10)
    assert result.stiffness == pytest.approx(right.stiffness, rel=1e-9, abs=1.0)


def test_a_ring_of_the_particles_material_is_a_larger_particle():
    exact = SeriesModel().solve(HermiteMap(0.6, 0, 0.6, 0), SOFT, [HARD])[0]
    result = by_slices(0.1, HARD, points=2)
    assert abs(result.modulus / exact.modulus - 1) <= result.estimated_error < 1e-6


def test_the_effect_of_a_thin_ring_is_linear_in_its_thickness():
    bare = SeriesModel().solve(STRAIGHT, SOFT, [HARD])[0].modulus
    slopes = [(by_slices(t, points=2).modulus - bare) / t for t in (1e-2, 1e-3, 1e-4)]
    assert slopes == pytest.approx([slopes[-1]] * 3, rel=0.05)
    assert abs(slopes[1] / slopes[2] - 1) < 0.2 * abs(slopes[0] / slopes[2] - 1)


def test_wedges_agree_with_slices_over_the_cone():
    ring = Interphase(0.05, RING)
    result = PrismModel(0.4, 4).solve(CONE, SOFT, [HARD], ring)[0]
    exact = SlicesModel(mesh_size=0.3, points=6).solve(CONE, SOFT, [HARD], ring)[0]
    assert abs(result.modulus / exact.modulus - 1) <= result.estimated_error < 2e-3
    assert exact.estimated_error < 1e-5
    assert result.energies.values.shape == (3, 2, 3)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Interphase(5e-5, RING), "thickness of the interphase is 5e-05"),
        (lambda: by_slices(0.5), "radius is 1"),
        (lambda: PrismModel(0.5, 2).solve(STRAIGHT, SOFT, [HARD], Interphase(0.5, RING)), "radius is 1"),
        (lambda: by_slices(0.1, Phase(1e9, 0.48)), "Poisson's ratio is 0.48"),
        (lambda: by_slices(0.1, outline=Ellipse(2)), "round particles"),
    ],
)  # fmt: skip
def test_rings_that_cannot_be_are_refused(make, message):
    with pytest.raises(RefusedError, match=message):
        make()


@pytest.mark.parametrize("thickness", [1e-4, 1e-2, 0.3])
def test_coarse_meshes_of_thin_rings_do_not_fold(thickness):
    ring = Interphase(thickness, RING)
    fine = by_slices(thickness, points=2).modulus
    coarse = PrismModel(0.7, 2, estimate=False).solve(STRAIGHT, SOFT, [HARD], ring)[0].modulus
    assert coarse == pytest.approx(fine, rel=0.01)
