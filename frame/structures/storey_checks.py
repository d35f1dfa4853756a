"""The values that make a storey frame, and what they must be."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from alphacut.frame.calculus.numbers import require_number, require_numbers
from alphacut.frame.structures.linear import Accelerogram
from alphacut.frame.structures.quantities import NOT_NEGATIVE, Parameter, of_storey_frame
from alphacut.fuzzy.refused import RefusedError

SYMBOLS = {
    **{"masses": "m", "lengths": "l", "modulus": "E", "second_moment": "I", "dampers": "d"},
    **{"q0": "q", "v0": "v", "columns": "c", "stiffness": "k", "damping_ratio": "zeta"},
}
"""What each argument's values are called as parameters."""


@dataclass(frozen=True)
class StoreyValues:
    """Values of a storey frame, as its springs and its checks see it; see `StoreyFrame`."""

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
        return () if self.second_moment is None else tuple(np.atleast_1d(self.second_moment))

    @property
    def ratios(self) -> dict[str, float]:
        """Damping ratios by the names of their parameters; empty where there are none."""
        values = np.atleast_1d(self.damping_ratio)
        return {
            "zeta" if len(values) == 1 else f"zeta{k + 1}": float(x) for k, x in enumerate(values)
        }


def check_values(frame: StoreyValues) -> None:
    """Refuse values that are no numbers or out of range, and lists that do not fit the floors.

    Raises:
        RefusedError: There is one.
    """
    rules = {name: of_storey_frame(symbol).range for name, symbol in SYMBOLS.items()}
    for name, rule in {**rules, "rayleigh": NOT_NEGATIVE, "gravity": NOT_NEGATIVE}.items():
        values = getattr(frame, name)
        if values is None:
            continue
        single = name in ("modulus", "gravity") or np.ndim(values) == 0
        (require_number if single else require_numbers)(name, values, "SI units")
        for value in np.atleast_1d(values):
            if not Parameter(name, range=rule).admits(value, value):
                raise RefusedError(name, f"{value:g}", rule or "finite numbers")
    _check_springs(frame)
    _check_lengths(frame)


def _check_springs(frame: StoreyValues) -> None:
    """Either stiffnesses, or all that makes them; heights where weights press."""
    made: dict[str, object] = {"modulus": frame.modulus, "second_moment": frame.second_moment}
    beside = [name for name, value in made.items() if value is not None]
    beside += ["columns"] if len(frame.columns) else []
    if len(frame.stiffness):
        if beside:
            raise RefusedError(", ".join(beside), "there", "either stiffness or what makes it")
        made = {}
    if not len(frame.stiffness) or frame.gravity:
        made["lengths"] = frame.lengths if len(frame.lengths) else None
    for name, value in made.items():
        if value is None:
            what = "lengths, modulus and second_moment, or stiffness (with lengths for gravity)"
            raise RefusedError(name, None, what)


def _check_lengths(frame: StoreyValues) -> None:
    n = len(frame.masses)
    lists = ("masses", "lengths", "stiffness", "columns", "dampers", "q0", "v0")
    sizes = {name: len(getattr(frame, name)) for name in lists}
    sizes["second_moment"] = len(frame.moments) if len(frame.moments) > 1 else 0
    sizes["damping_ratio"] = len(frame.ratios) if len(frame.ratios) > 1 else 0
    for name, size in sizes.items():
        if size not in (0, n) or not n:
            raise RefusedError(name, f"a list of {size}", f"one value a floor, {n} from below")
    if frame.damper_placement not in ("ground", "storey"):
        raise RefusedError("damper_placement", frame.damper_placement, "ground, storey")
