"""Coverage of the next value of a nonlinear function of several inputs with a claim each.

The function is the strength of a chain: that of the link which is weakest beside its load. Each of
1e4 repetitions draws 39 values of every link, makes lower limits by `from_data`, propagates them,
and looks whether the strength of a new chain lies in the cut at 20 levels. Rules: independent
sources; unknown dependence, also where the links share a common factor; and, shown to fail, the
minimum of the memberships: all cuts at the same α. `worst` is the least (share − (1 − α)) /
standard error. Cuts are taken by the ranks of one propagated number each, and compared with
propagation itself for the first samples. Writes benchmarks/results/fuzzy_joint_coverage.csv.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from alphacut.fuzzy import FuzzyNumber, Known, Signed, from_data, jointly, propagate
from alphacut.fuzzy.sets.claimed import Claimed
from benchmarks.rows import write

Array = NDArray[np.float64]
ALPHA = np.linspace(0.05, 1.0, 20)
VALUES = 39
BOUNDS = (0.0, 1e6)
CHECKED = 20
COUNTS = (2, 4, 8)


@dataclass(frozen=True)
class Row:
    """Coverage of one rule for one number of inputs."""

    inputs: int
    samples: str
    rule: str
    repetitions: int
    worst: float
    shortfall: float
    at_alpha: float
    limit_05: float

    @property
    def holds(self) -> bool:
        """Whether the coverage is as claimed."""
        return self.worst >= -4


def strength(**links: Array) -> Array:
    """Strength of the weakest link, each over its own load, shape (n,)."""
    least: Array = np.min([x**1.5 / (1 + 0.1 * k) for k, x in enumerate(links.values())], axis=0)
    return least


def draw(rng: np.random.Generator, links: int, *, common: bool) -> Array:
    """Strengths of old links and of the new one, last, shape (values + 1, links), gamma."""
    alone = rng.gamma(20.0, 0.05, (VALUES + 1, links))
    return alone * rng.gamma(20.0, 0.05, (VALUES + 1, 1)) if common else alone


def same_level(inputs: Mapping[str, FuzzyNumber | float]) -> dict[str, FuzzyNumber | float]:
    """The minimum rule: claimed numbers cut at the same α."""
    return {name: x.number if isinstance(x, Claimed) else x for name, x in inputs.items()}


RULES: dict[str, Callable[..., Mapping[str, FuzzyNumber | float]]] = {
    "independent": lambda inputs: jointly(inputs, independent=True),
    "unknown dependence": jointly,
    "minimum": same_level,
}


def cuts(values: Array, rule: str) -> tuple[Array, Array]:
    """Lower and upper ends of the chain's strength, shape (levels,), from values (n, links)."""
    names = [f"x{i}" for i in range(values.shape[1])]
    numbers = {
        name: from_data(column, "next value", side="lower", bounds=BOUNDS)
        for name, column in zip(names, values.T, strict=True)
    }
    known = Known(dict.fromkeys(names, 1))
    inputs = RULES[rule](numbers)
    found = propagate(strength, inputs, Signed(), alpha=ALPHA, known=known, vectorised=True)
    return found.bounds()


def lower_ends(values: Array, rule: str) -> Array:
    """Lower ends, shape (repetitions, levels), from values (repetitions, n, links) by ranks."""
    n, links = values.shape[1:]
    ranks = [
        from_data(np.arange(n) + 1e-9 * i, "next value", side="lower", bounds=(-1, n))
        for i in range(links)
    ]
    joined = RULES[rule]({f"x{i}": number for i, number in enumerate(ranks)})
    place = np.round([joined["x0"].cut(a).lower for a in ALPHA]).astype(int) + 1
    edge = np.ones((len(values), 1, links))
    ordered = np.hstack([BOUNDS[0] * edge, np.sort(values, axis=1), BOUNDS[1] * edge])
    taken = ordered[:, place]
    return strength(**{f"x{i}": taken[..., i] for i in range(links)})


def measure(
    links: int, rule: str, repetitions: int, rng: np.random.Generator, *, common: bool
) -> Row:
    """Coverage of one rule."""
    drawn = np.array([draw(rng, links, common=common) for _ in range(repetitions)])
    lower = lower_ends(drawn[:, :-1], rule)
    for row in range(min(CHECKED, repetitions)):
        np.testing.assert_allclose(lower[row], cuts(drawn[row, :-1], rule)[0], rtol=1e-12)
    truth = strength(**{f"x{i}": drawn[:, -1, i] for i in range(links)})
    excess = (lower <= truth[:, None]).mean(0) - (1 - ALPHA)
    error = np.maximum(np.sqrt(ALPHA * (1 - ALPHA) / repetitions), 1 / repetitions)
    worst, at = float((excess / error).min()), int(excess.argmin())
    samples = "common factor" if common else "independent"
    limit = float(lower[:, 0].mean())
    short = float(max(-excess[at], 0))
    return Row(links, samples, rule, repetitions, worst, short, float(ALPHA[at]), limit)


def rows_of(
    repetitions: int, rng: np.random.Generator, counts: Sequence[int] = COUNTS
) -> list[Row]:
    """All rules for which something is claimed, and the minimum."""
    cases = (
        ("independent", False),
        ("unknown dependence", False),
        ("unknown dependence", True),
        ("minimum", False),
    )
    return [
        measure(links, rule, repetitions, rng, common=common)
        for links in counts
        for rule, common in cases
    ]


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure, print and write the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--repetitions", type=int, default=10_000)
    parser.add_argument("--seed", type=int, default=None, help="default: a new one, printed")
    parser.add_argument("--out", type=Path, default=Path(__file__).parents[1] / "results")
    options = parser.parse_args(arguments)
    seed = np.random.SeedSequence(options.seed).entropy
    print(f"seed {seed}")
    rows = rows_of(options.repetitions, np.random.default_rng(seed))
    write([asdict(row) for row in rows], options.out / "fuzzy_joint_coverage.csv")
    for row in rows:
        print(
            f"{row.inputs} inputs, samples {row.samples:14} {row.rule:18} "
            f"{'holds' if row.holds else 'FAILS'}: worst {row.worst:7.2f} standard errors, short"
            f" by "
            f"{row.shortfall:.3f} at α = {row.at_alpha:.2f}; limit at α = 0.05: {row.limit_05:.3f}"
        )


if __name__ == "__main__":
    main()
