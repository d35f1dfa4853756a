"""Finite elements on a pixel or voxel, from unknowns to orthonormal modes of their fields.

Fields are strains, stresses in equilibrium, gradients of a temperature, or fluxes without sources.

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

Of conduction, temperatures are the same splines as displacements. Fluxes are the curl of a
potential, so that none arises or vanishes: q_x = ∂y ψ, q_y = −∂x ψ in the plane, with a continuous
ψ of the splines of temperatures. In space q = curl A, where A_i is constant along i in each voxel
and linear along the other axes (Nédélec 1980): the flux through a face is continuous, and along a
face it may jump. The mean energy is k Σ (modes of the gradient)², with 1/k for fluxes.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cache, reduce
from itertools import product
from typing import NamedTuple

import numpy as np

from alphacut.base.arrays import Array, Ints

Polynomials = tuple[tuple[int, ...], ...]
"""Polynomials on [0, 1], each by its coefficients of 1, x, x², …"""


class Place(NamedTuple):
    """Place of an unknown in its cell along one axis.

    Attributes:
        coordinate: Distance from the origin of the cell, in widths of the cell.
        is_odd: Whether the unknown changes its sign when the axis is mirrored, as a slope does.
    """

    coordinate: float = 0.0
    is_odd: bool = False


@dataclass(frozen=True)
class Basis:
    """Functions of one coordinate, whose products over the axes are the functions of an element.

    Args:
        functions: The functions that do not vanish on a cell.
        owners: For each function the number of its unknown among those of a cell, and how many
            cells further along the axis this cell is.
        places: Where each unknown of a cell lies.
    """

    functions: Polynomials
    owners: tuple[tuple[int, int], ...]
    places: tuple[Place, ...] = (Place(),)


def _basis(dimension: int, *, dual: bool, conduction: bool) -> Basis:
    """Return the functions of one coordinate whose products over the axes an element consists of.

    Stresses are second derivatives of potentials, so that potentials have continuous slopes. Of
    fluxes in the plane the potential is continuous, but its slope need not be.

    Args:
        dimension: 2 for pixels, 3 for voxels.
        dual: Whether the unknowns are potentials of stresses or of fluxes; else they are
            displacements or a temperature.
        conduction: Whether they are a temperature or potentials of fluxes.

    Returns:
        `functions`, each by its coefficients of 1, x, x², … on [0, 1]; `owners`, for each function
        the number of its unknown, from 0, and how many cells further on the unknown's own cell is;
        and `places`, the coordinate of each unknown in its cell, from 0 to 1, and whether it is
        odd, as a slope is. In space a cell has one unknown, by default at 0 and not odd.
    """
    if dimension == 3 and (conduction or not dual):  # values at both ends
        return Basis(((1, -1), (0, 1)), ((0, 0), (0, 1)))
    if dimension == 3:  # quadratic B-splines, which sum to 2
        return Basis(((1, -2, 1), (1, 2, -2), (0, 0, 1)), ((0, 0), (0, 1), (0, 2)))
    if conduction or not dual:  # values at 0, 1/2 and 1
        return Basis(
            functions=((1, -3, 2), (0, 4, -4), (0, -1, 2)),
            owners=((0, 0), (1, 0), (0, 1)),
            places=(Place(), Place(0.5)),
        )
    # Hermite's functions, with value and slope at 0, and value and slope at 1
    return Basis(
        functions=((1, 0, -3, 2), (0, 1, -2, 1), (0, 0, 3, -2), (0, 0, -1, 1)),
        owners=((0, 0), (1, 0), (0, 1), (1, 1)),
        places=(Place(), Place(is_odd=True)),
    )


EDGE = 2
"""Order in a term of fluxes of voxels that stands for the constant function of a cell.

It takes the place of the second derivative of linear functions, which is zero."""
SHEARS = {2: ((0, 1),), 3: ((1, 2), (0, 2), (0, 1))}
"""Indices of the shear components in Voigt's order, by the dimension: 12, or 23, 13, 12."""


class LocalUnknown(NamedTuple):
    """An unknown that acts on a cell.

    Attributes:
        unknown: Its number among the unknowns of the cell that owns it.
        offset: How many cells further this cell is along each axis of the grid.
    """

    unknown: int
    offset: tuple[int, ...]


