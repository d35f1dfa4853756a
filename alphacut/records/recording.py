"""A recording of the ground's acceleration as its file holds it, and the record made of it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from alphacut.frame import Accelerogram
from alphacut.fuzzy.arrays import Array
from alphacut.fuzzy.refused import require

Baseline = Literal["none", "mean", "linear"]
Trim = tuple[float, float] | Literal["arias"]
ARIAS_SHARES = 0.05, 0.95
"""Arias intensity before and after the significant duration (Trifunac, Brady 1975)."""


@dataclass(frozen=True, eq=False)
class Recording:
    """Samples of one channel, in SI, before any processing.

    Args:
        file_format: Name of the format, such as "PEER AT2".
        unit: Unit as the file states it.
        step: Time between samples, in s.
        samples: Accelerations from the first sample on, shape (n,), in m/s².
    """

    file_format: str
    unit: str
    step: float
    samples: Array

    @property
    def peak(self) -> float:
        """Largest magnitude, in m/s²."""
        return float(np.abs(self.samples).max())

    @property
    def offset_share(self) -> float:
        """Mean acceleration as a share of the peak; 0 of a recording of zeros."""
        return float(self.samples.mean()) / self.peak if self.peak > 0 else 0.0

    def accelerogram(
        self, *, baseline: Baseline = "none", trim: Trim | None = None, scale: float = 1.0
    ) -> Accelerogram:
        """Record of these samples: corrected, then trimmed, then scaled.

        Args:
            baseline: Subtracts nothing, the mean, or the straight line of least squares.
            trim: First and last time to keep, in s, or "arias" for 5 to 95 % of the Arias
                intensity; the record then begins at time 0.
            scale: Factor of all samples.

        Raises:
            RefusedError: `trim` leaves fewer than two samples.
        """
        samples = _trim(_subtract_baseline(self.samples, baseline), self.step, trim)
        return Accelerogram(self.step, scale * samples)


def arias_shares(samples: Array, step: float) -> Array:
    """Arias intensity up to each sample over that of the whole record, shape (n,).

    The integral of the squared piecewise linear acceleration is exact; of zeros it is zeros.
    """
    left, right = samples[:-1], samples[1:]
    intensity = np.append(0.0, np.cumsum(left**2 + left * right + right**2)) * step / 3
    return np.asarray(intensity / intensity[-1] if intensity[-1] > 0 else intensity)


def _subtract_baseline(samples: Array, baseline: Baseline) -> Array:
    if baseline == "mean":
        return np.asarray(samples - samples.mean())
    if baseline == "linear":
        time = np.linspace(-1.0, 1.0, len(samples))
        return np.asarray(samples - np.polyval(np.polyfit(time, samples, 1), time))
    return samples


def _trim(samples: Array, step: float, trim: Trim | None) -> Array:
    """The samples between two times in s, or, of "arias", those of the significant duration."""
    if trim is None:
        return samples
    if trim == "arias":
        first, last = np.searchsorted(arias_shares(samples, step), ARIAS_SHARES)
    else:  # a time that is a sample's but for rounding keeps that sample
        first, last = np.ceil(trim[0] / step - 1e-6), np.floor(trim[1] / step + 1e-6)
    kept_samples = samples[max(int(first), 0) : int(last) + 1]
    value = trim if isinstance(trim, str) else f"{trim[0]:g} … {trim[1]:g} s"
    allowed = f"times within 0 … {(len(samples) - 1) * step:g} s with two samples between them"
    require(len(kept_samples) > 1, "trim", value=value, allowed=allowed)
    return kept_samples
