"""Stresses that vanish in closed pores, by potentials that are prescribed there.

A stress σ̄ + curl curl Φ vanishes in a pore where Φ is a polynomial of second degree with
curl curl Φ = −σ̄. B-splines and Hermite functions reproduce such polynomials, so all coefficients of
functions that reach into a pore are those of one polynomial, about the pore's own centre. A pore
that is connected with its own periodic image has none, as Φ is periodic.

What is left free in each pore are polynomials of second degree without stress: in the plane the
linear ones, which carry forces from pore to pore, in space besides them 30 of gauge, without which
the potentials between pores would be stiffer than they need be.
"""

from __future__ import annotations

from collections import defaultdict, deque
from dataclasses import dataclass
from itertools import product
from typing import Self

import numpy as np
from scipy import ndimage
from scipy.sparse import csr_array

from alphacut.base.arrays import Array, Ints, Mask
from alphacut.rve.image.fields.element import BASES, Element, stress_derivatives
from alphacut.rve.image.fields.grid import Fields, namespace, on_host

UNIT = 2.0**-53  # rounding unit
RANK = 1e-11  # relative eigenvalue from which on polynomials count as independent in a pore


@dataclass(frozen=True, eq=False)
class PoreNodes:
    """Nodes whose functions reach into closed pores, K of them.

    Args:
        node: Indices of their cells along the axes of the grid, shape (K, dimension).
        pore: Number of the pore of each, from 0, shape (K,).
        position: Their places from the centre of the pore, not wrapped at the sides of the grid, in
            cells, whole numbers, shape (K, dimension).
    """

    node: Ints
    pore: Ints
    position: Array

    @classmethod
    def of_mask(cls, is_pore: Mask, reach: int) -> Self | None:
        """Nodes of all pores of a periodic grid; None where a pore meets its periodic image.

        Cells are of one pore if a function reaches into both: if they are at most `reach` cells
        apart along each axis.
        """
        shape = np.array(is_pore.shape)
        cells = np.argwhere(is_pore)
        labels, count = ndimage.label(is_pore, np.ones((3,) * is_pore.ndim))
        label = labels[tuple(cells.T)] - 1
        shift = _shifts(label, cells, labels, count=count, reach=reach)
        if shift is None:
            return None
        numbers = np.unique(shift[:, -1], return_inverse=True)[1]
        pore, unwrapped = numbers[label], cells + shift[label, :-1] * shape
        offsets = np.array(list(product(range(reach + 1), repeat=is_pore.ndim)))
        node = (cells[:, None] + offsets) % shape
        flat = np.ravel_multi_index(tuple(np.moveaxis(node, -1, 0)), is_pore.shape).ravel()
        _, first = np.unique(flat, return_index=True)
        owner = first // len(offsets)  # a cell that the node reaches into
        position = unwrapped[owner] + offsets[first % len(offsets)]
        sizes = np.bincount(pore[owner])
        sums = [np.bincount(pore[owner], x) for x in position.T]
        centre = np.round(np.stack(sums, axis=1) / sizes[:, None])
        place = node.reshape(-1, is_pore.ndim)[first]
        return cls(place, pore[owner], position - centre[pore[owner]])


def _shifts(label: Ints, cells: Ints, labels: Ints, *, count: int, reach: int) -> Ints | None:
    """Periods by which each part of the pores is moved to lie beside its neighbours.

    Args:
        label: Number of the part of each pore cell, parts being connected within the grid, (C,).
        cells: Indices of the pore cells, shape (C, dimension).
        labels: Number of each cell's part from 1, 0 outside pores, of the grid's shape.
        count: Number of parts.
        reach: Cells along an axis within which parts are neighbours.

    Returns:
        Periods along each axis and, last, a number that all parts of one pore share, shape (count,
        dimension + 1); None where a pore would have to be moved against itself.
    """
    shape, dimension = np.array(labels.shape), labels.ndim
    links = defaultdict[int, set[tuple[int, tuple[int, ...]]]](set)
    offsets = [x for x in product(range(-reach, reach + 1), repeat=dimension) if any(x)]
    for offset in offsets:
        period, neighbour = np.divmod(cells + offset, shape)
        other = labels[tuple(neighbour.T)] - 1
        is_link = (other >= 0) & ((other != label) | period.any(axis=1))
        rows = np.column_stack([label, other, period])[is_link]
        for first, second, *periods in np.unique(rows, axis=0).tolist():
            links[first].add((second, tuple(periods)))
    shift = np.zeros((count, dimension + 1), np.int64)
    shift[:, -1] = -1
    for start in range(count):
        if shift[start, -1] >= 0:
            continue
        shift[start, -1] = start
        queue = deque([start])
        while queue:
            part = queue.popleft()
            for other, periods in links[part]:
                moved = shift[part] + (*periods, 0)
                if shift[other, -1] < 0:
                    shift[other] = moved
                    queue.append(other)
                elif (shift[other] != moved).any():
                    return None
    return shift