class SplineProducts(NamedTuple):
    """The element as products over the axes, for kernels that work axis by axis.

    Attributes:
        tables: Matrices from functions to Legendre modes of their derivatives, shape (axes, orders
            of the derivative, modes, functions). Of order `EDGE`, of fluxes of voxels, is the
            constant function of a cell.
        mode_counts: Number of modes that are not zero, the lowest ones, by the order.
        terms: Rows (Voigt component, number of the unknown function, order of its derivative along
            each axis of the grid), sorted by the unknown function and the last order.
        groups: First row, and one past the last row, of the terms that are alike in both, shape
            (groups, 2).
        factors: Factor of each term.
    """

    tables: Array
    mode_counts: Ints
    terms: Ints
    groups: Ints
    factors: Array


@dataclass(frozen=True, eq=False)
class Element:
    """Unknowns of a pixel or voxel, and the modes that they cause of their field.

    The field is a strain or stress in Voigt's components, with modes of its trace and of the parts
    of its deviator; or a gradient or flux with its components, which are not divided into parts.

    The axes of a grid are (y, x) or (z, y, x). Lengths are in widths of a cell along x.

    Args:
        sides: Sides of a cell along the axes.
        unknowns: Number of unknowns that each cell of the periodic grid owns.
        local: The unknowns that act on a cell.
        modes: Matrix from local unknowns to modes, shape (modes, local unknowns).
        magnitude: Sums of the absolute terms of each entry of `modes`, by which rounding is
            bounded.
        bulk_rows: Number of modes that belong to the trace; they come first. 0 of conduction.
        of_voigt: Modes of uniform fields in Voigt order, shape (modes, components).
        places: Coordinates of each unknown in its cell along the axes, in widths of the cell along
            each, shape (unknowns, axes).
        is_odd: Whether each unknown changes its sign when space is mirrored at a point, shape
            (unknowns,).
        dual: Whether the modes are those of a stress or a flux; else of a strain or a gradient.
        conduction: Whether they are those of a gradient or a flux.
        products: The same element as products over the axes.
    """

    sides: tuple[float, ...]
    unknowns: int
    local: tuple[LocalUnknown, ...]
    modes: Array
    magnitude: Array
    bulk_rows: int
    of_voigt: Array
    places: Array
    is_odd: Array
    dual: bool
    conduction: bool
    products: SplineProducts

    @property
    def dimension(self) -> int:
        """2 in the plane, 3 in space."""
        return len(self.sides)

    @property
    def reach(self) -> int:
        """Largest number of cells along an axis to the owner of a local unknown."""
        return max(max(local.offset) for local in self.local)

    @property
    def parts(self) -> tuple[slice, ...]:
        """Rows of the modes that have one coefficient of the energy.

        They are those of the trace and those of the deviator, or all of a gradient or flux.
        """
        if self.conduction:
            return (slice(None),)
        return slice(0, self.bulk_rows), slice(self.bulk_rows, None)

    @property
    def part_matrix(self) -> Array:
        """Matrix from the components of a field to those of its parts, shape (n, n)."""
        return field_parts(self.dimension, dual=self.dual, conduction=self.conduction)

    @property
    def trace_in_deviator(self) -> float:
        """Largest c with ∫ deviator² ≥ c ∫ trace² for every periodic fluctuation of the field.

        Here deviator² is 2 dev:dev. The strain of a wave of displacements in n dimensions has 2
        dev:dev = 2 (1 − 1/n) tr² + |rotation|². The stress of a wave in equilibrium is a tensor in
        the n − 1 directions across the wave, so that its σ:σ is at least tr²/(n − 1), and 2 dev:dev
        = 2 σ:σ − 2 tr²/n.
        """
        n = self.dimension
        return 2 / (n * (n - 1)) if self.dual else 2 * (1 - 1 / n)

    def mean_modes(self, loads: Array) -> Array:
        """Return the modes of uniform fields, shape (modes, loads).

        `loads` are components of the fields, in Voigt's order of strains and stresses, shape
        (loads, components).
        """
        return np.asarray(self.of_voigt @ np.asarray(loads).T)


