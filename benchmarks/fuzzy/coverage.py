"""How often do the cuts of `from_data` hold what they claim, beside the field's usual recipes?

For every law and number of values: 1e4 samples (2e3 for means within bounds), a fuzzy number from
each, and at 20 levels α the share of samples whose cut holds the truth (a new value, the law's
median, quantile, mean). `worst` is the least (share − (1 − α)) / standard error: it must not be
below −4. `above` is the largest share − (1 − α) − 4 standard errors: of a continuous law at most
1/(n + 1); where coverage is made exact (`rng`) at most 0. Quantiles without `rng` may lie above by
the largest probability of one count, which no rule that looks at the ranks alone avoids; a mean
within bounds, and that of a log-normal law, by more. Recipes: triangle from
least over mean to greatest value; Dubois and Prade's possibility of a histogram; triangle mean ± 2
s. They claim the next value. Widths are means at α = 0.5 and 0.05, NaN where the values do not
decide. Writes benchmarks/results/fuzzy_coverage.csv.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from alphacut.fuzzy.knowledge.from_data import from_data
from alphacut.fuzzy.knowledge.order_statistics import windows
from alphacut.fuzzy.sets.claimed import Claimed
from benchmarks.rows import write

Array = NDArray[np.float64]
ALPHA = np.linspace(0.05, 1.0, 20)
COUNTS = (1, 5, 10, 30, 200)
FAR = 1e300
CHECKED = 20  # samples for which the shortcut is compared with `from_data` itself


@dataclass(frozen=True)
class Source:
    """A law to draw from, with its truths."""

    name: str
    draw: Callable[[np.random.Generator, tuple[int, int]], Array]
    truth: Callable[[str], float]
    continuous: bool = True
    bounds: tuple[float, float] = (-FAR, FAR)
    law: str = ""


def _scipy(
    name: str,
    law: Any,
    *,
    continuous: bool = True,
    bounds: tuple[float, float] = (-FAR, FAR),
    named: str = "",
) -> Source:
    def truth(claim: str) -> float:
        if claim == "mean":
            return float(law.mean())
        return float(law.ppf(0.5 if claim == "median" else float(claim.split()[1])))

    return Source(
        name,
        lambda rng, shape: np.asarray(law.rvs(size=shape, random_state=rng), float),
        truth,
        continuous,
        bounds,
        named,
    )


class _TwoPeaks:
    """An even mixture of two normal laws far apart, the median at the empty middle."""

    def rvs(self, size: tuple[int, int], random_state: np.random.Generator) -> Array:
        peak = np.where(random_state.random(size) < 0.5, -5.0, 5.0)
        return np.asarray(peak + random_state.normal(size=size))

    def ppf(self, q: float) -> float:
        from scipy.optimize import brentq

        return float(
            brentq(lambda x: (stats.norm.cdf(x, -5) + stats.norm.cdf(x, 5)) / 2 - q, -20, 20)
        )


class _Rounded:
    """A normal law in steps of 0.5: values tie."""

    def rvs(self, size: tuple[int, int], random_state: np.random.Generator) -> Array:
        return np.asarray(np.round(2 * random_state.normal(0.1, size=size)) / 2)

    def ppf(self, q: float) -> float:
        return float(np.round(2 * stats.norm.ppf(q, 0.1)) / 2)


SOURCES = (
    _scipy("normal", stats.norm(3, 2), named="normal"),
    _scipy("log-normal", stats.lognorm(0.8), named="log-normal", bounds=(0, FAR)),
    _scipy("Cauchy", stats.cauchy()),
    _scipy("Student, 2 degrees", stats.t(2)),
    _scipy("Pareto 1.1", stats.pareto(1.1)),
    _scipy("exponential", stats.expon(), bounds=(0, FAR)),
    _scipy("uniform", stats.uniform(), bounds=(0, 1)),
    _scipy("arcsine", stats.beta(0.5, 0.5), bounds=(0, 1)),
    _scipy("skewed beta", stats.beta(0.3, 6), bounds=(0, 1)),
    _scipy("two peaks", _TwoPeaks()),
    _scipy("Poisson 2", stats.poisson(2), continuous=False, bounds=(0, FAR)),
    _scipy("coin 0.1", stats.bernoulli(0.1), continuous=False, bounds=(0, 1)),
    _scipy("rounded normal", _Rounded(), continuous=False),
    Source("constant", lambda rng, shape: np.full(shape, 7.0), lambda claim: 7.0, continuous=False),
)


@dataclass(frozen=True)
class Row:
    """Coverage of one way to make numbers, at one law and number of values."""

    law: str
    values: int
    method: str
    claim: str
    repetitions: int
    worst: float
    above: float
    allowed_above: float
    shortfall: float
    at_alpha: float
    width_50: float
    width_05: float

    @property
    def holds(self) -> bool:
        """Whether the coverage is as claimed."""
        return self.worst >= -4 and self.above <= self.allowed_above


def row_of(
    source: Source,
    n: int,
    method: str,
    claim: str,
    ends: Array,
    truth: Array,
    allowed: float = np.inf,
) -> Row:
    """Coverage of cuts `ends` (repetitions, levels, 2) of truths (repetitions,)."""
    held = ((ends[..., 0] <= truth[:, None]) & (truth[:, None] <= ends[..., 1])).mean(0)
    excess = held - (1 - ALPHA)
    error = np.sqrt(ALPHA * (1 - ALPHA) / len(truth))
    score = np.where(excess >= 0, np.inf, excess / np.maximum(error, 1 / len(truth)))
    width = np.where(
        np.abs(ends).max((0, 2)) < FAR / 2, (ends[..., 1] - ends[..., 0]).mean(0), np.nan
    )
    fails = int(excess.argmin())
    middle = int(np.argmin(np.abs(ALPHA - 0.5)))
    above, worst = float((excess - 4 * error).max()), float(score.min())
    return Row(
        source.name,
        n,
        method,
        claim,
        len(truth),
        worst,
        above,
        allowed,
        float(max(-excess[fails], 0)),
        float(ALPHA[fails]),
        float(width[middle]),
        float(width[0]),
    )


def ends_of(sample: Array, make: Callable[[Array], Claimed]) -> Array:
    """Cuts of a number from each row of the sample, shape (repetitions, levels, 2)."""
    return np.array([[number.cut(a) for a in ALPHA] for number in (make(row) for row in sample)])


def rank_ends(lower: Array, upper: Array, bounds: tuple[float, float], number: Claimed) -> Array:
    """Cuts of numbers from rows of ends of values, (repetitions, n), by ranks.

    The ranks are those of a number from 0 … n − 1 within (−1, n): one number serves all rows.
    """
    edge = np.ones((len(lower), 1))
    low = np.hstack([bounds[0] * edge, np.sort(lower, axis=1), bounds[1] * edge])
    high = np.hstack([bounds[0] * edge, np.sort(upper, axis=1), bounds[1] * edge])
    place = np.array([number.cut(a) for a in ALPHA]) + 1
    return np.stack([_at(low, place[:, 0]), _at(high, place[:, 1])], axis=-1)


def _at(rows: Array, place: Array) -> Array:
    """Entries at places between which rows are linear, shape (repetitions, levels)."""
    first = np.floor(place).astype(int)
    share, after = place - first, np.minimum(first + 1, rows.shape[1] - 1)
    between: Array = rows[:, first] + np.where(
        share > 0, share * (rows[:, after] - rows[:, first]), 0.0
    )
    return between


def exact_ends(
    sample: Array, claim: str, bounds: tuple[float, float], options: Mapping[str, Any]
) -> Array:
    """Cuts from every row: by ranks, or by mean and standard deviation, from one number.

    The first rows are compared with `from_data` itself.
    """
    n, law = sample.shape[1], options.get("law")
    if claim == "mean" and law != "normal":
        return ends_of(sample, lambda row: from_data(row, claim, bounds=bounds, **options))
    if "rng" in options:
        return drawn_ends(sample, claim, bounds, options["rng"])
    if law is None:
        number = from_data(np.arange(float(n)), claim, bounds=(-1, n), **options)
        ends = rank_ends(sample, sample, bounds, number)
    else:
        standard = np.arange(n) / np.std(np.arange(n), ddof=1)
        options = {**options, "law": "normal"}
        number = from_data(standard - standard.mean(), claim, bounds=(-FAR, FAR), **options)
        values = np.log(sample) if law == "log-normal" else sample
        factor = np.array([number.cut(a) for a in ALPHA])
        ends = values.mean(1)[:, None, None] + factor * values.std(1, ddof=1)[:, None, None]
        ends = np.exp(ends) if law == "log-normal" else ends
        options = {**options, "law": law}
    own = ends_of(sample[:CHECKED], lambda row: from_data(row, claim, bounds=bounds, **options))
    np.testing.assert_allclose(ends[:CHECKED], own, rtol=1e-9, atol=1e-9)
    return ends


def drawn_ends(
    sample: Array, claim: str, bounds: tuple[float, float], rng: np.random.Generator
) -> Array:
    """Cuts of quantiles with a random number for each row; the last one is a point.

    The first rows are compared with `from_data` itself, given the same numbers.
    """
    n, quantile = sample.shape[1], probability(claim)
    own = [from_data(row, claim, bounds=bounds, rng=k) for k, row in enumerate(sample[:CHECKED])]
    share = rng.random((len(sample), 1))
    share[:CHECKED, 0] = [1 - np.random.default_rng(k).random() for k in range(len(own))]
    found = windows(n, quantile, "both", (False, False))
    level = np.append(found.level, 1.0)
    change = level[:-1] + share * np.diff(level)  # where the next cut begins, per row
    at = (change[:, None, :] <= ALPHA[None, :, None]).sum(-1)
    ordered = np.sort(sample, axis=1)
    edge, point = np.ones((len(sample), 1)), np.quantile(sample, quantile, axis=1)[:, None]
    low, high = np.hstack([bounds[0] * edge, ordered]), np.hstack([ordered, bounds[1] * edge])
    last = np.clip(point, low[:, found.low[-1:]], high[:, found.high[-1:]])
    ends = np.stack(
        [
            np.take_along_axis(np.hstack([rows[:, gaps], last]), at, axis=1)
            for rows, gaps in ((low, found.low), (high, found.high))
        ],
        axis=-1,
    )
    np.testing.assert_allclose(
        ends[:CHECKED], [[number.cut(a) for a in ALPHA] for number in own], rtol=1e-12, atol=1e-12
    )
    return ends


def probability(claim: str) -> float:
    """Probability of a claimed quantile."""
    return 0.5 if claim == "median" else float(claim.split()[1])


def claims_of(source: Source, rng: np.random.Generator) -> Iterator[tuple[str, Mapping[str, Any]]]:
    """What is claimed of a law: without its name, and with it."""
    yield "next value", {}
    yield "next value", {"side": "upper"}
    yield "median", {}
    yield "quantile 0.9", {}
    for claim in ("median", "quantile 0.9"):
        yield claim, {"rng": rng}
    if np.abs(source.bounds).max() < FAR:
        yield "mean", {}
    if source.law:
        yield from (
            (claim, {"law": source.law})
            for claim in ("next value", "mean", "median", "quantile 0.9")
        )


def allowed_above(source: Source, n: int, claim: str, options: Mapping[str, Any]) -> float:
    """Allowed excess of coverage: one step of the ranks for continuous laws, else no limit."""
    if not source.continuous or (claim == "mean" and options.get("law") != "normal"):
        return np.inf
    if claim == "next value" or "law" in options:
        return 1 / (n + 1)
    if "rng" in options:
        return 0.0
    level = windows(n, probability(claim), "both", (False, False)).level
    return float(np.diff(np.append(level, 1.0)).max())


def own_rows(
    source: Source,
    n: int,
    sample: Array,
    fresh: Array,
    rng: np.random.Generator,
    claims: Sequence[str] = (),
) -> Iterator[Row]:
    """Rows of `from_data`."""
    for claim, options in claims_of(source, rng):
        if (options.get("law") and n < 2) or (claims and claim not in claims):
            continue
        few = len(sample) if claim != "mean" or options else max(len(sample) // 5, 100)
        ends = exact_ends(sample[:few], claim, source.bounds, options)
        truth = fresh if claim == "next value" else np.full(few, source.truth(claim))
        named = " ".join(
            ("from_data", *("rng" if key == "rng" else str(x) for key, x in options.items()))
        )
        yield row_of(source, n, named, claim, ends, truth, allowed_above(source, n, claim, options))


def coarse_rows(source: Source, n: int, sample: Array, fresh: Array) -> Iterator[Row]:
    """Rows of `from_data` of values rounded to 1 or censored above the upper quartile."""
    gauge = source.truth("quantile 0.75")
    ways = {
        "rounded to 1": (np.round(sample) - 0.5, np.round(sample) + 0.5),
        "censored": (np.minimum(sample, gauge), np.where(sample > gauge, FAR, sample)),
    }
    number = from_data(np.arange(float(n)), "next value", bounds=(-1, n))
    for way, (lower, upper) in ways.items():
        ends = rank_ends(lower, upper, (-FAR, FAR), number)
        pairs = np.stack([lower, upper], axis=-1)[:CHECKED]
        own = ends_of(pairs, lambda rows: from_data(rows, "next value", bounds=(-FAR, FAR)))
        np.testing.assert_allclose(ends[:CHECKED, :-1], own[:, :-1])  # at α = 1 a point is chosen
        yield row_of(source, n, f"from_data {way}", "next value", ends, fresh)


def triangle(lower: Array, modal: Array, upper: Array) -> Array:
    """Cuts of triangles, shape (repetitions, levels, 2)."""
    low, mid, high = (x[:, None] for x in (lower, modal, upper))
    return np.stack([low + ALPHA * (mid - low), high - ALPHA * (high - mid)], axis=-1)


def histogram_cuts(values: Array) -> Array:
    """Hulls of the cuts of Dubois and Prade's possibility of a histogram.

    The possibility of a bin is the sum of all bins at most as probable.
    """
    count, edges = np.histogram(values, bins="sturges")
    share = count / count.sum()
    possible = np.array([share[share <= own].sum() for own in share]) * (share > 0)
    inside = [np.flatnonzero(possible >= min(a, possible.max()) - 1e-12) for a in ALPHA]
    return np.array([(edges[rows[0]], edges[rows[-1] + 1]) for rows in inside])


def recipe_rows(source: Source, n: int, sample: Array, fresh: Array) -> Iterator[Row]:
    """Rows of the usual recipes, taken as claims of the next value."""
    mean, low, high = sample.mean(1), sample.min(1), sample.max(1)
    spread = 2 * sample.std(1, ddof=1) if n > 1 else np.zeros(len(sample))
    yield row_of(source, n, "min-max triangle", "next value", triangle(low, mean, high), fresh)
    yield row_of(
        source, n, "mean ± 2 s", "next value", triangle(mean - spread, mean, mean + spread), fresh
    )
    yield row_of(
        source,
        n,
        "Dubois-Prade histogram",
        "next value",
        np.array([histogram_cuts(row) for row in sample]),
        fresh,
    )


def measure(
    source: Source, n: int, repetitions: int, rng: np.random.Generator, claims: Sequence[str] = ()
) -> list[Row]:
    """All rows of one law at one number of values."""
    drawn = source.draw(rng, (repetitions, n + 1))
    sample, fresh = drawn[:, :n], drawn[:, n]
    rows = list(own_rows(source, n, sample, fresh, rng, claims))
    if not claims:
        rows += coarse_rows(source, n, sample, fresh) if source.continuous else ()
        rows += recipe_rows(source, n, sample, fresh)
    return rows


def summary(rows: Sequence[Row]) -> str:
    """The worst of every method and claim over all laws and numbers of values."""
    lines = []
    for method, claim in dict.fromkeys((row.method, row.claim) for row in rows):
        own = [row for row in rows if (row.method, row.claim) == (method, claim)]
        low, high = (
            min(own, key=lambda row: row.worst),
            max(row.above - row.allowed_above for row in own),
        )
        failed = sum(not row.holds for row in own)
        short = max(own, key=lambda row: row.shortfall)
        lines.append(
            f"{method:26} {claim:13} {len(own):3} cases, {failed:3} fail; worst {low.worst:8.2f}"
            f" standard errors ({low.law}, n = {low.values}), "
            f"short by {short.shortfall:.3f} at α = {short.at_alpha:.2f}; above beyond allowed"
            f" {high:.4f}"
        )
    return "\n".join(lines)


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure, print and write the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--repetitions", type=int, default=10_000)
    parser.add_argument(
        "--seed", type=int, default=None, help="seed of the samples (default: a new one, printed)"
    )
    parser.add_argument("--out", type=Path, default=Path(__file__).parents[1] / "results")
    options = parser.parse_args(arguments)
    seed = np.random.SeedSequence(options.seed).entropy
    print(f"seed {seed}")
    rng = np.random.default_rng(seed)
    rows = [
        row
        for source in SOURCES
        for n in COUNTS
        for row in measure(source, n, options.repetitions, rng)
    ]
    write([asdict(row) for row in rows], options.out / "fuzzy_coverage.csv")
    print(summary(rows))


if __name__ == "__main__":
    main()
