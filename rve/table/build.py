"""Build of a table: mesh size and degrees rise until their errors are small."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import lru_cache, partial
from time import perf_counter
from typing import Protocol

import numpy as np

from alphacut.rve.cell import Phase, square_moduli
from alphacut.rve.ranks import ALONE, Ranks
from alphacut.rve.slices.model import solve_slice
from alphacut.rve.table.interpolant import Table, TableRange, coefficients, tail
from alphacut.stochastic.theta.truncated_normal import Array

_ORDER = 4
_ROUGH, _FINEST = 0.5, 0.04  # mesh sizes
_RATES = 7.5, 6.0  # of the moduli in the mesh size: hoped for, and likely
_LEAST, _MOST_NODES = 7, 65  # radii
_JUDGED = 0.03, 0.1, 0.3, 0.6, 0.72, 0.85  # radii, at which a mesh is judged
_SPACE_SHARE = 0.6  # of the accuracy; the rest is for interpolation


class TableError(RuntimeError):
    """A table does not reach its accuracy."""


class Source(Protocol):
    """Source of a table's moduli."""

    mesh_size: float
    space: Array
    unknowns: int
    systems: int

    def moduli(self, radius: float, modulus: Array) -> Array:
        """C11 + C12, C11 − C12 and C33 in Pa, shape (m, 3)."""

    def rough(self, radius: float, modulus: Array) -> Array:
        """The same, a few digits being enough."""


@dataclass
class PlanarSource:
    """Moduli by planar cells of order 4 on meshes as fine as `accuracy` needs.

    `ranks` share the radii at which a mesh is judged.
    """

    span: TableRange
    accuracy: float
    ranks: Ranks = ALONE
    mesh_size: float = field(init=False)
    space: Array = field(init=False)
    unknowns: int = 0
    systems: int = 0

    def __post_init__(self) -> None:
        radii = np.unique(np.clip([*_JUDGED, *self.span.radii], *self.span.radii))
        size, found = _ROUGH, self._all_errors(radii, _ROUGH)
        while found[:, :3].max() > self.accuracy:  # a finer mesh gains more at one than at another
            worst = int(found[:, :3].max(axis=1).argmax())
            size, errors = self._fine_enough(radii[worst], size, found[worst])
            rest = self._all_errors(np.delete(radii, worst), size)
            found = np.insert(rest, worst, errors, axis=0)
        self.mesh_size = size
        self.space = np.vstack([radii, found.T])

    def _fine_enough(self, radius: float, size: float, errors: Array) -> tuple[float, Array]:
        """Mesh size at which one radius keeps the accuracy, and its errors, from a rougher one."""
        while errors[:3].max() > self.accuracy:
            if size <= _FINEST:
                raise TableError(
                    f"planar cells at r = {radius:.4g} leave a relative error of"
                    f" {errors[:3].max():.1e} on the finest mesh ({_FINEST:g}) and"
                    f" {self.accuracy:.1e} is wanted: allow a larger error, or take the series"
                )
            wanted = 0.8 * self.accuracy / errors[:3].max()
            finer = [max(_FINEST, size * min(0.9, wanted ** (1 / rate))) for rate in _RATES]
            sizes = list(dict.fromkeys(finer))
            found = self.ranks.each(partial(self._errors, radius), sizes)
            kept = [one[:3].max() <= self.accuracy for one in found]
            best = kept.index(True) if True in kept else -1
            size, errors = sizes[best], found[best]
        return size, errors

    def _all_errors(self, radii: Array, size: float) -> Array:
        """Declared relative errors at all radii, shape (radii, 4)."""
        errors = partial(self._errors, size=size)
        return np.reshape(self.ranks.each(errors, list(radii), costs=_costs(radii)), (-1, 4))

    def _errors(self, radius: float, size: float) -> Array:
        """Declared relative errors at one radius of both extreme inclusions, shape (4,)."""
        errors, factorisations = _errors_of(self.span, radius, size)
        self.systems += 3 * factorisations
        return errors

    def _phases(self, modulus: Array) -> list[Phase]:
        return [Phase(float(e), self.span.poisson) for e in modulus]

    def moduli(self, radius: float, modulus: Array) -> Array:
        """At the chosen mesh size."""
        return self._solve(radius, modulus, _ORDER, self.mesh_size)

    def rough(self, radius: float, modulus: Array) -> Array:
        """At the first mesh size, one order less."""
        return self._solve(radius, modulus, _ORDER - 1, _ROUGH)

    def _solve(self, radius: float, modulus: Array, order: int, size: float) -> Array:
        phases = self._phases(modulus)
        solved = solve_slice(
            radius, self.span.matrix, phases, orders=(order,), mesh_size=size, share=True
        )
        self.systems += 3 * solved.factorisations
        self.unknowns = max(self.unknowns, solved.unknowns)
        return square_moduli(solved.stiffness)