def isotropic_parts(dimension: int, *, stress: bool) -> Array:
    """Return the matrix from Voigt components of a tensor to its trace and parts of its deviator.

    Row 0 is the trace. The other rows are 11 − 22, in space (11 + 22 − 2·33)/√3, and twice each
    shear component of the tensor. Their squares sum to 2 dev:dev, twice the squared norm of the
    deviator.

    Args:
        dimension: 2 for the components 11, 22, 12, or 3 for 11, 22, 33, 23, 13, 12.
        stress: Whether shear components are those of the tensor, as of a stress; else they are
            twice those, as of a strain.

    Returns:
        Matrix of shape (3, 3) in the plane, (6, 6) in space.
    """
    shears = len(SHEARS[dimension])
    parts = np.zeros((dimension + shears, dimension + shears))
    parts[0, :dimension] = 1
    # Row k is orthogonal to those before it, and its squared norm is 2, so that the squares of the
    # rows sum to 2 dev:dev (of normal components).
    for k in range(1, dimension):  # 11 − 22, then (11 + 22 − 2·33)/√3
        parts[k, :k] = 1
        parts[k, k] = -k
        parts[k] *= math.sqrt(2 / (k * (k + 1)))
    parts[dimension:, dimension:] = np.eye(shears) * (2 if stress else 1)
    return parts


def field_parts(dimension: int, *, dual: bool, conduction: bool) -> Array:
    """Return the matrix from the components of a field to its parts; see `isotropic_parts`.

    A gradient or a flux has its components as they are.
    """
    if conduction:
        return np.eye(dimension)
    return isotropic_parts(dimension, stress=dual)


@cache
def element_of(sides: tuple[float, ...], *, dual: bool, conduction: bool = False) -> Element:
    """Return the finite element of one of four kinds of fields of a pixel or voxel.

    Stresses and fluxes are made of derivatives of potentials, so that they are in equilibrium
    exactly. The result is kept: equal arguments give the same object.

    Args:
        sides: Sides of a pixel along y and x, or of a voxel along z, y and x, over that along x;
            another number is a KeyError.
        dual: Whether the unknowns are potentials of stresses or of fluxes; else they are
            displacements or a temperature.
        conduction: Whether they are a temperature or potentials of fluxes.

    Returns:
        The unknowns that act on a cell, with the matrix from them to modes: coefficients of the
        trace and of the parts of the deviator of the strain or stress, or of the components of the
        gradient or flux, in products of Legendre polynomials that are orthonormal on the cell,
        constant first.
    """
    n = len(sides)
    basis = _basis(n, dual=dual, conduction=conduction)
    derivatives = field_derivatives(n, dual=dual, conduction=conduction)
    names = unknown_functions(derivatives)
    tables = np.array([_derivative_modes(basis.functions, side) for side in sides])
    has_edges = n == 3 and dual and conduction
    if has_edges:
        tables[:, EDGE, 0, 0] = 1
    spline_products = _spline_products(tables, derivatives, names)

    # Functions and modes are products over the axes, so that matrices to the modes of each Voigt
    # component are Kronecker products; the axes of `components` are (component, mode, unknown
    # function, function of the basis). An unknown function is a displacement or a potential.
    functions = list(product(range(len(basis.functions)), repeat=n))
    components = np.zeros((len(derivatives), len(functions), len(names), len(functions)))
    for k, factor in enumerate(spline_products.factors):
        component, name = spline_products.terms[k, :2]
        orders = spline_products.terms[k, 2:]
        along_axes = (table[order] for table, order in zip(tables, orders, strict=True))
        components[component, :, name] += factor * reduce(np.kron, along_axes)
    by_unknown = components.reshape(len(derivatives), len(functions), -1)

    # Kernels number all modes of space; in the plane those that are always zero are left out.
    parts = field_parts(n, dual=dual, conduction=conduction)
    modes = np.tensordot(parts, by_unknown, axes=1)  # (part, mode, local unknown)
    magnitude = np.tensordot(abs(parts), abs(by_unknown), axes=1)
    is_kept = (magnitude.max(axis=-1) > 0) | (n == 3)
    of_voigt = np.zeros((len(parts), len(functions), len(parts)))
    of_voigt[:, 0] = parts  # a uniform field has the mode 1 alone

    # A function of the element is a product of functions of one coordinate, and so is its unknown.
    numbers = list(product(range(len(basis.places)), repeat=n))
    coordinates = np.array([place.coordinate for place in basis.places])[np.array(numbers)]
    signs = np.array([place.is_odd for place in basis.places])[np.array(numbers)].sum(axis=1)
    places = np.tile(coordinates, (len(names), 1))
    if has_edges:  # A_x, A_y and A_z lie in the middle of edges along x, y and z
        places += np.eye(3)[::-1] / 2
    local = []
    for name, function in product(range(len(names)), functions):
        owners = [basis.owners[f] for f in function]
        number = numbers.index(tuple(owner[0] for owner in owners))
        offset = tuple(owner[1] for owner in owners)
        local.append(LocalUnknown(name * len(numbers) + number, offset))
    return Element(
        sides=sides,
        unknowns=len(names) * len(numbers),
        local=tuple(local),
        modes=np.ascontiguousarray(modes[is_kept]),
        magnitude=magnitude[is_kept],
        bulk_rows=0 if conduction else int(is_kept[0].sum()),
        of_voigt=of_voigt[is_kept],
        places=places,
        is_odd=np.tile(signs % 2 == 1, len(names)),
        dual=dual,
        conduction=conduction,
        products=spline_products,
    )


