"""Guaranteed bounds of meshes of one's own, from displacements and stresses in equilibrium."""

from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("alphacut.rve.fenicsx")

from alphacut.fuzzy import FailedError, RefusedError
from alphacut.rve import MeshModel, Phase, PrismModel, SeriesModel, VoigtPhase
from alphacut.rve.mesh.file import write
from alphacut.rve.mesh.wedge import vertices_and_midpoints
from alphacut.rve.prism import mesh_bounds as module
from alphacut.rve.prism.mesh_bounds import ROTATION, mesh_bounds
from alphacut.rve.prism.problem import PrismProblem
from alphacut.rve.prism.stress_functions import solved_fields_of_bounds
from alphacut.rve.prism.theta_means import mean_over_theta
from alphacut.rve.solver.krylov import ConvergenceError, SolverOptions
from alphacut.stochastic import HermiteMap, TruncatedNormal
from benchmarks.rve.mesh_bounds import work_of_stresses
from tests.rve.prism.test_own_mesh import write_lattice

MESHES = Path(__file__).parents[3] / "meshes"
LAW = TruncatedNormal(-3.0, 3.0)
SOFT, HARD = Phase(20e9, 0.2), Phase(80e9, 0.3)
TURNED = VoigtPhase(((60e9, 8e9, 3e9), (8e9, 18e9, 2e9), (3e9, 2e9, 7e9)))


def excess(larger, smaller):
    """Smallest eigenvalue of a difference over the largest entry."""
    return np.linalg.eigvalsh(larger - smaller)[0] / abs(larger).max()


@pytest.mark.parametrize(
    ("name", "phases", "falls_to"),
    [
        ("two-particles", {"matrix": HARD, "particles": SOFT}, 1 / 8),
        pytest.param(
            "ring",
            {"matrix": SOFT, "ring": TURNED, "particle": HARD},
            1 / 8,
            marks=pytest.mark.slow,
        ),
        pytest.param(
            "paper-coarse",
            {"matrix": SOFT, "inclusion": Phase(2e12)},
            1 / 4,
            marks=pytest.mark.slow,
        ),
    ],
)
def test_bounds_of_a_refined_mesh_lie_within_those_of_the_mesh(name, phases, falls_to):
    model = MeshModel(MESHES / f"{name}.msh")
    coarse = model.bounds(LAW, phases)
    fine = replace(model, refine=True).bounds(LAW, phases)
    assert excess(coarse.upper, fine.upper) > -1e-8
    assert excess(fine.lower, coarse.lower) > -1e-8
    assert excess(fine.upper, fine.lower) > 0
    assert fine.width < falls_to * coarse.width


def structured(path, *, count, layers, phase_of, move):
    """Write a square of 2 count² triangles, extruded, with nodes moved along x2 by a function.

    Args:
        phase_of: Phase of a triangle by its centre (x1, x2).
        move: Takes x1, x2 and θ of nodes, gives what x2 grows by.
    """
    pytest.importorskip("gmsh")  # which writes the file
    x, y, z = vertices_and_midpoints().T
    barycentric = np.stack([1 - x - y, x, y], axis=1)
    corners = []
    for i, j in np.ndindex(count, count):
        square = np.array([[i, j], [i + 1, j], [i + 1, j + 1], [i, j + 1]])
        corners += [square[[0, 1, 2]], square[[0, 2, 3]]]
    corners = 2 * np.array(corners) / count - 1
    phase = [phase_of(*centre) for centre in corners.mean(axis=1)]
    plane = barycentric @ corners
    prisms = []
    for layer in range(layers):
        theta = np.broadcast_to(6 * (layer + z) / layers - 3, plane.shape[:2])
        prisms.append(np.concatenate([plane, theta[..., np.newaxis]], axis=-1))
    nodes = np.concatenate(prisms).reshape(-1, 3).round(9)
    points, cells = np.unique(nodes, axis=0, return_inverse=True)
    points[:, 1] += move(*points.T)
    write(path, points, cells.reshape(-1, 15), np.tile(phase, layers), ("soft", "hard"))
    return path


