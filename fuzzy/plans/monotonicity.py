"""Verification of monotonicity: the sign of every input's effect on every output, level by level.

A sign is *proved* where the caller states it or where a range of the gradient over the whole box
excludes 0. Otherwise it is *seen*: derivatives (from the model, or differences) at probes of the
box all have it, with a margin. What is seen is evidence, not proof, and the bounds that rest on it
are called inner.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from alphacut.fuzzy.knowledge.known import Known, Signs, contradictions, negligible
from alphacut.fuzzy.samples.design import Design
from alphacut.fuzzy.samples.model import Memo, Values
from alphacut.fuzzy.samples.result import FuzzyResult
from alphacut.fuzzy.sets.boxes import Domain
from alphacut.fuzzy.sets.given import require_fields
from alphacut.fuzzy.sets.numbers import Array, Mask, Rows


@dataclass(frozen=True)
class Verification:
    """Settings of the search for signs that are neither stated nor proved.

    Args:
        probes: Points per box at which derivatives are taken, besides its two extreme corners and
            its modal point.
        margin: The least slope must exceed this share of the spread of the slopes over the probes.
        step: Step of a difference, as a share of the width of the box.

    Raises:
        ValueError: A value is out of range.
    """

    probes: int = 4
    margin: float = 0.05
    step: float = 1e-3

    def __post_init__(self) -> None:
        require_fields(self)
        if self.probes < 0 or self.margin < 0 or not 0 < self.step <= 0.5:
            got = f"probes = {self.probes}, margin = {self.margin:g}, step = {self.step:g}"
            raise ValueError(
                f"the verification has {got}; it needs probes >= 0, margin >= 0 and a step in (0,"
                " 0.5]"
            )


@dataclass(frozen=True)
class Effects:
    """Signs of all effects.

    Args:
        outputs: Names of the outputs.
        signs: +1, −1, or 0 where none holds, shape (levels, outputs, inputs); an input without
            width has +1.
        proved: Whether the sign is proved, same shape.
    """

    outputs: tuple[str, ...]
    signs: Signs
    proved: Mask

    def table(self, result: FuzzyResult, holds: Mask) -> Mask:
        """Bounds for which something holds of all effects, shape (levels, columns)."""
        table = np.zeros(result.lower.shape, bool)
        for row, name in enumerate(self.outputs):
            table[:, result.column(name)] = holds[:, row].all(axis=1)
        return table

    def notes(self, domain: Domain) -> tuple[str, ...]:
        """Effects without a sign, and up to which level."""
        found = []
        for row, output in enumerate(self.outputs):
            for column, name in enumerate(domain.names):
                without = np.flatnonzero(self.signs[:, row, column] == 0)
                if len(without):
                    found.append(
                        f"output {output} is not monotone in input {name}, or not surely, up to α ="
                        f" {domain.alpha[without[-1]]:g}"
                    )
        return tuple(found)


def verify(
    model: Memo, domain: Domain, rule: Verification, *, outputs: Sequence[str] = ()
) -> Effects:
    """Find the sign of every effect on every level, from the widest box up.

    Args:
        model: The model with what is known of it.
        domain: Inputs and levels.
        rule: How signs are looked for.
        outputs: Outputs that matter; all but derivatives if none is named.
    """
    known = model.known
    modal = domain.modal[None]
    columns = model(modal).columns if known.gradient_range or not outputs else ()
    names = tuple(outputs) or primary(columns, known)
    signs = known.stated(domain.names, names)
    proved = signs != 0
    rows = []
    lowers, uppers = domain.boxes
    for level in range(len(lowers)):
        lower, upper = lowers[level], uppers[level]
        signs, proved = signs.copy(), proved.copy()
        signs[:, upper == lower], proved[:, upper == lower] = 1, True
        if known.gradient_range:
            ranges = known.gradient_range(lower, upper)
            unknown = sorted(set(ranges) - set(columns))
            if unknown:
                raise ValueError(
                    f"the range of the gradient names {', '.join(unknown)}; the outputs are"
                    f" {', '.join(columns)}"
                )
            _prove(signs, proved, ranges, names)
        if (signs == 0).any():
            box = _Box(model, domain.names, names, lower=lower, upper=upper, rule=rule)
            signs = np.where(signs == 0, box.seen(modal, signs), signs)
        rows.append((signs, proved))
    return Effects(names, np.array([row[0] for row in rows]), np.array([row[1] for row in rows]))


def primary(columns: Sequence[str], known: Known) -> tuple[str, ...]:
    """The outputs that are not derivatives of others."""
    derivatives = {name for row in known.derivatives.values() for name in row.values()}
    return tuple(name for name in columns if name not in derivatives)


def _prove(
    signs: Signs, proved: Mask, ranges: Mapping[str, tuple[Array, Array]], names: Sequence[str]
) -> None:
    """Signs that a range of the gradient over the box excludes from being others."""
    for row, name in enumerate(names):
        if name in ranges:
            least, most = map(np.asarray, ranges[name])
            for holds, sign in ((least >= 0, 1), (most <= 0, -1)):
                fresh = holds & ~proved[row]
                signs[row, fresh], proved[row, fresh] = sign, True


@dataclass(frozen=True)
class _Box:
    """One level's box under inspection."""

    model: Memo
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    lower: Array
    upper: Array
    rule: Verification

    def seen(self, modal: Array, stated: Signs) -> Signs:
        """Signs of the slopes at all probes, with the margin, shape (outputs, inputs), else 0."""
        open_inputs = np.flatnonzero((stated == 0).any(axis=0))
        first = np.sign(self._slopes(modal, open_inputs)[0]).astype(np.int8)
        corners = self._corners(np.where(stated != 0, stated, first))
        slopes = self._slopes(np.concatenate([modal, corners, self._spread()]), open_inputs)
        least, most = slopes.min(axis=0), slopes.max(axis=0)
        room = self.rule.margin * (most - least)
        rises, falls = (least > 0) & (least >= room), (most < 0) & (-most >= room)
        idle = (least == 0) & (most == 0)  # no effect at any probe: either end will do
        return np.asarray((rises | idle).astype(np.int8) - falls.astype(np.int8))

    def _corners(self, signs: Signs) -> Array:
        """The two extreme corners for every pattern of signs that occurs."""
        rises = np.unique(signs >= 0, axis=0)
        return np.concatenate(
            [np.where(rises, self.lower, self.upper), np.where(rises, self.upper, self.lower)]
        )

    def _spread(self) -> Array:
        from scipy.stats import qmc

        # the first is a corner
        unit: Array = qmc.Halton(len(self.lower), scramble=False).random(self.rule.probes + 1)[1:]
        return self.lower + unit * (self.upper - self.lower)

    def _slopes(self, points: Array, inputs: Rows) -> Array:
        """Slopes by the given inputs at the points, shape (n, outputs, inputs); 0 by the others."""
        values = self.model(points)
        slopes = np.zeros((len(points), len(self.outputs), len(self.inputs)))
        for column in inputs:
            given = [
                self.model.known.derivatives.get(output, {}).get(self.inputs[column], "")
                for output in self.outputs
            ]
            slopes[:, :, column] = (
                values.select(given) if all(given) else self._differences(points, values, column)
            )
        return slopes

    def _differences(self, points: Array, values: Values, column: int) -> Array:
        """One-sided differences that stay inside the box, shape (n, outputs)."""
        step = self.rule.step * (self.upper[column] - self.lower[column])
        steps = np.where(points[:, column] + step > self.upper[column], -step, step)
        moved = points.copy()
        moved[:, column] += steps
        rise = self.model(moved).select(self.outputs) - values.select(self.outputs)
        return np.asarray(rise / steps[:, None])