def _costs(radii: Array) -> list[float]:
    """About what cells cost: those about small particles have finer meshes."""
    return [3 + 1 / float(radius) for radius in radii]


@lru_cache(maxsize=64)
def _errors_of(span: TableRange, radius: float, size: float) -> tuple[Array, int]:
    """Declared relative errors, shape (4,), and how many systems were factorised.

    Tables of one range and several accuracies try the same meshes.
    """
    phases = [Phase(e, span.poisson) for e in dict.fromkeys(span.moduli)]
    orders = _ORDER - 2, _ORDER - 1, _ORDER
    solved = solve_slice(radius, span.matrix, phases, orders=orders, mesh_size=size)
    return np.asarray(solved.error.max(axis=0)), solved.factorisations


def build_table(
    span: TableRange,
    *,
    accuracy: float,
    make: Callable[[TableRange, float], Source] = PlanarSource,
    progress: Callable[[float], None] | None = None,
    ranks: Ranks = ALONE,
) -> Table:
    """Table of relative error `accuracy` in every modulus, by its own estimate.

    Args:
        span: What to cover.
        accuracy: Relative error allowed, mesh and interpolation together.
        make: Maker of the source from range and accuracy.
        progress: Called with the fraction done of the present degree.
        ranks: Those that share the radii, each of which solves its own.

    Raises:
        TableError: The accuracy is not reached.
    """
    started = perf_counter()
    supply = make(span, accuracy * _SPACE_SHARE)
    allowed = accuracy * (1 - _SPACE_SHARE)
    counts = (
        _LEAST if span.radii[1] > span.radii[0] * (1 + 1e-12) else 1,
        _moduli_needed(span, supply, allowed / 2),
    )
    known: dict[float, Array] = {}
    while True:
        radii, moduli = span.nodes(counts)
        fresh = [float(radius) for radius in radii if radius not in known]
        solve = partial(_logarithms, span, supply.moduli, modulus=moduli)
        costs = _costs(np.array(fresh))
        known.update(zip(fresh, ranks.each(solve, fresh, progress, costs), strict=True))
        found = coefficients(np.array([known[radius] for radius in radii]))
        noise = supply.space[1:].max(axis=1)
        tails = tail(found, 0, noise=noise), tail(found, 1, noise=noise)
        both = float((tails[0] + tails[1])[:3].max())
        if both <= allowed:
            return Table(
                span,
                found,
                supply.space,
                supply.mesh_size,
                supply.unknowns,
                sum(ranks.all(supply.systems)),
                perf_counter() - started,
            )
        if max(counts) >= _MOST_NODES:
            raise TableError(
                f"the table's coefficients leave a relative error of {both:.1e} with {counts[0]}"
                f" radii and {counts[1]} moduli and {allowed:.1e} is wanted: cover"
                " less, or allow a larger error"
            )
        if tails[0][:3].max() >= tails[1][:3].max():
            counts = (counts[0] + 2, counts[1])
        else:
            counts, known = (counts[0], counts[1] + 2), {}


def _logarithms(
    span: TableRange, moduli: Callable[[float, Array], Array], radius: float, modulus: Array
) -> Array:
    """Logarithms of the moduli over those of Mori and Tanaka at one radius, shape (m, 3)."""
    dilute = span.dilute(np.array([radius]), modulus)[0]
    return np.asarray(np.log(moduli(radius, modulus) / dilute))


def _moduli_needed(span: TableRange, supply: Source, allowed: float) -> int:
    """Nodes in the modulus that the strongest interaction, at the greatest radius, asks for."""
    if span.moduli[1] <= span.moduli[0] * (1 + 1e-12):
        return 1
    found: list[Array] = []
    for count in range(2, _MOST_NODES):
        _, moduli = span.nodes((1, count))
        found.extend(_logarithms(span, supply.rough, span.radii[1], moduli[len(found) :]))
        if tail(coefficients(np.array(found)[None]), 1)[:3].max() <= allowed:
            return count
    return _MOST_NODES
