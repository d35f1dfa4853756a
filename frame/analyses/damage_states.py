"""Damage states of a structure: their limits, lognormal fits, and the table that Pelicun reads.

A structure is in a damage state from the smallest intensity measure on at which any of the limits
of the state is exceeded, such as the drift of any storey. With n records there are n such measures
x. The lognormal fragility function Φ(ln(x/θ)/β) has the median θ and the dispersion β. If all
measures are known, ln θ is the mean and β the standard deviation of ln x, with n - 1. Of a frame
that yields, some records may not bring the state up to the largest measure C that was tried. Then
the likelihood Π φ((ln x - ln θ)/β)/β · Π (1 - Φ(ln(C/θ)/β)), with one factor of the latter kind
for each such record, is maximised (Baker, Earthquake Spectra 31, 579, 2015: truncated incremental
dynamic analysis).
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from alphacut.base.arrays import Array
from alphacut.base.errors import require
from alphacut.base.number_text import STANDARD_GRAVITY
from alphacut.frame.analyses.answer import Record
from alphacut.frame.analyses.limits import Limit, limits_by_name
from alphacut.fuzzy.result import Ends


class LognormalFit(NamedTuple):
    """Median θ, in the unit of the measures, and dispersion β of a lognormal distribution."""

    median: float
    dispersion: float


def lognormal_fit(measures: Array, largest: float = np.inf) -> LognormalFit:
    """Return the lognormal distribution of the measures at which records bring a damage state.

    Args:
        measures: Positive measure of each record, shape (records,); infinite for a record that does
            not bring the state up to the largest measure.
        largest: Largest measure that was tried. If it is infinite, infinite measures are taken as
            unknown.

    Returns:
        The fit by moments of ln x with n - 1, or by maximum likelihood if some records do not bring
        the state. Both numbers are infinite if fewer than two records bring it, or if those that do
        all have the same measure.

    Example:
        >>> lognormal_fit(np.array([1.0, 4.0])).median
        2.0
    """
    logs = np.log(measures[np.isfinite(measures)])
    n_censored = len(measures) - len(logs)
    if n_censored == 0 and len(logs) > 1:
        return LognormalFit(float(np.exp(logs.mean())), float(logs.std(ddof=1)))
    if len(logs) < 2 or np.ptp(logs) == 0 or not np.isfinite(largest):
        return LognormalFit(np.inf, np.inf)
    # SciPy takes time to import.
    from scipy.optimize import minimize
    from scipy.special import log_ndtr

    # With y = ln x in standard units, b = 1/β and a = b ln θ the negative logarithm of the
    # likelihood is convex in (a, b) (Burridge, J. R. Stat. Soc. B 43, 41, 1981), so that its only
    # minimum is found from anywhere.
    unit = logs.std()
    y = (logs - logs.mean()) / unit
    end = (np.log(largest) - logs.mean()) / unit

    def negative_log_likelihood(parameters: Array) -> float:
        a, b = parameters
        observed = len(y) * np.log(b) - ((b * y - a) ** 2).sum() / 2
        return float(-(observed + n_censored * log_ndtr(a - b * end)))

    bounds = [(None, None), (1e-9, None)]  # b is positive
    a, b = minimize(negative_log_likelihood, np.array([0.0, 1.0]), bounds=bounds, tol=1e-13).x
    return LognormalFit(float(np.exp(logs.mean() + unit * a / b)), float(unit / b))


def fits_between(low: Array, high: Array, largest: float) -> tuple[Ends, Ends]:
    """Return estimated ranges of median and dispersion of fits to measures within intervals.

    Four samples are fitted: all lower ends, all upper ends, the values nearest to the geometric
    mean of the sample, and those farthest from it. Between censored measures neither parameter is
    monotone, so that these ranges are no bounds: of 9,000 random samples within such intervals, the
    median of 58 and the dispersion of 6 lay outside.

    Args:
        low: Lower ends, shape (levels, records), infinite where no structure comes into the state.
        high: Upper ends, infinite where some structure does not come into the state.
        largest: Largest measure that was tried, finite.

    Returns:
        Ranges of the median and of the dispersion, shape (levels,) each; infinite without a fit.
    """
    # Infinite measures lie somewhere above the largest one.
    within = np.log(np.minimum(high, largest))
    centre = ((np.log(np.minimum(low, largest)) + within) / 2).mean(axis=1, keepdims=True)
    together = np.clip(np.exp(centre), low, high)
    is_low_farther = centre - np.log(low) > within - centre
    apart = np.where(is_low_farther, low, high)
    samples = np.stack([low, high, together, apart])  # (samples, levels, records)
    fits = [[lognormal_fit(row, largest) for row in sample] for sample in samples]
    median, dispersion = np.moveaxis(np.array(fits), -1, 0)  # (samples, levels) each
    return (
        Ends(median.min(axis=0), median.max(axis=0)),
        Ends(dispersion.min(axis=0), dispersion.max(axis=0)),
    )


def limits_of_states(states: Mapping[str, Limit | Sequence[Limit]]) -> list[Limit]:
    """Return the limits of all damage states, each with the name of its state as its event.

    Args:
        states: One limit or several by the name of the state, from the slightest state on.

    Raises:
        RefusedError: A state has no limit; or as of `require_states`.
    """
    limits = []
    for name, members in states.items():
        named = limits_by_name(members, ())
        limits += [replace(limit, event=name) for limit in named.values()]
    require_states(list(states), limits_by_name(limits, ()))
    return limits


def require_states(names: Sequence[str], limits: Mapping[str, Limit]) -> None:
    """Check names and limits of damage states.

    Args:
        names: Names of the states, from the slightest state on.
        limits: Limits by name; the event of each is its state.

    Raises:
        RefusedError: A name has other characters than letters, digits, blanks, "_" and "-"; two
            names differ in capitals and blanks alone; a name is that of a limit; or a limit of a
            peak is no larger than that of a slighter state.
    """
    allowed = "names of letters, digits, blanks, - and _, each once"
    seen = {" ".join(limit.casefold().split()) for limit in limits}
    for name in names:
        plain = " ".join(name.casefold().split())
        is_name = re.fullmatch(r"[\w -]+", name) is not None and plain not in seen | {""}
        require(is_name, "states", value=name, allowed=allowed)
        seen.add(plain)
    # States are compared where they limit the same peak.
    reached: dict[str, Limit] = {}
    for limit in sorted(limits.values(), key=lambda limit: names.index(limit.event)):
        before = reached.get(limit.peak, limit)
        is_rising = before is limit or limit.outwards > before.outwards
        value = f"{limit.text} of {limit.event}"
        allowed = f"a limit beyond {before.text} of {before.event}"
        require(is_rising, "states", value=value, allowed=allowed, cure="begin with the slightest")
        reached[limit.peak] = limit


def pelicun_rows(
    components: Mapping[str, Mapping[str, LognormalFit]], measure: str, period: float
) -> list[Record]:
    """Return rows of a table of damage models as Pelicun 3.10 reads it, a row for each component.

    The damage states of a component are its limit states LS1, LS2 …; its demand is the intensity
    measure in g, of a ground motion at the base.

    Args:
        components: Fits by state, from the slightest on, and by the name of the component.
        measure: "Sa(T1)" or "PGA".
        period: Natural period T1 in s, which Pelicun has in the name of the demand.

    Raises:
        RefusedError: The measure is the scale of the records, which is no demand of Pelicun.
    """
    demands = {"Sa(T1)": f"Peak Spectral Acceleration|{period:.2f}"}
    demands["PGA"] = "Peak Ground Acceleration"
    allowed = "Sa(T1) or PGA as the intensity measure"
    require(measure in demands, "Pelicun's table", value=f"over {measure}", allowed=allowed)
    rows = []
    for name, fits in components.items():
        are_known = all(np.isfinite(fit).all() and fit.dispersion > 0 for fit in fits.values())
        # Pelicun leaves out components that are marked as incomplete.
        row: Record = {"ID": name, "Incomplete": "0" if are_known else "1"}
        row |= {"Demand-Type": demands[measure], "Demand-Unit": "g"}
        # Pelicun multiplies demands without a direction by 1.2 (FEMA P-58), which a measure of the
        # whole ground motion must not be.
        row |= {"Demand-Offset": "0", "Demand-Directional": "1"}
        for number, fit in enumerate(fits.values(), start=1):
            row[f"LS{number}-Family"] = "lognormal"
            row[f"LS{number}-Theta_0"] = fit.median / STANDARD_GRAVITY if are_known else None
            row[f"LS{number}-Theta_1"] = fit.dispersion if are_known else None
        rows.append(row)
    return rows
