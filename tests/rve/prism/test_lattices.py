"""Finite elements on hexagons and rectangles, beside the series of the same arrays."""

import numpy as np
import pytest

pytest.importorskip("alphacut.rve.fenicsx")

from alphacut.rve import (
    Ellipse,
    LevelSetModel,
    MeshModel,
    Phase,
    PrismModel,
    SeriesModel,
    SlicesModel,
)
from alphacut.rve.cell.lattice import lattice_of
from alphacut.rve.mesh.columns import extrude
from alphacut.rve.mesh.file import read_grid
from alphacut.rve.mesh.periodicity import unknowns
from alphacut.rve.mesh.prism_grid import nodes_at_radii
from alphacut.stochastic import HermiteMap, TruncatedNormal
from tests.refused import refuses
from tests.rve.prism.test_own_mesh import write_lattice

SOFT, HARD = Phase(20e9), Phase(200e9, 0.2)
RISING = HermiteMap(0.3, 0.1, 0.9, 0.1)
LATTICES = ["hexagonal", [1, 1.8], [2.5, 1]]


def constant(radius):
    return HermiteMap(radius, 0.0, radius, 0.0)


def series(radius_map, lattice, inclusion=HARD):
    return SeriesModel(lattice=lattice).solve(radius_map, SOFT, [inclusion])[0]


@pytest.mark.parametrize("lattice", LATTICES)
@pytest.mark.parametrize("radius", [0.2, 0.7, 0.95])
def test_the_mesh_of_a_cell_is_periodic_at_all_radii(lattice, radius):
    cell = lattice_of(lattice)
    plane = extrude(size=0.4, radius=0.6, layers=1, lattice=cell).plane
    [points] = nodes_at_radii(plane, np.array([radius]))
    assert abs(cell.side_coordinates(points)).max() == pytest.approx(1, abs=1e-12)
    unknown = unknowns(points, cell)
    assert np.array_equal(unknown, unknowns(plane.points, cell))
    # Without corners and pairs there are as many unknowns as nodes.
    on_sides = (abs(abs(cell.side_coordinates(points)) - 1) < 1e-9).sum()
    corners = len(cell.corners)
    classes = 1 if corners == 4 else 2
    inner_of_sides = (on_sides - 2 * corners) // 2
    assert unknown.max() + 1 == len(points) - inner_of_sides - corners + classes - 1
    assert np.hypot(*points[plane.arc].T) == pytest.approx(radius, rel=1e-12)


@pytest.mark.parametrize("lattice", LATTICES)
@pytest.mark.parametrize("radius_map", [constant(0.5), RISING])
def test_slices_and_prisms_are_the_series_within_their_errors(lattice, radius_map):
    exact = series(radius_map, lattice).stiffness
    models = SlicesModel(lattice=lattice, points=4), PrismModel(lattice=lattice, layers=4)
    for model in models:
        [found] = model.solve(radius_map, SOFT, [HARD])
        allowed = found.modulus_errors
        wrong = abs(found.moduli / series(radius_map, lattice).moduli - 1)
        assert (wrong[~np.isnan(wrong)] <= allowed[~np.isnan(allowed)] + 1e-11).all()
        if found.stiffness is not None:
            distance = abs(found.stiffness - exact).diagonal()
            assert (distance <= found.stiffness_errors.diagonal() + 1e-11 * exact[0, 0]).all()
            assert (found.cell.lattice.is_isotropic) == ("isotropy" in found.checks)


@pytest.mark.parametrize("lattice", LATTICES)
def test_errors_of_prisms_and_slices_fall_with_their_order(lattice):
    """Energies converge with twice the order of the elements, here 2 and 4."""
    radius_map = constant(0.6)
    exact = series(radius_map, lattice).moduli

    def error(model):
        [found] = model.solve(radius_map, SOFT, [HARD])
        return abs(found.moduli / exact - 1).max()

    prisms = [
        error(PrismModel(size, 1, stiffness=True, estimate=False, lattice=lattice))
        for size in (0.2, 0.1)
    ]
    assert 2**3 < prisms[0] / prisms[1] < 2**5
    slices = [error(SlicesModel(size, 2, lattice=lattice)) for size in (0.7, 0.35)]
    assert 2**5 < slices[0] / slices[1] < 2**9


def test_a_turned_rectangle_exchanges_its_axes():
    wide, tall = (
        PrismModel(0.3, 2, stiffness=True, estimate=False, lattice=lattice)
        .solve(RISING, SOFT, [HARD])[0]
        .stiffness
        for lattice in ([2, 1], [1, 2])
    )
    order = [1, 0, 2]
    np.testing.assert_allclose(wide, tall[np.ix_(order, order)], rtol=0, atol=2e-4 * wide.max())
    assert abs(wide[0, 0] / wide[1, 1] - 1) > 0.05


