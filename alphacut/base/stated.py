"""One rule on what a file states of its numbers, and what its user says of them.

A number that is read in a wrong unit is proved right afterwards. So what a file states counts,
wherever in it that stands; two statements that disagree are refused, both shown, unless the user
says that the file is wrong.
"""

from __future__ import annotations

import warnings
from collections.abc import Collection, Iterable
from dataclasses import dataclass, replace
from math import isclose

from alphacut.base.errors import RefusedError, require

LENGTHS = "nm, um, mm, cm, m, in or ft"
"""Units of length that messages name."""


@dataclass(frozen=True)
class Stated:
    """A unit, a step, a side of a voxel or a count that a file states or its user says.

    Args:
        value: What is compared: a step in s, a length in m, or the factor of a unit to SI.
        text: How it is shown, as "cm/s^2" or "0.01 s".
        place: Where it stands, as "line 3"; empty of what the user says.
        remark: Clause for the report where the user overrides the file.
    """

    value: float
    text: str
    place: str = ""
    remark: str = ""

    def __str__(self) -> str:
        return f"{self.text} ({self.place})" if self.place else self.text


def settled(
    name: str,
    key: str,
    stated: Iterable[Stated],
    said: Stated | None = None,
    *,
    override: Collection[str] = (),
    tolerance: float = 1e-6,
    unsure: Iterable[Stated] = (),
) -> Stated | None:
    """Return what counts of a file's statements on one thing and what the user says of it.

    Args:
        name: Name of the file, or of a line of it, for messages.
        key: What it is, as "unit" or "step": the name of the user's key.
        stated: The statements of the file, in the order of their weight.
        said: What the user says; None if nothing.
        override: Keys of which the user says that the file is wrong.
        tolerance: Relative difference up to which two values are the same, as by rounding.
        unsure: Statements that may be of something else: they are never taken, and where the file
            has no other one of them must be what the user says. NaN is like no value.

    Returns:
        The first statement of the file, or what the user says where there is none or the user
        overrides it; then its `remark` says so. None if nobody says anything.

    Raises:
        RefusedError: Two of them disagree.
    """
    first = None
    for each in stated:
        if said is not None and not isclose(each.value, said.value, rel_tol=tolerance):
            if key in override:
                return replace(said, remark=f"its own {key}, {each}, is overridden by {said}")
            cure = f'say {key} as the file does, or override = ["{key}"] if it is wrong'
            raise RefusedError(name, f"said to be of {key} {said}", f"{key} {each}", cure)
        first = first or each
        if said is None and not isclose(each.value, first.value, rel_tol=tolerance):
            cure = f'mend one, or say {key} and override = ["{key}"]'
            raise RefusedError(name, f"of {key} {first} and {each}", f"one {key}", cure)
    doubtful = list(unsure)
    if first is None and said is not None and key not in override:
        is_among = any(isclose(x.value, said.value, rel_tol=tolerance) for x in doubtful)
        shown = " or ".join(map(str, doubtful))
        cure = f'say override = ["{key}"] if that is something else'
        what = f"said to be of {key} {said}"
        require(is_among or not doubtful, name, what, f"{key} {shown}", cure)
    return first or said


def warn_of_overrides(name: str, override: Collection[str]) -> None:
    """Warn that what a file states of some keys does not count, as its user says.

    Args:
        name: Name of the file.
        override: The keys.
    """
    for key in override:
        warnings.warn(f"of {name} what it states of its {key} is overridden", stacklevel=3)


def require_overrides(override: object, allowed: Collection[str]) -> None:
    """Raise RefusedError unless `override` is a sequence of some of the allowed keys."""
    is_known = isinstance(override, list | tuple) and all(key in allowed for key in override)
    require(is_known, "override", override, f"a list of {', '.join(allowed)}")
