"""Two finite elements on a pixel, from unknowns to orthonormal strain or stress modes.

Displacement: biquadratic, two components (Q2). Stress: from an Airy function φ in the bicubic
rectangle with continuous slopes (Bogner, Fox, Schmit 1965), σ11 = φ,22, σ22 = φ,11, σ12 = −φ,12,
which is in equilibrium exactly.

Either field is expanded in products of Legendre polynomials that are orthonormal on the pixel, so
the mean energy of a pixel is a sum of squares without quadrature error: k Σ (modes of the trace)² +
G Σ (modes of 11 − 22 and of twice 12)², with k = K + G/3, and with 1/(4 k), 1/(4 G) in the place of
k, G for stresses.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from functools import cache
from itertools import product

import numpy as np

from alphacut.fuzzy.arrays import Array

Basis = tuple[tuple[int, ...], ...]  # coefficients of 1, x, x², … on [0, 1]
LEGENDRE: Basis = ((1,), (-1, 2), (1, -6, 6), (-1, 12, -30, 20))


@dataclass(frozen=True, eq=False)
class Element:
    """Unknowns of a pixel and the modes that they cause.

    Args:
        unknowns: Number of values of the field in every pixel of the periodic grid.
        local: For each of the pixel's n local unknowns its number among these, and the pixel that
            owns it, so many rows up and columns to the right, 0 or 1.
        modes: Matrix from local unknowns to modes, shape (rows, n); lengths in pixel widths.
        bulk_rows: The first so many modes belong to the trace.
        constants: Rows of the constant modes of trace, difference of normal components and twice
            the shear component.
        twice_shear: Factor from the Voigt component 12 to twice the tensor component.
        anchors: For each local unknown the ones to subtract from it, which takes a field without
            strain or stress away.
        stress: Whether the modes are those of a stress, else of a strain.
    """

    unknowns: int
    local: tuple[tuple[int, int, int], ...]
    modes: Array
    bulk_rows: int
    constants: tuple[int, int, int]
    twice_shear: float
    anchors: tuple[tuple[int, ...], ...]
    stress: bool

    @property
    def parts(self) -> tuple[slice, slice]:
        """Rows of the modes of the trace, and of those of the deviator."""
        return slice(0, self.bulk_rows), slice(self.bulk_rows, None)

    def mean_modes(self, loads: Array) -> Array:
        """Modes of uniform fields in Voigt order, shape (loads, 3) → (rows, loads)."""
        modes = np.zeros((len(self.modes), len(loads)))
        first, second, shear = np.asarray(loads).T
        modes[list(self.constants)] = first + second, first - second, self.twice_shear * shear
        return modes


@cache
def displacement_element(aspect: float = 1.0) -> Element:
    """Q2 displacement on a pixel `aspect` times as high as wide."""
    basis = ((1, -3, 2), (0, 4, -4), (0, -1, 2))  # at 0, 1/2, 1
    value, slope, _ = _tables(basis)
    places = list(product(range(2), range(3), range(3)))  # component, y, x
    along_x, along_y = np.kron(value, slope), np.kron(slope, value) / aspect
    modes, constants = _stacked(
        np.hstack([along_x, along_y]), np.hstack([along_x, -along_y]), np.hstack([along_y, along_x])
    )
    return Element(
        unknowns=8,
        local=tuple((4 * c + 2 * (y % 2) + x % 2, y // 2, x // 2) for c, y, x in places),
        modes=modes,
        bulk_rows=constants[1],
        constants=constants,
        twice_shear=1.0,
        anchors=tuple((9 * c,) for c, _, _ in places),
        stress=False,
    )


@cache
def airy_element(aspect: float = 1.0) -> Element:
    """Bicubic Airy function on a pixel `aspect` times as high as wide; slopes are per pixel."""
    # value and slope at 0, value and slope at 1
    basis = ((1, 0, -3, 2), (0, 1, -2, 1), (0, 0, 3, -2), (0, 0, -1, 1))
    value, slope, bend = _tables(basis)
    nodes = list(product(range(2), repeat=4))  # y, slope in y, x, slope in x
    first, second = np.kron(bend, value) / aspect**2, np.kron(value, bend)
    mixed = np.asarray(-2 * np.kron(slope, slope) / aspect)
    modes, constants = _stacked(first + second, first - second, mixed)
    origin, slope_y, slope_x = nodes.index((0, 0, 0, 0)), nodes.index((0, 1, 0, 0)), 1

    def anchors(y: int, dy: int, x: int, dx: int) -> tuple[int, ...]:
        """Value and slopes at the origin, of which a linear function is made."""
        if dy or dx:
            return (slope_y,) * (dy > dx) + (slope_x,) * (dx > dy)
        return (origin,) + (slope_y,) * y + (slope_x,) * x

    return Element(
        unknowns=4,
        local=tuple((2 * dy + dx, y, x) for y, dy, x, dx in nodes),
        modes=modes,
        bulk_rows=constants[1],
        constants=constants,
        twice_shear=2.0,
        anchors=tuple(anchors(*node) for node in nodes),
        stress=True,
    )


def _tables(basis: Basis) -> list[Array]:
    """Orthonormal modes of derivatives 0, 1, 2 of basis functions, each (modes, functions).

    The integrals are rational and exact; each entry is rounded twice, and what is zero is zero.
    """
    functions, tables = list(basis), []
    count = len(basis[0])
    for _ in range(3):
        exact = [[_integral(polynomial, f) for f in functions] for polynomial in LEGENDRE[:count]]
        scale = np.sqrt(2 * np.arange(float(count)) + 1)
        tables.append(np.array(exact, dtype=float) * scale[:, None])
        functions = [tuple(n * c for n, c in enumerate(f))[1:] for f in functions]
    return tables


def _integral(first: tuple[int, ...], second: tuple[int, ...]) -> Fraction:
    """Integral of the product of two polynomials over [0, 1]."""
    pairs = product(enumerate(first), enumerate(second))
    return sum((Fraction(a * b, i + j + 1) for (i, a), (j, b) in pairs), Fraction(0))


def _stacked(*parts: Array) -> tuple[Array, tuple[int, int, int]]:
    """Modes of trace, difference and shear without rows that vanish, and the first row of each."""
    nonzero_rows = [part[np.abs(part).max(axis=1) > 0] for part in parts]
    first, second = len(nonzero_rows[0]), len(nonzero_rows[0]) + len(nonzero_rows[1])
    return np.ascontiguousarray(np.vstack(nonzero_rows)), (0, first, second)
