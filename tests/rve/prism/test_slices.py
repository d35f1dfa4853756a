"""The form over slices: constraint, operator, loads and means against answers found without it.

The manufactured displacement of (x, y, θ) and the patch test have answers that are not zero. The
homogeneous cell has none: its load vanishes whatever the weight or sign of the form.
"""

from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("alphacut.rve.fenicsx")

from mpi4py import MPI
from petsc4py import PETSc

from alphacut.rve import LOADS, Phase
from alphacut.rve.mesh.columns import extrude
from alphacut.rve.mesh.periodicity import unknowns
from alphacut.rve.mesh.wedge import wedge
from alphacut.rve.prism.problem import PrismProblem
from alphacut.rve.prism.slices import SliceProblem
from alphacut.rve.solver.layers import layer_interpolation
from alphacut.stochastic import HermiteMap

CONE = HermiteMap(0.3, 0.1, 0.6, 0.1)
SOFT, HARD = Phase(20e9), Phase(80e9, 0.2)
NOTHING = np.zeros((3, 3))
AREA = 4.0
THREE_LOADS = np.array([*LOADS, (0.01, -0.01, 0.0)])


def exactly_periodic(grid):
    """Give partners on opposite sides the same coordinate, which Gmsh leaves 3e-13 apart."""
    points, pair = grid.plane.points.copy(), unknowns(grid.plane.points)
    points[abs(abs(points) - 1) < 1e-9] = np.sign(points[abs(abs(points) - 1) < 1e-9])
    for axis in (0, 1):
        for node in np.flatnonzero((points[:, axis] == 1) & (pair >= 0)):
            [partner] = np.flatnonzero((points[:, axis] == -1) & (pair == pair[node]))
            points[node, 1 - axis] = points[partner, 1 - axis]
    return replace(grid, plane=replace(grid.plane, points=points))


@pytest.fixture(scope="module", params=["slices", "prisms"])
def problem(request):
    grid = exactly_periodic(extrude(size=0.15, radius=0.45, layers=6))
    if request.param == "slices":
        one = SliceProblem.of_grid(grid)
        one.mesh.move(CONE)
    else:
        one = PrismProblem(grid, MPI.COMM_SELF)
        one.move(CONE)
    return one


def test_slices_interpolate_as_the_element_of_the_prism_does(rng):
    plane = extrude(size=0.7, radius=0.45, layers=1).plane
    heights = rng.uniform(0, 1, 4)
    matrix = layer_interpolation(plane, heights)
    nodes, vertices = len(plane.points), plane.vertices
    values = rng.standard_normal((2 * nodes + vertices, 2))
    on_slices = (matrix @ values).reshape(4, nodes, 2)
    grid = extrude(size=0.7, radius=0.45, layers=1)
    # the grid numbers both levels, then the mid-level
    order = np.r_[0:nodes, nodes + vertices : 2 * nodes + vertices, nodes : nodes + vertices]
    corners = values[order][grid.cells]  # (prisms, 15, 2)
    triangle_nodes = np.array([[0, 0], [1, 0], [0, 1], [0.5, 0], [0, 0.5], [0.5, 0.5]])
    for height, on_slice in zip(heights, on_slices, strict=True):
        points = np.column_stack([triangle_nodes, np.full(6, height)])
        shapes = np.asarray(wedge(1).tabulate(0, points))[0].reshape(6, 15)
        expected = np.einsum("an,tnc->tac", shapes, corners)
        assert abs(on_slice[plane.triangles] - expected).max() < 1e-12


def test_both_phases_alike_have_a_load_of_round_off(problem):
    """Each phase alone has a load, and both cancel at the interface: ∫ σ : ε(v) = 0."""
    total, *parts = (
        _loads(problem, stiffness)
        for stiffness in (
            [SOFT.stiffness, SOFT.stiffness],
            [SOFT.stiffness, NOTHING],
            [NOTHING, SOFT.stiffness],
        )
    )
    for part in parts:
        assert (np.linalg.norm(part, axis=1) > 0).all()
        assert (np.linalg.norm(total, axis=1) <= 1e-12 * np.linalg.norm(part, axis=1)).all()


def _loads(problem, stiffness):
    _, loads = assembled(problem, stiffness)
    return np.array([load.array.copy() for load in loads])


def assembled(problem, stiffness):
    """Reduced stiffness and loads."""
    if isinstance(problem, SliceProblem):
        matrix = problem.matrix(problem.blocks(problem.form, stiffness))
        return matrix, problem.loads(problem.form, THREE_LOADS)
    return problem.assemble(stiffness), problem.loads(THREE_LOADS)


