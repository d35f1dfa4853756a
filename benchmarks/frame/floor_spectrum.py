"""Do bounds of floor spectra hold, and how far are they from the largest sample?

Random structures under random records, with oscillators on the top floor: chains of masses with
one damping ratio of all modes, or with Rayleigh's damping; chains with dashpots; and buildings of
one to three floors that move in two directions and turn, with modes near one another. Two or three
inputs are uncertain by 2 to 8 %. One oscillator is stiff, one is tuned to the first mode, with the
damping ratio of the modes, and one is drawn at random. Random samples, half of them corners, are
computed independently: structure and oscillators as one system of first order, which
`scipy.linalg.expm` solves for a ground acceleration of straight lines.

Run `python -m benchmarks.frame.floor_spectrum --help`.
"""

from __future__ import annotations

import argparse
import secrets
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import scipy.linalg

from alphacut.base.arrays import Array
from alphacut.frame import Accelerogram, MatrixStructure, floor_spectrum
from alphacut.fuzzy import Interval
from benchmarks.frame.spectrum_response import chain_matrix
from benchmarks.rows import write

RESULTS = Path(__file__).parents[1] / "results"
KINDS = ("ratio", "rayleigh", "dashpots", "building")
STEP = 0.02
DURATION = 8.0


@dataclass(frozen=True, eq=False)
class Problem:
    """A structure M = Σ p_i M_i, K = Σ p_i K_i, C = Σ p_i C_i (or ζ of all modes) with inputs p."""

    kind: str
    masses: Array  # M_i, diagonal, (inputs, n, n)
    stiffnesses: Array  # K_i, (inputs, n, n)
    dampers: Array  # C_i, (inputs, n, n)
    ratio: float  # ζ of all modes, beside C
    pattern: Array  # displacements by a unit displacement of the ground, (n,)
    output: Array  # row on absolute accelerations, (n,)

    @property
    def names(self) -> list[str]:
        """Names of the inputs, whose nominal values are 1."""
        return [f"p{i}" for i in range(len(self.masses))]

    def structure(self, ground: Accelerogram) -> MatrixStructure:
        """Return the structure as the program takes it."""
        parts = {}
        kinds = {"mass": self.masses, "stiffness": self.stiffnesses, "damping": self.dampers}
        for kind, arrays in kinds.items():
            parts[kind] = [(x, y) for x, y in zip(self.names, arrays, strict=True) if y.any()]
        return MatrixStructure(
            dict.fromkeys(self.names, 1.0),
            **parts,
            observed={"a": np.concatenate([0 * self.output, 0 * self.output, self.output])},
            pattern=self.pattern,
            ratios=[self.ratio] if self.ratio else [],
            ground=ground,
        )

    def peaks(self, points: Array, ground: Accelerogram, periods: Array, ratio: float) -> Array:
        """Return the peaks |ω² w| of oscillators at inputs p, shape (points, periods)."""
        parts = self.masses, self.stiffnesses, self.dampers
        M, K, C = (np.tensordot(points, x, 1) for x in parts)
        root = np.sqrt(M.diagonal(axis1=1, axis2=2))
        squares, vectors = np.linalg.eigh(K / root[:, :, np.newaxis] / root[:, np.newaxis])
        half = root[:, :, np.newaxis] * vectors
        C = C + 2 * self.ratio * (half * np.sqrt(squares)[:, np.newaxis]) @ half.swapaxes(1, 2)
        n = len(self.pattern)
        size = 2 * (n + len(periods))
        A = np.zeros((len(points), size + 2, size + 2))
        A[:, :n, n : 2 * n] = np.eye(n)
        A[:, n : 2 * n, : 2 * n] = -np.concatenate([K, C], -1) / root[:, :, np.newaxis] ** 2
        floor = np.einsum("n,snj->sj", self.output, A[:, n : 2 * n])  # before the ground's part
        A[:, n : 2 * n, size] = -self.pattern
        for k, period in enumerate(periods):
            w, omega = 2 * (n + k), 2 * np.pi / period
            A[:, w, w + 1] = 1.0
            A[:, w + 1] = -floor
            A[:, w + 1, w : w + 2] += [-(omega**2), -2 * ratio * omega]
        # In parts of a step the ground's acceleration a0 + (a1 − a0) t / h is a straight line.
        parts_of_step = int(np.ceil(24 * ground.step / periods.min()))
        h = ground.step / parts_of_step
        A[:, size, size + 1] = 1.0 / h
        advance = scipy.linalg.expm(A * h)
        time_nodes = np.arange(round(DURATION / h) + 1) * h
        behind, before = ground.values(time_nodes), ground.before(time_nodes)
        largest = np.zeros((len(points), len(periods)))
        places = 2 * (n + np.arange(len(periods)))
        state = np.zeros((len(points), size + 2, 1))
        for a0, a1 in zip(behind[:-1], before[1:], strict=True):
            state[:, size] = a0
            state[:, size + 1] = a1 - a0
            state = advance @ state
            np.maximum(largest, np.abs(state[:, places, 0]), out=largest)
        return np.asarray(largest * (2 * np.pi / periods) ** 2)


