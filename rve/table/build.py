"""Build of a table: mesh size and degrees rise until their errors are small."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from math import log
from time import perf_counter
from typing import NamedTuple, Protocol

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
_JUDGED_AT = 0.03, 0.1, 0.3, 0.6, 0.72, 0.85  # radii, at which a mesh is judged
_JUDGES = 1.5  # cost of a cell that judges, over that of others
_NONE = np.array([])
_SPACE_SHARE = 0.6  # of the accuracy; the rest is for interpolation


class TableError(RuntimeError):
    """A table does not reach its accuracy."""


def larger_error(found: float) -> str:
    """The cure where this error is the least, of which a table keeps half for interpolation."""
    return f"take a --tolerance (modulus.tolerance) of {4 * found:.0e}, say, or --method series"


class Source(Protocol):
    """Source of a table's moduli; its errors are known once it has been asked for some."""

    mesh_size: float
    space: Array
    unknowns: int
    systems: int
    progress: Callable[[float], None] | None

    def moduli(self, radii: Sequence[float], modulus: Array) -> list[Array]:
        """C11 + C12, C11 − C12 and C33 in Pa at each radius, shape (m, 3) each."""

    def rough(self, radius: float, modulus: Array) -> Array:
        """The same at one, a few digits being enough."""


class SolvedCell(NamedTuple):
    """Moduli of a cell in Pa, shape (m, 3), declared errors where it judges a mesh, shape (4,)."""

    moduli: Array
    errors: Array
    factorisations: int

    @property
    def error(self) -> float:
        """The largest of the moduli."""
        return float(self.errors[:3].max())


@dataclass(frozen=True)
class Asked:
    """Cells on one mesh: those that judge it, then those of given moduli."""

    places: Sequence[float]
    radii: Sequence[float] = ()
    modulus: Array = field(default_factory=lambda: _NONE)

    @property
    def costs(self) -> list[float]:
        """About what they cost."""
        return [_JUDGES * cost for cost in _costs(self.places)] + _costs(self.radii)


