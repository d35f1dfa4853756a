"""Guaranteed bounds of the mean stiffness of prisms, by displacements and stresses in equilibrium.

At each θ the cell is plane. Let u be its displacements under the mean strain ε̄, and v others that
are continuous, with a periodic fluctuation and the same mean strain. The energy of v exceeds that
of u, ε̄ : C̄ ε̄, by ‖e‖² = ⟨ε(e) : C ε(e)⟩ of e = v − u, with means ⟨⟩ over the cell. A stress σ
without divergence, whose tractions are continuous, does no work in the periodic e, as the stress of
u does none. So, with the skew parts A of σ and W of the gradient of e,

    ‖e‖² = ⟨ε(e) : (C ε(v) − sym σ)⟩ − ⟨W : A⟩.

By Fourier series ⟨W : W⟩ = ⟨2 ε12² − 2 ε11 ε22⟩ of a periodic e, in a cell of any lattice. It is at
most λ ‖e‖² with the largest eigenvalue λ of this form relative to C in any phase; of isotropic
phases that is 1/(2 G) of the softest. Hence the bound of Prager and Synge (Quart. Appl. Math. 5,
241, 1947), with the asymmetry counted:

    ‖e‖ ≤ √⟨(sym σ − C ε(v)) : C⁻¹ (sym σ − C ε(v))⟩ + √(λ ⟨A : A⟩).

The square of the right-hand side is at most (1 + s) times the first mean and 1 + 1/s times the
second for any s > 0. Both means are quadratic forms of ε̄, and fall with the fourth power of the
mesh size where the fields are smooth.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from alphacut.base.arrays import Array, Ints
from alphacut.rve.fenicsx import MPI, basix
from alphacut.rve.image.bounds import StiffnessBounds, is_positive_definite
from alphacut.rve.mesh.columns import ABOVE, BELOW, MID_LEVEL
from alphacut.rve.mesh.periodicity import SAME_PLACE, MeshError
from alphacut.rve.prism.problem import FoldedMeshError, PrismProblem
from alphacut.rve.prism.stress_functions import LOADS, PrismFields, solved_fields_of_bounds
from alphacut.rve.prism.theta_means import (
    InverseDeterminant,
    chebyshev_points,
    determinant_ranges,
    mean_over_theta,
    planar_slopes,
)
from alphacut.rve.solver.krylov import SolverOptions
from alphacut.stochastic.theta.distribution import require_matching_density

ROTATION = np.array([[0.0, -1, 0], [-1, 0, 0], [0, 0, 0.5]])
"""2 ε12² − 2 ε11 ε22 as a quadratic form of (ε11, ε22, 2 ε12)."""
ROUNDING = 1e-8
"""Relative margin for places of partners on opposite sides, which are checked to 1e-8, and sums."""
MAX_RATIO = 1e8
"""Ratio of eigenvalues of the stiffness up to which rounding is below the relative margin."""
CHUNK = 2048
"""Prisms whose fields are evaluated at once (tuned), to bound the memory: about 100 MB."""


class Energies(NamedTuple):
    """Means over the cell of products of the fields under two loads, shape (…, loads, loads) each.

    Args:
        lower: Lower bound of ⟨ε(v) : C ε(v)⟩ in the Loewner order, in Pa.
        upper: Upper bound of it.
        residual: Upper bound of ⟨(sym σ − C ε(v)) : C⁻¹ (sym σ − C ε(v))⟩.
        asymmetry: Upper bound of λ ⟨A : A⟩.
    """

    lower: Array
    upper: Array
    residual: Array
    asymmetry: Array


def mesh_bounds(
    problem: PrismProblem, stiffness: Sequence[Array], options: SolverOptions
) -> StiffnessBounds:
    """Return guaranteed bounds of the mean stiffness over θ, for the geometry of the prisms.

    All ranks must call, and get the same values.

    Args:
        problem: Mesh from a file, moved to its distribution of θ. Its stiffness matrix is
            overwritten.
        stiffness: Stiffness of each phase in Voigt order, positive definite, (3, 3) each, in Pa.
        options: PETSc's options, the ones of the default solver included. A looser tolerance makes
            wider bounds.

    Returns:
        The bounds; the lower one is 0 where the mesh is so coarse that it is not positive definite.

    Raises:
        MeshError: Middles of vertical edges do not lie half-way between the levels.
        RefusedError: The distribution function of θ is not that of its density, or PETSc does not
            use one of the options.
        FoldedMeshError: A prism cannot be shown to be unfolded.
        ConvergenceError: The linear solver did not reach its tolerance.
    """
    _require_mid_levels(problem)
    of_phases = np.array(stiffness)
    # The eigenvalues of C⁻¹ times the form, as a matrix, are those relative to C.
    factor = float(np.linalg.eigvals(np.linalg.solve(of_phases, ROTATION)).real.max())
    require_matching_density(problem.map.distribution, problem.grid.heights)
    fields = solved_fields_of_bounds(problem, stiffness, rotation_factor=factor, options=options)
    means, errors = _mean_energies(problem, fields, of_phases, factor=factor)
    # A symmetric matrix lies between ∓ the diagonal matrix of its sums of magnitudes in rows.
    margins = errors.sum(axis=-1)[..., np.newaxis] * LOADS
    upper = Energies(*(means + margins))
    lower = Energies(*(means - margins))
    # The best s for the trace, and some s where both vanish to rounding, as of one phase alone.
    rounding = ROUNDING**2 * np.trace(upper.upper)
    s = np.sqrt((np.trace(upper.asymmetry) + rounding) / (np.trace(upper.residual) + rounding))
    distance = (1 + s) * upper.residual + (1 + 1 / s) * upper.asymmetry
    lowest = lower.lower * (1 - ROUNDING) - distance
    highest = upper.upper * (1 + ROUNDING)
    # Sums over prisms round by units of their largest terms, which a soft direction has not. The
    # factor is tuned: up to 5 units were seen of 64 prisms, and errors grow with the root.
    softest, *_, stiffest = np.linalg.eigvalsh(highest)
    if stiffest > MAX_RATIO * softest:
        units = 64 * np.sqrt(len(problem.grid.cells))
        margin = units * np.finfo(float).eps * np.trace(highest) * LOADS
        lowest = lowest - margin
        highest = highest + margin
    if not is_positive_definite(lowest):
        lowest = np.zeros_like(lowest)
    return StiffnessBounds(lowest, highest)


def _mean_energies(
    problem: PrismProblem, fields: PrismFields, stiffness: Array, *, factor: float
) -> tuple[Array, Array]:
    """Return means over cell and θ of the four products of `Energies`, with bounds of their errors.

    Args:
        problem: The cell.
        fields: Fields in this rank's prisms.
        stiffness: Stiffness of each phase, shape (phases, 3, 3).
        factor: λ.

    Returns:
        Means and bounds of the absolute errors, shape (4, loads, loads) each, the same on all
        ranks.

    Raises:
        FoldedMeshError: det J > 0 is not proved.
    """
    law = problem.map.distribution
    levels = problem.grid.level_thetas(law)
    of_prisms = stiffness[problem.grid.phase[problem.wedge]]
    is_upright = bool(problem.comm.allreduce(int(_is_upright(fields.nodes)), MPI.MIN))
    total: Array = np.zeros((2, len(Energies._fields), len(LOADS), len(LOADS)))
    for layer, (low, high) in enumerate(pairwise(levels)):
        prisms = np.flatnonzero(problem.layer == layer)
        pieces = _pieces(fields.nodes[prisms], problem.comm)
        for (start, end), inverse in pieces:
            # Positions and fields are quadratic in the triangle and along θ. Products of slopes
            # with the Jacobian matrix are quadratic in the triangle, as det J. Along θ this is of
            # degree 4, and in upright columns 0; the products, with the quadratic Σ, 2 more.
            along_theta = 0 if is_upright else 4
            degree = 2 * (2 + along_theta) + along_theta * inverse.degree
            heights = start + chebyshev_points(degree) * (end - start)
            triangle, weights = basix.make_quadrature(
                basix.CellType.triangle, 4 + 2 * inverse.degree
            )
            energies = np.zeros((len(heights), *total.shape[1:]))
            for k, z in enumerate(heights):
                slopes = planar_slopes(np.column_stack([triangle, np.full(len(triangle), z)]))
                mean_stress = fields.mean_stress_at(z)[layer]
                for chunk in np.array_split(np.arange(len(prisms)), len(prisms) // CHUNK + 1):
                    chosen = prisms[chunk]
                    of_chunk = replace(inverse, ends=inverse.ends[:, chunk])
                    points = _at_points(fields, chosen, slopes, mean_stress)
                    energies[k] += points.energies(of_prisms[chosen], of_chunk, weights, factor)
            energies /= problem.grid.plane.lattice.area
            problem.comm.Allreduce(MPI.IN_PLACE, energies)
            ends = low + start * (high - low), low + end * (high - low)
            total += mean_over_theta(law, *ends, energies)
    means, errors = total
    return means, errors


def _pieces(
    nodes: Array, comm: MPI.Intracomm
) -> list[tuple[tuple[float, float], InverseDeterminant]]:
    """Divide a layer along θ where det J varies, so that few points are needed in all.

    Args:
        nodes: Positions of the nodes of this rank's prisms of the layer, shape (prisms, 15, 2).
        comm: The ranks, which get the same pieces.

    Returns:
        Ends of each piece as heights in [0, 1], and the approximation of 1/det J in it.

    Raises:
        FoldedMeshError: det J > 0 is not proved.
    """
    found = []
    for count in (1, 2, 4, 8):
        cuts = [float(cut) for cut in np.linspace(0.0, 1.0, count + 1)]
        ends = [determinant_ranges(nodes, *piece) for piece in pairwise(cuts)]
        low, high = np.stack(ends, axis=1)
        with np.errstate(divide="ignore"):
            ratios = np.where(low > 0, high / low, np.inf).max(axis=1, initial=1 + ROUNDING)
        comm.Allreduce(MPI.IN_PLACE, ratios, MPI.MAX)
        if np.isfinite(ratios).all():
            inverses = [InverseDeterminant.of_ends(*of) for of in zip(ends, ratios, strict=True)]
            # Points on a triangle grow with the square of the degree, heights in proportion.
            cost = sum((inverse.degree + 2) ** 3 for inverse in inverses)
            found.append((cost, list(zip(pairwise(cuts), inverses, strict=True))))
    if not found:
        what = "a prism is so bent that det J > 0 is not proved in it"
        raise FoldedMeshError(what, "refine the mesh, or set mesh.refine = true")
    return min(found, key=lambda pair: pair[0])[1]


class _Points(NamedTuple):
    """Fields at points of a slice through some prisms, times det J.

    Args:
        determinant: det J, shape (prisms, points).
        strain: ε(v) as (ε11, ε22, 2 ε12) under each load, shape (prisms, points, 3, loads).
        stress: sym σ as (σ11, σ22, σ12), of the same shape.
        asymmetry: σ12 − σ21, shape (prisms, points, 1, loads).
    """

    determinant: Array
    strain: Array
    stress: Array
    asymmetry: Array

    def energies(
        self, stiffness: Array, inverse: InverseDeterminant, weights: Array, factor: float
    ) -> Array:
        """Return integrals over the slice of the products of `Energies`, shape (4, loads, loads).

        Args:
            stiffness: C of each prism, shape (prisms, 3, 3).
            inverse: Approximation of 1/det J in these prisms.
            weights: Quadrature weights of the points on the triangle.
            factor: λ.
        """
        weights = weights * inverse(self.determinant)
        errors = inverse.errors[:, np.newaxis]
        stress = stiffness[:, np.newaxis] @ self.strain
        residual = self.stress - stress
        residual_strain = np.linalg.inv(stiffness)[:, np.newaxis] @ residual
        # ⟨N/det J⟩ is between ⟨N q⟩/(1 + error) and ⟨N q⟩/(1 − error) in each prism.
        above = weights / (1 - errors)
        return np.array(
            [
                _products(self.strain, stress, weights / (1 + errors)),
                _products(self.strain, stress, above),
                _products(residual, residual_strain, above),
                _products(self.asymmetry, self.asymmetry, factor / 2 * above),
            ]
        )


def _products(first: Array, second: Array, weights: Array) -> Array:
    """Return sums over points of products of two fields, shape (loads, loads).

    Args:
        first: Field of some components under each load, shape (prisms, points, components, loads).
        second: The other field, of the same shape.
        weights: Weights of the points, shape (prisms, points).
    """
    loads = first.shape[-1]
    weighted = weights[..., np.newaxis, np.newaxis] * first
    return np.asarray(weighted.reshape(-1, loads).T @ second.reshape(-1, loads))


def _at_points(fields: PrismFields, prisms: Ints, slopes: Array, mean_stress: Array) -> _Points:
    """Return the fields at points of a slice through prisms of one layer.

    Args:
        fields: Fields in all prisms of this rank.
        prisms: Numbers of the prisms.
        slopes: Derivatives of the functions of the nodes on the triangle, shape (2, points, 15).
        mean_stress: Σ at the slice, shape (3, loads).
    """
    by_x, by_y = slopes[:, np.newaxis] @ fields.nodes[prisms]  # (prisms, points, 2) each
    determinant = by_x[..., 0] * by_y[..., 1] - by_x[..., 1] * by_y[..., 0]
    # The rows of the inverse of J are the derivatives of x and y of the triangle in the cell.
    across = by_x[..., np.newaxis, np.newaxis, :], by_y[..., np.newaxis, np.newaxis, :]

    def gradient(values: Array) -> tuple[Array, Array]:
        """Return det J times the derivatives along x1 and x2, shape (prisms, points, 2, loads)."""
        shape = *determinant.shape, *values.shape[2:]
        flat = values[prisms].reshape(len(prisms), 15, shape[-2] * shape[-1])
        first, second = [(of_axis @ flat).reshape(shape) for of_axis in slopes]
        along_x1 = first * across[1][..., 1] - second * across[0][..., 1]
        along_x2 = second * across[0][..., 0] - first * across[1][..., 0]
        return along_x1, along_x2

    uniform = determinant[..., np.newaxis, np.newaxis]
    v_1, v_2 = gradient(fields.displacement)
    strain = np.stack([v_1[..., 0, :], v_2[..., 1, :], v_2[..., 0, :] + v_1[..., 1, :]], axis=2)
    p_1, p_2 = gradient(fields.potential)
    shear = (p_2[..., 1, :] - p_1[..., 0, :]) / 2
    stress = np.stack([p_2[..., 0, :], -p_1[..., 1, :], shear], axis=2)
    asymmetry = p_1[..., :1, :] + p_2[..., 1:, :]  # its sign does not matter
    return _Points(determinant, strain + uniform * LOADS, stress + uniform * mean_stress, asymmetry)


def _is_upright(nodes: Array) -> bool:
    """Whether columns of prisms are upright to rounding; their nodes have (prisms, 15, 2)."""
    below = nodes[:, BELOW]
    distances = [abs(nodes[:, ABOVE] - below), abs(nodes[:, MID_LEVEL] - below[:, :3])]
    largest = max(float(distance.max(initial=0.0)) for distance in distances)
    edges = nodes[:, 1] - nodes[:, 0]
    shortest = float(np.hypot(*edges.T).min(initial=np.inf))
    return largest <= 1e-3 * ROUNDING * shortest


def _require_mid_levels(problem: PrismProblem) -> None:
    """Raise MeshError unless middles of vertical edges lie half-way between the levels."""
    grid = problem.grid
    theta = grid.positions(problem.map)[:, 2]
    first = (grid.layers + 1) * len(grid.plane.points)
    levels = theta[:first].reshape(grid.layers + 1, -1)[:, 0]
    middles = (levels[1:] + levels[:-1]) / 2
    distances = theta[first:].reshape(grid.layers, -1) - middles[:, np.newaxis]
    if abs(distances).max() > SAME_PLACE * np.diff(levels).min():
        what = "the middle of a vertical edge is not half-way between two levels"
        raise MeshError(what, "extrude along straight lines in θ, or put the middles there")