class Manufactured:
    """u = (1 + θ/4) (sin π x + sin π y, sin π x cos π y) with integrals that no mesh gives.

    Integrals over cell and disc are by rules of their own, those over θ by the law of θ.
    """

    def __init__(self):
        nodes, weights = np.polynomial.legendre.leggauss(40)
        law = CONE.distribution
        half = (law.upper - law.lower) / 2
        self.theta = law.lower + half * (nodes + 1)
        self.theta_weights = half * weights * law.pdf(self.theta)
        self.square = np.stack(np.meshgrid(nodes, nodes, indexing="ij")).reshape(2, -1)
        self.square_weights = np.outer(weights, weights).ravel()
        rho, angle = np.meshgrid((nodes + 1) / 2, 2 * np.pi * np.arange(64) / 64, indexing="ij")
        self.disc = np.stack([rho * np.cos(angle), rho * np.sin(angle)]).reshape(2, -1)
        self.disc_weights = (weights[:, None] / 2 * rho * 2 * np.pi / 64).ravel()

    @staticmethod
    def displacement(x, y, theta):
        """Periodic in x and y, and zero at the corners of the cell."""
        first, second = np.sin(np.pi * x) + np.sin(np.pi * y), np.sin(np.pi * x) * np.cos(np.pi * y)
        return (1 + theta / 4)[:, None] * np.stack([first, second], axis=-1)

    @staticmethod
    def strain(x, y, theta):
        """(ε11, ε22, 2 ε12), by hand."""
        strain = [
            np.cos(np.pi * x),
            -np.sin(np.pi * x) * np.sin(np.pi * y),
            np.cos(np.pi * y) + np.cos(np.pi * x) * np.cos(np.pi * y),
        ]
        return np.pi * (1 + theta / 4) * np.stack(strain)

    def integrate(self, function):
        """∫ f_Θ of a function of ε(u) over matrix and particle, shape (2, …)."""
        totals = 0
        for theta, weight in zip(self.theta, self.theta_weights, strict=True):
            radius = float(CONE(theta))
            square = function(self.strain(*self.square, theta)) @ self.square_weights
            in_disc = function(self.strain(*(radius * self.disc), theta))
            disc = radius**2 * (in_disc @ self.disc_weights)
            totals = totals + weight * np.array([square - disc, disc])
        return totals

    def unknowns(self, problem):
        """Nodal values in the reduced unknowns."""
        positions = problem.numbering.grid.positions(CONE)
        pairs = problem.numbering.pairs
        values = np.zeros(problem.numbering.size)
        is_free = pairs >= 0
        u = self.displacement(*positions.T)[is_free]
        values.reshape(-1, 2)[pairs[is_free]] = u
        return PETSc.Vec().createWithArray(values, comm=PETSc.COMM_SELF)


def test_a_manufactured_displacement_has_its_work_energy_and_means(problem):
    """uᵀ K u = ∫ f_Θ C ε(u) : ε(u), uᵀ F = −∫ f_Θ C ε̄ : ε(u), and means of ε(u) by phase."""
    exact = Manufactured()
    stiffness = [SOFT.stiffness, HARD.stiffness]
    matrix, loads = assembled(problem, stiffness)
    u = exact.unknowns(problem)
    product = u.duplicate()
    matrix.mult(u, product)
    squares = exact.integrate(lambda e: e[:, None] * e)  # ∫ f_Θ ε ⊗ ε, (phases, 3, 3)
    first = exact.integrate(lambda e: e)  # ∫ f_Θ ε, (phases, 3)
    assert u.dot(product) == pytest.approx(np.sum(stiffness * squares), rel=2e-3)
    scale = np.sqrt(squares.trace(axis1=1, axis2=2).sum())
    for uniform, load in zip(THREE_LOADS, loads, strict=True):
        stresses = stiffness @ uniform  # of each phase
        largest = abs(stresses).max() * scale
        assert u.dot(load) == pytest.approx(-np.sum(stresses * first), abs=5e-4 * largest)
        assert abs(np.sum(stresses * first)) > 1e-2 * largest or uniform[2] == 0

    means = problem.slice_strains(np.zeros((1, 3)), [u])
    by_theta = np.einsum("psi,s->pi", means.strain[..., 0], means.weights)
    assert by_theta == pytest.approx(first / AREA, abs=5e-4 * scale)
    products = means.products[:, :, 0, :, 0]
    assert products == pytest.approx(squares / AREA, rel=2e-3, abs=2e-4 * scale**2)
