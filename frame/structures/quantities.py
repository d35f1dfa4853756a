"""Observed quantities and parameters of structures: their names, SI units and ranges."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass

from alphacut.base.errors import require
from alphacut.base.quantity import Quantity

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
ANY_NUMBER = Quantity()
RATIO = Quantity(minimum=0, below=1)
"""A damping ratio, of which 1 is the critical damping."""


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
        quantity: Its unit and range, as far as they are known.
    """

    name: str
    quantity: Quantity = ANY_NUMBER

    @property
    def unit(self) -> str:
        """SI unit; empty where it has none, or none is known."""
        return self.quantity.si

    @property
    def range(self) -> str:
        """The range in words; empty for any number."""
        return self.quantity.range

    def admits(self, low: float, high: float) -> bool:
        """Return whether all values from `low` to `high` are finite and within the range."""
        return self.quantity.admits(low, high)


OF_STOREY_FRAME = {
    "E": Quantity("Pa", above=0),
    "I": Quantity("m^4", above=0),
    "m": Quantity("kg", above=0),
    "l": Quantity("m", above=0),
    "k": Quantity("N/m", above=0),
    "c": Quantity(above=0),
    "d": Quantity("N*s/m", minimum=0),
    "rayleigh_mass": Quantity("1/s", minimum=0),
    "rayleigh_stiffness": Quantity("s", minimum=0),
    "zeta": RATIO,
    "fy": Quantity("N", above=0),
    "dy": Quantity("m", above=0),
    "hardening": Quantity(minimum=0, maximum=1),
    "q": Quantity("m"),
    "v": Quantity("m/s"),
    "frequency": Quantity("Hz", above=0),
    "F": Quantity("N"),
    "J": Quantity("N*s"),
}
"""A storey frame's parameters, by names without the number of the floor.

The ranges are those in which structures vibrate: masses and stiffnesses are positive, so that M and
K are positive definite, and dampers are not negative, so that nothing feeds energy.
"""


def of_storey_frame(name: str) -> Parameter:
    """Return a parameter of a storey frame; without unit and range if the frame has no such."""
    kind = re.sub(r"\d+(_\d+)?$", "", name)
    return Parameter(name, OF_STOREY_FRAME.get(kind, ANY_NUMBER))
