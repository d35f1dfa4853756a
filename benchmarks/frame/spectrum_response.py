"""Do bounds by the response-spectrum method hold, and how far are they from the largest sample?

Random structures under random spectra, half of them with modes that meet or come near one another:
chains of masses; buildings of one to three floors that move in two directions and turn, with nearly
equal stiffnesses in both directions and small or no eccentricities; two equal chains with a weak
link. Two to four inputs are uncertain by 2 to 10 %. The combined peaks of random samples are
computed independently, by `scipy.linalg.eigh` and the formulas of Der Kiureghian (1981).

Run `python -m benchmarks.frame.spectrum_response --help`.
"""

from __future__ import annotations

import argparse
import secrets
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import scipy.linalg

from alphacut.base.arrays import Array
from alphacut.frame import (
    MatrixStructure,
    TargetSpectrum,
    asce7_two_period,
    eurocode8_spectrum,
    spectrum_response,
)
from alphacut.fuzzy import Interval
from benchmarks.rows import write

RESULTS = Path(__file__).parents[1] / "results"
KINDS = ("chain", "building", "twins")


@dataclass(frozen=True, eq=False)
class Problem:
    """A structure M = Σ p_i M_i, K = Σ p_i K_i with the inputs p, and what is asked of it."""

    kind: str
    nominal: Array  # p, (inputs,)
    masses: Array  # M_i, (inputs, n, n)
    stiffnesses: Array  # K_i, (inputs, n, n)
    pattern: Array  # displacements by a unit displacement of the ground, (n,)
    outputs: Array  # rows on displacements, (m, n)

    @property
    def structure(self) -> MatrixStructure:
        """The structure as the program takes it."""
        names = [f"p{i}" for i in range(len(self.nominal))]
        return MatrixStructure(
            dict(zip(names, self.nominal.tolist(), strict=True)),
            mass=[(x, y) for x, y in zip(names, self.masses, strict=True) if y.any()],
            stiffness=[(x, y) for x, y in zip(names, self.stiffnesses, strict=True) if y.any()],
            observed={f"output{i}": row for i, row in enumerate(self.outputs)},
            pattern=self.pattern,
            ratios=[0.05],
        )

    def combined(self, inputs: Array, spectrum: TargetSpectrum, rule: str) -> Array:
        """Return the combined peaks of the outputs at inputs p."""
        K = np.tensordot(inputs, self.stiffnesses, 1)
        M = np.tensordot(inputs, self.masses, 1)
        squares, shapes = scipy.linalg.eigh(K, M)
        omega = np.sqrt(squares)
        displacements = (shapes.T @ M @ self.pattern) * spectrum(2 * np.pi / omega) / squares
        peaks = (self.outputs @ shapes) * displacements  # (m, modes)
        rho: Array = np.eye(len(omega))
        if rule == "CQC":
            r = omega / omega[:, np.newaxis]
            z = spectrum.damping
            rho = 8 * z**2 * (1 + r) * r**1.5
            rho = rho / ((1 - r**2) ** 2 + 4 * z**2 * r * (1 + r) ** 2)
        return np.asarray(np.sqrt(np.einsum("mi,ij,mj->m", peaks, rho, peaks)))


def chain_matrix(springs: Array) -> Array:
    """Return the stiffness matrix of a chain that the first spring ties to the ground."""
    after = np.append(springs[1:], 0.0)
    return np.diag(springs + after) - np.diag(after[:-1], 1) - np.diag(after[:-1], -1)


