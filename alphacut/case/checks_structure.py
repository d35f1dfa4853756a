"""Needs of a structure that no single key states: damping, and something that moves it."""

from __future__ import annotations

from collections.abc import Iterator

from alphacut.case.case import Case
from alphacut.io.problem import Problem

RAYLEIGH = ("rayleigh_mass", "rayleigh_stiffness")
DAMPING = 'damping_ratio = "5 %", rayleigh_mass and rayleigh_stiffness'


def incomplete(case: Case) -> Iterator[Problem]:
    """Every key that a frame or tower lacks."""
    if case.sections.frame:
        yield from frame_stiffness(case)
        yield from frame_damping(case)
        yield from frame_motion(case)


def given(case: Case, section: str, *names: str) -> bool:
    """True if the file holds any of the keys."""
    return any(case.asked(f"{section}.{name}") for name in names)


def frame_stiffness(case: Case) -> Iterator[Problem]:
    """Stiffnesses, or all that makes them; heights where weights press."""
    stiff = given(case, "frame", "stiffness")
    for name in ("modulus", "second_moment", "columns") if stiff else ():
        if given(case, "frame", name):
            yield case.problem(
                f"frame.{name}", "there is a stiffness besides", f"one of stiffness and {name}"
            )
    for name, what in MAKES.items():
        needed = not stiff or (name == "lengths" and case.frame.p_delta)
        if needed and not given(case, "frame", name):
            cure = "one for each floor, or for all" + ("" if stiff else "; or stiffness in N/m")
            yield Problem(f"frame.{name}", f"missing: {what}", allowed=cure)
    if stiff and (makers := [*({"modulus", "image"} & set(case.stages)), *case.stand_ins]):
        yield case.problem(
            "frame.stiffness",
            f"the frame makes no use of the modulus that {', '.join(sorted(makers))} gives",
            'one of them; with stiffness, stages = ["envelope"]',
        )


MAKES = {
    "lengths": "height of the columns below each floor",
    "second_moment": "second moment of area of one column",
}


def frame_damping(case: Case) -> Iterator[Problem]:
    """Dampers go with their placement; where there are none, the damping is given otherwise."""
    if given(case, "frame", "dampers") and not given(case, "frame", "damper_placement"):
        yield Problem(
            "frame.damper_placement",
            "missing: where the dampers stand",
            allowed='"ground" or "storey"',
        )
    if not given(case, "frame", "dampers") and given(case, "frame", "damper_placement"):
        yield Problem(
            "frame.dampers",
            "missing: damper_placement says where dampers stand",
            allowed='for example "50 N s/m", for all floors',
        )
    elif not given(case, "frame", "dampers", "damping_ratio", *RAYLEIGH):
        yield Problem(
            "frame.dampers",
            "missing: the frame has no damping",
            allowed=f'dampers, {DAMPING}; "0 %" for none',
        )


def frame_motion(case: Case) -> Iterator[Problem]:
    """A start is given, unless the ground moves; and something moves at all."""
    if case.frame.accelerogram:
        return
    missing = [name for name in ("displacements", "velocities") if not given(case, "frame", name)]
    for name in missing:
        yield Problem(
            f"frame.{name}",
            "missing: without an accelerogram the start moves the frame",
            allowed="one for each floor, or for all",
        )
    starts = (*case.frame.displacements, *case.frame.velocities)
    if not missing and not any(number.support.lower or number.support.upper for number in starts):
        what = (
            "nothing moves the frame: displacements and velocities are zero, and there is no"
            " accelerogram"
        )
        yield Problem(
            "frame.displacements", what, allowed="a start that is not zero, or an accelerogram"
        )
