"""One envelope that a case asks for."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from alphacut.case.case import Case
from alphacut.case.checks import displacements

TOLERANCES = ("envelope.relative_tolerance", "envelope.tolerance", "pendulum.tolerance")
SHARE = 1e-3  # the tolerance where no output is a displacement: of their peaks


@dataclass(frozen=True)
class EnvelopeTask:
    """One envelope to be computed.

    Args:
        fuzzy: Fuzzy inputs as the user names them: E, m, m1 …
        duration: Length of the simulation, in s.
        step: Time step, in s.
        alpha: Levels, rising.
        method: How the envelope is found.
        integrator: Time stepping; None leaves it to the method.
        order: Order κ of the Taylor models.
        tolerance: Gain that is worth a new trajectory, or the error wanted of auto, in the unit of
            the outputs.
        exclude: Methods that auto must not take.
        certify: Gap between attained and proved bounds that is wanted, in the unit of the outputs;
            None for no certificate.
        relative: Whether the tolerance is a share of each output's peak.
    """

    fuzzy: tuple[str, ...]
    duration: float
    step: float
    alpha: tuple[float, ...]
    method: str
    integrator: str | None
    order: int
    tolerance: float
    exclude: tuple[str, ...] = ()
    certify: float | None = None
    relative: bool = False

    @property
    def scheme(self) -> str:
        """Time stepping of a linear structure: integrator, or the method's own."""
        return self.integrator or ("exact" if self.method in ("auto", "modal") else "midpoint")


def task_of(
    case: Case, *, fuzzy: Sequence[str] | None = None, duration: float | None = None
) -> EnvelopeTask:
    """Envelope that [envelope] asks for, with other inputs or duration if given."""
    tolerance = "pendulum.tolerance" if case.has("pendulum.mass") else "envelope.tolerance"
    relative, method = case.has("envelope.relative_tolerance"), case.text("envelope.method")
    forces = (
        case.has("frame.masses") and bool(case.names("frame.outputs")) and not displacements(case)
    )
    certify = case.number("envelope.certify") if case.has("envelope.certify") else None
    return EnvelopeTask(
        tuple(fuzzy) if fuzzy else case.names("envelope.fuzzy"),
        duration or case.number("envelope.duration"),
        case.number("envelope.step"),
        case.numbers("envelope.alpha"),
        "modal" if certify is not None and method == "auto" else method,
        case.text("envelope.integrator") if case.has("envelope.integrator") else None,
        case.integer("envelope.order"),
        (
            case.number("envelope.relative_tolerance")
            if relative
            else SHARE
            if forces
            else case.number(tolerance)
        ),
        certify=certify,
        relative=relative or forces,
    )
