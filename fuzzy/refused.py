"""Errors of every package, with what a caller needs to know as fields."""

from __future__ import annotations


class RefusedError(ValueError):
    """A value that has no meaning where it stands.

    Args:
        key: Name of the argument or of the case key, such as "mesh.size".
        value: The value as the caller wrote it; None where it is missing.
        allowed: The values that have a meaning, such as "values in (0, 1]".
        cure: What to do where that is not obvious from `allowed`.
    """

    def __init__(self, key: str, value: object, allowed: str, cure: str = "") -> None:
        self.key, self.value, self.allowed, self.cure = key, value, allowed, cure
        has = "is missing" if value is None else f"is {value}"
        super().__init__(f"{key} {has}; allowed: {allowed}" + (f"; {cure}" if cure else ""))


class FailedError(RuntimeError):
    """A computation that ended without an answer.

    Args:
        what: What failed, with its numbers.
        cure: What the caller can change.
    """

    def __init__(self, what: str, cure: str = "") -> None:
        self.what, self.cure = what, cure
        super().__init__(what + (f"; {cure}" if cure else ""))