def _spline_products(
    tables: Array, derivatives: Derivatives, names: Sequence[tuple[int, int]]
) -> SplineProducts:
    """Return the terms of strains or stresses as arrays, grouped as compiled kernels need them.

    Args:
        tables: Matrices from functions of one coordinate to Legendre modes of their derivatives of
            order 0, 1 and 2, shape (axes of the grid, orders, modes, functions).
        derivatives: Terms, each a factor times a derivative of an unknown function, of each Voigt
            component. Their orders are along x, y and z.
        names: Indices of the unknown functions, displacements or potentials, in the order in which
            their unknowns are numbered. Each term's function is among them.

    Returns:
        `tables` as given, with `mode_counts`, the number of modes that are not zero, by order;
        `terms`, rows of (Voigt component, number of the unknown function, order
        of the derivative along each axis of the grid, x last); `groups`, ranges [first, last) of
        rows with the same function and order along x, shape (groups, 2); and `factors`, one for
        each row.
    """
    rows = [
        (component, names.index(term.function), *term.orders[::-1], term.factor)
        for component, terms in enumerate(derivatives)
        for term in terms
    ]
    # Sorted by the function and the order along x, which make a group: kernels take the derivative
    # along x once for all terms of a group.
    rows.sort(key=lambda row: (row[1], row[-2]))
    table: Ints = np.array(rows)
    terms = table[:, :-1].copy()
    starts_group = np.diff(terms[:, [1, -1]], axis=0).any(axis=1)
    ends = np.concatenate([[0], 1 + np.flatnonzero(starts_group), [len(rows)]])
    groups = np.stack([ends[:-1], ends[1:]], axis=1)
    mode_counts = tables.any(axis=(0, 3)).sum(axis=1)
    return SplineProducts(tables, mode_counts, terms, groups, table[:, -1].astype(float))


class Derivative(NamedTuple):
    """A term of a component of a field.

    Attributes:
        factor: Factor of the derivative.
        function: Indices of the function: (i, 0) of the displacement u_i, of the temperature or of
            the potential A_i of fluxes; (m, n) with m ≤ n of the potential Φ_mn of stresses, from
            0.
        orders: Orders of the derivative along x, y and, in space, z; or `EDGE`.
    """

    factor: int
    function: tuple[int, int]
    orders: tuple[int, ...]


Derivatives = list[list[Derivative]]
"""Terms of each component."""


def unknown_functions(derivatives: Derivatives) -> list[tuple[int, int]]:
    """Return the indices of the functions that occur in the components of a field, sorted."""
    # the order of the unknowns of a cell, which all of `fields` relies on
    return sorted({term.function for terms in derivatives for term in terms})


def field_derivatives(dimension: int, *, dual: bool, conduction: bool) -> Derivatives:
    """Return the terms of each component of one of the four kinds of fields."""
    if conduction:
        return flux_derivatives(dimension) if dual else gradient_derivatives(dimension)
    return stress_derivatives(dimension) if dual else strain_derivatives(dimension)


def gradient_derivatives(dimension: int) -> Derivatives:
    """Return the terms of the gradient ∂i T of a temperature."""
    return [[_derivative(1, (0, 0), [i], dimension)] for i in range(dimension)]


def flux_derivatives(dimension: int) -> Derivatives:
    """Return the terms of q = curl A; in the plane A is along z and depends on x and y.

    In space A_k is constant along k in each voxel, which the order `EDGE` of a term says.
    """
    if dimension == 2:
        return [[_derivative(1, (2, 0), [1], 2)], [_derivative(-1, (2, 0), [0], 2)]]
    by_component = []
    for i in range(3):
        j = (i + 1) % 3
        k = (i + 2) % 3
        terms = [  # ∂j A_k − ∂k A_j
            _derivative(1, (k, 0), [j, *[k] * EDGE]),
            _derivative(-1, (j, 0), [k, *[j] * EDGE]),
        ]
        by_component.append(terms)
    return by_component


