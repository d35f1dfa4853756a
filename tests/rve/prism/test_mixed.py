"""Nearly incompressible phases of the product space: no locking, no more iterations."""

import numpy as np
import pytest

pytest.importorskip("dolfinx")

from alphacut.rve.cell import Phase
from alphacut.rve.prism.mixed_element import mixed_elements, split_bulk
from alphacut.rve.prism.model import PrismModel
from alphacut.rve.series.model import SeriesModel
from alphacut.stochastic import HermiteMap

PAPER = HermiteMap(0.1337, 0.1, 0.8663, 0.1692)
CURVED = np.array([[[0, 0], [1, 0.1], [0.2, 0.9], [0.5, 0.12], [0.1, 0.45], [0.62, 0.5]]])


def errors_and_iterations(poissons, **options):
    phases = Phase(20e9, poissons[0]), [Phase(80e9, poissons[1])]
    result = PrismModel(mesh_size=0.2, **options).solve(PAPER, *phases)[0]
    exact = SeriesModel(accuracy=1e-9).solve(PAPER, *phases)[0].curve.mean
    return np.array(result.curve.mean) / exact - 1, max(result.iterations)


@pytest.fixture(scope="module")
def ordinary():
    return errors_and_iterations((0.3, 0.3))


@pytest.mark.parametrize("poissons", [(0.4999, 0.4999), (0.4999, 0.2), (0.2, 0.4999)])
def test_neither_errors_nor_iterations_grow_towards_incompressibility(poissons, ordinary):
    errors, iterations = errors_and_iterations(poissons)
    assert abs(errors).max() < 4 * abs(ordinary[0]).max()  # quadratic triangles: 26 times
    assert iterations <= 2 * ordinary[1]  # without pressures of their own: 25 times


@pytest.mark.parametrize("poisson", [0.46, 0.4999, 0.499999])
def test_a_homogeneous_cell_returns_its_material(poisson):
    material = Phase(20e9, poisson)
    result = PrismModel(mesh_size=0.4, layers=3, stiffness=True).solve(PAPER, material, [material])
    assert result[0].stiffness == pytest.approx(material.stiffness, rel=1e-8, abs=20)


def test_a_direct_solver_gives_the_same():
    phases = Phase(20e9, 0.4999), [Phase(20e12, 0.48)]
    model = {"mesh_size": 0.4, "layers": 3}
    first, second = (
        PrismModel(solver=name, **model).solve(PAPER, *phases)[0] for name in ("theta", "mumps")
    )
    assert first.modulus == pytest.approx(second.modulus, rel=1e-8)
    assert first.reason == ""  # nothing gave way to it


def test_stresses_at_nodes_follow_the_series():
    from alphacut.rve.cell import LOADS
    from alphacut.rve.prism.model import _system, reference_radius, triangulate
    from alphacut.rve.prism.task import PrismTask, Stopwatch
    from alphacut.rve.series.field import SeriesField
    from alphacut.rve.solver.options import SolverOptions

    crisp, phases = HermiteMap(0.5, 0, 0.5, 0), (Phase(20e9, 0.4999), Phase(80e9, 0.3))
    system = _system(triangulate(size=0.15, radius=reference_radius(crisp)), 1, False)
    system.move(crisp)
    solved = PrismTask(system, SolverOptions(), LOADS, Stopwatch()).solve(phases)
    centre = np.array([[1 / 3, 1 / 3, 0.0], [1 / 3, 1 / 3, 1.0]])
    stress = system.stress(solved.total, phases, centre, solved.pressure)[:, 0]
    corners = system.positions[system.grid.cells[:, [0, 1, 2]]][..., :2]
    inside = system.grid.plane.inside
    exact = SeriesField(0.5, *phases).stress(corners.mean(axis=1), LOADS[1], inside=inside)
    apart = np.linalg.norm(stress[..., 1] - exact) / np.linalg.norm(exact)
    assert apart < 0.05


def test_an_element_carries_uniform_strain_and_does_not_stiffen_with_its_bulk_modulus():
    nodes = CURVED[0]
    strained = np.stack([nodes[:, 0] * 2 + nodes[:, 1], nodes[:, 1] * 3 - nodes[:, 0]], axis=-1)
    turned = np.stack([1 - nodes[:, 1], 2 + nodes[:, 0]], axis=-1).ravel()
    for poisson in (0.2, 0.4999, 0.4999999):
        phase = Phase(1.0, poisson)
        element = mixed_elements(CURVED, phase)
        u, area = strained.ravel(), element.area[0]
        assert abs(element.stiffness[0] @ turned).max() < 1e-12
        assert element.strain[0] @ u == pytest.approx(np.array([2, 3, 0]) * area, abs=1e-13)
        energy = (
            u @ element.stiffness[0] @ u + split_bulk(phase)[2] * (element.flux[0] @ u) ** 2 / area
        )
        assert energy == pytest.approx(area * np.array([2, 3, 0]) @ phase.stiffness @ [2, 3, 0])
        assert np.linalg.eigvalsh(element.stiffness[0])[-1] < 40


def test_a_level_without_factors_gives_way_to_a_direct_solver():
    bent = HermiteMap(0.126375, 0.0353527, 0.966353, -0.311758)
    phases = Phase(20e9, 0.49966), [Phase(1.37e13, 0.49984)]
    result = PrismModel(mesh_size=0.432, layers=2).solve(bent, *phases)[0]
    assert "a level's factors have a pivot of the wrong sign" in result.reason
    assert result.solver == "mumps"