@pytest.mark.parametrize("amplitude", [0.0, 0.08])
def test_a_laminate_has_its_own_stiffness(tmp_path, rng, amplitude):
    """Its fields are linear in each phase, so that both bounds are exact, of bent columns too."""
    shift = rng.uniform(0, 6)

    def move(x, y, theta):
        return amplitude * np.sin(np.pi * y) * np.cos(np.pi * x + theta + shift)

    path = structured(
        tmp_path / "laminate.msh",
        count=4,
        layers=2,
        phase_of=lambda x, _: abs(x) < 0.5,
        move=move,
    )
    bounds = MeshModel(path).bounds(LAW, {"soft": SOFT, "hard": TURNED})
    # (σ11, ε22, σ12) is the same in both phases; means of the mixed form of Hooke's law.
    mixed = np.zeros((3, 3))
    across, along = [0, 2], [1]
    for stiffness in (SOFT.stiffness, TURNED.stiffness):
        inverse = np.linalg.inv(stiffness[np.ix_(across, across)])
        coupling = inverse @ stiffness[np.ix_(across, along)]
        mixed[np.ix_(across, across)] += inverse / 2
        mixed[np.ix_(across, along)] -= coupling / 2
        rest = stiffness[np.ix_(along, across)] @ coupling
        mixed[np.ix_(along, along)] += (stiffness[np.ix_(along, along)] - rest) / 2
    exact = np.zeros((3, 3))
    inverse = np.linalg.inv(mixed[np.ix_(across, across)])
    coupling = -inverse @ mixed[np.ix_(across, along)]
    exact[np.ix_(across, across)] = inverse
    exact[np.ix_(across, along)] = coupling
    exact[np.ix_(along, across)] = coupling.T
    exact[np.ix_(along, along)] = mixed[np.ix_(along, along)] + coupling.T @ np.linalg.solve(
        inverse, coupling
    )
    assert excess(bounds.upper, exact) > 0
    assert excess(exact, bounds.lower) > 0
    assert abs(bounds.upper - bounds.lower).max() < 1e-5 * exact.max()


@pytest.mark.usefixtures("read_here")
def test_a_phase_of_very_unlike_directions_is_inside(tmp_path, rng):
    """Of a homogeneous cell, by exact sums of its energies along soft directions."""
    ratio = 10 ** rng.uniform(9, 10)
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    stiffness = (np.array([1e9, 1e9, 1e9 * ratio]) * turn) @ turn.T
    stiffness = (stiffness + stiffness.T) / 2
    phase = VoigtPhase(tuple(map(tuple, stiffness.tolist())))

    def move(x, y, theta):
        return 0.05 * np.sin(np.pi * y) * np.cos(np.pi * x + theta)

    path = structured(
        tmp_path / "one.msh", count=4, layers=1, phase_of=lambda x, _: abs(x) < 0.5, move=move
    )
    try:
        bounds = MeshModel(path).bounds(LAW, {"soft": phase, "hard": phase})
    except ConvergenceError:  # a system of such entries may be beyond the solver
        return
    vectors = np.linalg.eigh(stiffness)[1]
    for vector in vectors.T[:2]:
        energies = []
        for matrix in (bounds.lower, phase.stiffness, bounds.upper):
            terms = np.multiply.outer(vector, vector).ravel().tolist()
            pairs = zip(map(Fraction, matrix.ravel().tolist()), map(Fraction, terms), strict=True)
            energies.append(sum(entry * term for entry, term in pairs))
        assert energies[0] <= energies[1] <= energies[2]


@pytest.mark.parametrize("change", ["scaled", "reversed", "other"])
def test_a_distribution_function_that_is_not_the_integral_of_its_density_is_refused(change):
    class Wrong:
        lower, upper = -3.0, 3.0
        pdf = staticmethod(LAW.pdf)
        quantile = staticmethod(LAW.quantile)

        def cdf(self, theta):
            right = np.asarray(LAW.cdf(theta))
            return {"scaled": right / 2, "reversed": 1 - right, "other": right**1.01}[change]

    phases = {"matrix": SOFT, "inclusion": HARD}
    with pytest.raises(RefusedError, match="distribution function of θ"):
        MeshModel(MESHES / "paper-coarse.msh").bounds(Wrong(), phases)


@pytest.mark.parametrize("lattice", ["square", "hexagonal", [1.0, 1.2]])
def test_bounds_of_a_cone_hold_the_series(lattice):
    """Of the mesh of a map, whose radii are those of the cone at the levels."""
    radii = HermiteMap(0.3, 0.0, 0.6, 0.0, LAW)
    problem = PrismModel(0.25, 4, lattice=lattice).problem(radii)
    bounds = mesh_bounds(problem, [SOFT.stiffness, HARD.stiffness], SolverOptions())
    [series] = SeriesModel(lattice=lattice).solve(radii, SOFT, [HARD])
    assert excess(bounds.upper, series.stiffness) > 0
    assert excess(series.stiffness, bounds.lower) > 0
    assert bounds.width < 5e-3


def test_a_hexagonal_array_in_a_rhombus_is_transversely_isotropic(tmp_path, gmsh):
    path = tmp_path / "cell.msh"
    write_lattice(gmsh, path, [(1, 0), (0.5, np.sqrt(3) / 2)], radius=0.3)
    bounds = MeshModel(path).bounds(LAW, {"matrix": SOFT, "fibre": HARD})
    middle = (bounds.upper + bounds.lower) / 2
    half = abs(bounds.upper - bounds.lower).sum(axis=1).max() / 2
    assert half < 3e-3 * middle.max()
    assert abs(middle[0, 0] - middle[0, 1] - 2 * middle[2, 2]) < 4 * half


