"""Coverage and widths of the parameters that measured modes leave of a six-storey frame.

Each repetition draws a frame within ±20 % of its nominal stiffnesses, measures its first three
frequencies and shapes some times with a normal noise of 1 % (of each frequency; of each shape's
largest amplitude), and updates the priors of ±20 %. Rows: share of the repetitions whose true
parameters have a joint possibility of α at least, beside the 1 − α claimed, over 20 levels; truth
in the box at α = 0.05; widths of its stiffnesses over those of the priors. Where masses are
unknown too the true values lie within ±5 %, so that the priors do not pin their common factor. Then
the widths that an unbiased estimate from one record, its noise known, needs at the least for 95 %
of each stiffness alone (Cramér and Rao): from more records they fall by the root of their number.
The last line compares the envelope of the roof before and after. Writes
benchmarks/results/frame_update.csv; the table kept there is that of `--seed 201803`.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from alphacut.frame import StoreyFrame, envelope
from alphacut.frame.update.chain import Chain
from alphacut.frame.update.measured import Measurement, measured_mode
from alphacut.frame.update.posterior import Posterior, RefutedError, update
from alphacut.fuzzy import FuzzyNumber, Interval
from benchmarks.rows import write

Array = NDArray[np.float64]
LEVELS = np.linspace(0.05, 1.0, 20)
FLOORS, MODES, NOISE, SPREAD = 6, 3, 0.01, 0.2
FRAME = StoreyFrame(
    [20e3] * FLOORS,
    [3.0] * FLOORS,
    30e9,
    3e-4,
    q0=[0.01 * z for z in range(1, FLOORS + 1)],
    rayleigh=(0.1, 2e-3),
    outputs=(f"q{FLOORS}",),
)


@dataclass(frozen=True)
class Row:
    """Coverage and widths of one kind of measurement."""

    masses: str
    records: int
    repetitions: int
    worst: float
    """Least (share − (1 − α)) / standard error over the levels."""
    in_box: float
    width_mean: float
    width_most: float
    common_factor: float
    """Least range of a factor common to all parameters over that of their priors, at α = 0.05, of
    repetitions whose true values lie in the set."""
    told: float
    tried: float
    seconds: float


def names_of(masses: bool) -> tuple[str, ...]:
    """Uncertain parameters: stiffnesses by their columns, and masses where they are unknown."""
    letters = "cm" if masses else "c"
    return tuple(f"{letter}{z + 1}" for letter in letters for z in range(FLOORS))


def priors(masses: bool) -> dict[str, FuzzyNumber]:
    """± 20 % of the nominal values."""
    nominal = FRAME.parameters
    return {
        name: Interval((1 - SPREAD) * nominal[name], (1 + SPREAD) * nominal[name])
        for name in names_of(masses)
    }


def measure(truth: Array, records: int, masses: bool, rng: np.random.Generator) -> Measurement:
    """Noisy modes of a frame."""
    values, vectors = Chain.of(FRAME, names_of(masses)).modes(truth[None])
    modes = []
    for k in range(MODES):
        shape = vectors[0, :, k]
        largest = int(np.abs(shape).argmax())
        shape = shape / shape[largest]
        noise = NOISE * rng.standard_normal((records, FLOORS))
        frequency = np.sqrt(values[0, k]) / (2 * np.pi)
        frequencies = frequency * (1 + NOISE * rng.standard_normal(records))
        floors = {z + 1: shape[z] + noise[:, z] for z in range(FLOORS)}
        modes.append(measured_mode(k + 1, frequencies, floors))
    return Measurement(tuple(modes), independent=True)


def least_widths(frames: int, rng: np.random.Generator) -> Array:
    """Widths of 95 % by Cramér and Rao's bound over those of the priors, shape (frames, FLOORS)."""
    ends = np.array([x.support for x in priors(False).values()])
    truths = ends.mean(1) * rng.uniform(1 - SPREAD, 1 + SPREAD, (frames, FLOORS))
    return np.array([1.96 * 2 * _deviations(truth) / np.ptp(ends, axis=1) for truth in truths])


def _deviations(truth: Array, step: float = 1e-5) -> Array:
    """Least standard deviation of each stiffness, from one record with noise of 1 %."""
    shifted = [truth * (1 + sign * step * np.eye(FLOORS)) for sign in (1, -1)]
    ahead, behind = (np.array([_noise_free(row) for row in rows]) for rows in shifted)
    # a shape's scale is unknown: of its length only the ratio to the noise counts
    share = 1 / np.abs(_noise_free(truth)[MODES:].reshape(FLOORS, MODES)).max(axis=0)
    sharpness = np.concatenate([np.ones(MODES), np.tile(share, FLOORS)]) / NOISE
    slopes = (ahead - behind).T / (2 * step * truth) * sharpness[:, None]
    return np.sqrt(np.diag(np.linalg.inv(slopes.T @ slopes)))