def _powers(element: Element, position: Array, degree: int) -> Array:
    """Coefficients of x^degree along one axis at nodes (K,), x in cells: shape (numbers, K).

    They are exact: multiples of 1/4 of whole numbers.
    """
    if element.dimension == 2:  # value and slope of Hermite's functions
        slope = degree * position ** max(degree - 1, 0)
        return np.stack([position**degree, slope])
    # the quadratic B-splines of `element` sum to 2
    quadratic = position * (position - 1)
    return np.stack([(np.ones_like(position), position - 0.5, quadratic)[degree] / 2])


def _polynomials(element: Element) -> tuple[Array, Array, list[tuple[int, ...]]]:
    """Polynomials of second degree of the potentials, for coordinates in cells.

    Returns:
        Coefficients whose curl curl is −1 in one Voigt component and 0 in the others, shape
        (components, potentials, monomials); those of all without stress, shape (J, potentials,
        monomials), each with one term in a potential; and the monomials' degrees along the axes.
    """
    n, sides = element.dimension, element.sides
    monomials = [x for x in product(range(3), repeat=n) if sum(x) <= 2]
    derivatives = stress_derivatives(n)
    potentials = sorted({potential for terms in derivatives for _, potential, _ in terms})
    shape = (len(potentials), len(monomials))
    is_free = np.ones(shape, bool)  # monomials that occur in no component of the stress
    particular, gauge = np.zeros((len(derivatives), *shape)), []
    for component, terms in enumerate(derivatives):
        units = []  # of each term the polynomial of stress 1 in this component
        for factor, potential, orders in terms:
            degrees = orders[::-1]  # along the axes of the grid
            at = potentials.index(potential), monomials.index(degrees)
            is_free[at] = False
            area = np.prod([side**degree for side, degree in zip(sides, degrees, strict=True)])
            unit = np.zeros(shape)
            unit[at] = area / (factor * max(orders))  # ∂² x² = 2, ∂x ∂y x y = 1
            units.append(unit)
        particular[component] = -units[0]
        gauge += [unit - units[0] for unit in units[1:]]
    for at in np.argwhere(is_free):
        alone = np.zeros(shape)
        alone[tuple(at)] = 1.0
        gauge.append(alone)
    return particular, np.array(gauge), monomials


