"""A tolerance is a contract: a declared error above it is a failure, unless it is accepted."""

from __future__ import annotations

from collections.abc import Mapping

from alphacut.case.case import Case
from alphacut.case.limits import asked_tolerance, by_auto
from alphacut.io.files import say
from alphacut.io.problem import BadInput

STEERED = ("auto", "table", "series")
"""Models of the cell that a tolerance always steers."""


class ToleranceMissedError(RuntimeError):
    """A result's declared error is above the tolerance that was asked for."""


def keep(reached: float, asked: float, *, of: str, cure: str, best_effort: bool) -> None:
    """Require a declared error within the tolerance; with `best_effort` only warn.

    Args:
        reached: Declared error.
        asked: Tolerance, in the same unit.
        of: Whose error it is, for the message.
        cure: What would reach the tolerance.
        best_effort: Take the result all the same.

    Raises:
        ToleranceMissedError: The error is larger, and `best_effort` is not set.
    """
    if reached <= asked * (1 + 1e-9):
        return
    message = f"{of} is up to {reached:.2g}, {asked:.2g} is asked for; {cure}"
    if not best_effort:
        raise ToleranceMissedError(f"{message}, or --best-effort takes this result")
    say(f"warning: {message}")


def keep_modulus(case: Case, method: str, error: Mapping[str, float], *, best_effort: bool) -> None:
    """Require the declared error of E within the case's tolerance, where it names one.

    Raises:
        ToleranceMissedError: It is larger.
    """
    if (asked := case.modulus_tolerance) is None:
        return
    cure = f"{by_auto(case, 'modulus.method')} reaches it"
    if method in ("prism", "slices"):
        cure = f"without mesh.size and mesh.layers method {method} is refined; {cure}"
    keep(
        sum(error.values()),
        asked,
        of=f"the relative error of E by method {method}",
        cure=cure,
        best_effort=best_effort,
    )


def contract(case: Case, reached: float | None) -> dict[str, float | None]:
    """The tolerance of E that is asked for and the error that is declared, for JSON."""
    return {"asked": case.modulus_tolerance, "reached": reached}


def require_choice(case: Case, *, modulus: bool, envelope: bool) -> None:
    """Refuse ``--best-effort`` where nothing can miss a tolerance.

    Args:
        case: The case.
        modulus: A modulus is computed.
        envelope: Envelopes are computed.

    Raises:
        BadInput: No tolerance is asked for, or every method is steered by it.
    """
    fixed = modulus and case.modulus_tolerance is not None and case.names_mesh
    fixed = fixed and case.modulus.method not in STEERED
    own = envelope and (asked_tolerance(case) is not None or case.envelope.certify is not None)
    own = own and (case.envelope.method != "auto" or case.envelope.certify is not None)
    if not fixed and not own:
        raise BadInput.of(
            "--best-effort",
            "no tolerance can be missed here",
            allowed="beside a tolerance and a method of a named resolution",
        )
