"""Sections on the response of a structure: envelopes, studies, limits, measured modes."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Literal

from pydantic import Field, ValidationInfo

from alphacut.base.errors import RefusedError, require
from alphacut.case.types import (
    ALPHA,
    CaseFile,
    Fraction,
    Levels,
    Names,
    Quantity,
    Section,
    Time,
    after,
    text,
)
from alphacut.frame import METHODS
from alphacut.io import quantity

if TYPE_CHECKING:
    MethodName = str
else:
    MethodName = Literal[tuple(METHODS)]


@dataclass(frozen=True)
class Tolerance:
    """Error of an envelope that is allowed: in SI, or without a unit a fraction of each peak."""

    value: float
    unit: str = "m"


def _parse_tolerance(value: object, info: ValidationInfo) -> Tolerance:
    """Return the allowed error that "0.2 mm", "0.05 N" or "0.1 %" states.

    A length or a force is an absolute error in m or N; a number without a unit is a fraction of
    each peak.

    Raises:
        RefusedError: The value is another quantity, is fuzzy or not positive, or is a fraction of 1
            or more.
    """
    allowed = 'a length, a force or a fraction of each peak, as "0.2 mm", "0.05 N", "0.1 %"'
    try:
        tolerance, unit = quantity.parse_fuzzy_in_any_unit(value, ("m", "N", ""))
    except ValueError as error:
        raise RefusedError("", value, allowed, str(error)) from None
    # A tolerance of the whole peak or more would let every bound pass.
    lower, upper = tolerance.support
    require(lower == upper > 0 and (unit != "" or upper < 1), "", value, allowed)
    return Tolerance(upper, unit)


def _file_name(value: str) -> str:
    # The name becomes part of a file's name: with a slash or ".." it could leave the folder of the
    # results, and other signs are not allowed on every file system.
    match = re.fullmatch(r"(?!.*\.\.)[A-Za-z0-9_+-][A-Za-z0-9_.+-]{0,63}", value)
    require(bool(match), "", value, "up to 64 letters, digits and . _ + -, as a file's name")
    return value


class Study(Section):
    """One envelope that `alphacut run` computes; what it leaves out is as in [envelope].

    Args:
        name: name of envelope_NAME.nc.
        fuzzy: inputs that are fuzzy.
        duration: length of the simulation.
        figures: outputs that are drawn, each with its number in the paper.
    """

    name: Annotated[str, after(_file_name)]
    fuzzy: Names
    duration: Time
    figures: dict[str, str] = Field({})


class EnvelopeSection(Section):
    """Fuzzy forward dynamics.

    Args:
        fuzzy: inputs that are fuzzy; of a frame E, I, m or m1 …, l, c (columns), k (stiffness), d,
            q0, v0, zeta (damping_ratio), rayleigh_mass, rayleigh_stiffness.
        alpha: α-levels.
        method: method of the envelope.
        integrator: time stepping; by the method if left out.
        tolerance: error that is allowed: of displacements, of forces, or over each peak.
        gain: gain worth a trajectory to a Graph Follower, as a fraction of the tolerance.
        duration: length of the simulation.
        step: time step.
    """

    fuzzy: Names
    alpha: Levels = ALPHA
    method: MethodName = "auto"
    integrator: Literal["midpoint", "exact"] | None = None
    tolerance: Annotated[Tolerance, text(_parse_tolerance)] | None = None
    gain: Annotated[float, Quantity(minimum=1e-6, maximum=1)] = 0.25
    duration: Time
    step: Time

    def require_steps(self, key: str, duration: float) -> None:
        """Refuse a duration that is no whole number of time steps, or of too many.

        Args:
            key: Key of the duration, such as "envelope.duration". "KEY of NAME" means the duration
                of a record, which the case cannot change.
            duration: Length of the simulation in s.

        Raises:
            RefusedError: The duration is shorter than one step, is no multiple of it to 1e-9, or
                has more than a million steps. The message has a step that fits.
        """
        # Envelopes of all outputs on all levels are kept at each step: more do not fit into memory.
        max_steps = 1_000_000
        steps = duration / self.step
        # 0.3 s in steps of 0.1 s are 2.9999999999999996 steps: rounding alone is forgiven.
        is_multiple = round(steps) >= 1 and abs(round(steps) - steps) <= 1e-9 * steps
        if not is_multiple or steps > max_steps:
            allowed = f"whole multiples of envelope.step, up to {max_steps:,} steps"
            if steps < 1:
                cure = f"envelope.step is longer, {self.step:g} s: mend the unit of either"
                raise RefusedError(key, f"{duration:g} s", allowed, cure)
            count = round(steps)
            cure = f'write envelope.step = "{duration / count:.9g} s"'
            if count > max_steps:
                cure = f'write envelope.step = "{duration / max_steps:.3g} s" or more'
            elif " of " not in key:  # the duration of a record is the record's
                cure += f' or {key} = "{count * self.step:.9g} s"'
            raise RefusedError(key, f"{duration:g} s", allowed, cure)


class Identify(Section):
    """Measured natural modes, from which inputs are identified.

    Args:
        measured: CSV file mode,frequency [Hz],q1,q2 …, or a universal file.
        frequency_unit: of a CSV file that states none, as Hz.
        override: what the file states wrongly: that of the case is taken.
        floors: floor of each unknown of a universal file, as {"12.x" = 1}.
        learn: inputs that are identified, as c or k1.
        held_out: modes that are predicted and not learned from.
        frequency_deviation: standard deviation of a frequency over its mean.
        shape_deviation: standard deviation of an amplitude, over the mode's largest.
    """

    measured: CaseFile
    frequency_unit: str = ""
    override: list[Literal["frequency_unit"]] = Field([])
    floors: dict[str, Annotated[int, Quantity(minimum=1, is_integer=True)]] = Field({})
    learn: Names
    held_out: tuple[Annotated[int, Quantity(minimum=1, is_integer=True)], ...] = ()
    frequency_deviation: Fraction | None = None
    shape_deviation: Fraction | None = None
