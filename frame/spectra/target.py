"""Target spectra: the spectral acceleration that a code or a site asks for, over the period."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from alphacut.base.arrays import Array
from alphacut.base.csv_columns import fields, number
from alphacut.base.errors import path_of, require, require_numbers
from alphacut.base.number_text import percent_text
from alphacut.base.units import ACCELERATION, factor_of


class MeanRule(NamedTuple):
    """What a code asks of the mean of the spectra of a suite of records.

    Args:
        clause: Code and clause.
        floor: Smallest ratio of the mean to the target over a range of periods.
        floor_at_start: The same at the first period of the target, which is 0 in codes.
        records: Smallest number of records.
    """

    clause: str = "The practice of EN 1998-1 and ASCE 7-22"
    floor: float = 0.9
    floor_at_start: float = 0.0
    records: int = 3


PRACTICE = MeanRule()
MAX_HEAD = 200
"""Largest length of the head of a file of a spectrum in characters."""


@dataclass(frozen=True, eq=False, repr=False)
class TargetSpectrum:
    """Spectral acceleration over the natural period, which is called at periods.

    It is linear between the given periods. Behind each period of `falls_from` it is multiplied with
    this period over T besides: the branches of codes in 1/T and 1/T² are such.

    Args:
        periods: Rising periods in s, the first one 0 or more, shape (n,), n at least 2.
        accelerations: Positive pseudo-accelerations there in m/s², before they fall, shape (n,).
        name: What it is, for tables and figures.
        clause: Code and clause.
        damping: Damping ratio that it belongs to.
        falls_from: Periods T_C and T_D of codes, in s, two at most; none for a table.
        minimum: Smallest value, in m/s².
        rule: What is asked of the mean spectrum of a suite.

    Raises:
        RefusedError: The periods do not rise, an acceleration is not positive, there are not as
            many of both, or more than two periods to fall from, or one that is not positive.

    Example:
        >>> from alphacut.frame import TargetSpectrum
        >>> site = TargetSpectrum([0.0, 0.2, 2.0], [1.0, 2.5, 0.5], "spectrum of the site")
        >>> site([0.1, 1.1]).round(3).tolist()
        [1.75, 1.5]
    """

    periods: Array
    accelerations: Array
    name: str = "table"
    clause: str = "of one's own"
    damping: float = 0.05
    falls_from: tuple[float, ...] = ()
    minimum: float = 0.0
    rule: MeanRule = PRACTICE

    def __post_init__(self) -> None:
        """Check periods and accelerations, and store them as arrays."""
        for key in ("periods", "accelerations"):
            require_numbers(key, getattr(self, key))
            object.__setattr__(self, key, np.asarray(getattr(self, key), float))
        periods, sizes = self.periods, self.accelerations
        rises = bool((np.diff(periods, prepend=-1e-300) > 0).all())
        fits = 1 < len(periods) == len(sizes) and rises and bool((sizes > 0).all())
        allowed = "two or more rising periods from 0 s on, a positive acceleration for each"
        require(fits, "spectrum", f"{periods} s, {sizes} m/s^2", allowed)
        # `displacement_chord` bounds branches in 1/T and 1/T², and no others.
        falls = len(self.falls_from) <= 2 and all(0 < x < np.inf for x in self.falls_from)
        require(falls, "falls_from", f"{self.falls_from} s", "two positive periods at most")

    def __call__(self, periods: ArrayLike) -> Array:
        """Return the spectral acceleration in m/s² at periods in s, in their shape.

        Raises:
            RefusedError: A period lies outside the range of the spectrum.
        """
        values = np.asarray(periods, float)
        outside = values[~((values >= self.periods[0]) & (values <= self.periods[-1]))]
        cure = "compare fewer periods, or give a longer spectrum"
        require(not outside.size, "period", f"{outside} s", f"those of the {self}", cure)
        found = np.interp(values, self.periods, self.accelerations)
        for corner in self.falls_from:
            found = found * corner / np.maximum(values, corner)
        return np.asarray(np.maximum(found, self.minimum))

    def __str__(self) -> str:
        """Return name, clause, damping and range of periods."""
        ends = f"T = {self.periods[0]:g} … {self.periods[-1]:g} s"
        return f"{self.name} ({self.clause}), damping {percent_text(self.damping)}, {ends}"

    __repr__ = __str__


def read_spectrum(path: str | Path, *, damping: float = 0.05) -> TargetSpectrum:
    """Read a spectrum of one's own from a CSV file with the head ``period [s],acceleration [g]``.

    Args:
        path: The file. The unit of the second column may be any of accelerations. Each row below
            the head has a period and the spectral acceleration there.
        damping: Damping ratio that the spectrum belongs to.

    Returns:
        The spectrum, linear between its rows, named as the file without its ending.

    Raises:
        RefusedError: The file cannot be read, its head is another one, a row is no two numbers, the
            periods do not rise, or an acceleration is not positive.
    """
    file = path_of("path", path)
    head, *rows = fields(file)
    text = ",".join(head.cells)
    # The pattern takes the square of the length of a text.
    require(len(text) <= MAX_HEAD, f"{file.name}, head", text[:80], "two names with units")
    match = re.fullmatch(r"[^,]+[\[(]s[\])],[^,]+[\[(]([^,]+)[\])]\s*", text)
    factor = factor_of(match[1], ACCELERATION) if match else 0.0
    allowed = "period [s],acceleration [g] or in another unit"
    require(factor > 0, f"{file.name}, head", text[:80], allowed)
    for row, cells in rows:
        what, cure = ",".join(cells), "write decimal points"
        require(len(cells) == 2, f"{file.name}, row {row}", what, "two numbers", cure)
    periods = [number(file, row, cells, 0) for row, cells in rows]
    values = [number(file, row, cells, 1) for row, cells in rows]
    accelerations = np.array(values) * factor
    return TargetSpectrum(np.array(periods), accelerations, name=file.stem, damping=damping)
