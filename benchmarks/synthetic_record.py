"""Synthetic earthquake record: noise in the spectrum of Kanai and Tajimi.

    python -m benchmarks.synthetic_record > cases/building.record.csv

The spectrum is that of Kanai and Tajimi with the high-pass of Clough and Penzien (Dynamics of
Structures, 1975), the amplitude rises, stays and fades like a moderate earthquake. The seed is
fixed, so that the file can be made again.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass

import numpy as np

from alphacut.fuzzy.arrays import Array


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


if __name__ == "__main__":
    sys.stdout.write(text(SyntheticRecord()))
