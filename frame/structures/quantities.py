"""Observed quantities and parameters of structures: their names, SI units and ranges."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from alphacut.base.errors import require

# SI unit and words of each kind of output, by its name without the number of the floor.
OUTPUTS = {
    "q": ("m", "displacement of floor"),
    "v": ("m/s", "velocity of floor"),
    "a": ("m/s^2", "acceleration of floor"),
    "drift": ("m", "drift of storey"),
    "shear": ("N", "shear force of storey"),
    "residual": ("m", "residual drift of storey"),
    "ductility": ("", "ductility of storey"),
    "dissipated": ("J", "energy dissipated in storey"),
    "overturning_moment": ("N*m", ""),
    "base_shear": ("N", ""),
    "force": ("N", ""),
    "phi": ("rad", ""),
}
# A name that texts of limits and peaks ("max roof"), files and tables can have.
NAME = re.compile(r"[^\W\d]\w{0,63}")
# Ranges of parameters, as messages say them.
POSITIVE = "positive"
NOT_NEGATIVE = "0 or greater"
UP_TO_ONE = "0 to 1"
RATIO = "0 or greater and below 1, the critical damping"


class Output(str):
    """Name of an observed quantity that knows its unit; among other texts it is its name.

    Args:
        name: As ``q3``, or any word.
        unit: SI unit, as ``m/s``; empty of a ratio. Where None, that of the storey frame's output
            of this kind; "SI" of names that are none.

    Example:
        >>> Output("v1").unit, Output("moment", "N m").unit
        ('m/s', 'N m')
    """

    unit: str

    def __new__(cls, name: str, unit: str | None = None) -> Output:
        """Return the name with a unit; without one, that of its kind, such as "m" of "q3"."""
        # a text, so that names of outputs are used and stored as any other names
        output = super().__new__(cls, name)
        of_kind, _ = OUTPUTS.get(output._parts[0], ("SI", ""))
        if unit is None:
            unit = name.unit if isinstance(name, Output) else of_kind
        output.unit = unit
        return output

    def __reduce__(self) -> tuple[type[Output], tuple[str, str]]:
        """Say how a copy is made, in another process, too."""
        return Output, (str(self), self.unit)

    @property
    def _parts(self) -> tuple[str, str]:
        """The kind of the output, and its floor as text: "q" and "3" of "max q3"."""
        name = output_of(self)
        kind = name.rstrip("0123456789")
        return kind, name[len(kind) :]

    @property
    def words(self) -> str:
        """The output in words, as "displacement of floor 3 (q3)", or its name if it has none."""
        kind, floor = self._parts
        _, words = OUTPUTS.get(kind, ("", ""))
        return f"{words} {floor} ({self})" if words and floor else self.replace("_", " ")


def require_names(key: str, names: Iterable[str]) -> None:
    """Check the alphabet of names of parameters or outputs, and of the units of outputs.

    Args:
        key: What the names are of, for the message.
        names: The names. A name begins with a letter or _, and has up to 64 letters, digits or _;
            an `Output` among them also has a unit of up to 32 letters, digits and % ° * / ^ · . ( )
            + - or blanks.

    Raises:
        RefusedError: A name is no text of this alphabet, or a unit is not.
    """
    for name in names:
        is_name = isinstance(name, str) and NAME.fullmatch(name) is not None
        allowed = "names of a letter, then letters, digits or _, up to 64"
        require(is_name, key, value=repr(str(name)), allowed=allowed)
        if isinstance(name, Output):
            is_unit = re.fullmatch(r"[\w%°*/^·. ()+-]{0,32}", name.unit) is not None
            allowed = "units of letters, digits and % ° * / ^ · . ( ) + -, up to 32, as N*m"
            require(is_unit, f"unit of {name}", value=repr(name.unit), allowed=allowed)


def output_of(peak: str) -> str:
    """Return the output of a peak: "q3" of "max q3"."""
    return peak.removeprefix("max ").removeprefix("min ").removeprefix("mean ")


@dataclass(frozen=True)
class Parameter:
    """A parameter of a structure.

    Args:
        name: As ``m2``.
        unit: SI unit; empty where it has none, or none is known.
        range: `POSITIVE`, `NOT_NEGATIVE`, `UP_TO_ONE`, `RATIO`, or empty for any number.
    """

    name: str
    unit: str = ""
    range: str = ""

    def admits(self, low: float, high: float) -> bool:
        """Return whether all values from `low` to `high` are finite and within the range.

        The range `self.range` is one of the texts "positive", "0 or greater", "0 to 1" (both ends
        allowed) and "0 or greater and below 1, the critical damping", which say what is allowed.
        Any other text, as the empty one, allows all finite values. `low` must not be above `high`,
        which is not checked.
        """
        is_within = {
            POSITIVE: low > 0,
            NOT_NEGATIVE: low >= 0,
            RATIO: low >= 0 and high < 1,
            UP_TO_ONE: low >= 0 and high <= 1,
        }
        return bool(np.isfinite([low, high]).all() and is_within.get(self.range, True))


# SI units and ranges of a storey frame's parameters, by names without the number of the floor.
OF_STOREY_FRAME = {
    "E": ("Pa", POSITIVE),
    "I": ("m^4", POSITIVE),
    "m": ("kg", POSITIVE),
    "l": ("m", POSITIVE),
    "k": ("N/m", POSITIVE),
    "c": ("", POSITIVE),
    "d": ("N*s/m", NOT_NEGATIVE),
    "rayleigh_mass": ("1/s", NOT_NEGATIVE),
    "rayleigh_stiffness": ("s", NOT_NEGATIVE),
    "zeta": ("", RATIO),
    "fy": ("N", POSITIVE),
    "dy": ("m", POSITIVE),
    "hardening": ("", UP_TO_ONE),
    "q": ("m", ""),
    "v": ("m/s", ""),
    "F": ("N", ""),
    "J": ("N*s", ""),
}


def of_storey_frame(name: str) -> Parameter:
    """Return a parameter of a storey frame; without unit and range if the frame has no such."""
    return Parameter(name, *OF_STOREY_FRAME.get(re.sub(r"\d+(_\d+)?$", "", name), ()))
