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

from collections.abc import Iterator
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
        places: Of each unknown its y and x in a pixel of side 1, and whether it changes its sign
            where the pixel is turned by 180°.
        stress: Whether the modes are those of a stress, else of a strain.
    """

    unknowns: int
    local: tuple[tuple[int, int, int], ...]
    modes: Array
    bulk_rows: int
    constants: tuple[int, int, int]
    twice_shear: float
    anchors: tuple[tuple[int, ...], ...]
    places: tuple[tuple[float, float, bool], ...]
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
    """Q2 displacement element on a pixel whose height is `aspect` times its width."""
    basis = ((1, -3, 2), (0, 4, -4), (0, -1, 2))  # at 0, 1/2, 1
    value, slope, _ = _derivative_modes(basis)
    nodes = list(product(range(2), range(3), range(3)))  # component, y, x
    d_dx, d_dy = np.kron(value, slope), np.kron(slope, value) / aspect
    modes, constants = _stack_modes(
        trace=np.hstack([d_dx, d_dy]),
        difference=np.hstack([d_dx, -d_dy]),
        twice_shear=np.hstack([d_dy, d_dx]),
    )
    return Element(
        unknowns=8,  # a corner, two edge middles and the centre of a pixel, times two components
        local=tuple((4 * c + 2 * (y % 2) + x % 2, y // 2, x // 2) for c, y, x in nodes),
        modes=modes,
        bulk_rows=constants[1],
        constants=constants,
        twice_shear=1.0,
        anchors=tuple((9 * c,) for c, _, _ in nodes),  # the lower left node moves rigidly
        places=tuple((y / 2, x / 2, False) for _, y, x in product(range(2), repeat=3)),
        stress=False,
    )


@cache
def airy_element(aspect: float = 1.0) -> Element:
    """Bicubic stress element of φ and its slopes, per pixel of height `aspect` times its width."""
    # value and slope at 0, value and slope at 1
    basis = ((1, 0, -3, 2), (0, 1, -2, 1), (0, 0, 3, -2), (0, 0, -1, 1))
    value, slope, curvature = _derivative_modes(basis)
    nodes = list(product(range(2), repeat=4))  # y, whether slope in y, x, whether slope in x
    stress_11, stress_22 = np.kron(curvature, value) / aspect**2, np.kron(value, curvature)
    modes, constants = _stack_modes(
        trace=stress_11 + stress_22,
        difference=stress_11 - stress_22,
        twice_shear=np.asarray(-2 * np.kron(slope, slope) / aspect),
    )
    origin, slope_y, slope_x = (nodes.index(n) for n in ((0, 0, 0, 0), (0, 1, 0, 0), (0, 0, 0, 1)))

    def anchors(y: int, dy: int, x: int, dx: int) -> list[int]:
        """Unknowns at the origin that make up the linear function, free of stress, at a node."""
        if dy and dx:
            return []
        if dy or dx:
            return [slope_y if dy else slope_x]
        return [origin] + [slope_y] * y + [slope_x] * x

    return Element(
        unknowns=4,
        local=tuple((2 * dy + dx, y, x) for y, dy, x, dx in nodes),
        modes=modes,
        bulk_rows=constants[1],
        constants=constants,
        twice_shear=2.0,
        anchors=tuple(tuple(anchors(*node)) for node in nodes),
        places=tuple((0.0, 0.0, dy != dx) for dy, dx in product(range(2), repeat=2)),
        stress=True,
    )


def _derivative_modes(basis: Basis) -> list[Array]:
    """Matrices (polynomials, functions) to orthonormal Legendre modes of derivatives 0, 1 and 2."""
    functions, matrices = list(basis), []
    count = len(basis[0])
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


def _stack_modes(
    trace: Array, difference: Array, twice_shear: Array
) -> tuple[Array, tuple[int, int, int]]:
    """Stack modes of trace, difference and shear without zero rows; and the first row of each."""
    parts = trace, difference, twice_shear
    nonzero_rows = [part[np.abs(part).max(axis=1) > 0] for part in parts]
    first, second = len(nonzero_rows[0]), len(nonzero_rows[0]) + len(nonzero_rows[1])
    return np.ascontiguousarray(np.vstack(nonzero_rows)), (0, first, second)


COLUMNS = 6144  # pixels times loads worked on at once: what the second cache holds


@dataclass(frozen=True)
class Operator:
    """Stiffness of a pixel grid: element matrices times coefficients of trace and deviator.

    Both coefficients are positive and have the shape (rows, columns).
    """

    element: Element
    trace: Array
    deviator: Array

    def apply(self, fields: Array) -> Array:
        """Nodal forces of fields, both of shape (loads, unknowns, rows, columns)."""
        result = np.zeros_like(fields)
        trace_modes, deviator_modes = (self.element.modes[rows] for rows in self.element.parts)
        matrix = np.hstack([trace_modes.T @ trace_modes, deviator_modes.T @ deviator_modes])
        for rows in blocks(fields.shape):
            local = gather(self.element, fields, rows)
            # (trace Tᵀ T + deviator Dᵀ D) times the local unknowns of each pixel
            weighted = np.stack([self.trace[rows] * local, self.deviator[rows] * local])
            forces = matrix @ weighted.reshape(matrix.shape[1], -1)
            scatter(self.element, forces.reshape(local.shape), result, rows)
        return result

    def load(self, mean_modes: Array) -> Array:
        """Minus the nodal forces of mean modes (modes, loads), (loads, unknowns, rows, columns)."""
        result = np.zeros((mean_modes.shape[1], self.element.unknowns, *self.trace.shape))
        trace_force, deviator_force = (
            -(self.element.modes[part].T @ mean_modes[part])[..., None, None]
            for part in self.element.parts
        )
        for rows in blocks(result.shape):
            local = trace_force * self.trace[rows] + deviator_force * self.deviator[rows]
            scatter(self.element, local, result, rows)
        return result


def blocks(shape: tuple[int, ...]) -> Iterator[slice]:
    """Slices of rows, each of about `COLUMNS` pixels times loads."""
    loads, _, rows, columns = shape
    count = max(1, COLUMNS // (loads * columns))
    for row in range(0, rows, count):
        yield slice(row, min(rows, row + count))


def gather(element: Element, fields: Array, rows: slice) -> Array:
    """Local unknowns of the pixels of some rows, shape (local unknowns, loads, rows, columns)."""
    row_numbers = np.arange(rows.start, rows.stop)
    local = np.empty((len(element.local), len(fields), row_numbers.size, fields.shape[-1]))
    for k, (unknown, up, right) in enumerate(element.local):
        source = fields[:, unknown, (row_numbers + up) % fields.shape[-2]]
        local[k] = np.roll(source, -right, axis=-1) if right else source
    return local


def scatter(element: Element, forces: Array, result: Array, rows: slice) -> None:
    """Add element forces, (n, loads, rows, columns), of the pixels of some rows to `result`."""
    row_numbers = np.arange(rows.start, rows.stop)
    for k, (unknown, up, right) in enumerate(element.local):
        force = np.roll(forces[k], right, axis=-1) if right else forces[k]
        result[:, unknown, (row_numbers + up) % result.shape[-2]] += force
