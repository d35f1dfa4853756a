"""One envelope that a case asks for."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from alphacut.case.case import Case
from alphacut.case.checks import forces_only

FINE = 8
FOLLOWERS = ("graph-follower", "improved-graph-follower")
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
        tolerance: Wanted error, in the unit of the outputs.
        exclude: Methods that auto must not take.
        certify: Gap between attained and proved bounds that is wanted, in the unit of the outputs;
            None for no certificate.
        relative: Whether the tolerance is a share of each output's peak.
        gain: Gain that is worth a new trajectory to a Graph Follower, as a share of the tolerance.
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
    gain: float = 0.25

    @property
    def resolution(self) -> float:
        """Tolerance of the method itself, of a Graph Follower the gain worth a trajectory."""
        shares = {"modal": 1 / FINE, **dict.fromkeys(FOLLOWERS, self.gain)}
        return self.tolerance * shares.get(self.method, 1.0)

    @property
    def scheme(self) -> str:
        """Time stepping of a linear structure: integrator, or the method's own."""
        return self.integrator or (
            "exact" if self.method in ("auto", "modal", "proof", "search") else "midpoint"
        )


def task_of(
    case: Case, *, fuzzy: Sequence[str] | None = None, duration: float | None = None
) -> EnvelopeTask:
    """Envelope that [envelope] asks for, with other inputs or duration if given."""
    given, forces = case.envelope, forces_only(case)
    share = SHARE if forces and given.relative_tolerance is None else given.relative_tolerance
    length = case.pendulum.tolerance if case.sections.pendulum else given.tolerance
    return EnvelopeTask(
        tuple(fuzzy) if fuzzy else given.fuzzy,
        duration or given.duration,
        given.step,
        given.alpha,
        "modal" if given.certify is not None and given.method == "auto" else given.method,
        given.integrator,
        given.order,
        length if share is None else share,
        certify=given.certify,
        relative=share is not None,
        gain=given.gain,
    )
