"""Resolution of the fastest oscillation by a step."""

from __future__ import annotations

from dataclasses import dataclass
from math import atan, pi

from alphacut.frame.calculus.numbers import below
from alphacut.frame.dynamics.flow import nodes
from alphacut.frame.structures.linear import LinearSystem, frequencies

LIMIT = 0.5
"""Largest ω_max h that passes without a warning."""


@dataclass(frozen=True, repr=False)
class StepGuard:
    """Resolution of the fastest mode by a midpoint step.

    Args:
        frequency: Largest undamped angular frequency, in rad/s.
        step: Step, in s.
        duration: Length of the simulation, in s.
    """

    frequency: float
    step: float
    duration: float

    @property
    def resolution(self) -> float:
        """ω_max h; π would be two steps per cycle."""
        return self.frequency * self.step

    @property
    def ok(self) -> bool:
        """True if the step resolves the fastest mode."""
        return self.resolution <= LIMIT

    @property
    def phase_error(self) -> float:
        """Phase lag of the fastest mode at the end, in rad, by 2 atan(ωh/2) for ωh."""
        return (self.resolution - 2 * atan(self.resolution / 2)) * self.duration / self.step

    @property
    def message(self) -> str:
        """One sentence, for a warning or an error where the step is too long."""
        found = (
            f"step: {self.step:g} s gives omega_max h = {self.resolution:.3g} with omega_max ="
            f" {self.frequency:.4g} rad/s; "
        )
        lag = (
            f"lags by {self.phase_error:.3g} rad ({self.phase_error / (2 * pi):.3g} cycles) after"
            f" {self.duration:g} s"
        )
        if self.ok:
            return (
                f"{found}not above {LIMIT:g}, so that the step is short enough: by the midpoint"
                f" rule the fastest mode {lag}"
            )
        most = below(LIMIT / self.frequency)
        cure = f"take a step of at most {most} s, or check the units of masses and stiffness"
        return f"{found}above {LIMIT:g} the fastest mode {lag}; {cure}"

    def __repr__(self) -> str:
        return self.message


def guard(system: LinearSystem, step: float, duration: float) -> StepGuard:
    """The guard of a structure at its modal parameters.

    Args:
        system: A linear structure.
        step: Step, in s.
        duration: Length of the simulation, in s.

    Raises:
        ValueError: The system is not linear, or the step or the duration is not positive.
    """
    if not hasattr(system, "matrices"):
        what = f"a {type(system).__name__} has no fixed frequencies"
        raise ValueError(
            f"guard: {what}; take a linear structure, or read the fact step_error of envelope()"
        )
    nodes(duration, step)
    return StepGuard(float(frequencies(system)[-1]), step, duration)
