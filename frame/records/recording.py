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


@dataclass(frozen=True, eq=False)
class Recording:
    """Samples of one channel before any processing.

    Args:
        file_format: Name of the format of the file.
        unit: Unit of the samples in the file.
        step: Time between samples, in s.
        samples: The samples, in m/s², shape (n,).
        channel: The file's own name of the channel; empty if it has none.
        remarks: Clauses on what reading left out or took for granted.
        name: Name of its results: that of the file without ending, and of a channel asked for.
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
    def mean_to_peak_ratio(self) -> float:
        """Mean acceleration over the peak; 0 of a recording of zeros."""
        return float(self.samples.mean()) / max(self.peak, np.finfo(float).tiny)

    def doubts(self, *, is_vertical: bool = False) -> Iterator[str]:
        """Yield clauses on what a user should look at, as "its step is 0.2 s: check it".

        First come the remarks that reading the file has left. Then follow clauses on a peak above 5
        g, and on a channel whose name says that it is vertical. Nothing is yielded if all is as
        usual.

        Args:
            is_vertical: Whether it is used as the vertical component.
        """
        yield from self.remarks
        peak_in_g = self.peak / STANDARD_GRAVITY
        if peak_in_g > 5:  # the largest that instruments have recorded on the ground is about 4
            yield f"its peak is {peak_in_g:.3g} g: check the unit {self.unit}"
        # Vertical channels have one of these words, or a SEED code such as HNZ. The words must
        # stand alone: "v" is vertical in "090 V", and not in "HNV1".
        words = "up|dn|down|ud|u-d|v|vert|vertical|z|[A-Z][HNLG]Z"
        pattern = rf"(?:.*\W)?(?:{words})(?:\W.*)?"
        if not is_vertical and re.fullmatch(pattern, self.channel, re.IGNORECASE):
            yield f"its channel {self.channel} is vertical"

    def accelerogram(
        self, baseline: Baseline = "none", *, is_vertical: bool = False
    ) -> Accelerogram:
        """Return the accelerogram of these samples, in m/s², with their baseline subtracted.

        Args:
            baseline: What is subtracted: nothing ("none"), the "mean" of the samples, or their
                straight line of least squares ("linear").
            is_vertical: Whether it is used as the vertical component.

        Returns:
            An accelerogram with the same step and name. Its remarks are the clauses on what is
            unusual in the recording before the correction, as "its step is 0.2 s: check it". The
            recording is not changed.
        """
        samples = self.samples
        if baseline != "none":
            samples = samples - samples.mean()
        if baseline == "linear":
            # With times of mean 0 the slope is Σ t a / Σ t², and the line passes through the mean.
            # The maximum keeps a single sample from a division by zero.
            time = np.arange(len(samples)) - (len(samples) - 1) / 2  # in steps
            samples = samples - time * (time @ samples) / max(float(time @ time), 1.0)
        remarks = tuple(self.doubts(is_vertical=is_vertical))
        return Accelerogram(self.step, samples, name=self.name, remarks=remarks)


def arias_fractions(samples: Array, step: float) -> Array:
    """Return the Arias intensity up to each sample over that of the whole record, shape (n,).

    The Arias intensity is proportional to ∫ a² dt. For a piecewise linear acceleration the integral
    over a step h from a to b is exactly h (a² + a b + b²) / 3. The fractions rise from 0 at the
    first sample to 1 at the last one. If all samples are zeros, or there is one sample or none,
    there is no intensity: then n zeros, at least one, are returned.

    Args:
        samples: Accelerations at even times, in any unit, shape (n,).
        step: Time between samples, in any unit, above 0.
    """
    left = samples[:-1]
    right = samples[1:]
    squares = left**2 + left * right + right**2
    intensity = np.append(0.0, np.cumsum(squares)) * step / 3
    return np.asarray(intensity / intensity[-1] if intensity[-1] > 0 else intensity)
