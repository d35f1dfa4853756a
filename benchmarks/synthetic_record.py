"""Synthetic earthquake record: noise in the spectrum of Kanai and Tajimi.

    python -m benchmarks.synthetic_record > cases/building.record.csv
    python -m benchmarks.synthetic_record --suite cases/suite
    python -m benchmarks.synthetic_record --suite FOLDER 44 12    (records, and their length in s)
    python -m benchmarks.synthetic_record --gust > cases/wind.force.csv

The spectrum is that of Kanai and Tajimi with the high-pass of Clough and Penzien (Dynamics of
Structures, 1975), the amplitude rises, stays and fades like a moderate earthquake. The seed is
fixed, so that the file can be made again.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from alphacut.base.arrays import Array


@dataclass(frozen=True)
class SyntheticRecord:
    """Filtered noise under a window.

    Args:
        peak: Largest acceleration, in m/s².
        duration: Length, in s.
        step: Time step, in s.
        ground: Angular frequency of the ground filter, in rad/s.
        damping: Damping ratio of the ground filter.
        corner: Angular frequency of the high-pass, in rad/s.
        seed: Of the phases.
    """

    peak: float = 2.5
    duration: float = 20.0
    step: float = 0.01
    ground: float = 15.0
    damping: float = 0.6
    corner: float = 1.5
    seed: int = 1975

    @property
    def time(self) -> Array:
        """Nodes, in s, from 0."""
        return np.arange(round(self.duration / self.step) + 1) * self.step

    def spectrum(self, omega: Array) -> Array:
        """Power spectral density up to a factor, at angular frequencies `omega` in rad/s."""
        x, y = (omega / self.ground) ** 2, (omega / self.corner) ** 2
        kanai_tajimi = (1 + 4 * self.damping**2 * x) / ((1 - x) ** 2 + 4 * self.damping**2 * x)
        return np.asarray(kanai_tajimi * y**2 / ((1 - y) ** 2 + 4 * self.damping**2 * y))

    def window(self) -> Array:
        """Rise as t² over 3 s, stay until 10 s, fade exponentially; zero at the start."""
        t = self.time
        return np.asarray(
            np.where(t < 3, (t / 3) ** 2, np.where(t < 10, 1.0, np.exp(-0.4 * (t - 10))))
        )

    def acceleration(self) -> Array:
        """Samples at `time`, in m/s²."""
        frequencies = np.arange(0.1, 25.0, 0.05)  # Hz
        omega = 2 * np.pi * frequencies
        phases = np.random.default_rng(self.seed).uniform(0, 2 * np.pi, len(omega))
        noise = np.sqrt(self.spectrum(omega)) @ np.cos(np.outer(omega, self.time) + phases[:, None])
        shaped = noise * self.window()
        return np.asarray(self.peak * shaped / np.abs(shaped).max())


def text(record: SyntheticRecord) -> str:
    """The record as CSV, with a line that says what it is."""
    rows = "".join(
        f"{t:.2f},{a:.5f}\n" for t, a in zip(record.time, record.acceleration(), strict=True)
    )
    return (
        f"# synthetic: made by python -m benchmarks.synthetic_record, seed {record.seed}\ntime"
        f" [s],acceleration [m/s^2]\n{rows}"
    )


FIRST_SEED = 2001
"""Seed of the first record of a suite; the others follow."""


def at2_text(record: SyntheticRecord) -> str:
    """The record as a file of type AT2, in g."""
    samples = record.acceleration() / 9.80665
    rows = (samples[k : k + 5] for k in range(0, len(samples), 5))
    numbers = "".join("".join(f"{x:15.7E}" for x in row) + "\n" for row in rows)
    return (
        "SYNTHETIC RECORD, NO MEASURED EARTHQUAKE\n"
        f"made by python -m benchmarks.synthetic_record --suite, seed {record.seed}\n"
        "ACCELERATION TIME SERIES IN UNITS OF G\n"
        f"NPTS= {len(samples):6d}, DT= {record.step:7.4f} SEC\n{numbers}"
    )


def write_suite(folder: Path, count: int = 11, duration: float = 10.0) -> None:
    """Records whose peaks and grounds differ."""
    folder.mkdir(parents=True, exist_ok=True)
    for seed in range(FIRST_SEED, FIRST_SEED + count):
        rng = np.random.default_rng(seed)
        record = SyntheticRecord(
            peak=2.0 * rng.lognormal(0, 0.3),
            duration=duration,
            step=0.02,
            ground=15 * rng.lognormal(0, 0.2),
            seed=seed,
        )
        (folder / f"record-{seed}.AT2").write_text(at2_text(record), encoding="utf-8")


def gust_text(
    seed: int = 1961, step: float = 0.25, count: int = 121, intensity: float = 0.18
) -> str:
    """Wind force over its mean as CSV, of turbulence in the spectrum of Davenport (1961)."""
    frequencies = np.arange(1, 61) / 30  # Hz
    x = 1200 * frequencies / 25  # of a mean wind of 25 m/s at 10 m
    power = x**2 / (frequencies * (1 + x**2) ** (4 / 3))
    phases = np.random.default_rng(seed).uniform(0, 2 * np.pi, len(x))
    time = np.arange(count) * step
    turning = np.cos(np.outer(time, 2 * np.pi * frequencies) + phases)
    turbulence = turning @ np.sqrt(power)
    speed = 1 + intensity * turbulence / turbulence.std()
    rows = "".join(f"{t:.2f},{f:.4f}\n" for t, f in zip(time, speed**2, strict=True))
    head = f"# synthetic: made by python -m benchmarks.synthetic_record --gust, seed {seed}\n"
    return f"{head}time [s],force\n{rows}"


if __name__ == "__main__":
    if sys.argv[1:2] == ["--gust"]:
        sys.stdout.write(gust_text())
    elif sys.argv[1:2] == ["--suite"]:
        numbers = zip((int, float), sys.argv[3:], strict=False)
        write_suite(Path(sys.argv[2]), *(read(word) for read, word in numbers))
    else:
        sys.stdout.write(text(SyntheticRecord()))