@pytest.mark.parametrize("lattice", ["hexagonal", [1, 1.5]])
def test_ellipses_on_lattices_are_alike_by_prisms_and_slices(lattice):
    outline = Ellipse(1.6, 25.0)
    prisms = PrismModel(0.3, 2, outline=outline, lattice=lattice)
    [found] = prisms.solve(constant(0.5), SOFT, [HARD])
    [fine] = SlicesModel(outline=outline, lattice=lattice).solve(constant(0.5), SOFT, [HARD])
    distance = abs(found.stiffness - fine.stiffness).diagonal()
    assert (distance <= 1.001 * found.stiffness_errors.diagonal()).all()
    assert distance.max() < 1e-3 * fine.stiffness[0, 0]
    assert not found.is_of_fibres
    assert abs(found.stiffness[0, 2]) > 1e-3 * found.stiffness[0, 0]


def test_particles_that_do_not_fit_are_refused_with_the_largest_that_do():
    long = Ellipse(3.0, 30.0)  # towards a neighbour of the hexagonal array at 60°
    for model in (SlicesModel, PrismModel):
        with refuses("radius"):
            model(outline=long, lattice="hexagonal").solve(constant(0.8), SOFT, [HARD])
        with refuses("lattice"):
            model(lattice="cubic")


def test_two_particles_in_a_rectangle_are_the_hexagonal_array():
    sides = [1.0, np.sqrt(3)]
    corner = np.array(sides)

    def z(x1, x2, theta):
        at_corner = np.hypot(abs(x1) - corner[0], abs(x2) - corner[1])
        return np.minimum(np.hypot(x1, x2), at_corner) - 0.6

    phases = {"matrix": SOFT, "inclusion": HARD}
    [found] = LevelSetModel(z, 0.1, 1, lattice=sides).solve(TruncatedNormal(), phases)
    right = series(constant(0.6), "hexagonal").stiffness
    np.testing.assert_allclose(found.stiffness, right, rtol=0, atol=0.02 * right[0, 0])
    [same] = LevelSetModel(
        lambda x1, x2, theta: np.hypot(x1, x2) - 0.6, 0.1, 1, lattice="hexagonal"
    ).solve(TruncatedNormal(), phases)
    np.testing.assert_allclose(same.stiffness, right, rtol=0, atol=0.02 * right[0, 0])
    with refuses("lattice"):
        LevelSetModel(z, lattice=[1, 20])


def test_a_rhombus_of_one_s_own_is_the_hexagonal_array(tmp_path, gmsh):
    phases = {"matrix": SOFT, "fibre": HARD}
    write_lattice(gmsh, tmp_path / "rhombus.msh", [(2, 0), (1, np.sqrt(3))], radius=0.6)
    [rhombus] = MeshModel(tmp_path / "rhombus.msh").solve(TruncatedNormal(), phases)
    right = series(constant(0.6), "hexagonal").stiffness
    np.testing.assert_allclose(rhombus.stiffness, right, rtol=0, atol=3e-4 * right[0, 0])


def test_an_exported_hexagon_is_solved_as_a_mesh_of_one_s_own(tmp_path):
    model = PrismModel(0.3, 2, stiffness=True, estimate=False, lattice="hexagonal")
    model.fields(RISING, SOFT, [HARD]).write(tmp_path / "hexagon.msh")
    exported = MeshModel(tmp_path / "hexagon.msh")
    [found] = exported.solve(TruncatedNormal(), {"matrix": SOFT, "inclusion": HARD})
    [own] = model.solve(RISING, SOFT, [HARD])
    scale = own.stiffness[0, 0]
    np.testing.assert_allclose(found.stiffness, own.stiffness, rtol=0, atol=1e-9 * scale)
    phases = {"matrix": SOFT, "inclusion": HARD}
    bounds = exported.bounds(TruncatedNormal(), phases)
    [finer] = MeshModel(tmp_path / "hexagon.msh", refine=True).solve(TruncatedNormal(), phases)
    assert np.linalg.eigvalsh(bounds.upper - finer.stiffness)[0] > 0
    assert np.linalg.eigvalsh(finer.stiffness - bounds.lower)[0] > 0
    lattice = read_grid(tmp_path / "hexagon.msh").plane.lattice
    np.testing.assert_allclose(
        lattice.half_vectors, lattice_of("hexagonal").half_vectors, atol=1e-8
    )


def test_level_sets_and_meshes_of_the_square_array_are_alike_in_any_cell(rng):
    """Two squares side by side, each with its particle, are the square array once more."""
    radius = rng.uniform(0.4, 0.7)
    [double] = LevelSetModel(
        lambda x1, x2, theta: np.hypot(abs(x1) - 1, x2) - radius, 0.1, 1, lattice=[2, 1]
    ).solve(TruncatedNormal(), {"matrix": SOFT, "inclusion": HARD})
    right = series(constant(radius), "square").stiffness
    np.testing.assert_allclose(double.stiffness, right, rtol=0, atol=0.03 * right[0, 0])
