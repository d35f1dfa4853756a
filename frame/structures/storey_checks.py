"""The values that make a storey frame, and what they must be."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from alphacut.frame.calculus.numbers import require_number, require_numbers
from alphacut.frame.structures.linear import Accelerogram
from alphacut.frame.structures.quantities import (
    NOT_NEGATIVE,
    OF_STOREY_FRAME,
    Parameter,
    of_storey_frame,
)

SYMBOLS = {
    **{"masses": "m", "lengths": "l", "modulus": "E", "second_moment": "I", "dampers": "d"},
    **{"q0": "q", "v0": "v", "columns": "c", "stiffness": "k", "damping_ratio": "zeta"},
}
"""What each argument's values are called as parameters."""
UNITS = {name: OF_STOREY_FRAME[symbol][0] for name, symbol in SYMBOLS.items()} | {
    "rayleigh": "1/s and s",
    "damping_ratio": "shares of the critical damping",
    "columns": "columns of each storey",
    "gravity": "m/s^2",
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
    ranges = {name: of_storey_frame(symbol).range for name, symbol in SYMBOLS.items()}
    for name, rule in {**ranges, "rayleigh": NOT_NEGATIVE, "gravity": NOT_NEGATIVE}.items():
        given = getattr(frame, name)
        for value in () if given is None else np.atleast_1d(given):
            if not Parameter(name, range=rule).admits(value, value):
                must = rule if np.isfinite(value) else "finite"
                raise ValueError(f"{name}: {value:g} is not allowed; it must be {must}")


def _check_damping(frame: StoreyValues) -> None:
    n = len(frame.masses)
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
