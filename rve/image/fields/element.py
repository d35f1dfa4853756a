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
from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cache
from itertools import permutations, product

import numpy as np

from alphacut.fuzzy.arrays import Array, Ints

Basis = tuple[tuple[int, ...], ...]  # coefficients of 1, x, x², … on [0, 1]
LEGENDRE: Basis = ((1,), (-1, 2), (1, -6, 6), (-1, 12, -30, 20))
SPLINES: dict[int, Basis] = {  # of degree p, in any unit: those that do not vanish on [0, 1]
    1: ((1, -1), (0, 1)),
    2: ((1, -2, 1), (1, 2, -2), (0, 0, 1)),
}
SHEARS = {2: ((0, 1),), 3: ((1, 2), (0, 2), (0, 1))}  # Voigt's order: 12, or 23, 13, 12


@dataclass(frozen=True, eq=False)
class Element:
    """Unknowns of a pixel or voxel and the modes that they cause.

    The axes of a grid are (y, x) or (z, y, x); lengths are in widths along x.

    Args:
        unknowns: Number of values of the field in every cell of the periodic grid.
        local: For each of the cell's local unknowns its number among these, and the neighbour that
            owns it, so many cells further along each axis of the grid.
        modes: Matrix from local unknowns to modes, shape (modes, local unknowns).
        magnitude: Sums of the absolute terms of each entry, by which rounding is bounded.
        bulk_rows: The first so many modes belong to the trace.
        of_voigt: Constant modes of uniform fields in Voigt order, shape (modes, components).
        origins: For each local unknown the one to subtract from it, if any.
        slopes: And those, of what is left, to subtract then: so that a field without strain or
            stress is taken away.
        places: Of each unknown its place in a cell of side 1 along the axes, and whether it
            changes its sign where space is mirrored at a point.
        stress: Whether the modes are those of a stress, else of a strain.
        products: Of products of splines alone: tables to modes, (axis, order, mode, function);
            terms (component, unknown, orders along the grid's axes), sorted by unknown and last
            order, and their factors.
    """

    unknowns: int
    local: tuple[tuple[int, tuple[int, ...]], ...]
    modes: Array
    magnitude: Array
    bulk_rows: int
    of_voigt: Array
    origins: tuple[int | None, ...]
    slopes: tuple[tuple[int, ...], ...]
    places: tuple[tuple[tuple[float, ...], bool], ...]
    stress: bool
    products: tuple[Array, Ints, Array] | None = None

    @property
    def dimension(self) -> int:
        """2 in the plane, 3 in space."""
        return len(self.local[0][1])

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
def spline_element(sides: tuple[float, ...], *, stress: bool) -> Element:
    """Products of splines on a cell with `sides` along the grid's axes, in any unit.

    Displacements of degree 1, whose strains may jump from cell to cell, or potentials of degree 2.
    """
    degree = 2 if stress else 1
    n, width = len(sides), degree + 1
    tables = _derivative_modes(SPLINES[degree])
    derivatives = stress_derivatives(n) if stress else strain_derivatives(n)
    potentials = sorted({potential for terms in derivatives for _, potential, _ in terms})

    def modes_of(orders: Sequence[int]) -> Array:
        """Matrix of a derivative, of orders along x, y, z, of one unknown."""
        matrix = np.ones((1, 1))
        for order, side in zip(orders[::-1], sides, strict=True):
            matrix = np.kron(matrix, tables[order] / side**order)
        return matrix

    shape = (len(derivatives), width**n, len(potentials), width**n)
    components = np.zeros(shape)  # (Voigt component, mode, unknown, function)
    for component, terms in enumerate(derivatives):
        for factor, potential, orders in terms:
            components[component, :, potentials.index(potential)] += factor * modes_of(orders)
    offsets = list(product(range(width), repeat=n))
    functions = [(u, offset) for u in range(len(potentials)) for offset in offsets]
    products: list[tuple[int, ...]] = [
        (component, potentials.index(potential), *orders[::-1], factor)
        for component, of_component in enumerate(derivatives)
        for factor, potential, orders in of_component
    ]
    products.sort(key=lambda term: (term[1], term[-2]))  # kernels share derivatives along x
    scaled = [[table / side**order for order, table in enumerate(tables)] for side in sides]
    element = _element(
        components.reshape(len(derivatives), width**n, -1),
        local=functions,
        origins=[None for _ in functions],
        slopes=[() for _ in functions],
        places=[((0.0,) * n, False) for _ in potentials],
        stress=stress,
    )
    *indices, factors = np.array(products).T
    return replace(
        element, products=(np.array(scaled), np.stack(indices, axis=1), factors.astype(float))
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


@cache
def displacement_element(aspect: float = 1.0) -> Element:
    """Biquadratic displacements on a pixel whose height is `aspect` times its width."""
    basis = ((1, -3, 2), (0, 4, -4), (0, -1, 2))  # at 0, 1/2, 1
    value, slope, _ = _derivative_modes(basis)
    d_dx, d_dy = np.kron(value, slope), np.kron(slope, value) / aspect
    none = np.zeros_like(d_dx)
    nodes = list(product(range(2), range(3), range(3)))  # component, y, x
    return _element(
        np.array([np.hstack([d_dx, none]), np.hstack([none, d_dy]), np.hstack([d_dy, d_dx])]),
        # a corner, two edge middles and the centre of a pixel, times two components
        local=[(4 * c + 2 * (y % 2) + x % 2, (y // 2, x // 2)) for c, y, x in nodes],
        origins=[9 * c for c, _, _ in nodes],
        slopes=[() for _ in nodes],
        places=[((y / 2, x / 2), False) for _, y, x in product(range(2), repeat=3)],
        stress=False,
    )


@cache
def airy_element(aspect: float = 1.0) -> Element:
    """Bicubic stress element of φ and its slopes, per pixel of height `aspect` times its width."""
    # value and slope at 0, value and slope at 1
    basis = ((1, 0, -3, 2), (0, 1, -2, 1), (0, 0, 3, -2), (0, 0, -1, 1))
    value, slope, curvature = _derivative_modes(basis)
    nodes = list(product(range(2), repeat=4))  # y, whether slope in y, x, whether slope in x
    origin, slope_y, slope_x = (nodes.index(n) for n in ((0, 0, 0, 0), (0, 1, 0, 0), (0, 0, 0, 1)))

    def slopes(y: int, dy: int, x: int, dx: int) -> tuple[int, ...]:
        """Slopes at the origin that a linear function has in an unknown."""
        if dy or dx:
            return () if dy and dx else (slope_y if dy else slope_x,)
        return (slope_y,) * y + (slope_x,) * x

    return _element(
        np.array(
            [
                np.kron(curvature, value) / aspect**2,
                np.kron(value, curvature),
                -np.kron(slope, slope) / aspect,
            ]
        ),
        local=[(2 * dy + dx, (y, x)) for y, dy, x, dx in nodes],
        # the unknowns at the origin that make up a linear function at a node
        origins=[None if dy or dx else origin for _, dy, _, dx in nodes],
        slopes=[slopes(*node) for node in nodes],
        places=[((0.0, 0.0), dy != dx) for dy, dx in product(range(2), repeat=2)],
        stress=True,
    )


def _element(
    components: Array,
    local: Sequence[tuple[int, tuple[int, ...]]],
    origins: Sequence[int | None],
    slopes: Sequence[tuple[int, ...]],
    places: Sequence[tuple[tuple[float, ...], bool]],
    *,
    stress: bool,
) -> Element:
    """Element from the modes of its Voigt components, (components, modes, local unknowns)."""
    parts = isotropic_parts(len(local[0][1]), stress=stress)
    modes = np.tensordot(parts, components, axes=1)
    magnitude = np.tensordot(abs(parts), abs(components), axes=1)
    # (part, mode); kernels number all modes of space
    is_kept = (magnitude.max(axis=-1) > 0) | (len(parts) == 6)
    of_voigt = np.zeros((*is_kept.shape, len(parts)))
    of_voigt[:, 0] = parts
    return Element(
        unknowns=len(places),
        local=tuple(local),
        modes=np.ascontiguousarray(modes[is_kept]),
        magnitude=magnitude[is_kept],
        bulk_rows=int(is_kept[0].sum()),
        of_voigt=of_voigt[is_kept],
        origins=tuple(origins),
        slopes=tuple(slopes),
        places=tuple(places),
        stress=stress,
    )


def _derivative_modes(basis: Basis) -> list[Array]:
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