@dataclass
class PlanarSource:
    """Moduli by planar cells of order 4 on meshes as fine as `accuracy` needs.

    The mesh is judged beside the first cells that are asked for. `ranks` share all of them.
    """

    span: TableRange
    accuracy: float
    ranks: Ranks = ALONE
    mesh_size: float = field(init=False, default=0.0)
    space: Array = field(init=False)
    unknowns: int = 0
    systems: int = 0
    progress: Callable[[float], None] | None = None

    def moduli(self, radii: Sequence[float], modulus: Array) -> list[Array]:
        """At the chosen mesh size, which the first call chooses."""
        asked = Asked((), radii, modulus)
        found = self._cells(asked) if self.mesh_size else self._first(radii, modulus)
        return [one.moduli for one in found]

    def _first(self, radii: Sequence[float], modulus: Array) -> list[SolvedCell]:
        """Cells beside those that judge their mesh, which gets finer until all are accurate."""
        places = judging_radii(self.span)
        others = [r for r in radii if modulus.size > 1 or r not in places]
        self.mesh_size, solved = _ROUGH, {}
        found = dict(zip(places, self._cells(Asked(places)), strict=True))
        while (most := max((cell.error, r) for r, cell in found.items()))[0] > self.accuracy:
            worst = most[1]
            rest = [r for r in places if r != worst]  # a finer mesh gains more at one than another
            best, *cells = self._refined(worst, found[worst], Asked(rest, others, modulus))
            found = dict(zip(rest, cells, strict=False)) | {worst: best}
            solved = dict(zip(others, cells[len(rest) :], strict=True))
        self.space = np.vstack([places, np.transpose([found[r].errors for r in places])])
        if not solved:
            solved = dict(zip(others, self._cells(Asked((), others, modulus)), strict=True))
        return [(found | solved)[radius] for radius in radii]

    def _refined(self, worst: float, found: SolvedCell, asked: Asked) -> list[SolvedCell]:
        """A cell on a mesh that keeps the accuracy, from a rougher one, and all asked for on it."""
        sizes: list[float] = []
        while True:
            sizes = sizes or self._finer(worst, found)
            tried, sizes = sizes[: self.ranks.size], sizes[self.ranks.size :]
            cells = self._tried(worst, tried, asked)
            kept = [k for k in range(len(tried)) if cells[k].error <= self.accuracy]
            best = kept[0] if kept else len(tried) - 1
            self.mesh_size, found = tried[best], cells[best]
            if kept and best == len(tried) - 1 and len(cells) == len(tried) + len(asked.costs):
                return [cells[k] for k in range(best, len(cells))]
            if kept:
                return [found, *self._cells(asked)]

    def _finer(self, radius: float, found: SolvedCell) -> list[float]:
        """Mesh sizes that are likely to keep the accuracy, from a cell of a rougher mesh."""
        if self.mesh_size <= _FINEST:
            raise TableError(
                f"planar cells at r = {radius:.4g} leave a relative error of"
                f" {found.error:.1e} on the finest mesh ({_FINEST:g}) and"
                f" {self.accuracy:.1e} is wanted: {larger_error(found.error)}"
            )
        wanted = 0.8 * self.accuracy / found.error
        finer = [self.mesh_size * min(0.9, wanted ** (1 / rate)) for rate in _RATES]
        return list(dict.fromkeys(max(_FINEST, size) for size in finer))

    def _tried(self, worst: float, sizes: Sequence[float], asked: Asked) -> dict[int, SolvedCell]:
        """One cell on each mesh, 0, 1, …; the next are those asked for, on the finest.

        These are begun by ranks that have none of the former left, until the mesh is not the one.
        """
        meshes, costs = len(sizes), asked.costs
        numbers = [
            *range(meshes),
            *sorted(range(meshes, meshes + len(costs)), key=lambda k: -costs[k - meshes]),
        ]

        def cell(number: int) -> SolvedCell:
            if number < meshes:
                return self._judge(worst, sizes[number])
            return self._cell(asked, sizes[-1], number - meshes)

        def enough(k: int, found: SolvedCell) -> bool:
            return k < meshes and (found.error <= self.accuracy) == (k + 1 < meshes)

        found = self.ranks.until(enough, cell, numbers, self.progress)
        return {numbers[k]: one for k, one in found.items()}

    def _cells(self, asked: Asked) -> list[SolvedCell]:
        """The cells on the chosen mesh, dealt out."""
        costs, solve = asked.costs, partial(self._cell, asked, self.mesh_size)
        return self.ranks.each(solve, range(len(costs)), self.progress, costs)

    def _cell(self, asked: Asked, size: float, number: int) -> SolvedCell:
        if number < len(asked.places):
            return self._judge(asked.places[number], size)
        radius = asked.radii[number - len(asked.places)]
        return self._solve(radius, asked.modulus, _ORDER, size)

    def _judge(self, radius: float, size: float) -> SolvedCell:
        """The cell of both extreme inclusions."""
        found = _judged(self.span, radius, size)
        self.systems += 3 * found.factorisations
        return found

    def rough(self, radius: float, modulus: Array) -> Array:
        """At the first mesh size, one order less."""
        return self._solve(radius, modulus, _ORDER - 1, _ROUGH).moduli

    def _solve(self, radius: float, modulus: Array, order: int, size: float) -> SolvedCell:
        phases = [Phase(float(e), self.span.poisson) for e in modulus]
        solved = solve_slice(
            radius, self.span.matrix, phases, orders=(order,), mesh_size=size, share=True
        )
        self.systems += 3 * solved.factorisations
        self.unknowns = max(self.unknowns, solved.unknowns)
        return SolvedCell(square_moduli(solved.stiffness), _NONE, solved.factorisations)


def _costs(radii: Sequence[float]) -> list[float]:
    """About what cells cost: small particles and narrow gaps between them have finer meshes."""
    return [1 - log(r) + 0.65 * max(0.0, log(0.25 / (1 - r))) for r in radii]


