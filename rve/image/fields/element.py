"""Finite elements on a pixel or voxel, from unknowns to orthonormal strain or stress modes.

Displacements are products of linear splines in each component. Stresses are derivatives of
potentials in products of quadratic B-splines, whose slopes are continuous, so that equilibrium
holds exactly (Beltrami 1892; Gurtin 1972, section 17):

    σ_ij = Σ ε_ikm ε_jln ∂k ∂l Φ_mn,

with the six Φ_mn of space, and in the plane with Φ_33 alone, which is Airy's function. In the plane
two elements are better at equal time: biquadratic displacements, and Airy's function in the bicubic
rectangle (Bogner, Fox, Schmit 1965).

A field is expanded in products of Legendre polynomials that are orthonormal on the element, so its
mean energy is a sum of squares without quadrature error: k Σ (modes of the trace)² + G Σ (modes of
the deviator)², where the deviator's are those of 11 − 22, (11 + 22 − 2·33)/√3 and twice the shear
components, and k is K (in the plane K + G/3); with 1/(n² k), 1/(4 G) for stresses in n dimensions.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction
from functools import cache, reduce
from itertools import permutations, product

import numpy as np

from alphacut.base.arrays import Array, Ints

Polynomials = tuple[tuple[int, ...], ...]  # coefficients of 1, x, x², … on [0, 1]
LEGENDRE: Polynomials = ((1,), (-1, 2), (1, -6, 6), (-1, 12, -30, 20))


@dataclass(frozen=True)
class Basis:
    """Functions of one coordinate; their products are those of an element.

    Args:
        functions: Those that do not vanish on a cell.
        owners: Of each its number among the unknowns of a cell, and how many cells further that is.
        places: Of each unknown its place in a cell, and whether its sign changes in a mirror.
        linear: Of each the functions at the origin (value 0, slope 1) whose sum is its unknown in
            any linear function; none where that is not subtracted.
    """

    functions: Polynomials
    owners: tuple[tuple[int, int], ...]
    places: tuple[tuple[float, bool], ...] = ((0.0, False),)
    linear: tuple[tuple[int, ...], ...] = ((), (), ())


LINEAR = Basis(((1, -1), (0, 1)), ((0, 0), (0, 1)))
B_SPLINES = Basis(((1, -2, 1), (1, 2, -2), (0, 0, 1)), ((0, 0), (0, 1), (0, 2)))
QUADRATIC = Basis(  # values at 0, 1/2 and 1
    functions=((1, -3, 2), (0, 4, -4), (0, -1, 2)),
    owners=((0, 0), (1, 0), (0, 1)),
    places=((0.0, False), (0.5, False)),
    linear=((0,), (0,), (0,)),
)
HERMITE = Basis(  # value and slope at 0, value and slope at 1
    functions=((1, 0, -3, 2), (0, 1, -2, 1), (0, 0, 3, -2), (0, 0, -1, 1)),
    owners=((0, 0), (1, 0), (0, 1), (1, 1)),
    places=((0.0, False), (0.0, True)),
    linear=((0,), (1,), (0, 1), (1,)),
)
BASES = {(2, False): QUADRATIC, (2, True): HERMITE, (3, False): LINEAR, (3, True): B_SPLINES}
"""By the dimension and whether of stresses."""
SHEARS = {2: ((0, 1),), 3: ((1, 2), (0, 2), (0, 1))}  # Voigt's order: 12, or 23, 13, 12


@dataclass(frozen=True, eq=False)
class Element:
    """Unknowns of a pixel or voxel and the modes that they cause.

    The axes of a grid are (y, x) or (z, y, x); lengths are in widths along x.

    Args:
        sides: Sides of a cell along the axes.
        unknowns: Number of values of the field in every cell of the periodic grid.
        local: For each of the cell's local unknowns its number among these, and the neighbour that
            owns it, so many cells further along each axis of the grid.
        modes: Matrix from local unknowns to modes, shape (modes, local unknowns).
        magnitude: Sums of the absolute terms of each entry, by which rounding is bounded.
        bulk_rows: The first so many modes belong to the trace.
        of_voigt: Constant modes of uniform fields in Voigt order, shape (modes, components).
        subtracted: For each local unknown those to subtract from it, so that a field without strain
            or stress is taken away.
        places: Of each unknown its place in a cell of side 1 along the axes, and whether it
            changes its sign where space is mirrored at a point.
        stress: Whether the modes are those of a stress, else of a strain.
        products: Tables to modes, (axis, order, mode, function); terms (component, unknown, orders
            along the grid's axes), sorted by unknown and last order; first and one past the last of
            each group of terms that are alike in both; factors of the terms.
    """

    sides: tuple[float, ...]
    unknowns: int
    local: tuple[tuple[int, tuple[int, ...]], ...]
    modes: Array
    magnitude: Array
    bulk_rows: int
    of_voigt: Array
    subtracted: tuple[tuple[int, ...], ...]
    places: tuple[tuple[tuple[float, ...], bool], ...]
    stress: bool
    products: tuple[Array, Ints, Ints, Array]

    @property
    def dimension(self) -> int:
        """2 in the plane, 3 in space."""
        return len(self.local[0][1])

    @property
    def reach(self) -> int:
        """Cells along an axis to the farthest that owns a local unknown."""
        return max(max(offset) for _, offset in self.local)

    @property
    def parts(self) -> tuple[slice, slice]:
        """Rows of the modes of the trace, and of those of the deviator."""
        return slice(0, self.bulk_rows), slice(self.bulk_rows, None)

    @property
    def trace_in_deviator(self) -> float:
        """Greatest c with ∫ deviator² ≥ c ∫ trace² for every periodic fluctuation.

        A displacement's wave has 2 dev:dev = 2 (1 − 1/n) tr² + |rotation|², a stress is a tensor in
        the n − 1 directions across its wave, so that its σ:σ is at least tr²/(n − 1).
        """
        n = self.dimension
        return 2 / (n * (n - 1)) if self.stress else 2 * (1 - 1 / n)

    def mean_modes(self, loads: Array) -> Array:
        """Modes of uniform fields in Voigt order, shape (loads, components) → (modes, loads)."""
        return np.asarray(self.of_voigt @ np.asarray(loads).T)


def isotropic_parts(dimension: int, *, stress: bool) -> Array:
    """Matrix from Voigt components to the trace (row 0) and the parts of the deviator.

    Their squares sum to 2 dev:dev. The shear components of strains are twice those of the tensor.
    """
    shears = len(SHEARS[dimension])
    parts = np.zeros((dimension + shears, dimension + shears))
    parts[0, :dimension] = 1
    for k in range(1, dimension):  # 11 − 22, then (11 + 22 − 2·33)/√3
        parts[k, :k], parts[k, k] = 1, -k
        parts[k] *= math.sqrt(2 / (k * (k + 1)))
    parts[dimension:, dimension:] = np.eye(shears) * (2 if stress else 1)
    return parts


@cache
def element_of(sides: tuple[float, ...], *, stress: bool) -> Element:
    """Element of stresses or of displacements of a cell with `sides` along the grid's axes."""
    n = len(sides)
    basis = BASES[n, stress]
    derivatives = stress_derivatives(n) if stress else strain_derivatives(n)
    potentials = sorted({potential for terms in derivatives for _, potential, _ in terms})
    tables = [
        [table / side**order for order, table in enumerate(_derivative_modes(basis.functions))]
        for side in sides
    ]
    terms = [
        (component, potentials.index(potential), *orders[::-1], factor)
        for component, of_component in enumerate(derivatives)
        for factor, potential, orders in of_component
    ]
    terms.sort(key=lambda term: (term[1], term[-2]))  # kernels share derivatives along x
    functions = list(product(range(len(basis.functions)), repeat=n))
    shape = (len(derivatives), len(functions), len(potentials), len(functions))
    components = np.zeros(shape)  # (Voigt component, mode, potential, function)
    for component, potential, *orders, factor in terms:
        along_axes = (table[order] for table, order in zip(tables, orders, strict=True))
        components[component, :, potential] += factor * reduce(np.kron, along_axes)
    parts, by_unknown = isotropic_parts(n, stress=stress), components.reshape(*shape[:2], -1)
    modes = np.tensordot(parts, by_unknown, axes=1)
    magnitude = np.tensordot(abs(parts), abs(by_unknown), axes=1)
    is_kept = magnitude.max(axis=-1) > 0  # (part, mode)
    is_kept |= n == 3  # kernels number all modes of space
    of_voigt = np.zeros((*is_kept.shape, len(parts)))
    of_voigt[:, 0] = parts
    unknowns = list(product(range(len(basis.places)), repeat=n))
    local, subtracted = [], []
    for potential, function in product(range(len(potentials)), functions):
        numbers, offsets = zip(*(basis.owners[f] for f in function), strict=True)
        local.append((potential * len(unknowns) + unknowns.index(numbers), offsets))
        at_origin = product(*(basis.linear[f] for f in function))
        first = potential * len(functions)
        subtracted.append(tuple(first + functions.index(f) for f in at_origin if sum(f) <= 1))
    places = [list(zip(*(basis.places[k] for k in numbers), strict=True)) for numbers in unknowns]
    table: Ints = np.array(terms)
    indices, factors = table[:, :-1].copy(), table[:, -1].astype(float)
    starts = 1 + np.flatnonzero(np.diff(indices[:, [1, -1]], axis=0).any(axis=1))
    ends = np.array([0, *starts, len(terms)])
    groups = np.stack([ends[:-1], ends[1:]], axis=1)
    return Element(
        sides=sides,
        unknowns=len(potentials) * len(unknowns),
        local=tuple(local),
        modes=np.ascontiguousarray(modes[is_kept]),
        magnitude=magnitude[is_kept],
        bulk_rows=int(is_kept[0].sum()),
        of_voigt=of_voigt[is_kept],
        subtracted=tuple(subtracted),
        places=tuple((place, sum(odd) % 2 == 1) for place, odd in places) * len(potentials),
        stress=stress,
        products=(np.array(tables), indices, groups, factors),
    )


Derivatives = list[list[tuple[int, tuple[int, int], tuple[int, ...]]]]
"""By Voigt component: terms (factor, indices of the unknown, orders along x, y, z)."""


def strain_derivatives(dimension: int) -> Derivatives:
    """ε_ii = ∂i u_i and 2 ε_ij = ∂i u_j + ∂j u_i."""
    first = [tuple(int(i == j) for j in range(dimension)) for i in range(dimension)]
    normal: Derivatives = [[(1, (i, 0), first[i])] for i in range(dimension)]
    shear: Derivatives = [
        [(1, (j, 0), first[i]), (1, (i, 0), first[j])] for i, j in SHEARS[dimension]
    ]
    return [*normal, *shear]


def stress_derivatives(dimension: int) -> Derivatives:
    """Derivatives of Beltrami's potentials; in the plane Φ_33, which varies with x and y alone."""
    signs = {(0, 1, 2): 1, (1, 2, 0): 1, (2, 0, 1): 1, (2, 1, 0): -1, (1, 0, 2): -1, (0, 2, 1): -1}
    by_component: Derivatives = []
    for i, j in [*((i, i) for i in range(dimension)), *SHEARS[dimension]]:
        factors: dict[tuple[tuple[int, int], tuple[int, ...]], int] = {}
        for (a, k, m), (b, q, r) in product(permutations(range(3)), repeat=2):
            if (a, b) != (i, j) or max(k, q) >= dimension or (dimension == 2 and (m, r) != (2, 2)):
                continue
            orders = tuple((k == axis) + (q == axis) for axis in range(dimension))
            term = (min(m, r), max(m, r)), orders
            factors[term] = factors.get(term, 0) + signs[a, k, m] * signs[b, q, r]
        by_component.append([(f, pair, orders) for (pair, orders), f in factors.items() if f])
    return by_component


def _derivative_modes(basis: Polynomials) -> list[Array]:
    """Matrices (polynomials, functions) to orthonormal Legendre modes of derivatives 0, 1 and 2."""
    functions, matrices = list(basis), []
    count = max(map(len, basis))
    norms = np.sqrt(2 * np.arange(float(count)) + 1)
    for _ in range(3):
        exact = [[_integral(polynomial, f) for f in functions] for polynomial in LEGENDRE[:count]]
        matrices.append(np.array(exact, dtype=float) * norms[:, None])
        functions = [tuple(n * c for n, c in enumerate(f))[1:] for f in functions]
    return matrices


def _integral(first: tuple[int, ...], second: tuple[int, ...]) -> Fraction:
    """Integral of the product of two polynomials over [0, 1]."""
    pairs = product(enumerate(first), enumerate(second))
    return sum((Fraction(a * b, i + j + 1) for (i, a), (j, b) in pairs), Fraction(0))
