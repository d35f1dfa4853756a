"""The error of a proof that is not found."""

from __future__ import annotations

from alphacut.base.errors import FailedError


class UnprovedError(FailedError):
    """A property that a proof needs does not hold, or is not known to hold.

    Args:
        what: The property.
        cure: What the caller can change.
        along: Input, by its place among those of the box, whose bisection is most likely to help;
            None where none stands out.
    """

    def __init__(self, what: str, cure: str = "", along: int | None = None) -> None:
        super().__init__(what, cure)
        self.along = along