def verified(result: FuzzyResult, memo: Memo, effects: Effects) -> FuzzyResult:
    """Bounds that rest on verified signs, confronted with all samples of the plan.

    Args:
        result: Bounds from the corners that the signs name.
        memo: All samples.
        effects: The signs.
    """
    every = Design.from_samples(result.domain, memo.points).bounds(memo.values, plan=result.plan)
    small = negligible(memo.values.array)
    beyond = (every.lower < result.lower - small) | (every.upper > result.upper + small)
    refuted = (beyond & effects.table(result, effects.signs != 0)).any(axis=0) | _contradicted(
        result, memo, effects
    )
    notes = tuple(
        f"a sample lies beyond the corners of output {name}: {_basis(memo, effects, name)} not hold"
        for name in np.array(result.outputs)[refuted]
    )
    proved = effects.table(result, effects.proved) & ~refuted
    spent = len(memo) - result.runs
    return replace(
        every,
        proved=proved,
        error=np.where(proved, 0.0, every.error),
        given=memo.known.words,
        runs=result.runs,
        verification_runs=spent,
        notes=(*effects.notes(result.domain), *notes),
    )


def _basis(memo: Memo, effects: Effects, output: str) -> str:
    """What the corners of an output rest on, with an auxiliary verb."""
    row = effects.outputs.index(output)
    if not ((effects.signs[:, row] != 0) & ~effects.proved[:, row]).any():
        return "the signs do"
    stated = "what was stated or " if memo.known.words else ""
    return f"{stated}the monotonicity seen at the probes does"


def _contradicted(result: FuzzyResult, memo: Memo, effects: Effects) -> Mask:
    """Outputs (columns,) whose samples contradict their verified signs."""
    columns = np.array([result.column(name) for name in effects.outputs])
    looked_at = result.enforced[:, columns].any(axis=0) | (memo.known.gradient_range is not None)
    refuted = np.zeros(len(result.outputs), bool)
    for inside, signs in (
        zip(result.domain.inside(memo.points), effects.signs, strict=True)
        if looked_at.any()
        else ()
    ):
        relevant = np.where(looked_at.reshape(-1, 1), signs, 0)
        found = contradictions(memo.points[inside], memo.values.array[inside][:, columns], relevant)
        refuted[columns[list(found)]] = True
    return refuted & effects.table(result, effects.signs != 0).any(axis=0)


def require_few(size: int, limit: int, notes: Sequence[str]) -> None:
    """Refuse a fall-back that would take more samples than the caller allows.

    Raises:
        ValueError: As said.
    """
    if size > limit:
        cure = (
            f"state the signs that you know, raise the limit of {limit:,}, or take Optimisation or"
            " Chebyshev"
        )
        raise ValueError(
            f"the plan would take {size:,} samples since {notes[0]} (and {len(notes) - 1} more);"
            f" {cure}"
        )
