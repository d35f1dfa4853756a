"""The values that make a storey frame, and what they must be."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from alphacut.frame.calculus.numbers import require_number, require_numbers
from alphacut.frame.structures.linear import Accelerogram

UNITS = {
    "masses": "kg",
    "lengths": "m",
    "modulus": "Pa",
    "second_moment": "m⁴",
    "dampers": "N s/m",
    "q0": "m",
    "v0": "m/s",
}
UNITS |= {
    "rayleigh": "1/s and s",
    "damping_ratio": "shares of the critical damping",
    "columns": "columns of each storey",
    "stiffness": "N/m",
    "gravity": "m/s²",
}


@dataclass(frozen=True)
class StoreyValues:
    """What is given of a storey frame, as its springs and its checks see it; see `StoreyFrame`."""

    masses: Sequence[float]
    lengths: Sequence[float] = ()
    modulus: float | None = None
    second_moment: float | Sequence[float] | None = None
    dampers: Sequence[float] = ()
    damper_placement: Literal["ground", "storey"] = "ground"
    q0: Sequence[float] = ()
    v0: Sequence[float] = ()
    outputs: tuple[str, ...] = ()
    rayleigh: tuple[float, float] = (0.0, 0.0)
    ground: Accelerogram | None = None
    damping_ratio: float | Sequence[float] = ()
    columns: Sequence[float] = ()
    stiffness: Sequence[float] = ()
    gravity: float = 0.0

    @property
    def moments(self) -> tuple[float, ...]:
        """Second moments of area: one for all storeys, one for each, or none beside stiffness."""
        if self.second_moment is None:
            return ()
        return tuple(float(x) for x in np.atleast_1d(self.second_moment))

    @property
    def ratios(self) -> dict[str, float]:
        """Damping ratios by the names of their parameters; empty where there are none."""
        values = np.atleast_1d(self.damping_ratio)
        return {
            "zeta" if len(values) == 1 else f"zeta{k + 1}": float(x) for k, x in enumerate(values)
        }


def check_numbers(frame: StoreyValues) -> None:
    """Refuse what is no number, and lists with what is none, by ValueError."""
    for name, unit in UNITS.items():
        value = getattr(frame, name)
        if value is None and name in ("modulus", "second_moment"):
            continue
        single = name in ("modulus", "gravity") or (
            name in ("second_moment", "damping_ratio") and np.ndim(value) == 0
        )
        (require_number if single else require_numbers)(name, value, unit)


def check_springs(frame: StoreyValues) -> None:
    """Either stiffnesses, or all that makes them; heights where weights press.

    Raises:
        ValueError: Both are given, or something is missing.
    """
    made: dict[str, object] = {"modulus": frame.modulus, "second_moment": frame.second_moment}
    if frame.stiffness:
        beside = [name for name, value in made.items() if value is not None]
        if beside := [*beside, *(["columns"] if len(frame.columns) else [])]:
            raise ValueError(
                f"stiffness: {', '.join(beside)} beside it would make another one; give one of them"
            )
        made = {}
    if not frame.stiffness or frame.gravity:
        made["lengths"] = frame.lengths if len(frame.lengths) else None
    for name, value in made.items():
        if value is None:
            raise ValueError(
                f"{name}: missing; a frame needs lengths, modulus and second_moment, or"
                " stiffness, and lengths beside it for gravity"
            )


def check_values(frame: StoreyValues) -> None:
    """One value for each floor, all in their range.

    Raises:
        ValueError: They are not.
    """
    _check_lengths(frame)
    _check_signs(frame)
    _check_damping(frame)


def _check_lengths(frame: StoreyValues) -> None:
    n, given = len(frame.masses), bool(frame.stiffness)
    lists = ["masses", *(["stiffness"] if given else ["columns"]), "dampers", "q0", "v0"]
    lists += ["lengths"] if len(frame.lengths) else []
    lists += ["moments"] if len(frame.moments) > 1 else []
    for name in lists:
        if len(getattr(frame, name)) != n:
            raise ValueError(
                f"{name}: {len(getattr(frame, name))} values for {n} floors; give one per floor,"
                " from below"
            )


def _check_signs(frame: StoreyValues) -> None:
    positive: dict[str, Sequence[float]] = {
        "masses": frame.masses,
        "lengths": frame.lengths,
        "modulus": [] if frame.modulus is None else [frame.modulus],
        "second_moment": frame.moments,
        "columns": frame.columns,
        "stiffness": frame.stiffness,
    }
    for name, values in positive.items():
        for value in values:
            if not (value > 0 and np.isfinite(value)):
                raise ValueError(
                    f"{name}: {value:g} is not allowed; it must be positive and finite"
                )
    not_negative = {"dampers": frame.dampers, "rayleigh": frame.rayleigh}
    for name, values in {**not_negative, "gravity": [frame.gravity]}.items():
        for value in values:
            if not (value >= 0 and np.isfinite(value)):
                what = name if name == "gravity" else "damping"
                raise ValueError(f"{name}: {value:g} is not allowed; {what} must not be negative")


def _check_damping(frame: StoreyValues) -> None:
    n = len(frame.masses)
    for value in frame.ratios.values():
        if not 0 <= value < 1:
            raise ValueError(
                f"damping_ratio: {value:g} is not allowed; it must be 0 or greater and below 1,"
                " the critical damping"
            )
    if len(frame.ratios) not in (0, 1, n):
        raise ValueError(
            f"damping_ratio: {len(frame.ratios)} values for {n} modes; give one for all modes,"
            f" or {n}, by rising frequency"
        )
    if frame.damper_placement not in ("ground", "storey"):
        raise ValueError(
            f"damper_placement: '{frame.damper_placement}' is unknown; allowed are 'ground' and"
            " 'storey'"
        )