Place = tuple[TableRange, float, float]  # with the radius and the mesh size
_known: dict[Place, SolvedCell] = {}


def _judged(span: TableRange, radius: float, size: float) -> SolvedCell:
    """A cell by three orders, of the extreme inclusions."""
    if (known := _known.get((span, radius, size))) is not None:
        return known
    phases = [Phase(e, span.poisson) for e in dict.fromkeys(span.moduli)]
    orders = _ORDER - 2, _ORDER - 1, _ORDER
    solved = solve_slice(radius, span.matrix, phases, orders=orders, mesh_size=size)
    errors = np.asarray(solved.error.max(axis=0))
    found = SolvedCell(square_moduli(solved.stiffness), errors, solved.factorisations)
    keep({(span, radius, size): found})
    return found


def keep(cells: Mapping[Place, SolvedCell]) -> None:
    """Keep cells that some rank has solved."""
    if len(_known) > 64:  # tables of one range and several accuracies try the same meshes
        _known.clear()
    _known.update(cells)


def first_cells(span: TableRange) -> dict[Place, Callable[[], SolvedCell]]:
    """What solves the cells that every table of a range begins with, by what to `keep` them."""
    return {(span, r, _ROUGH): partial(_judged, span, r, _ROUGH) for r in judging_radii(span)}


def judging_radii(span: TableRange) -> list[float]:
    """Radii at which a mesh is judged, rising, both ends among them; meshes differ by chance."""
    places = np.unique(np.clip([*_JUDGED_AT, *span.radii], *span.radii))
    return list(map(float, places if len(places) > 3 else np.unique(np.linspace(*span.radii, 4))))


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
    supply.progress = progress
    allowed = accuracy * (1 - _SPACE_SHARE)
    counts = (
        _LEAST if span.radii[1] > span.radii[0] * (1 + 1e-12) else 1,
        _moduli_needed(span, supply, allowed / 2),
    )
    known: dict[float, Array] = {}
    before = np.inf
    while True:
        radii, moduli = span.nodes(counts)
        fresh = [float(radius) for radius in radii if radius not in known]
        for radius, solved in zip(fresh, supply.moduli(fresh, moduli), strict=True):
            known[radius] = _logarithms(span, radius, moduli, solved)
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
                f" less, or {larger_error(both)}"
            )
        if tails[0][:3].max() >= tails[1][:3].max():
            counts, before = (counts[0] + _missing(found, both, before, allowed), counts[1]), both
        else:
            counts, known = (counts[0], counts[1] + 2), {}


def _missing(found: Array, left: float, before: float, allowed: float) -> int:
    """About how many radii are missing, 2 to 6, by the error left `before`, inf at first."""
    if before == np.inf:  # what two radii less would have left, by the coefficients
        sizes = abs(found).max(axis=(1, 2))
        before = left * float(sizes[-6:-3].max() / sizes[-3:].max()) ** (2 / 3)
    more = np.log(allowed / left) / np.log(left / before) if left < before else 1
    return 2 * int(np.clip(round(more), 1, 3))


def _logarithms(span: TableRange, radius: float, modulus: Array, solved: Array) -> Array:
    """Logarithms of solved moduli over those of Mori and Tanaka at one radius, shape (m, 3)."""
    return np.asarray(np.log(solved / span.dilute(np.array([radius]), modulus)[0]))


def _moduli_needed(span: TableRange, supply: Source, allowed: float) -> int:
    """Nodes in the modulus that the strongest interaction, at the greatest radius, asks for."""
    if span.moduli[1] <= span.moduli[0] * (1 + 1e-12):
        return 1
    found: list[Array] = []
    for count in range(2, _MOST_NODES):
        _, moduli = span.nodes((1, count))
        fresh = moduli[len(found) :]
        solved = supply.rough(span.radii[1], fresh)
        found.extend(_logarithms(span, span.radii[1], fresh, solved))
        if tail(coefficients(np.array(found)[None]), 1)[:3].max() <= allowed:
            return count
    return _MOST_NODES
