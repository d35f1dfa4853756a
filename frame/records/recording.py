"""A recording of the ground's acceleration as its file holds it, and its correction."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np

from alphacut.base.arrays import Array
from alphacut.base.number_text import STANDARD_GRAVITY
from alphacut.frame.records.history import Accelerogram

Baseline = Literal["none", "mean", "linear"]
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
    """Samples of one channel, shape (n,), in m/s², before any processing; their step is in s.

    `unit` is the file's, `channel` its own name of the channel or empty. `remarks` are clauses on
    what reading left out or took for granted. `name` is that of its results: of the file without
    ending, and of a channel asked for.
    """

    file_format: str
    unit: str
    step: float
    samples: Array
    channel: str = ""
    remarks: tuple[str, ...] = ()
    name: str = ""

    @property
    def peak(self) -> float:
        """Largest magnitude, in m/s²."""
        return float(np.abs(self.samples).max())

    @property
    def offset_share(self) -> float:
        """Mean acceleration over the peak; 0 of a recording of zeros."""
        return float(self.samples.mean()) / self.peak if self.peak > 0 else 0.0

    def doubts(self) -> Iterator[str]:
        """Yield clauses on what a user should look at: unusual values, a vertical channel."""
        yield from self.remarks
        peak_in_g = self.peak / STANDARD_GRAVITY
        if peak_in_g > LARGEST_PEAK:
            yield f"its peak is {peak_in_g:.3g} g: check the unit {self.unit}"
        if not USUAL_STEPS[0] <= self.step <= USUAL_STEPS[1]:
            yield f"its step is {self.step:g} s: check it"
        if VERTICAL.fullmatch(self.channel):
            yield f"its channel {self.channel} is vertical"

    def accelerogram(self, baseline: Baseline = "none") -> Accelerogram:
        """Record of these samples, without their mean or their straight line of least squares."""
        samples = self.samples
        if baseline != "none":
            samples = samples - samples.mean()
        if baseline == "linear":
            time = np.arange(len(samples)) - (len(samples) - 1) / 2  # in steps, of mean 0
            samples = samples - time * (time @ samples) / max(float(time @ time), 1.0)
        return Accelerogram(self.step, samples, name=self.name, remarks=tuple(self.doubts()))


def arias_fractions(samples: Array, step: float) -> Array:
    """Arias intensity up to each sample over that of the whole record, shape (n,).

    The integral of the squared piecewise linear acceleration is exact; of zeros it is zeros.
    """
    left, right = samples[:-1], samples[1:]
    intensity = np.append(0.0, np.cumsum(left**2 + left * right + right**2)) * step / 3
    return np.asarray(intensity / intensity[-1] if intensity[-1] > 0 else intensity)
