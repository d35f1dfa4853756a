"""Two finite elements on a pixel, from unknowns to orthonormal strain or stress modes.

Displacement: biquadratic, two components (Q2). Stress: from an Airy function φ in the bicubic
rectangle with continuous slopes (Bogner, Fox, Schmit 1965), σ11 = φ,22, σ22 = φ,11, σ12 = −φ,12,
which is in equilibrium exactly.

Either field f is expanded in products of Legendre polynomials that are orthonormal on the pixel, so
the mean energy of a pixel is a
sum of squares without quadrature error: k Σ (modes of the trace)² + G Σ (modes of 11 − 22 and of
twice 12)², with k = K + G/3, and with 1/(4 k), 1/(4 G) in the place of k, G for stresses.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from functools import cache
from itertools import product

import numpy as np

from alphacut.stochastic.theta.truncated_normal import Array

Polynomial = tuple[Fraction, ...]  # coefficients of 1, x, x², … on [0, 1]


@dataclass(frozen=True)
class Element:
    """Unknowns of a pixel and the modes that they cause.

    Args:
        types: Unknowns per pixel of the periodic grid.
        local_types: Type of each of the pixel's local unknowns, shape (n,).
        shifts: Pixel, from this one in (rows, columns), that owns each local unknown, shape (n, 2),
            0 or 1.
        positions: Place (y, x) of each local unknown in pixels, shape (n, 2), multiples of 1/2.
        odd: Types whose unknown changes sign under inversion of the plane, shape (types,).
        modes: Matrix from local unknowns to modes, shape (rows, n); lengths in pixel widths.
        bulk_rows: The first so many modes belong to the trace.
        constants: Rows of the constant modes of trace, difference of normal components and twice
            the shear component.
        twice_shear: Factor from the Voigt component 12 to twice the tensor component.
        anchors: For each local unknown the ones to subtract from it, which takes a field without
            strain or stress away.
        line: Coefficients of the basis functions along one side, of which the pixel's are products.
        order: Derivatives between the field and its modes.
        orders: For each mode its part (0 trace, 1 difference, 2 shear) and Legendre orders along y,
            x.
        functionals: For each type its component, place (y, x) in its pixel and orders of its
            derivatives along y and x.
    """

    types: int
    local_types: tuple[int, ...]
    shifts: tuple[tuple[int, int], ...]
    positions: Array
    odd: tuple[bool, ...]
    modes: Array
    bulk_rows: int
    constants: tuple[int, int, int]
    twice_shear: float
    anchors: tuple[tuple[int, ...], ...]
    line: tuple[tuple[int, ...], ...]
    order: int
    orders: tuple[tuple[int, int, int], ...]
    functionals: tuple[tuple[int, float, float, int, int], ...]

    def mean_modes(self, loads: Array) -> Array:
        """Modes of uniform fields in Voigt order, shape (loads, 3) → (rows, loads)."""
        modes = np.zeros((len(self.modes), len(loads)))
        first, second, shear = np.asarray(loads).T
        for row, value in zip(
            self.constants, (first + second, first - second, self.twice_shear * shear), strict=True
        ):
            modes[row] = value
        return modes


@cache
def displacement_element(aspect: float = 1.0) -> Element:
    """Q2 displacement on a pixel `aspect` times as high as wide."""
    basis = ((1, -3, 2), (0, 4, -4), (0, -1, 2))  # at 0, 1/2, 1
    table = _tables(basis, degree=2)
    places = list(product(range(2), range(3), range(3)))  # component, y, x
    zero = np.zeros((9, 9))
    along_x = np.kron(table[0], table[1])
    along_y = np.kron(table[1], table[0]) / aspect
    parts = (
        np.hstack([along_x, along_y]),
        np.hstack([along_x, -along_y]),
        np.hstack([along_y, zero + along_x]),
    )
    modes, bulk_rows, constants, orders = _stacked(parts)
    return Element(
        types=8,
        local_types=tuple(4 * c + 2 * (y % 2) + x % 2 for c, y, x in places),
        shifts=tuple((y // 2, x // 2) for _, y, x in places),
        positions=np.array([(y / 2, x / 2) for _, y, x in places]),
        odd=(False,) * 8,
        modes=modes,
        bulk_rows=bulk_rows,
        constants=constants,
        twice_shear=1.0,
        anchors=tuple((9 * c,) for c, _, _ in places),
        line=basis,
        order=1,
        orders=orders,
        functionals=tuple((c, y / 2, x / 2, 0, 0) for c, y, x in product(range(2), repeat=3)),
    )


@cache
def airy_element(aspect: float = 1.0) -> Element:
    """Bicubic Airy function on a pixel `aspect` times as high as wide; slopes are per pixel."""
    # value and slope at 0, value and slope at 1
    basis = ((1, 0, -3, 2), (0, 1, -2, 1), (0, 0, 3, -2), (0, 0, -1, 1))
    table = _tables(basis, degree=3)
    places = list(product(range(2), range(2), range(2), range(2)))  # y, slope in y, x, slope in x
    first = np.kron(table[2], table[0]) / aspect**2
    second = np.kron(table[0], table[2])
    modes, bulk_rows, constants, orders = _stacked(
        (first + second, first - second, -2 * np.kron(table[1], table[1]) / aspect)
    )
    number = {place: k for k, place in enumerate(places)}
    value, slope_y, slope_x = number[0, 0, 0, 0], number[0, 1, 0, 0], number[0, 0, 0, 1]
    anchors = {(0, 0): (value,), (1, 0): (slope_y,), (0, 1): (slope_x,), (1, 1): ()}
    linear = {
        (y, x): (value,) + (slope_y,) * y + (slope_x,) * x for y, x in product(range(2), range(2))
    }
    return Element(
        types=4,
        local_types=tuple(2 * dy + dx for _, dy, _, dx in places),
        shifts=tuple((y, x) for y, _, x, _ in places),
        positions=np.array([(y, x) for y, _, x, _ in places], dtype=float),
        odd=(False, True, True, False),
        modes=modes,
        bulk_rows=bulk_rows,
        constants=constants,
        twice_shear=2.0,
        anchors=tuple(
            linear[y, x] if dy == dx == 0 else anchors[dy, dx] for y, dy, x, dx in places
        ),
        line=basis,
        order=2,
        orders=orders,
        functionals=tuple((0, 0.0, 0.0, dy, dx) for dy, dx in product(range(2), repeat=2)),
    )


def _tables(basis: tuple[tuple[int, ...], ...], *, degree: int) -> list[Array]:
    """Orthonormal modes 0 … degree of derivatives 0, 1, 2, each (degree + 1, functions).

    The integrals are rational and exact; each entry is rounded twice, and what is zero is zero.
    """
    functions = [tuple(map(Fraction, f)) for f in basis]
    tables = []
    for _ in range(3):
        exact = [[_integral(_times(_legendre(a), f)) for f in functions] for a in range(degree + 1)]
        tables.append(
            np.array(exact, dtype=float) * np.sqrt(2 * np.arange(degree + 1.0) + 1)[:, None]
        )
        functions = [tuple(n * c for n, c in enumerate(f))[1:] for f in functions]
    return tables


@cache
def _legendre(order: int) -> Polynomial:
    """The Legendre polynomial shifted to [0, 1]."""
    if order < 2:
        return (Fraction(1),) if order == 0 else (Fraction(-1), Fraction(2))
    rise = _times(_legendre(1), _legendre(order - 1))
    before = _legendre(order - 2) + (Fraction(0),) * 2
    return tuple(
        ((2 * order - 1) * a - (order - 1) * b) / order for a, b in zip(rise, before, strict=True)
    )


def _times(first: Polynomial, second: Polynomial) -> Polynomial:
    result = [Fraction(0)] * (len(first) + len(second) - 1)
    for (i, a), (j, b) in product(enumerate(first), enumerate(second)):
        result[i + j] += a * b
    return tuple(result)


def _integral(polynomial: Polynomial) -> Fraction:
    return sum((c / (n + 1) for n, c in enumerate(polynomial)), Fraction(0))


def _stacked(
    parts: tuple[Array, Array, Array],
) -> tuple[Array, int, tuple[int, int, int], tuple[tuple[int, int, int], ...]]:
    """Modes of trace, difference and shear without rows that vanish."""
    kept = [np.flatnonzero(np.abs(part).max(axis=1) > 0) for part in parts]
    starts = np.cumsum([0] + [len(rows) for rows in kept])
    modes = np.vstack([part[rows] for part, rows in zip(parts, kept, strict=True)])
    line = round(len(parts[0]) ** 0.5)
    orders = tuple((k, *divmod(int(row), line)) for k, rows in enumerate(kept) for row in rows)
    constants = (int(starts[0]), int(starts[1]), int(starts[2]))
    return np.ascontiguousarray(modes), int(starts[1]), constants, orders
