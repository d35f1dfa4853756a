"""Stresses and fluxes that vanish in closed pores, by potentials that are prescribed there.

A stress σ̄ + curl curl Φ vanishes in a pore where Φ is a polynomial of second degree with
curl curl Φ = −σ̄. B-splines and Hermite functions reproduce such polynomials, so all coefficients of
functions that reach into a pore are those of one polynomial, about the pore's own centre. A pore
that is connected with its own periodic image has none, as Φ is periodic.

What is left free in each pore are polynomials of second degree without stress: in the plane the
linear ones, which carry forces from pore to pore, in space besides them 30 of gauge, without which
the potentials between pores would be stiffer than they need be. Of a flux q̄ + curl A the
polynomials are of first degree with curl A = −q̄; free are a constant in the plane, and six
polynomials in space.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import compress, product
from typing import TYPE_CHECKING, NamedTuple, Self

import numpy as np

from alphacut.base.arrays import Array, Ints, Mask
from alphacut.rve.image.fields.element import (
    Element,
    field_derivatives,
    unknown_functions,
)
from alphacut.rve.image.fields.grid import Fields, namespace, on_host

if TYPE_CHECKING:
    from scipy.sparse import csr_array


@dataclass(frozen=True, eq=False)
class PoreNodes:
    """Nodes whose functions reach into closed pores, K of them.

    Args:
        node: Indices of their cells along the axes of the grid, shape (K, dimension).
        pore: Number of the pore of each, from 0, shape (K,).
        position: Places from the centre of the pore, not wrapped at the sides of the grid, in
            cells, whole numbers, shape (K, dimension).
    """

    node: Ints
    pore: Ints
    position: Array

    @classmethod
    def of_mask(cls, is_pore: Mask, reach: int) -> Self | None:
        """Return the nodes of all closed pores of a periodic grid.

        Cells belong to one pore if a function of the element reaches into both: if they are at most
        `reach` cells apart along each axis, also through the sides of the grid.

        Args:
            is_pore: Whether each cell is a pore, shape (y, x) or (z, y, x), with one pore at least.
            reach: Largest number of cells along an axis over which a function of the element
                extends beyond its own cell.

        Returns:
            For K nodes, each listed once: the index of the node's cell in the grid, the number of
            its pore, and its integer coordinates about the centre of the pore, which do not jump at
            the sides of the grid. None where a pore meets its own periodic image, so that it is not
            closed.
        """
        from scipy import ndimage  # takes time to import

        shape = np.array(is_pore.shape)
        cells = np.argwhere(is_pore)
        labels, count = ndimage.label(is_pore, np.ones((3,) * is_pore.ndim))
        label = labels[tuple(cells.T)] - 1
        pieces = _unwrapped_pieces(label, cells, labels, count=count, reach=reach)
        if pieces is None:
            return None
        pore = pieces.pore[label]
        unwrapped = cells + pieces.periods[label] * shape

        # Each cell has the nodes at these offsets; a node is listed once, with one of its cells.
        offsets = np.array(list(product(range(reach + 1), repeat=is_pore.ndim)))
        nodes = ((cells[:, None] + offsets) % shape).reshape(-1, is_pore.ndim)
        flat = np.ravel_multi_index(tuple(nodes.T), is_pore.shape)
        _, first = np.unique(flat, return_index=True)
        owner, number = np.divmod(first, len(offsets))
        position = unwrapped[owner] + offsets[number]
        sums = np.stack([np.bincount(pore[owner], x) for x in position.T], axis=1)
        # A centre in whole numbers keeps the coordinates of nodes exact; anywhere near the middle
        # will do, since it only keeps the monomials of the coordinates small.
        centre = np.round(sums / np.bincount(pore[owner])[:, None])
        return cls(nodes[first], pore[owner], position - centre[pore[owner]])


class _Pieces(NamedTuple):
    """Pieces of pores that are connected within the grid.

    Attributes:
        pore: Number of the pore of each piece, shape (pieces,).
        periods: Periods of the grid by which each piece is moved along the axes to lie beside the
            others of its pore, shape (pieces, dimension).
    """

    pore: Ints
    periods: Ints


def _unwrapped_pieces(
    label: Ints, cells: Ints, labels: Ints, *, count: int, reach: int
) -> _Pieces | None:
    """Return which pore each piece belongs to in a periodic grid, and where the piece lies in it.

    A piece is a set of pore cells that are connected within the grid, without its sides.

    Args:
        label: Number of the piece of each of the C pore cells, from 0, shape (C,).
        cells: Indices of these cells along the axes of the grid, shape (C, dimension).
        labels: Number of the piece of each cell of the grid from 1, and 0 outside pores, of the
            grid's shape.
        count: Number of pieces, at least 1.
        reach: Cells of pores that are at most this many cells apart along each axis belong to one
            pore.

    Returns:
        For each piece the number of its pore, shape (count,), and the periods of the grid by which
        it is moved along the axes to lie beside the others of its pore, shape (count, dimension).
        None where a pore meets its own periodic image.
    """
    from scipy.sparse import csr_array  # takes time to import
    from scipy.sparse.csgraph import breadth_first_order, connected_components

    # Links (piece, neighbouring piece, periods from one to the other along each axis). Pieces are
    # few where cells are many, so that links are compared by piece and each kind counts once.
    rows = []
    for offset in product(range(-reach, reach + 1), repeat=labels.ndim):
        period, neighbour = np.divmod(cells + offset, labels.shape)
        other = labels[tuple(neighbour.T)] - 1
        is_link = (other >= 0) & ((other != label) | period.any(axis=1))
        rows.append(np.column_stack([label, other, period])[is_link])
    links = np.unique(np.concatenate(rows), axis=0)
    first = links[:, 0]
    second = links[:, 1]
    periods = links[:, 2:]

    # Breadth first from an added root that is linked to the first piece of each pore, so that one
    # search reaches all pores. Its number is `count`.
    graph = csr_array((np.ones(len(links)), (first, second)), (count, count))
    _, pore = connected_components(graph, directed=False)
    _, starts = np.unique(pore, return_index=True)
    tails = np.append(first, np.full(len(starts), count))
    heads = np.append(second, starts)
    rooted = csr_array((np.ones(len(heads)), (tails, heads)), (count + 1, count + 1))
    order, predecessors = breadth_first_order(rooted, count)
    between = {(a, b): k for k, (a, b) in enumerate(zip(first, second, strict=True))}
    moved = np.zeros((count, labels.ndim), np.int64)
    for piece in order[1:]:
        predecessor = predecessors[piece]
        if predecessor < count:
            moved[piece] = moved[predecessor] + periods[between[predecessor, piece]]
    # The tree moves each piece beside its predecessor. A pore is closed if all other links agree
    # with it; a loop of links whose periods do not add up to zero leads to the pore's own image.
    if (moved[second] != moved[first] + periods).any():
        return None
    return _Pieces(pore, moved)


class _Polynomials(NamedTuple):
    """Polynomials of the potentials, for coordinates in cells.

    Attributes:
        degree: Degree of the particular polynomials: 2 of stresses, 1 of fluxes.
        particular: Coefficients of polynomials whose stress or flux is −1 in one component and 0
            in the others, shape (components, potentials, monomials).
        gauge: Coefficients of all polynomials without stress or flux, shape (J, potentials,
            monomials); each has one term in a potential.
        monomials: Degrees of the monomials along the axes of the grid.
    """

    degree: int

    particular: Array
    gauge: Array
    monomials: list[tuple[int, ...]]


def _polynomials(element: Element) -> _Polynomials:
    """Return the potentials with a unit stress or flux, and those without one.

    Coordinates are in cells. A polynomial has a coefficient for each potential and each monomial
    whose degree along all axes together is at most 2, or 1 for fluxes.

    Args:
        element: Element of stresses or fluxes, whose potentials and sides are used.

    Returns:
        `degree`, 2 or 1; `particular`, polynomials whose stress or flux is −1 in one component and
        0 in the others, shape (components, potentials, monomials); `gauge`, a basis of all
        polynomials without stress or flux, shape (J, potentials, monomials); and `monomials`, the
        degrees of each along (y, x) or (z, y, x).
    """
    degree = 1 if element.conduction else 2  # that of the derivatives
    degrees_of_axes = product(range(degree + 1), repeat=element.dimension)
    monomials = [degrees for degrees in degrees_of_axes if sum(degrees) <= degree]
    derivatives = field_derivatives(element.dimension, dual=True, conduction=element.conduction)
    potentials = unknown_functions(derivatives)
    shape = (len(potentials), len(monomials))
    is_free = np.ones(shape, bool)  # monomials that occur in no component of the field
    particular = np.zeros((len(derivatives), *shape))
    gauge = []
    for component, terms in enumerate(derivatives):
        units = []  # for each term the polynomial of stress 1 in this component
        for term in terms:
            degrees = term.orders[::-1]  # along the axes of the grid
            if element.conduction:  # constant along an axis of the order `EDGE`
                degrees = tuple(int(order == 1) for order in degrees)
            index = potentials.index(term.function), monomials.index(degrees)
            is_free[index] = False
            area = np.prod(np.array(element.sides) ** degrees)
            unit = np.zeros(shape)
            unit[index] = area / (term.factor * max(degrees))  # ∂² x² = 2, ∂x ∂y x y = ∂x x = 1
            units.append(unit)
        particular[component] = -units[0]
        # The difference of two polynomials with the same stress has no stress.
        gauge += [unit - units[0] for unit in units[1:]]
    if element.conduction and element.dimension == 3:
        for axis in range(3):  # A_i is constant along i
            is_free[axis, monomials.index(tuple(np.eye(3, dtype=int)[2 - axis]))] = False
    for index in np.argwhere(is_free):
        alone = np.zeros(shape)
        alone[tuple(index)] = 1.0
        gauge.append(alone)
    return _Polynomials(degree, particular, np.array(gauge), monomials)


def _coefficients(element: Element, position: Array, degrees: tuple[int, ...]) -> Array:
    """Return the coefficients of the element's functions that make up a monomial, at nodes.

    The monomial is a product of powers of the coordinates, of degree 2 at most. The coefficients
    are exact: whole multiples of 1/32 in space, of 1/2 in the plane.

    Args:
        element: Element of stresses or fluxes; of the latter the degree is 1 at most.
        position: Whole coordinates of K nodes in cells along the axes, shape (K, dimension).
        degrees: Degrees of the monomial along these axes.

    Returns:
        Coefficients, shape (unknowns of a potential at a node, K). In the plane the unknowns of
        stresses are Hermite's: value, slope along x, slope along y, mixed derivative; those of
        fluxes are the values at the node, half a cell further along x, along y, and along both. In
        space there is one, of a quadratic B-spline.
    """
    along_axes: list[list[Array]] = []
    for axis, degree in enumerate(degrees):
        x = position[:, axis]
        if element.dimension == 2 and element.conduction:
            along_axes.append([x**degree, (x + 0.5) ** degree])
        elif element.conduction:  # the value at a node, or on an edge along a constant monomial
            along_axes.append([x**degree])
        elif element.dimension == 2:  # value and slope of Hermite's functions
            along_axes.append([x**degree, degree * x ** max(degree - 1, 0)])
        else:  # coefficients of the quadratic B-splines of `element`, which sum to 2
            of_degrees = np.ones_like(x), x - 0.5, x * (x - 1)
            along_axes.append([of_degrees[degree] / 2])
    return np.array([np.prod(factors, axis=0) for factors in product(*along_axes)])


def _node_matrix(
    polynomials: Array, coefficients: Array, first_column: Ints, n_columns: int
) -> csr_array:
    """Return the matrix from factors of polynomials to the unknowns at the nodes of pores.

    Args:
        polynomials: N polynomials of the potentials, shape (N, potentials, monomials).
        coefficients: Coefficients of the monomials at the K nodes, shape (monomials, unknowns of a
            potential at a node × K).
        first_column: Column of the first of the N polynomials for each of these unknowns, of the
            pore that the node belongs to, shape (unknowns × K,).
        n_columns: Number of columns.

    Returns:
        Sparse matrix with a row for each potential, unknown at a node, and node, in this order.
    """
    from scipy.sparse import csr_array  # takes time to import

    number, potential, monomial = np.nonzero(polynomials)
    size = coefficients.shape[1]
    factors = polynomials[number, potential, monomial]
    values = factors[:, None] * coefficients[monomial]
    rows = potential[:, None] * size + np.arange(size)
    columns = number[:, None] + first_column
    shape = polynomials.shape[1] * size, n_columns
    return csr_array((values.ravel(), (rows.ravel(), columns.ravel())), shape)


@dataclass(frozen=True, eq=False)
class PorePotentials:
    """Fields of potentials whose total stress or flux vanishes in pores: an affine space.

    Under the mean stress σ̄ the R unknowns that act on pores are `particular` σ̄ + `gauge` y, with J
    parameters y for each of P pores; likewise under a mean flux.

    Args:
        index: Index of these unknowns in an array of shape (fields, unknowns, *grid).
        particular: Matrix from mean stresses, shape (R, components).
        gauge: Matrix from the parameters of all pores, shape (R, P × J).
        inverse: Pseudo-inverses of the Gram matrices of `gauge` in each pore, shape (P, J, J).
    """

    index: tuple[slice | Ints, ...]
    particular: csr_array
    gauge: csr_array
    inverse: Array

    @classmethod
    def of_nodes(cls, element: Element, nodes: PoreNodes, is_pore: Mask) -> Self:
        """Return the potentials whose total stress or flux vanishes in closed pores.

        In each pore the potentials are polynomials about the pore's centre: a particular one for
        each component of the mean stress or flux, plus any combination of J polynomials without
        stress or flux.

        Args:
            element: Element of stresses or fluxes, of the grid's dimension.
            nodes: Nodes of the closed pores, at least one, with pores numbered from 0 without gaps.
            is_pore: Whether each cell is in a pore, of the grid's shape.

        Returns:
            The affine space of the R unknowns at these nodes of P pores that act on a cell of a
            pore: their `index` in an array of fields; `particular`, the matrix from mean stresses
            or fluxes to them, shape (R, components); `gauge`, the matrix from the J parameters of
            each pore to them, shape (R, P × J); and `inverse`, the pseudo-inverses of the pores'
            Gram matrices, shape (P, J, J).
        """
        polynomials = _polynomials(element)
        n_gauge = len(polynomials.gauge)
        n_pores = int(nodes.pore.max()) + 1
        # Parameters are factors of monomials in units of the pore's extent, a power of two.
        largest = np.ones(n_pores)
        np.maximum.at(largest, nodes.pore, abs(nodes.position).max(axis=1))
        extent = 2.0 ** np.ceil(np.log2(largest))[nodes.pore]
        of_monomials = []
        for degrees in polynomials.monomials:
            coefficients = _coefficients(element, nodes.position, degrees)
            of_monomials.append((coefficients / extent ** sum(degrees)).ravel())
        coefficients = np.array(of_monomials)
        n_numbers = coefficients.shape[1] // len(nodes.pore)
        first_column = n_gauge * np.tile(nodes.pore, n_numbers)
        gauge = _node_matrix(polynomials.gauge, coefficients, first_column, n_pores * n_gauge)

        # The monomials of the particular polynomials are of the same degree.
        coefficients = coefficients * np.tile(extent**polynomials.degree, n_numbers)
        n_components = len(polynomials.particular)
        particular = _node_matrix(
            polynomials.particular, coefficients, np.zeros_like(first_column), n_components
        )
        # An unknown at a node may act on other cells alone, as that half a cell further does.
        acts_on_pores = np.zeros((element.unknowns, *is_pore.shape), bool)
        axes = tuple(range(is_pore.ndim))
        acts: Mask = element.magnitude.max(axis=0) > 0
        for local in compress(element.local, acts):
            acts_on_pores[local.unknown] |= np.roll(is_pore, local.offset, axes)
        unknown, node = np.nonzero(acts_on_pores[:, *nodes.node.T])
        rows = unknown * len(nodes.pore) + node
        particular = particular[rows]
        gauge = gauge[rows]
        # Polynomials whose eigenvalue is below 1e-11 of the largest count as dependent in a small
        # pore. A larger limit would take freedom from the stress, a smaller one keep rounding.
        gram = (gauge.T @ gauge).tobsr(blocksize=(n_gauge, n_gauge)).data
        inverse = np.linalg.pinv(gram, rcond=1e-11, hermitian=True)
        index = slice(None), unknown, *nodes.node[node].T
        return cls(index, particular, gauge, inverse)

    def project(self, fields: Fields) -> Fields:
        """Project fields orthogonally on differences of fields of the space, in place.

        Returns the changed array, which has the shape (fields, unknowns, *grid).
        """
        return self._set_at_nodes(fields, self.gauge @ self._parameters(self._at_nodes(fields)))

    def particular_fields(self, loads: Array, like: Fields) -> Fields:
        """Return potentials whose total stress or flux under given mean ones vanishes in pores.

        They are zero outside the nodes of the pores.

        Args:
            loads: Mean stresses in Voigt order or mean fluxes, shape (loads, components).
            like: Array of shape (loads, unknowns of a cell, *grid), whose shape and library the
                result has; it is not changed.
        """
        return self._set_at_nodes(namespace(like).zeros_like(like), self.particular @ loads.T)

    def impose(self, fields: Fields) -> Fields:
        """Put fields for unit loads into the space of potentials that vanish in pores, in place.

        At the pores' nodes the fields become those of the nearest polynomials, whose total stress
        or flux vanishes in exact arithmetic. What rounding leaves is bounded.

        Args:
            fields: Potentials under unit mean stresses in Voigt order or unit mean fluxes, shape
                (loads, unknowns of a cell, *grid); changed at the pores' nodes.

        Returns:
            Bounds of the distances of the new values from the exact polynomials, in the shape of
            `fields`; 0 outside the pores' nodes.
        """
        particular = self.particular.toarray()
        # `_parameters` gives those of the nearest combination of polynomials without stress.
        parameters = self._parameters(self._at_nodes(fields) - particular)
        self._set_at_nodes(fields, particular + self.gauge @ parameters)
        # A value is a sum of n products with parameters, which are taken as exact, and entries,
        # which are rounded by 6 units at most. The error is at most n + 8 units of the sum of the
        # magnitudes (Higham, Accuracy and Stability of Numerical Algorithms, section 3.1).
        unit = 2.0**-53
        terms = self.inverse.shape[1] + particular.shape[1] + 8
        size = abs(particular) + abs(self.gauge) @ abs(parameters)
        return self._set_at_nodes(namespace(fields).zeros_like(fields), terms * unit * size)

    def _at_nodes(self, fields: Fields) -> Array:
        """Return the R unknowns that act on pores in NumPy, shape (R, fields)."""
        return on_host(fields[self.index]).T

    def _set_at_nodes(self, fields: Fields, at_nodes: Array) -> Fields:
        """Set the unknowns at the pores' nodes in place, and return the changed array.

        Args:
            fields: Array of shape (fields, unknowns of a cell, *grid); changed at the R unknowns
                alone.
            at_nodes: Values, shape (R, fields).
        """
        fields[self.index] = namespace(fields).asarray(at_nodes.T)
        return fields

    def _parameters(self, at_nodes: Array) -> Array:
        """Return the parameters of the nearest polynomials without stress, (P × J, fields)."""
        moments = self.gauge.T @ at_nodes
        n_pores, n_gauge, _ = self.inverse.shape
        parameters = self.inverse @ moments.reshape(n_pores, n_gauge, -1)
        return np.asarray(parameters.reshape(moments.shape))