def strain_derivatives(dimension: int) -> Derivatives:
    """Return the terms of ε_ii = ∂i u_i and of 2 ε_ij = ∂i u_j + ∂j u_i."""
    by_component = [[_derivative(1, (i, 0), [i], dimension)] for i in range(dimension)]
    for i, j in SHEARS[dimension]:
        terms = [_derivative(1, (j, 0), [i], dimension), _derivative(1, (i, 0), [j], dimension)]
        by_component.append(terms)
    return by_component


def stress_derivatives(dimension: int) -> Derivatives:
    """Return the terms of Beltrami's stresses, second derivatives of potentials Φ_mn.

    With i, j and k all different they are

        σ_ii = ∂j² Φ_kk + ∂k² Φ_jj − 2 ∂j ∂k Φ_jk,
        σ_ij = ∂i ∂k Φ_jk + ∂j ∂k Φ_ik − ∂i ∂j Φ_kk − ∂k² Φ_ij.

    In the plane Φ_33 alone is used: Airy's function of x and y.

    Args:
        dimension: 2 for the plane; 3 for space.

    Returns:
        For each component in Voigt's order (11, 22, 12, or 11, 22, 33, 23, 13, 12) a list of terms:
        the factor, the indices (m, n) of Φ_mn from 0 with m ≤ n, and the orders of its derivative
        along x, y and, in space, z.
    """
    axes = {0, 1, 2}
    by_component = []
    for i in range(3):
        j, k = sorted(axes - {i})
        terms = [
            _derivative(1, (k, k), [j, j]),
            _derivative(1, (j, j), [k, k]),
            _derivative(-2, (j, k), [j, k]),
        ]
        by_component.append(terms)
    for i, j in SHEARS[3]:
        (k,) = axes - {i, j}
        terms = [
            _derivative(1, (min(j, k), max(j, k)), [i, k]),
            _derivative(1, (min(i, k), max(i, k)), [j, k]),
            _derivative(-1, (k, k), [i, j]),
            _derivative(-1, (i, j), [k, k]),
        ]
        by_component.append(terms)
    if dimension == 3:
        return by_component
    # Each component has one term of Φ_33, with the indices (2, 2), without a derivative along z.
    plane = []
    for component in (0, 1, 5):  # 11, 22 and 12
        for factor, function, (x, y, z) in by_component[component]:
            if function == (2, 2) and z == 0:
                plane.append([Derivative(factor, function, (x, y))])
    return plane


def _derivative(
    factor: int, function: tuple[int, int], axes: Sequence[int], dimension: int = 3
) -> Derivative:
    """Return a term with a derivative along each of some axes."""
    return Derivative(factor, function, tuple(axes.count(axis) for axis in range(dimension)))


def _derivative_modes(basis: Polynomials, side: float) -> Array:
    """Return matrices from functions of one coordinate to Legendre modes of their derivatives.

    The modes are coefficients in the Legendre polynomials on [0, 1], scaled to be orthonormal.

    Args:
        basis: Functions of x/side on [0, 1], each by its coefficients of 1, x, x², …; at most
            cubic.
        side: Side of the cell along this axis.

    Returns:
        Matrices for the derivatives along x of order 0, 1 and 2, shape (3, modes, functions); there
        are as many modes as the longest function has coefficients. An entry is an exact integral
        that is rounded, times a root and a power of the side.
    """
    legendre: Polynomials = ((1,), (-1, 2), (1, -6, 6), (-1, 12, -30, 20))
    functions = list(basis)
    count = max(map(len, basis))
    # ∫ P_k² over [0, 1] is 1/(2k + 1) for the shifted Legendre polynomials P_k.
    norms = np.sqrt(2 * np.arange(float(count)) + 1)
    matrices = []
    for order in range(3):
        # fractions of whole numbers, so that a table's error is that of one rounding
        exact = [_integral(mode, f) for mode in legendre[:count] for f in functions]
        matrix = np.array(exact, dtype=float).reshape(count, len(functions))
        matrices.append(matrix * norms[:, None] / side**order)
        functions = [_differentiated(f) for f in functions]
    return np.array(matrices)


def _differentiated(polynomial: tuple[int, ...]) -> tuple[int, ...]:
    """Return the coefficients of the derivative of a polynomial."""
    return tuple(power * c for power, c in enumerate(polynomial))[1:]


def _integral(first: tuple[int, ...], second: tuple[int, ...]) -> Fraction:
    """Return the integral of the product of two polynomials over [0, 1]."""
    pairs = product(enumerate(first), enumerate(second))
    return sum((Fraction(a * b, i + j + 1) for (i, a), (j, b) in pairs), Fraction(0))
