"""Settings that run and give rough envelopes: a time step or a tolerance that is coarse beside the motion."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from alphacut.output import say
from alphacut.problem import BadInput, Problem
from alphacut.structure import Structure

if TYPE_CHECKING:
    from alphacut.envelope import EnvelopeTask

WITH_TOLERANCE = ("auto", "modal", "graph-follower", "improved-graph-follower")


def rough(wanted: Structure, task: EnvelopeTask) -> Iterator[Problem]:
    """What is coarse about an envelope."""
    yield from coarse_step(wanted, task)
    yield from coarse_tolerance(wanted, task)


def coarse_step(wanted: Structure, task: EnvelopeTask) -> Iterator[Problem]:
    """A step that cannot resolve the fastest mode, with the phase error that means; the exact propagator needs none."""
    from frame import guard

    if wanted.linear is None or task.scheme == "exact":
        return
    found = guard(wanted.linear, task.step, task.duration)
    if not found.ok:
        yield Problem("envelope.step", found.message.removeprefix("step: "))


def coarse_tolerance(wanted: Structure, task: EnvelopeTask) -> Iterator[Problem]:
    """A tolerance that is more than a hundredth of the peak of an output."""
    from frame.box import UnitFlow, boxes
    from frame.tolerance_guard import tolerance_guard

    if task.method not in WITH_TOLERANCE:
        return
    inputs = wanted.inputs(task.fuzzy)
    flow = wanted.flow(tuple(inputs), task.duration, task.step, "exact" if wanted.linear is not None else task.integrator)
    found = tolerance_guard(UnitFlow(flow, boxes(inputs, (0.0,)), task.relative), task.tolerance)
    if not found.ok:
        key = "envelope.relative_tolerance" if task.relative else "envelope.tolerance" if wanted.linear else "pendulum.tolerance"
        yield Problem(key, found.message.removeprefix("tolerance: "))


def guard_against(wanted: Structure, task: EnvelopeTask, *, strict: bool) -> None:
    """Warn of what is coarse about an envelope.

    Raises:
        BadInput: `strict`, and something is.
    """
    found = list(rough(wanted, task))
    if found and strict:
        raise BadInput(found)
    for problem in found:
        say(f"warning: {problem}")