def random_field(problem, rng):
    """A periodic field at the nodes of prisms, shape (prisms, 15, 2)."""
    vector = problem.matrix.createVecRight()
    vector.array[:] = rng.normal(size=vector.local_size)
    return problem.elimination.displacements(vector)[problem.space.dofmap.list]


@pytest.mark.parametrize("name", ["ring", "paper-coarse"])
def test_stresses_are_in_equilibrium_at_each_theta(name, rng):
    """They do no work in random displacements of a slice, by a quadrature of their own."""
    phases = {"matrix": SOFT, "ring": HARD, "particle": TURNED, "inclusion": HARD}
    model = MeshModel(MESHES / f"{name}.msh")
    named = {key: phases[key] for key in model.cached_problem().grid.names}
    assert work_of_stresses(model, named, rng) < 1e-12


@pytest.fixture(scope="module")
def two_particles():
    """A model, its phases and bounds of good fields."""
    model, phases = (
        MeshModel(MESHES / "two-particles.msh"),
        {"matrix": SOFT, "particles": Phase(400e9, 0.2)},
    )
    return model, phases, model.bounds(LAW, phases)


@pytest.mark.parametrize(("scale", "noise"), [(1.0, 1e-4), (1e4, 1e-4), (1e-4, 0.0)])
def test_any_fields_give_bounds(two_particles, rng, monkeypatch, scale, noise):
    """Displacements that are none, and stresses that fit them but need not be symmetric."""
    model, phases, good = two_particles
    slice_strains = PrismProblem.slice_strains

    def forgotten_after_the_mean(self, strains, fluctuations):
        means = slice_strains(self, strains, fluctuations)
        for vector in fluctuations:
            vector.zeroEntries()
        return means

    def poor_fields(problem, stiffness, *, rotation_factor, options):
        fields = solved_fields_of_bounds(
            problem, stiffness, rotation_factor=rotation_factor * scale, options=options
        )
        waves = noise * np.stack([random_field(problem, rng) for _ in range(3)], axis=-1)
        return replace(
            fields,
            displacement=fields.displacement + waves,
            potential=fields.potential + 20e9 * waves,
        )

    monkeypatch.setattr(PrismProblem, "slice_strains", forgotten_after_the_mean)
    monkeypatch.setattr(module, "solved_fields_of_bounds", poor_fields)
    bounds = model.bounds(LAW, phases)
    assert excess(bounds.upper, good.upper) > 0
    assert excess(good.lower, bounds.lower) > 0
    if scale < 1:  # such a stress is nearer than any that is symmetric
        monkeypatch.setattr(module, "mean_over_theta", without_asymmetry)
        assert excess(good.lower, model.bounds(LAW, phases).lower) < 0


def without_asymmetry(law, low, high, energies):
    """The means of the products of `Energies` with hardly any of the asymmetry."""
    return mean_over_theta(law, low, high, energies * np.reshape([1, 1, 1, 1e-9], (4, 1, 1)))


def test_rotations_are_bounded_by_strains(rng):
    """Korn's inequality of periodic fields, by two waves in a lattice that is not square."""
    reciprocal = np.linalg.inv(rng.normal(size=(2, 2)))
    means = np.zeros(2)
    for wave in rng.integers(-3, 4, (20, 2)):
        k = reciprocal @ wave
        gradient = np.outer(rng.normal(size=2) + 1j * rng.normal(size=2), k)
        strain = np.array([gradient[0, 0], gradient[1, 1], gradient[0, 1] + gradient[1, 0]])
        means += (
            (strain.conj() @ ROTATION @ strain).real,
            abs(gradient[0, 1] - gradient[1, 0]) ** 2 / 2,
        )
    assert means[0] == pytest.approx(means[1])


def test_middles_at_theta_of_their_own_are_refused(tmp_path):
    def move(*_):
        return 0.0

    path = structured(tmp_path / "a.msh", count=2, layers=1, phase_of=lambda x, _: x > 0, move=move)
    grid = MeshModel(path).cached_problem().grid
    points = grid.fixed.copy()
    points[-1, 2] += 0.2
    write(tmp_path / "b.msh", points, grid.cells, grid.phase, grid.names)
    with pytest.raises(FailedError, match="half-way between two levels"):
        MeshModel(tmp_path / "b.msh").bounds(LAW, {"soft": SOFT, "hard": HARD})
    points = grid.fixed.copy()
    side = np.flatnonzero((abs(points[:, 0] - 1) < 1e-9) & (abs(points[:, 1]) < 1e-9))[-1]
    assert points[side, 2] == 0  # the middle of an edge that is vertical
    points[side, 1] += 0.1
    write(tmp_path / "c.msh", points, grid.cells, grid.phase, grid.names)
    with pytest.raises(FailedError, match="has no partner"):
        MeshModel(tmp_path / "c.msh").bounds(LAW, {"soft": SOFT, "hard": HARD})
