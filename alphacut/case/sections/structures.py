"""Sections on structures: storey frame, tower of beams, pendulum."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

from alphacut.case.key import NOT_NEGATIVE, RATIO, Key, Section, positive
from alphacut.fuzzy import Crisp, FuzzyNumber

ZERO, TWO = Crisp(0.0), Crisp(2.0)


@dataclass(frozen=True, kw_only=True, slots=True)
class Frame(Section):
    """Storey frame: rigid floors on elastic columns, numbered from the ground."""

    masses: Annotated[tuple[FuzzyNumber, ...], positive("mass of each floor", "kg")]
    lengths: Annotated[
        tuple[FuzzyNumber, ...] | None,
        positive(
            "length of the columns below each floor; beside stiffness the height of each storey,"
            " for p_delta and for limits in % of it",
            "m",
            alone=True,
        ),
    ] = None
    modulus: Annotated[
        FuzzyNumber | None, positive("Young's modulus where none is handed on", "Pa")
    ] = None
    second_moment: Annotated[
        tuple[FuzzyNumber, ...] | None,
        positive(
            "second moment of area of one column, one for all storeys or one for each",
            "m^4",
            alone=True,
        ),
    ] = None
    columns: Annotated[
        tuple[FuzzyNumber, ...],
        positive(
            "columns in each storey, clamped at both ends; fuzzy where a storey's stiffness is",
            alone=True,
        ),
    ] = (TWO,)
    stiffness: Annotated[
        tuple[FuzzyNumber, ...] | None,
        positive(
            "stiffness of each storey, in place of lengths, modulus, second_moment and columns",
            "N/m",
            alone=True,
        ),
    ] = None
    p_delta: Annotated[
        bool,
        Key(
            "whether the weight P of the floors above reduces each storey's stiffness by P over"
            " its height"
        ),
    ] = False
    damping_ratio: Annotated[
        tuple[FuzzyNumber, ...] | None,
        Key(
            "viscous damping over the critical one: of all modes, or of each by rising"
            " frequency; beside the other damping",
            allowed=RATIO,
            alone=True,
        ),
    ] = None
    dampers: Annotated[
        tuple[FuzzyNumber, ...],
        Key(
            "viscous damper of each floor; needed where no other damping is given",
            "N*s/m",
            allowed=NOT_NEGATIVE,
            alone=True,
        ),
    ] = (ZERO,)
    damper_placement: Annotated[
        Literal["ground", "storey"] | None,
        Key("to the ground, or between storeys; needed with dampers"),
    ] = None
    displacements: Annotated[
        tuple[FuzzyNumber, ...],
        Key(
            "displacement of each floor at the start; needed without an accelerogram",
            "m",
            alone=True,
        ),
    ] = (ZERO,)
    velocities: Annotated[
        tuple[FuzzyNumber, ...],
        Key(
            "velocity of each floor at the start; needed without an accelerogram", "m/s", alone=True
        ),
    ] = (ZERO,)
    rayleigh_mass: Annotated[
        FuzzyNumber, Key("factor a of Rayleigh damping a M + b K", "1/s", allowed=NOT_NEGATIVE)
    ] = ZERO
    rayleigh_stiffness: Annotated[
        FuzzyNumber, Key("factor b of Rayleigh damping a M + b K", "s", allowed=NOT_NEGATIVE)
    ] = ZERO
    accelerogram: Annotated[
        str | None,
        Key(
            "CSV or AT2 file of the ground's acceleration; displacements are relative to it",
            file=True,
        ),
    ] = None
    outputs: Annotated[
        tuple[str, ...],
        Key(
            "observed quantities: q1, v1 (m/s), a1 (absolute, m/s²), ar1 (relative to the ground,"
            " m/s²), drift1, shear1 … (in the"
            " columns of a storey; dampers excluded), base_shear (that of the lowest storey); all"
            " displacements if left out"
        ),
    ] = ()

    @property
    def damped(self) -> bool:
        """Whether any damper is there."""
        return any(number.support.upper > 0 for number in self.dampers)


@dataclass(frozen=True, kw_only=True, slots=True)
class Pendulum(Section):
    """Damped pendulum: a mass on a bar under gravity; the output is the force in the bar."""

    mass: Annotated[FuzzyNumber, positive("mass", "kg")]
    length: Annotated[FuzzyNumber, positive("length of the bar", "m")]
    damping: Annotated[
        FuzzyNumber, Key("moment over angular velocity", "N*m*s", allowed=NOT_NEGATIVE)
    ]
    gravity: Annotated[FuzzyNumber, positive("acceleration of gravity", "m/s^2")]
    angle: Annotated[FuzzyNumber, Key("angle at the start, 0 hanging down", "rad")]
    angular_velocity: Annotated[FuzzyNumber, Key("angular velocity at the start", "rad/s")]
    tolerance: Annotated[
        float, positive("wanted error of the force; a declared error above it is a failure", "N")
    ] = 0.001
