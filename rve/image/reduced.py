"""Proved bounds of an image for any moduli of its phases, by reduced bases from a few solves.

The energy of a field is linear in the moduli of the phases, so the products of the fields' modes
over each phase, summed once, give a proved bound at any moduli by the algebra of a few fields.
"""

from __future__ import annotations

from dataclasses import dataclass
from time import perf_counter

import numpy as np
from scipy.linalg import eigh

from alphacut.fuzzy.arrays import Array, Rows
from alphacut.rve.image.bounds import inverse_below
from alphacut.rve.image.fields.conjugate_gradient import ConjugateGradient
from alphacut.rve.image.fields.energy import SAFETY, UNIT, Energies, energies
from alphacut.rve.image.fields.side import DISPLACEMENT, STRESS, UNIT_LOADS, Side, solve_side

PIECE = 4000  # parameter points worked on at once
NEGLIGIBLE = 1e-10  # relative energy of a field that is no use


@dataclass(frozen=True, eq=False)
class ReducedSide:
    """Trial fields of one side with their energies by phase; the first three uniform.

    Args:
        side: The space.
        aspect: Height of a pixel over its width.
        labels: Phase of each pixel, shape (rows, columns).
        phases: Number of phases.
        fields: Fluctuations, shape (n, unknowns, rows, columns).
        energies: Of the uniform fields and the fluctuations, by trace and deviator of phase 0, of
            phase 1, …
    """

    side: Side
    aspect: float
    labels: Rows
    phases: int
    fields: Array
    energies: Energies

    @classmethod
    def of(cls, side: Side, aspect: float, labels: Rows, phases: int, fields: Array) -> ReducedSide:
        """The side with the energies of these fields."""
        element = side.element(aspect)
        whole = np.concatenate([np.zeros((3, *fields.shape[1:])), fields])
        means = np.zeros((len(element.modes), len(whole)))
        means[:, :3] = element.mean_modes(UNIT_LOADS)
        weights = [(p, (labels == k) * 1.0) for k in range(phases) for p in element.parts]
        return cls(side, aspect, labels, phases, fields, energies(element, whole, means, weights))

    def coefficients(self, bulk: Array, shear: Array) -> Array:
        """Coefficients of the energies, shape (m, 2 phases), from moduli of shape (m, phases)."""
        return np.stack(self.side.coefficients(bulk, shear), axis=-1).reshape(len(bulk), -1)

    def combination(self, coefficients: Array) -> Array:
        """Shares of the fields under the three loads, shape (m, 3 + n, 3).

        They need not be good for the bound to hold, so single precision does.
        """
        count = len(self.fields)
        shares = np.zeros((len(coefficients), 3 + count, 3))
        shares[:, :3] = np.eye(3)
        if count:
            lower = self.energies.value[:, 3:].astype(np.float32)
            relative = (coefficients / coefficients.max(axis=1, keepdims=True)).astype(np.float32)
            rows = (relative @ lower.reshape(len(lower), -1)).reshape(-1, count, 3 + count)
            rows[:, np.arange(count), 3 + np.arange(count)] *= 1 + 1e-6
            shares[:, 3:] = -np.linalg.solve(rows[:, :, 3:], rows[:, :, :3])
        return shares

    def energy_above(self, coefficients: Array) -> Array:
        """Matrices above the least mean energies, shape (m, 3, 3), rounding included."""
        shares, number = self.combination(coefficients), len(self.energies.value)
        flat = self.energies.value.reshape(number, -1)
        whole = (coefficients @ flat).reshape(-1, *self.energies.value.shape[1:])
        value = np.swapaxes(shares, 1, 2) @ (whole @ shares)
        sizes, errors = (
            np.swapaxes(np.abs(shares), 1, 2) @ norm.T
            for norm in (self.energies.size + self.energies.error, self.energies.error)
        )
        terms = self.energies.summed + (2 * len(flat[0]) ** 0.5 + number + 20) * UNIT
        weighted = coefficients[:, None] * sizes
        mixed = weighted @ np.swapaxes(errors, 1, 2)
        small = (coefficients[:, None] * errors) @ np.swapaxes(errors, 1, 2)
        summed = terms * (weighted @ np.swapaxes(sizes, 1, 2))
        rounding = SAFETY**2 * (mixed + np.swapaxes(mixed, 1, 2) + small + summed)
        symmetric = (value + np.swapaxes(value, 1, 2)) / 2
        return np.asarray(symmetric + rounding.sum(axis=2)[..., None] * np.eye(3))


