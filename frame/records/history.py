"""Histories of a load over time, and a record of the ground's acceleration."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import ClassVar, Self

import numpy as np

from alphacut.base.arrays import Array, Mask
from alphacut.base.errors import RefusedError, checked_number, require

# Distance of a time and a sample, as a fraction of the step of the samples, that is taken as
# rounding. Times k h of a million steps have rounding errors of some 1e-10 steps; a real distance
# of 1e-9 steps changes g by no more than 1e-9 of the difference of two samples.
SAME_TIME = 1e-9


@dataclass(frozen=True, eq=False)
class History:
    """f(t) = g(t) sin(Ω (t − start) + phase), or g(t) alone where Ω is 0.

    g is linear between its samples and zero outside them, so that it may jump where it begins or
    ends. At a jump f is the value after it.

    Args:
        step: Time between samples, in s; it need not go into the step of the nodes.
        samples: Samples of g from `start` on, at least two, shape (n,).
        start: Time of the first sample, in s.
        is_held: Whether the last sample stays on for ever.
        is_static: Whether f(0) has acted for ever: the structure starts at rest under it.
        frequency: Ω, in rad/s.
        phase: In rad.

    Raises:
        RefusedError: Step or samples are not as said, or the start lies before t = 0.

    Example:
        >>> wind = History(0.5, [1.0, 1.2, 0.7], is_held=True)
        >>> wind.values([0.25, 3.0]).tolist()
        [1.1, 0.7]
    """

    step: float
    samples: Array = field(repr=False)
    start: float = 0.0
    is_held: bool = False
    is_static: bool = False
    frequency: float = 0.0
    phase: float = 0.0
    key: ClassVar[str] = "history"

    def __post_init__(self) -> None:
        """Store `step` and `samples` as numbers, and check all fields.

        Raises:
            RefusedError: `samples` is not a sequence of two or more finite numbers; `step` is not a
                positive, finite number of seconds; `start` or `frequency` is not a finite number
                from 0 on; or `phase` is not a finite number.
        """
        allowed = "two or more finite samples, a positive step"
        try:
            samples = np.asarray(self.samples, float)
            step = float(self.step)
        except (TypeError, ValueError):
            what = f"{self.samples!r} every {self.step!r} s"
            raise RefusedError(self.key, what, allowed) from None
        is_series = samples.ndim == 1 and samples.size > 1 and bool(np.isfinite(samples).all())
        what = f"{samples.size} samples every {step:g} s"
        require(is_series and 0 < step < np.inf, self.key, value=what, allowed=allowed)
        checked_number("start", self.start, least=0)
        checked_number("frequency", self.frequency, least=0)
        checked_number("phase", self.phase)
        object.__setattr__(self, "step", step)
        object.__setattr__(self, "samples", samples)

    @classmethod
    def constant(cls, start: float = 0.0, *, is_static: bool = False) -> Self:
        """Return the history that is 1 from the time `start` on, in s."""
        return cls(1.0, np.ones(2), start, is_held=True, is_static=is_static)

    @classmethod
    def harmonic(cls, hertz: float, phase: float = 0.0, start: float = 0.0) -> Self:
        """Return the history sin(2π hertz (t - start) + phase) from the time `start` on.

        Before `start` it is 0.

        Args:
            hertz: Frequency in Hz, greater than 0.
            phase: Phase at `start`, in rad.
            start: Time at which it begins, in s, not below 0.

        Raises:
            RefusedError: An argument is not such a number.
        """
        checked_number("frequency", hertz, positive=True)
        omega = 2 * np.pi * float(hertz)
        # The sine is multiplied by samples, which are 1 here and are held for ever.
        return cls(1.0, np.ones(2), start, is_held=True, frequency=omega, phase=phase)

    @property
    def identity(self) -> tuple[object, ...]:
        """Hashable value that two histories have in common only if they are equal."""
        samples = self.samples.tobytes()
        course = self.step, samples, self.start, self.frequency, self.phase
        return (course, self.is_held, self.is_static)

    @property
    def extremes(self) -> tuple[float, float]:
        """Upper bounds of |f| over all times, and of |f′| at all times where f does not jump.

        The history is f(t) = g(t) sin(Ω (t - start) + phase), where g is linear between its
        samples, or f = g where Ω = 0. The first bound has the unit of the samples, the second one
        that unit over s. The samples give the largest |g| = G and the largest |g′| = S. Then |f| ≤
        G, and |f′| ≤ |g′| |sin| + |g| Ω |cos| ≤ S + G Ω.
        """
        magnitude = float(np.abs(self.samples).max())
        slope = float(np.abs(np.diff(self.samples)).max()) / self.step
        return magnitude, slope + self.frequency * magnitude

    def values(self, time: Array) -> Array:
        """Return f at times in s, in the same shape."""
        times = np.asarray(time, float)
        return self.envelope(times) * self.wave(times)

    def before(self, time: Array) -> Array:
        """Return f at times in s, in the same shape; where it jumps, its value before the jump."""
        return self.envelope(time, -1.0) * self.wave(time)

    def jumps_in_steps(self, time: Array) -> Mask:
        """Return whether the history f may jump in the step before each of rising times.

        The end of a step counts as part of it. f can jump where its samples begin, and, unless the
        last sample is held, where they end; both only if the sample there is not zero.

        Args:
            time: Times in s in rising order, shape (T,).

        Returns:
            Mask of shape (T,). Entry k is for jumps after time k - 1 and up to, and including, time
            k. The first entry is always False: a jump at or before the first time falls into no
            step.
        """
        # One entry more takes the jumps behind the last time; it is left out of the result.
        jumps = np.zeros(len(time) + 1, bool)
        ends = [(self.start, self.samples[0])]
        if not self.is_held:
            ends.append((self.start + (len(self.samples) - 1) * self.step, self.samples[-1]))
        for end, value in ends:
            if value:
                # A time next to a jump counts as at the jump, and has the value after it.
                jumps[np.searchsorted(time, end - SAME_TIME * self.step)] = True
        jumps[0] = False
        return jumps[:-1]

    def wave(self, time: Array) -> Array:
        """Return the sine by which g is multiplied, or ones without one, in the shape of `time`."""
        if not self.frequency:
            return np.ones_like(time)
        return np.asarray(np.sin(self.frequency * (time - self.start) + self.phase))

    def envelope(self, time: Array, side: float = 1.0) -> Array:
        """Return the factor g of the history f(t) = g(t) sin(Ω (t - start) + phase).

        g is linear between the samples. It is 0 before the first one, and 0 behind the last one,
        unless this one is held (`is_held`): then it stays for ever.

        Args:
            time: Times in s, in any order and shape.
            side: Where g jumps, at its first or its last sample: a positive number for the value
                after the jump, any other for the value before it.

        Returns:
            Values in the unit of the samples, in the shape of `time`.
        """
        n = len(self.samples)
        position = (time - self.start) / self.step  # in steps
        # A time that is a sample but for rounding is moved onto it, lest it fall before a jump.
        is_sample = np.abs(position - np.round(position)) < SAME_TIME
        position = np.where(is_sample, np.round(position), position)
        inside: Array = np.interp(position, np.arange(n), self.samples)
        after = np.greater_equal if side > 0 else np.greater
        has_started = after(position, 0)
        has_ended = after(position, n - 1) & (not self.is_held)
        return np.asarray(np.where(has_started & ~has_ended, inside, 0.0))


@dataclass(frozen=True, eq=False)
class Accelerogram(History):
    """Acceleration of the ground, samples in m/s², linear between them and zero outside them.

    Args:
        name: What a table or a message calls it; empty, or of `read_record` that of the file.
        remarks: Clauses on what is unusual in the file, or was taken for granted.
    """

    key: ClassVar[str] = "accelerogram"
    name: str = field(default="", kw_only=True)
    remarks: tuple[str, ...] = field(default=(), kw_only=True, repr=False)

    def require_times_of(self, other: Accelerogram) -> None:
        """Raise RefusedError unless another accelerogram has as many samples at the same times."""
        what = " and ".join(f"{len(x.samples)} every {x.step:g} s" for x in (self, other))
        is_as_long = len(self.samples) == len(other.samples)
        has_same_times = self.identity == replace(other, samples=self.samples).identity
        allowed = "the same times in all components"
        require(is_as_long and has_same_times, "samples of components", what, allowed)
