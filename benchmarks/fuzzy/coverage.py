"""How often do the cuts of `from_data` hold what they claim, beside the field's usual recipes?

For every law, claim and number of values: samples, a fuzzy number from each, and at seven levels α
the share of samples whose cut holds the truth (a new value, the law's median, quantile, mean).
`worst` is the least (share − (1 − α)) / standard error: below −4 a claim is not kept. The recipes
claim the next value: the triangle from least over mean to greatest value, and mean ± 2 s. Then
joint claims of several quantities, with the rule of `jointly` and with the minimum of memberships.
Prints its seed and writes benchmarks/results/fuzzy_coverage.csv.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy import stats

from alphacut.base.arrays import Array
from alphacut.fuzzy import FuzzyNumber, RefusedError, Triangular, from_data, jointly
from benchmarks.rows import write

ALPHA = np.array([0.05, 0.1, 0.2, 0.35, 0.5, 0.7, 0.9])
FAR = 1e300
LAWS: dict[str, tuple[Any, tuple[float, float]]] = {
    "normal": (stats.norm(3, 2), (-FAR, FAR)),
    "log-normal": (stats.lognorm(0.8), (0.0, FAR)),
    "Cauchy": (stats.cauchy(), (-FAR, FAR)),
    "Pareto 1.1": (stats.pareto(1.1), (0.0, FAR)),
    "uniform": (stats.uniform(), (0.0, 1.0)),
    "arcsine": (stats.beta(0.5, 0.5), (0.0, 1.0)),
    "skewed beta": (stats.beta(0.3, 6), (0.0, 1.0)),
    "Poisson 2": (stats.poisson(2), (0.0, FAR)),
    "coin 0.1": (stats.bernoulli(0.1), (0.0, 1.0)),
}
FREE = ("next value", "median", "quantile 0.9")
NAMED = {"normal": ("mean",)}


@dataclass(frozen=True)
class Row:
    """Coverage of one way to make numbers."""

    law: str
    claim: str
    values: int
    way: str
    worst: float
    excess: float


def truth_of(law: Any, claim: str, rng: np.random.Generator, count: int) -> Array:
    """What the cuts of `count` samples should hold, shape (count,)."""
    if claim == "next value":
        return np.asarray(law.rvs(size=count, random_state=rng), float)
    if claim == "mean":
        return np.full(count, float(law.mean()))
    return np.full(count, float(law.ppf(0.5 if claim == "median" else float(claim.split()[1]))))


def held(
    name: str,
    claim: str,
    n: int,
    count: int,
    rng: np.random.Generator,
    *,
    named: str | None = None,
    make: Callable[..., FuzzyNumber] = from_data,
) -> tuple[Array, Array]:
    """Share of samples of n values whose cut holds the truth, less 1 − α.

    A cut that the values do not decide holds everything, and counts; without those the share would
    be that of some samples.

    Returns:
        Two arrays over `ALPHA`: over its standard error, and as it is.
    """
    law, bounds = LAWS[name]
    values = law.rvs(size=(count, n), random_state=rng).astype(float)
    numbers = [make(row, claim, bounds=bounds, law=named) for row in values]
    cuts = np.array([[decided_cut(number, alpha) for alpha in ALPHA] for number in numbers])
    truth = truth_of(law, claim, rng, count)[:, None]
    excess = ((cuts[..., 0] <= truth) & (truth <= cuts[..., 1])).mean(0) - (1 - ALPHA)
    return excess / np.sqrt(ALPHA * (1 - ALPHA) / count), excess


def decided_cut(number: FuzzyNumber, alpha: float) -> tuple[float, float]:
    """The cut; all numbers where the values do not decide it."""
    try:
        low, high = number.cut(alpha)
    except RefusedError:
        return -np.inf, np.inf
    return low, high


def triangle(values: Array, claim: str, **_: object) -> Triangular:
    """The recipe: least, mean, greatest value."""
    return Triangular(values.min(), values.mean(), values.max())


def spread(values: Array, claim: str, **_: object) -> Triangular:
    """The recipe: mean ± 2 s."""
    middle, reach = values.mean(), 2 * values.std(ddof=1)
    return Triangular(middle - reach, middle, middle + reach)


def ways(name: str, n: int) -> Iterator[tuple[str, str, dict[str, Any]]]:
    """Claim, name and options of every way to make numbers from n values of a law."""
    yield from ((claim, "from_data", {}) for claim in FREE)
    if np.abs(LAWS[name][1]).max() <= 1:
        yield "mean", "from_data", {}
    if n > 1:
        own = NAMED.get(name, ())
        yield from ((claim, f"from_data {name}", {"named": name}) for claim in own)
        yield "next value", "min-max triangle", {"make": triangle}
        yield "next value", "mean ± 2 s", {"make": spread}


def measure(name: str, n: int, count: int, rng: np.random.Generator) -> Iterator[Row]:
    """All rows of a law."""
    for claim, way, options in ways(name, n):
        score, excess = held(name, claim, n, count, rng, **options)
        yield Row(name, claim, n, way, float(score.min()), float(excess.max()))


def jointly_held(
    links: int, count: int, rng: np.random.Generator, *, alpha: float = 0.3
) -> dict[str, float]:
    """Score of all of several next values in their cuts at once, by the rule that joins them."""
    scores = {}
    for rule in ("minimum", "unknown", "independent"):
        hits = 0
        for drawn in rng.normal(size=(count, links, 20)):
            numbers = {
                str(k): from_data(row[:19], "next value", bounds=(-99, 99))
                for k, row in enumerate(drawn)
            }
            joined = jointly(numbers, independent=rule == "independent")
            chosen = numbers if rule == "minimum" else joined
            cuts = np.array([number.cut(alpha) for number in chosen.values()])  # type: ignore[union-attr]
            hits += bool(((cuts[:, 0] <= drawn[:, 19]) & (drawn[:, 19] <= cuts[:, 1])).all())
        scores[rule] = (hits / count - (1 - alpha)) / np.sqrt(alpha * (1 - alpha) / count)
    return scores


def main() -> None:
    """Measure, print and write."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=1000, help="samples of a row")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    rng = np.random.default_rng(options.seed)
    print(f"seed {options.seed}, {options.count} samples a row")
    rows = [
        row for name in LAWS for n in (1, 5, 20) for row in measure(name, n, options.count, rng)
    ]
    for row in rows:
        kept = "kept" if row.worst >= -4 else "NOT KEPT"
        print(
            f"{row.law:12} {row.claim:13} n = {row.values:2} {row.way:21} {row.worst:7.2f} {kept}"
        )
    for links in (2, 4, 8):
        print(f"{links} claims at once:", jointly_held(links, options.count // 2, rng))
    write([asdict(row) for row in rows], Path(__file__).parents[1] / "results/fuzzy_coverage.csv")


if __name__ == "__main__":
    main()