def problem(kind: str, rng: np.random.Generator) -> Problem:
    """Return a random structure of a kind."""
    floors = int(rng.integers(1, 4))
    period = rng.uniform(0.2, 0.8)
    spring = 4e4 * (2 * np.pi / period) ** 2 * (1 + floors) / 2
    springs = spring * rng.uniform(0.8, 1.2, floors)
    masses = rng.uniform(3e4, 5e4, floors)
    unit, zero = np.eye(floors), np.zeros((floors, floors))
    top, first = unit[-1], unit[0]
    if kind == "chain":
        # inputs: the mass of all floors, the stiffness of the first storey, and of the others
        of_first = chain_matrix(springs * first)
        parts = [zero, of_first, chain_matrix(springs) - of_first]
        mass = [np.diag(masses), zero, zero]
        keep = 3 if floors > 1 else 2
        rows = np.array([top, springs[0] * first])
        return Problem(
            kind,
            np.ones(keep),
            np.array(mass[:keep]),
            np.array(parts[:keep]),
            np.ones(floors),
            rows,
        )
    if kind == "twins":
        # two equal chains, of which one is uncertain, linked weakly at the top
        link = np.outer([1.0, -1.0], [1.0, -1.0])
        weak = rng.choice([0.0, 1e-4, 1e-2]) * spring
        chain = chain_matrix(springs)
        parts = [
            np.kron([[1, 0], [0, 0]], chain),
            np.kron([[0, 0], [0, 1]], chain) + weak * np.kron(link, np.outer(top, top)),
            np.zeros((2 * floors, 2 * floors)),
        ]
        mass = [0 * parts[0], 0 * parts[0], np.kron(np.eye(2), np.diag(masses))]
        both = np.kron([1.0, 1.0], top)
        rows = np.array([both, np.kron([1.0, 0.0], springs[0] * first)])
        return Problem(kind, np.ones(3), np.array(mass), np.array(parts), np.ones(2 * floors), rows)
    # A building: displacements in x and y and turns times the radius of gyration, floor by floor.
    eccentricity = rng.choice([0.0, 0.01, 0.1])
    turning = rng.uniform(0.9, 1.5)
    chain = chain_matrix(springs)
    in_x = np.array([[1, 0, eccentricity], [0, 0, 0], [eccentricity, 0, turning]])
    in_y = np.array([[0, 0, 0], [0, 1, 0], [0, 0, 0.1]])
    parts = [np.kron(in_x, chain), np.kron(in_y, chain), np.zeros((3 * floors, 3 * floors))]
    mass = [0 * parts[0], 0 * parts[0], np.kron(np.eye(3), np.diag(masses))]
    angle = rng.choice([0.0, np.pi / 4])
    pattern = np.kron([np.cos(angle), np.sin(angle), 0.0], np.ones(floors))
    corner = np.kron([1.0, 0.0, 0.8], top)
    rows = np.array([corner, np.kron([1.0, 0.0, eccentricity], springs[0] * first)])
    return Problem(kind, np.ones(3), np.array(mass), np.array(parts), pattern, rows)


def study(
    structures: int, samples: int, seed: int, kinds: Sequence[str] = KINDS
) -> Iterator[dict[str, Any]]:
    """Yield a row for each structure and rule: how many samples lie outside, and the bounds."""
    for number in range(structures):
        rng = np.random.default_rng([seed, number])
        asked = problem(kinds[number % len(kinds)], rng)
        of_code = [eurocode8_spectrum(2.0, "B"), asce7_two_period(9.0, 4.0, 6.0)]
        spectrum = [*of_code, eurocode8_spectrum(2.0, "C", q=3.0)][int(rng.integers(3))]
        radius = rng.uniform(0.02, 0.1, len(asked.nominal))
        points = rng.uniform(1 - radius, 1 + radius, (samples, len(radius)))
        inputs = {f"p{i}": Interval(1 - x, 1 + x) for i, x in enumerate(radius.tolist())}
        for rule in ("SRSS", "CQC"):
            begun = time.perf_counter()
            found = spectrum_response(
                asked.structure, inputs, spectrum, combination=rule, alpha=[0.0]
            )
            seconds = time.perf_counter() - begun
            peaks = np.array([asked.combined(point, spectrum, rule) for point in points])
            low, high = found.proved[0].T
            yield {
                "structure": number,
                "kind": asked.kind,
                "rule": rule,
                "unknowns": len(asked.pattern),
                "inputs": len(radius),
                "outside": int(((peaks < low) | (peaks > high)).sum()),
                "upper bound over largest sample": float((high / peaks.max(axis=0)).max()),
                "lower bound over smallest sample": float((low / peaks.min(axis=0)).min()),
                "seconds": seconds,
            }


def main(arguments: list[str] | None = None) -> None:
    """Print and write the study."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--structures", type=int, default=30)
    parser.add_argument("--kinds", nargs="+", choices=KINDS, default=KINDS)
    parser.add_argument("--samples", type=int, default=5000)
    parser.add_argument("--seed", type=int, default=None, help="random unless given")
    options = parser.parse_args(arguments)
    seed = secrets.randbits(32) if options.seed is None else options.seed
    print(f"seed {seed}")
    rows = []
    for row in study(options.structures, options.samples, seed, options.kinds):
        rows.append(row)
        print(*(f"{x:.4g}" if isinstance(x, float) else x for x in row.values()), flush=True)
    if options.kinds == KINDS:
        write(rows, RESULTS / "frame_spectrum_response.csv")
    print(f"{sum(row['outside'] for row in rows)} samples outside")
    for kind in options.kinds:
        for rule in ("SRSS", "CQC"):
            own = [row for row in rows if (row["kind"], row["rule"]) == (kind, rule)]
            ratios = [row["upper bound over largest sample"] for row in own]
            print(f"{kind}, {rule}: median {np.median(ratios):.4f}, largest {max(ratios):.4f}")
    ratios = [row["upper bound over largest sample"] for row in rows]
    print(f"upper bound over largest sample: median {np.median(ratios):.4f}")


if __name__ == "__main__":
    main()