@dataclass(frozen=True, eq=False)
class PorePotentials:
    """Fields of potentials whose total stress vanishes in pores: an affine space.

    At the nodes of the pores, K of them in P pores, coefficients are those of polynomials with
    parameters y for each load and pore: `values` times (`particular` + `gauge` y).

    Args:
        places: Indices of the nodes along each axis of the grid.
        values: Coefficients of monomials, shape (numbers of a node × K, P × monomials); each column
            in units of the pore's extent, a power of two, to the monomial's degree.
        scale: Square of each pore's extent, shape (P,).
        particular: By Voigt component, shape (components, potentials × monomials).
        gauge: Shape (potentials × monomials, J).
        inverse: Pseudo-inverses of the Gram matrices of the polynomials without stress, (P, J, J).
        potentials: Number of potentials.
    """

    places: tuple[Ints, ...]
    values: csr_array
    scale: Array
    particular: Array
    gauge: Array
    inverse: Array
    potentials: int

    @classmethod
    def of_nodes(cls, element: Element, nodes: PoreNodes) -> Self:
        """Potentials of an element of stresses, for the nodes of closed pores."""
        particular, gauge, monomials = _polynomials(element)
        count, n_pores, n_monomials = len(nodes.pore), int(nodes.pore.max()) + 1, len(monomials)
        largest = np.ones(n_pores)
        np.maximum.at(largest, nodes.pore, abs(nodes.position).max(axis=1))
        extent = 2.0 ** np.ceil(np.log2(largest))
        n_numbers = len(BASES[element.dimension, True].places)
        columns = []
        for degrees in monomials:
            along_axes = [
                _powers(element, nodes.position[:, axis], degree)
                for axis, degree in enumerate(degrees)
            ]
            numbers = product(range(n_numbers), repeat=element.dimension)
            of_numbers = [
                np.prod([of_axis[k] for of_axis, k in zip(along_axes, ks, strict=True)], axis=0)
                for ks in numbers
            ]
            columns.append(np.stack(of_numbers) / extent[nodes.pore] ** sum(degrees))
        dense = np.stack(columns, axis=-1)  # (numbers of a node, K, monomials)
        row = np.broadcast_to(np.arange(dense[..., 0].size).reshape(-1, count, 1), dense.shape)
        column = n_monomials * nodes.pore[:, None] + np.arange(n_monomials)
        column = np.broadcast_to(column, dense.shape)
        shape = (dense[..., 0].size, n_pores * n_monomials)
        values = csr_array((dense.ravel(), (row.ravel(), column.ravel())), shape)
        # products of monomials in each pore, then of the polynomials without stress
        products = np.zeros((n_pores, n_monomials, n_monomials))
        np.add.at(products, nodes.pore, np.einsum("bka,bkc->kac", dense, dense))
        gram = np.einsum("ipa,Nac,jpc->Nij", gauge, products, gauge, optimize=True)
        inverse = np.linalg.pinv(gram, rcond=RANK, hermitian=True)
        return cls(
            places=tuple(nodes.node.T),
            values=values,
            scale=extent**2,
            particular=particular.reshape(len(particular), -1),
            gauge=gauge.reshape(len(gauge), -1).T,
            inverse=inverse,
            potentials=len(particular[0]),
        )

    def project(self, fields: Fields) -> Fields:
        """Orthogonal projection on differences of the space's fields, in place; returned."""
        at_nodes = self._at_nodes(fields)
        polynomials = self._parameters(at_nodes) @ self.gauge.T
        return self._put(fields, self._evaluated(self.values, polynomials))

    def particular_fields(self, loads: Array, like: Fields) -> Fields:
        """Fields of the space that vanish outside the pores' nodes, for mean stresses `loads`.

        `like` is an array of the fields' shape and library; loads are rows in Voigt order.
        """
        fields = namespace(like).zeros_like(like)
        return self._put(fields, self._evaluated(self.values, self._stress_polynomials(loads)))

    def impose(self, fields: Fields) -> Fields:
        """Put fields for unit loads into the space, in place, and bound how far they are off.

        At the pores' nodes the fields become those of the nearest polynomials, whose stress
        vanishes in exact arithmetic. Returned are bounds of what the numbers there are off from
        these polynomials by, of the fields' shape; 0 elsewhere.
        """
        stress = self._stress_polynomials(np.eye(len(self.particular)))
        difference = self._at_nodes(fields) - self._evaluated(self.values, stress)
        parameters = self._parameters(difference)
        polynomials = stress + parameters @ self.gauge.T
        self._put(fields, self._evaluated(self.values, polynomials))
        # a coefficient is a sum over monomials of a sum over parameters, of products of numbers
        # that are rounded thrice at most
        terms = self.gauge.shape[1] + self.values.shape[1] // len(self.scale) + 8
        size = abs(stress) + abs(parameters) @ abs(self.gauge.T)
        error = terms * UNIT * self._evaluated(abs(self.values), size)
        return self._put(namespace(fields).zeros_like(fields), error)

    def _stress_polynomials(self, loads: Array) -> Array:
        """Coefficients of stress −`loads`, shape (loads, pores, potentials × monomials)."""
        return (loads @ self.particular)[:, None] * self.scale[:, None]

    def _at_nodes(self, fields: Fields) -> Array:
        """Values at the pores' nodes, shape (loads, potentials, numbers of a node × K)."""
        found = on_host(fields[(slice(None), slice(None), *self.places)])
        return found.reshape(len(found), self.potentials, -1)

    def _put(self, fields: Fields, at_nodes: Array) -> Fields:
        """Set the values at the pores' nodes, in place; the fields are returned."""
        values = at_nodes.reshape(*fields.shape[:2], -1)
        fields[(slice(None), slice(None), *self.places)] = namespace(fields).asarray(values)
        return fields

    def _parameters(self, at_nodes: Array) -> Array:
        """Parameters y of the nearest polynomials without stress, shape (loads, pores, J)."""
        count, n_pores = len(at_nodes), len(self.scale)
        moments = self.values.T @ at_nodes.reshape(-1, at_nodes.shape[-1]).T
        moments = moments.reshape(n_pores, -1, count, self.potentials).transpose(2, 0, 3, 1)
        of_gauge = moments.reshape(count, n_pores, -1) @ self.gauge
        return np.asarray(np.einsum("pij,lpj->lpi", self.inverse, of_gauge))

    def _evaluated(self, values: csr_array, polynomials: Array) -> Array:
        """Polynomials (loads, pores, potentials × monomials) at the nodes, as `_at_nodes`."""
        count, n_pores = polynomials.shape[:2]
        by_potential = polynomials.reshape(count, n_pores, self.potentials, -1)
        columns = by_potential.transpose(1, 3, 0, 2).reshape(values.shape[1], -1)
        return np.asarray((values @ columns).T.reshape(count, self.potentials, -1))
