"""The error that says that a proof was not found."""

from __future__ import annotations

from alphacut.base.errors import FailedError


class UnprovedError(FailedError):
    """A property that a proof needs does not hold, or is not known to hold.

    Args:
        what: The property.
        cure: What the caller can change.
        along: Index of the input whose bisection is most likely to help, or None where none stands
            out.
    """

    def __init__(self, what: str, cure: str = "", along: int | None = None) -> None:
        super().__init__(what, cure)
        self.along = along
