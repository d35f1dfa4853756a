"""Histories of a load over time, and a record of the ground's acceleration."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar, Self

import numpy as np

from alphacut.base.arrays import Array, Mask
from alphacut.base.errors import RefusedError, checked_number, require

SAME_TIME = 1e-9
"""Distance of a time and a sample, as a fraction of the step of samples, that is rounding alone."""


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
        """Store step and samples as numbers; refuse values that are not allowed."""
        allowed = "two or more finite samples, a positive step"
        try:
            samples, step = np.asarray(self.samples, float), float(self.step)
        except (TypeError, ValueError):
            what = f"{self.samples!r} every {self.step!r} s"
            raise RefusedError(self.key, what, allowed) from None
        is_series = samples.ndim == 1 and samples.size > 1 and bool(np.isfinite(samples).all())
        what = f"{samples.size} samples every {step:g} s"
        require(is_series and 0 < step < np.inf, self.key, value=what, allowed=allowed)
        for name in ("start", "frequency"):
            checked_number(name, getattr(self, name), least=0)
        checked_number("phase", self.phase)
        object.__setattr__(self, "step", step)
        object.__setattr__(self, "samples", samples)

    @classmethod
    def constant(cls, start: float = 0.0, *, is_static: bool = False) -> Self:
        """1 from a time on."""
        return cls(1.0, np.ones(2), start, is_held=True, is_static=is_static)

    @classmethod
    def harmonic(cls, hertz: float, phase: float = 0.0, start: float = 0.0) -> Self:
        """A sine of unit amplitude from the time `start` on, where it has the phase, in rad."""
        checked_number("frequency", hertz, positive=True)
        omega = 2 * np.pi * float(hertz)
        return cls(1.0, np.ones(2), start, is_held=True, frequency=omega, phase=phase)

    @property
    def identity(self) -> tuple[object, ...]:
        """What tells it from other histories."""
        flags = self.is_held, self.is_static
        return (self.step, self.samples.tobytes(), self.start, self.frequency, self.phase, *flags)

    @property
    def extremes(self) -> tuple[float, float]:
        """Bounds of ``|f|`` and of ``|f′|`` between jumps."""
        size, rise = (float(np.abs(x).max()) for x in (self.samples, np.diff(self.samples)))
        return size, rise / self.step + self.frequency * size

    def values(self, time: Array) -> Array:
        """Values of f at times, the same shape."""
        times = np.asarray(time, float)
        return self.envelope(times) * self.wave(times)

    def largest_in_steps(self, time: Array) -> Array:
        """Bound of ``|f|`` within the step to each of rising times, shape (T,); 0 at the first."""
        # |g| is largest at an end of the step or at a sample in it, and |sin| at most 1
        samples = self.start + np.arange(len(self.samples)) * self.step
        inside = samples[(samples > time[0]) & (samples < time[-1])]
        times = np.union1d(time, inside)
        size = np.maximum(np.abs(self.envelope(times)[:-1]), np.abs(self.envelope(times, -1.0)[1:]))
        largest = np.zeros(len(time))
        largest[1:] = np.maximum.reduceat(size, np.searchsorted(times, time[:-1]))
        return largest

    def before(self, time: Array) -> Array:
        """Values of f at times, before what jumps there, the same shape."""
        return self.envelope(time, -1.0) * self.wave(time)

    def jumps_at(self, time: Array) -> Mask:
        """Whether f jumps at each of the times, (T,)."""
        return np.asarray(self.envelope(time, -1.0) != self.envelope(time))

    def jumps_in_steps(self, time: Array) -> Mask:
        """Whether f may jump within the step to each of the rising times, or at its end, (T,)."""
        ends = [(self.start, self.samples[0])]
        if not self.is_held:
            ends.append((self.start + (len(self.samples) - 1) * self.step, self.samples[-1]))
        jumps = np.zeros(len(time) + 1, bool)
        # a node next to a jump has the value after it
        jumps[
            [np.searchsorted(time, at - SAME_TIME * self.step) for at, value in ends if value]
        ] = True
        jumps[0] = False
        return jumps[:-1]

    def wave(self, time: Array) -> Array:
        """The sine that g is multiplied by; ones where there is none."""
        if not self.frequency:
            return np.ones_like(time)
        return np.asarray(np.sin(self.frequency * (time - self.start) + self.phase))

    def envelope(self, time: Array, side: float = 1.0) -> Array:
        """Values of g at times, same shape: after jumps (`side` 1) or before them (−1)."""
        n, position = len(self.samples), (time - self.start) / self.step
        is_sample = np.abs(position - np.round(position)) < SAME_TIME
        position = np.where(is_sample, np.round(position), position)
        inside: Array = np.interp(position, np.arange(n), self.samples)
        after = np.greater_equal if side > 0 else np.greater
        has_started, has_ended = after(position, 0), after(position, n - 1) & (not self.is_held)
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
