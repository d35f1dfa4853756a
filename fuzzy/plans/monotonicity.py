"""Verification of monotonicity: the sign of every input's effect on every output, level by level.

A sign is *proved* where the caller states it and no sample contradicts it; samples in which one
stated input changes alone test it. Otherwise it is *observed*: differences at probes of the box all
have it, with a margin. That is evidence, not proof, and bounds that rest on it are attained only.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from alphacut.fuzzy.arrays import Array, Rows
from alphacut.fuzzy.campaign.campaign import Campaign
from alphacut.fuzzy.knowledge.known import Signs
from alphacut.fuzzy.refused import require_choice
from alphacut.fuzzy.sets.boxes import Domain, quasi_random_points

_PROBES = 4  # points inside a box, besides its extreme corners and the modal point
_MARGIN = 0.05  # of the range of the slopes over the probes, which the least slope must exceed
_STEP = 1e-3  # of a finite difference, over the width of the box


@dataclass(frozen=True)
class Effects:
    """Signs of the effects of the inputs on the outputs, shape (levels, outputs, inputs).

    They are +1, −1, or 0 where neither holds; an input without width has +1.
    """

    outputs: tuple[str, ...]
    signs: Signs

    def notes(self, domain: Domain) -> tuple[str, ...]:
        """Return a sentence for each effect of unknown sign, with the highest such level."""
        return tuple(
            f"output {output} is not monotone in input {name}, or not surely, up to α ="
            f" {domain.alpha[np.flatnonzero(signs == 0)[-1]]:g}"
            for row, output in enumerate(self.outputs)
            for name, signs in zip(domain.names, self.signs[:, row].T, strict=True)
            if (signs == 0).any()
        )


def verify(campaign: Campaign, domain: Domain, outputs: tuple[str, ...] = ()) -> Effects:
    """Return the sign of every input's effect on every output, level by level.

    Stated signs are tested at pairs of points; the others are observed at probes, from the widest
    box to the narrowest. A sign holds on all narrower boxes.

    Args:
        campaign: The model with the knowledge about it.
        domain: Inputs and levels.
        outputs: Outputs that matter; all if none is named.
    """
    columns = campaign.output_names(domain)
    for name in outputs:
        require_choice("output", name, columns)
    outputs = outputs or columns
    signs = campaign.knowledge.stated_signs(domain.names, outputs)
    lowers, uppers = domain.boxes
    for column in np.flatnonzero(signs.any(axis=0)):
        campaign(_sign_test_points(domain.modal, signs, lowers[0], uppers[0], int(column)))
    levels = []
    for row in range(len(lowers)):
        lower, upper = lowers[row], uppers[row]
        signs = np.where(upper == lower, np.int8(1), signs)
        if (signs == 0).any():
            observed = _Box(campaign, outputs, lower, upper).observed_signs(domain.modal, signs)
            signs = np.where(signs == 0, observed, signs)
        levels.append(signs)
    return Effects(outputs, np.array(levels))


def _sign_test_points(modal: Array, signs: Signs, lower: Array, upper: Array, column: int) -> Array:
    """Return points (n, inputs) that test the stated sign of the input in a column."""
    # pairs with the input at either end, the others at nominal values or at an extreme corner
    others = np.concatenate([modal[None], _extreme_corners(signs, lower, upper)])
    points = np.repeat(others, 2, axis=0)
    points[::2, column], points[1::2, column] = lower[column], upper[column]
    return np.asarray(np.unique(points, axis=0))


def _extreme_corners(signs: Signs, lower: Array, upper: Array) -> Array:
    """Return the corners of least and greatest output for each distinct row of signs."""
    rises = np.unique(signs >= 0, axis=0)
    return np.concatenate([np.where(rises, lower, upper), np.where(rises, upper, lower)])


@dataclass(frozen=True)
class _Box:
    """The box of a level, in which signs are observed."""

    campaign: Campaign
    outputs: tuple[str, ...]
    lower: Array
    upper: Array

    def observed_signs(self, modal: Array, stated: Signs) -> Signs:
        """Return the sign of the slopes at all probes of the box, shape (outputs, inputs).

        It is 0 where slopes differ in sign, or the smallest is below 5 % of their range, and 1 for
        an input without any effect. Only inputs without a sign in `stated` are probed.
        """
        free = np.flatnonzero((stated == 0).any(axis=0))
        first = np.nan_to_num(np.sign(self._slopes(modal[None], free)[0])).astype(np.int8)
        signs = np.where(stated != 0, stated, first)
        corners = _extreme_corners(signs, self.lower, self.upper)
        unit = quasi_random_points(len(self.lower), _PROBES)
        inside = self.lower + unit * (self.upper - self.lower)
        probes = np.concatenate([modal[None], corners, inside])
        slopes = self._slopes(probes, free)
        least, greatest = slopes.min(axis=0), slopes.max(axis=0)
        margin = _MARGIN * (greatest - least)
        rises = (least > 0) & (least >= margin)
        falls = (greatest < 0) & (-greatest >= margin)
        has_no_effect = (least == 0) & (greatest == 0)  # either end will do
        return np.asarray((rises | has_no_effect).astype(np.int8) - falls.astype(np.int8))

    def _slopes(self, points: Array, inputs: Rows) -> Array:
        """Return one-sided differences by some inputs inside the box, (n, outputs, inputs)."""
        values = self._values(points)
        slopes = np.zeros((*values.shape, points.shape[1]))
        for column in inputs:
            step = _STEP * (self.upper[column] - self.lower[column])
            steps = np.where(points[:, column] + step > self.upper[column], -step, step)
            stepped = points.copy()
            stepped[:, column] += steps
            slopes[:, :, column] = (self._values(stepped) - values) / steps[:, None]
        return slopes

    def _values(self, points: Array) -> Array:
        values = self.campaign(points)
        return values.array[:, [values.column(name) for name in self.outputs]]