def problem(kind: str, rng: np.random.Generator) -> Problem:
    """Return a random structure of a kind."""
    floors = int(rng.integers(1, 4))
    spring = 4e4 * (2 * np.pi / rng.uniform(0.2, 0.8)) ** 2 * (1 + floors) / 2
    springs = spring * rng.uniform(0.8, 1.2, floors)
    masses = np.diag(rng.uniform(3e4, 5e4, floors))
    ratio = float(rng.uniform(0.02, 0.06))
    zero = np.zeros((floors, floors))
    top = np.eye(floors)[-1]
    chain = chain_matrix(springs)
    of_first = chain_matrix(springs * np.eye(floors)[0])
    mass = [masses, zero, zero]
    stiffness = [zero, of_first, chain - of_first]
    damping = [zero] * 3
    keep = 3 if floors > 1 else 2
    if kind == "rayleigh":
        frequencies = np.sqrt(scipy.linalg.eigh(chain, masses, eigvals_only=True))
        a, b = ratio * frequencies[0], ratio / frequencies[-1]
        damping = [a * masses, b * of_first, b * (chain - of_first)]
    if kind == "dashpots":
        floor = int(rng.integers(floors))
        constant = 2 * ratio * np.sqrt(springs[floor] * masses[floor, floor])
        damping = [zero, 0.5 * ratio / np.sqrt(spring / 4e4) * chain, zero]
        damping[0] = constant * np.diag(np.eye(floors)[floor])
    if kind in ("rayleigh", "dashpots"):
        ratio = 0.0
    if kind != "building":
        arrays = (np.array(x[:keep]) for x in (mass, stiffness, damping))
        return Problem(kind, *arrays, ratio, np.ones(floors), top)
    # Displacements in x and y and turns times the radius of gyration, floor by floor.
    eccentricity = rng.choice([0.0, 0.01, 0.1])
    in_x = np.array([[1, 0, eccentricity], [0, 0, 0], [eccentricity, 0, rng.uniform(0.9, 1.5)]])
    in_y = np.array([[0, 0, 0], [0, 1, 0], [0, 0, 0.1]])
    none = np.zeros((3 * floors, 3 * floors))
    return Problem(
        kind,
        np.array([none, none, np.kron(np.eye(3), masses)]),
        np.array([np.kron(in_x, chain), np.kron(in_y, chain), none]),
        np.zeros((3, 3 * floors, 3 * floors)),
        ratio,
        np.kron([np.cos(0.6), np.sin(0.6), 0.0], np.ones(floors)),
        np.kron([1.0, 0.0, 0.8], top),
    )


def record(rng: np.random.Generator) -> Accelerogram:
    """Return five seconds of noise that rises and falls, in m/s²."""
    noise = rng.normal(size=250)
    smooth = np.convolve(noise, [0.25, 0.5, 0.25], "same")
    return Accelerogram(STEP, 3.0 * smooth * np.sin(np.pi * np.arange(250) / 250) ** 0.5)


def study(structures: int, samples: int, seed: int) -> Iterator[dict[str, Any]]:
    """Yield a row for each structure and period: how many samples lie outside, and the bound."""
    for number in range(structures):
        rng = np.random.default_rng([seed, number])
        asked = problem(KINDS[number % len(KINDS)], rng)
        ground = record(rng)
        squares = scipy.linalg.eigh(
            asked.stiffnesses.sum(axis=0), asked.masses.sum(axis=0), eigvals_only=True
        )
        periods = np.array(
            [rng.uniform(0.06, 0.12), 2 * np.pi / np.sqrt(squares[0]), rng.uniform(0.15, 1.5)]
        )
        damping = asked.ratio or 0.05
        radius = rng.uniform(0.02, 0.08, len(asked.masses))
        unit = rng.uniform(-1, 1, (samples, len(radius)))
        unit[::2] = np.sign(unit[::2])
        inputs = {x: Interval(1 - r, 1 + r) for x, r in zip(asked.names, radius, strict=True)}
        chunks = np.array_split(1 + radius * unit, max(samples // 250, 1))
        peaks = np.concatenate([asked.peaks(x, ground, periods, damping) for x in chunks])
        structure = asked.structure(ground)
        for p, what in enumerate(("stiff", "tuned", "random")):
            begun = time.perf_counter()
            found = floor_spectrum(
                structure,
                inputs,
                "a",
                periods[p],
                damping,
                duration=DURATION,
                step=0.01,
                alpha=[0.0],
                progress=False,
            )
            bound = float(found.bound[0, 0, 0])
            largest = float(peaks[:, p].max())
            yield {
                "structure": number,
                "kind": asked.kind,
                "unknowns": len(asked.pattern),
                "inputs": len(radius),
                "oscillator": what,
                "period": float(periods[p]),
                "nature": str(found.natures[0][0]),
                "outside": int((peaks[:, p] > bound).sum()),
                "attained over largest sample": float(found.attained[0, 0, 0]) / largest,
                "bound over largest sample": bound / largest,
                "seconds": time.perf_counter() - begun,
            }


def main(arguments: list[str] | None = None) -> None:
    """Print and write the study."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--structures", type=int, default=20)
    parser.add_argument("--samples", type=int, default=5000)
    parser.add_argument("--seed", type=int, default=None, help="random unless given")
    options = parser.parse_args(arguments)
    seed = secrets.randbits(32) if options.seed is None else options.seed
    print(f"seed {seed}")
    rows = []
    for row in study(options.structures, options.samples, seed):
        rows.append(row)
        print(*(f"{x:.4g}" if isinstance(x, float) else x for x in row.values()), flush=True)
    write(rows, RESULTS / "frame_floor_spectrum.csv")
    count = sum(row["nature"] == "guaranteed" for row in rows)
    print(f"{sum(row['outside'] for row in rows)} samples outside; {count} of {len(rows)} proved")
    for what in ("stiff", "tuned", "random"):
        ratios = [row["bound over largest sample"] for row in rows if row["oscillator"] == what]
        print(f"{what}: median {np.median(ratios):.4f}, largest {max(ratios):.4f}")
    ratios = [row["bound over largest sample"] for row in rows]
    print(f"bound over largest sample: median {np.median(ratios):.4f}")


if __name__ == "__main__":
    main()
