"""Amplitude scaling of a suite of records to a target spectrum."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from alphacut.base.arrays import Array
from alphacut.base.errors import checked_number, require, require_choice
from alphacut.frame.analyses.answer import Answer, Row
from alphacut.frame.analyses.suites import nominal_mode, record_names
from alphacut.frame.records.history import Accelerogram
from alphacut.frame.spectra.response_spectrum import response_spectrum
from alphacut.frame.spectra.target import TargetSpectrum
from alphacut.frame.structures.model import StructureModel

FITS = {
    "record": "each record has a factor of its own, by least squares of the logarithms",
    "suite": "all records have one factor, by least squares of the logarithms",
    "period": "each record has the target's value at T1, and no floor is kept",
}
"""What the factors of records are fitted to."""
COUNT = 101
"""Periods at which spectra are compared, in geometric progression: 2.3 % apart from 0.2 T1 to 2 T1
(tuned: a denser list changes factors by less than 0.5 %)."""


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class ScaledSuite(Answer):
    """Records scaled to a target spectrum.

    Args:
        target: The target.
        factors: Factors of the records by name.
        governs: Sentence on what the factors are fitted to, and what raised them.
        periods: Periods in s: T1, those compared with the target, and at last 0, shape (P,).
        spectra: Spectra of the scaled records in m/s², for the damping of the target, shape
            (records, P).
        suite: The scaled records.
    """

    key = "spectrum"
    title = "By which factors do the records reach the target spectrum?"
    target: TargetSpectrum
    factors: dict[str, float]
    governs: str
    periods: Array
    spectra: Array
    suite: tuple[Accelerogram, ...]

    def text_rows(self) -> Iterator[Row]:
        """Yield `number_rows` with numbers of four digits."""
        for row in self.number_rows():
            yield {title: x if isinstance(x, str) else f"{x:.4g}" for title, x in row.items()}

    def number_rows(self) -> Iterator[Row]:
        """Yield a row of numbers for each record, and one for the mean of factors and spectra.

        The columns are the record, its factor, its largest ground acceleration, and its spectrum
        over the target: at T1, and the smallest and the largest ratio over the range of periods.
        """
        factors = list(self.factors.values())
        spectra = np.vstack([self.spectra, self.spectra.mean(axis=0)])
        ratios = spectra[:, :-1] / self.target(self.periods[:-1])
        columns = {
            "factor": np.append(factors, np.mean(factors)),
            "PGA [m/s^2]": spectra[:, -1],
            "Sa/target at T1": ratios[:, 0],
            "least": ratios.min(axis=1),
            "greatest": ratios.max(axis=1),
        }
        for k, name in enumerate([*self.factors, "mean"]):
            yield {"record": name} | {title: column[k] for title, column in columns.items()}

    def words(self) -> str:
        """Return sentences on the target, what governs, and what the code asks for."""
        rule = self.target.rule
        at_zero = " (at T = 0 all of it)" if rule.floor_at_start else ""
        return (
            f"The target is the {self.target}. {self.governs}. {rule.clause} asks for"
            f" {rule.records} records or more, whose mean is at least {rule.floor:.0%} of the"
            f" target{at_zero}."
        )


def scale_suite(
    suite: Sequence[Accelerogram],
    target: TargetSpectrum,
    period: float | StructureModel,
    *,
    fit: str = "record",
    over: tuple[float, float] = (0.2, 2.0),
) -> ScaledSuite:
    """Scale the records of a suite to a target spectrum.

    The spectra of the records are those for the damping ratio of the target. The factors of the
    fit minimise the sum of (ln Sa - ln target)² over the periods. If the mean of the spectra is
    then below 90 % of the target, or below all of it at T = 0 where the rule of the target says so,
    all factors are raised alike until it is not.

    Args:
        suite: Records, see `read_suite`.
        target: The target spectrum.
        period: First natural period T1 in s, or the structure that has it at its own parameters.
        fit: "record" for a factor of each record, "suite" for one of all, both over a range of
            periods; "period" for the target's value at T1, without floors.
        over: Ends of the range of periods, over T1.

    Returns:
        Factors and spectra; the scaled records are `suite`, for `over_records` and others.

    Raises:
        RefusedError: The target does not cover the range of periods, a record is zero throughout,
            two have the same name, or an argument is not as said.

    Example:
        >>> from alphacut.frame import eurocode8_spectrum, read_suite, scale_suite
        >>> records = read_suite("cases/suite/*.AT2", baseline="mean")
        >>> scaled = scale_suite(records, eurocode8_spectrum(2.5, "C"), 0.5)
        >>> round(scaled.factors["record-2001"], 3), len(scaled.suite)
        (1.826, 11)
    """
    names = record_names([[record] for record in suite])
    require_choice("fit", fit, FITS)
    if isinstance(period, StructureModel):
        period = nominal_mode(period).period
    checked_number("period", period, positive=True)
    low, high = over
    require(0 < low <= 1 <= high, "over", over, "multiples of T1 below and above 1, as (0.2, 2)")
    compared = period * np.append(1.0, np.geomspace(low, high, COUNT))
    goal = target(compared)
    periods = np.append(compared, 0.0)
    spectra = np.array([response_spectrum(record, periods, target.damping) for record in suite])
    allowed = "records that move something"
    require(bool(spectra.all()), "suite", "with a record that is zero throughout", allowed)
    logarithms = np.log(goal / spectra[:, :-1])
    fitted = logarithms[:, 1:].mean(axis=1)
    if fit == "suite":
        fitted[:] = fitted.mean()
    elif fit == "period":
        fitted = logarithms[:, 0]
    factors = np.exp(fitted)

    # The floors of the mean, the last one at T = 0, over the mean of the spectra.
    rule = target.rule
    floors = np.append(rule.floor * goal, rule.floor_at_start * target.accelerations[0])
    demands = floors / np.mean(factors[:, np.newaxis] * spectra, axis=0)
    governs = FITS[fit]
    if fit != "period" and demands.max() > 1:
        factors *= demands.max()
        governing = periods[demands.argmax()]
        governs += f"; the floor at T = {governing:.4g} s raised them all {demands.max():.4g} times"
    return ScaledSuite(
        target=target,
        factors=dict(zip(names, factors.tolist(), strict=True)),
        governs=f"T1 is {period:.4g} s; {governs}",
        periods=periods,
        spectra=factors[:, np.newaxis] * spectra,
        suite=tuple(
            replace(record, samples=factor * record.samples, name=name)
            for name, factor, record in zip(names, factors, suite, strict=True)
        ),
    )
