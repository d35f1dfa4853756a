"""A recording of the ground's acceleration as its file holds it, and the record made of it."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np

from alphacut.frame import Accelerogram
from alphacut.fuzzy.arrays import Array
from alphacut.fuzzy.refused import require
from alphacut.io.quantity import factor

Baseline = Literal["none", "mean", "linear"]
Trim = tuple[float, float] | Literal["arias"]
ARIAS_SHARES = 0.05, 0.95
"""Arias intensity before and after the significant duration (Trifunac, Brady 1975)."""
LARGEST_PEAK = 5.0
"""In g; the largest that instruments have recorded on the ground is about 4."""
USUAL_STEPS = 1e-4, 0.1
"""In s: instruments sample 50 to 1000 times a second, and simulations at least ten times."""
VERTICAL = re.compile(
    r"(?:.*\W)?(?:up|dn|down|ud|u-d|v|vert|vertical|z|[A-Z][HNLG]Z)(?:\W.*)?", re.I
)
"""Names of vertical channels: as a word, or SEED codes such as HNZ."""


@dataclass(frozen=True, eq=False)
class Recording:
    """Samples of one channel, in SI, before any processing.

    Args:
        file_format: Name of the format, such as "PEER AT2".
        unit: Unit as the file states it.
        step: Time between samples, in s.
        samples: Accelerations from the first sample on, shape (n,), in m/s².
        channel: The file's own name of the channel; empty if it has none.
        remarks: What reading left out or took for granted, one clause each.
    """

    file_format: str
    unit: str
    step: float
    samples: Array
    channel: str = ""
    remarks: tuple[str, ...] = ()

    @property
    def peak(self) -> float:
        """Largest magnitude, in m/s²."""
        return float(np.abs(self.samples).max())

    @property
    def offset_share(self) -> float:
        """Mean acceleration as a share of the peak; 0 of a recording of zeros."""
        return float(self.samples.mean()) / self.peak if self.peak > 0 else 0.0

    def doubts(self) -> Iterator[str]:
        """Yield clauses on what a user should look at: unusual values, a vertical channel."""
        yield from self.remarks
        peak_in_g = self.peak / float(factor("g", "m/s^2"))
        if peak_in_g > LARGEST_PEAK:
            yield f"its peak is {peak_in_g:.3g} g: check the unit {self.unit}"
        if not USUAL_STEPS[0] <= self.step <= USUAL_STEPS[1]:
            yield f"its step is {self.step:g} s: check it"
        if VERTICAL.fullmatch(self.channel):
            yield f"its channel {self.channel} is vertical"

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
