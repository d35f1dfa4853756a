"""A tolerance that a case names: a declared error above it is a failure."""

from __future__ import annotations

from alphacut.case.case import Case
from alphacut.fuzzy.refused import FailedError


def require_within(reached: float, tolerance: float, *, of: str, cure: str) -> None:
    """Require a declared error within the tolerance.

    Args:
        reached: Declared error.
        tolerance: What the case allows, in the same unit.
        of: Whose error it is.
        cure: What reaches the tolerance.

    Raises:
        FailedError: The error is larger.
    """
    if reached > tolerance * (1 + 1e-9):
        what = f"the error of {of} is {reached:.2g}; the case allows {tolerance:.2g}"
        raise FailedError(what, cure)


def require_modulus(case: Case, error: float) -> None:
    """Require the relative error of E within modulus.tolerance, where the case names it.

    Raises:
        FailedError: It is larger.
    """
    if (tolerance := case.modulus_tolerance) is not None:
        require_within(error, tolerance, of="E", cure='modulus.method = "auto" reaches it')