def _noise_free(truth: Array) -> Array:
    """Logarithms of the frequencies, and the shapes, of length 1."""
    values, vectors = Chain.of(FRAME, names_of(False)).modes(truth[None])
    shapes = vectors[0, :, :MODES]
    largest = np.abs(shapes).argmax(axis=0)
    scaled = shapes / np.linalg.norm(shapes, axis=0) * np.sign(shapes[largest, np.arange(MODES)])
    return np.concatenate([np.log(values[0, :MODES]) / 2, scaled.ravel()])


@dataclass
class Tally:
    """What repetitions gave, one entry each; of refuted ones only the first two lists."""

    degrees: list[float] = field(default_factory=list)
    inside: list[bool] = field(default_factory=list)
    widths: list[list[float]] = field(default_factory=list)
    common: list[float] = field(default_factory=list)
    told: list[bool] = field(default_factory=list)
    tried: list[float] = field(default_factory=list)

    def take(self, found: Posterior, truth: Array, ends: Array) -> None:
        """One posterior of a frame with the parameters `truth` (d,), its priors at `ends`."""
        lower, upper = found.lower[0], found.upper[0]
        self.degrees.append(float(found.agreement.possibility(truth[None])[0]))
        self.inside.append(bool(((lower <= truth) & (truth <= upper)).all()))
        assert (lower >= ends[:, 0]).all()
        assert (upper <= ends[:, 1]).all()
        self.widths.append([found.narrowed[name] for name in names_of(False)])
        lost = ("common factor" in x.words and not x.learned for x in found.directions)
        self.told.append(any(lost))
        factors = np.linspace(0.75, 1.25, 1001)
        held = found.agreement.possibility(factors[:, None] * truth) >= 0.05
        if held.any():
            self.common.append(float(np.ptp(factors[held]) / (2 * SPREAD)))
        tried = (found.tried_upper - found.tried_lower)[0] / (upper - lower)
        self.tried.append(float(np.nanmean(tried)))

    def worst(self) -> float:
        """Least (share − (1 − α)) / standard error over the levels."""
        count = len(self.degrees)
        shares = (np.array(self.degrees)[:, None] >= LEVELS).mean(0)
        error = np.maximum(np.sqrt(LEVELS * (1 - LEVELS) / count), 1 / count)
        return float(((shares - (1 - LEVELS)) / error).min())


def repeat(masses: bool, records: int, repetitions: int, rng: np.random.Generator) -> Row:
    """Coverage and widths over repetitions."""
    prior, start, tally = priors(masses), time.perf_counter(), Tally()
    ends = np.array([x.support for x in prior.values()])
    for _ in range(repetitions):
        truth = ends.mean(1) * rng.uniform(*(0.95, 1.05) if masses else (0.8, 1.2), len(ends))
        try:
            found = update(FRAME, prior, measure(truth, records, masses, rng), alpha=(0.05,))
        except RefutedError:  # of a true frame, with P <= 0.05
            tally.degrees.append(0.0)
            tally.inside.append(False)
            continue
        tally.take(found, truth, ends)
    return Row(
        "unknown" if masses else "known",
        records,
        repetitions,
        tally.worst(),
        float(np.mean(tally.inside)),
        float(np.mean(tally.widths)),
        float(np.max(tally.widths)),
        float(np.min(tally.common or [np.nan])),
        float(np.mean(tally.told)),
        float(np.mean(tally.tried)),
        (time.perf_counter() - start) / repetitions,
    )


def narrower(found: Posterior, prior: dict[str, FuzzyNumber]) -> float:
    """Mean width of the roof's envelope after the update over that before, at α = 0.05."""
    before, after = (
        envelope(FRAME, numbers, duration=5.0, step=0.02, alpha=(0.05,), method="modal")
        for numbers in (prior, found.numbers)
    )
    return float((after.upper - after.lower).mean() / (before.upper - before.lower).mean())


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure, print and write the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--repetitions", type=int, default=500)
    parser.add_argument("--records", type=int, default=40)
    parser.add_argument("--seed", type=int, default=None, help="default: a new one, printed")
    parser.add_argument("--out", type=Path, default=Path(__file__).parents[1] / "results")
    options = parser.parse_args(arguments)
    seed = np.random.SeedSequence(options.seed).entropy
    print(f"seed {seed}", flush=True)
    rng, few = np.random.default_rng(seed), max(options.repetitions // 10, 2)
    records = options.records
    kinds = ((False, records, options.repetitions), (False, 10, few), (True, records, few))
    rows = []
    for masses, records, count in kinds:
        rows.append(repeat(masses, records, count, rng))
        print(rows[-1], flush=True)
    write([asdict(row) for row in rows], options.out / "frame_update.csv")
    least = least_widths(options.repetitions, np.random.default_rng([seed, 1]))
    print(f"one record, least widths of 95 %: mean {least.mean():.3f}, most {least.max():.3f}")
    prior = priors(False)
    truth = np.array([FRAME.parameters[name] for name in prior])
    found = update(FRAME, prior, measure(truth, records, False, rng), alpha=(0.05,))
    print(f"envelope of the roof: {narrower(found, prior):.3f} of its width before the update")
    assert all(row.worst >= -4 and row.in_box >= 0.95 - 0.05 for row in rows)


if __name__ == "__main__":
    main()