@dataclass(frozen=True, eq=False)
class ReducedBounds:
    """Proved bounds of the stiffness of an image for any moduli of its phases.

    Args:
        upper: Displacement side.
        lower: Stress side.
        points: Moduli of the solves, shape (solves, 2, phases): K + G/3 and G.
        seconds: Wall time of the making.
    """

    upper: ReducedSide
    lower: ReducedSide
    points: Array
    seconds: float

    def bounds(self, bulk: Array, shear: Array) -> tuple[Array, Array]:
        """Lower and upper stiffness, each of shape (m, 3, 3), in the unit of the moduli.

        Args:
            bulk: K + G/3 of the phases, shape (m, phases), positive; near the moduli of the solves
                the bounds are close.
            shear: G of the phases, same shape.
        """
        lower, upper = np.empty((2, len(bulk), 3, 3))
        for start in range(0, len(bulk), PIECE):
            part = slice(start, start + PIECE)
            upper[part] = self.upper.energy_above(self.upper.coefficients(bulk[part], shear[part]))
            compliance = self.lower.energy_above(self.lower.coefficients(bulk[part], shear[part]))
            lower[part] = inverse_below(compliance)
        return lower, upper


def widths(lower: Array, upper: Array) -> Array:
    """Largest ratio of upper to lower energy minus one, shape (m,)."""
    pairs = zip(lower, upper, strict=True)
    return np.array([eigh(high, low, eigvals_only=True)[-1] - 1 for low, high in pairs])


def reduced_bounds(
    labels: Rows,
    bulk: Array,
    shear: Array,
    *,
    solves: int = 12,
    aspect: float = 1.0,
    solver: ConjugateGradient | None = None,
) -> ReducedBounds:
    """Reduced bases of both sides, each solve at the candidate farthest from those before.

    A common factor of all moduli changes nothing, so distances are between logarithms less their
    mean.

    Args:
        labels: Phase of each pixel, shape (rows, columns).
        bulk: K + G/3 of candidates that cover the range of use, shape (m, phases).
        shear: G of the candidates, same shape.
        solves: Parameter points, each solved under three loads.
        aspect: Height of a pixel over its width.
        solver: Stopping rule.
    """
    began, rule = perf_counter(), solver or ConjugateGradient()
    sides = [_empty(side, aspect, labels, bulk.shape[1]) for side in (DISPLACEMENT, STRESS)]
    chosen = _far_apart(np.log(np.hstack([bulk, shear])), solves)
    for k in chosen:
        sides = [_extended(side, bulk[k], shear[k], rule) for side in sides]
    points = np.stack([bulk[chosen], shear[chosen]], axis=1)
    return ReducedBounds(sides[0], sides[1], points, perf_counter() - began)


def _far_apart(logarithms: Array, number: int) -> list[int]:
    """Rows one after another, each the farthest from those before it."""
    places = logarithms - logarithms.mean(axis=1, keepdims=True)
    distance = np.linalg.norm(places - places.mean(axis=0), axis=1)
    chosen = [int(np.argmax(distance))]
    distance[:] = np.inf
    while len(chosen) < number:
        distance = np.minimum(distance, np.linalg.norm(places - places[chosen[-1]], axis=1))
        chosen.append(int(np.argmax(distance)))
    return chosen


def _empty(side: Side, aspect: float, labels: Rows, phases: int) -> ReducedSide:
    fields = np.zeros((0, side.element(aspect).unknowns, *labels.shape))
    return ReducedSide.of(side, aspect, labels, phases, fields)


def _extended(
    reduced: ReducedSide, bulk: Array, shear: Array, solver: ConjugateGradient
) -> ReducedSide:
    """The side with what its best fields lack at these moduli, made orthogonal."""
    own = reduced.side, reduced.aspect, reduced.labels, reduced.phases
    coefficients = reduced.coefficients(bulk[None], shear[None])
    shares = reduced.combination(coefficients)[0, 3:]
    start = np.asarray(np.tensordot(shares.T, reduced.fields, axes=1))
    moduli = bulk[reduced.labels], shear[reduced.labels]
    solution = solve_side(reduced.side, *moduli, solver=solver, aspect=reduced.aspect, start=start)
    lacking = solution.fields - start
    raw = ReducedSide.of(*own, lacking)
    products = np.tensordot(coefficients[0], raw.energies.value, axes=1)
    values, vectors = np.linalg.eigh(products[3:, 3:])
    kept = values > NEGLIGIBLE * np.trace(products[:3, :3])
    turned = np.tensordot((vectors[:, kept] / np.sqrt(values[kept])).T, lacking, axes=1)
    return ReducedSide.of(*own, np.concatenate([reduced.fields, turned]))
