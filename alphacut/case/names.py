"""Names of a structure's inputs and outputs."""

from __future__ import annotations

import re
from collections.abc import Iterator

from alphacut.case.case import Case
from alphacut.case.checks_structure import RAYLEIGH
from alphacut.case.values import nearest
from alphacut.io.problem import Problem

GROUPS = ("E", "I", "m", "l", "c", "k", "d", "q0", "v0", "zeta", *RAYLEIGH)
LISTS = (
    "lengths", "dampers", "displacements", "velocities", "second_moment", "columns", "stiffness",
)  # fmt: skip
"""Keys of a frame with one value for each floor, or one for all."""
OTHERS = {  # structures beside the storey frame, and their inputs
    "pendulum": ("m", "l", "d", "g", "phi_0", "omega_0"),
}
# of structures beside the storey frame
OUTPUTS = {"pendulum": ("force",)}


def floors(case: Case) -> Iterator[Problem]:
    """One entry for each floor in every array of the frame, or one for all floors."""
    frame, count = case.frame, len(case.frame.masses)
    for name in LISTS:
        found = len(getattr(frame, name) or (None,))
        if found not in (1, count):
            few = f"{count} value{'s' if count > 1 else ''}"
            words = (
                f"{few}, or one for all floors; the number of floors is that of frame.masses, which"
                f" has {count}"
            )
            yield Problem(
                f"frame.{name}",
                f"got {found} values for {count} floor{'s' if count > 1 else ''}",
                allowed=words,
            )
    if frame.damping_ratio is not None and len(frame.damping_ratio) not in (1, count):
        what = f"got {len(frame.damping_ratio)} values for {count} modes"
        yield Problem(
            "frame.damping_ratio",
            what,
            allowed=f"one for all modes, or {count}: one for each, by rising frequency",
        )
    yield from known_output(case, count)
    for key, names in named_inputs(case):
        for name in names:
            yield from known_input(case, key, name, count)


def structures(case: Case) -> list[str]:
    """Names of the sections on structures that the case has."""
    return [name for name in ("frame", *OTHERS) if getattr(case.sections, name) is not None]


def others(case: Case) -> Iterator[Problem]:
    """Fuzzy inputs of a structure that has no groups of them."""
    for section in structures(case):
        if section in OTHERS:
            yield from other_inputs(case, section, OTHERS[section])


def other_inputs(case: Case, section: str, known: tuple[str, ...]) -> Iterator[Problem]:
    """Names of inputs that a pendulum or a tower does not have."""
    for key, names in named_inputs(case):
        for name in names:
            if name not in known:
                yield Problem(
                    key,
                    f"the {section} has no input {name}",
                    name,
                    ", ".join(known),
                    nearest(name, known),
                )


def named_inputs(case: Case) -> Iterator[tuple[str, tuple[str, ...]]]:
    """Keys that name inputs of the structure, each with the names."""
    given = case.sections
    if given.envelope:
        yield "envelope.fuzzy", given.envelope.fuzzy
    if given.exceedance:
        yield "exceedance.random", given.exceedance.random
    if given.update:
        yield "update.learn", given.update.learn
    for index, study in enumerate(given.study):
        yield f"study[{index}].fuzzy", study.fuzzy


def frame_outputs(floors: int) -> list[str]:
    """Outputs that a storey frame may have."""
    kinds = ("q", "v", "a", "ar", "drift", "shear")
    return [f"{kind}{floor + 1}" for kind in kinds for floor in range(floors)] + ["base_shear"]


def known_output(case: Case, floors: int) -> Iterator[Problem]:
    """The observed quantities, and the one that a study draws."""
    possible = frame_outputs(floors)
    for name in case.frame.outputs:
        if name not in possible:
            yield Problem(
                "frame.outputs",
                f"there is no output {name}",
                name,
                "q, v, a, ar, drift, shear with a floor, base_shear:"
                f" {', '.join(possible[:floors])} …",
                nearest(name, possible),
            )
    outputs = case.frame.outputs or tuple(possible[:floors])
    for index, study in enumerate(case.sections.study):
        drawn = study.output
        if drawn and drawn not in outputs:
            yield Problem(
                f"study[{index}].output", f"there is no output {drawn}", drawn, ", ".join(outputs)
            )


def known_input(case: Case, key: str, name: str, count: int) -> Iterator[Problem]:
    """A fuzzy input of the frame: a group or one floor's member of it."""
    kinds = ("m", "l", "c", "k", "d", "I")
    members = [f"{group}{floor + 1}" for group in kinds for floor in range(count)]
    members += [f"{group}{floor + 1}_0" for group in ("q", "v") for floor in range(count)]
    members += [f"zeta{mode + 1}" for mode in range(count)]
    if name not in GROUPS and name not in members:
        groups = [group for group in GROUPS if not no_such_part(case, group)]
        members = [member for member in members if not no_such_part(case, member)]
        firsts = [member for member in members if re.fullmatch(r"\D+1(_0)?", member)]
        ends = ((first, first.replace("1", str(count))) for first in firsts)
        each = ", ".join(" to ".join(dict.fromkeys(pair)) for pair in ends)
        allowed = f"{', '.join(groups)}, or one floor: {each}"
        initial = re.sub(r"^([qv])_?0?_?(\d+)$", r"\1\2_0", name)  # as of the paper's q02
        alike = [known for known in (*groups, *members) if known[0] == name[:1]]
        close = initial if initial in members else nearest(name, alike)
        yield Problem(key, f"the frame has no input {name}", name, allowed, close)
    elif without := no_such_part(case, name):
        yield Problem(key, f"the frame has no input {name}: {without}", name)


def no_such_part(case: Case, name: str) -> str:
    """Why a frame lacks an input that others have; empty where it has it."""
    given, ratios = case.frame, len(case.frame.damping_ratio or ())
    if name.startswith("zeta") and not ratios:
        return "no damping_ratio is given"
    if name[4:] and name.startswith("zeta") and ratios == 1:
        return "one damping_ratio stands for all modes, zeta"
    if given.stiffness is None:
        if name[0] == "k":
            return "no stiffness is given"
        if re.fullmatch(r"I\d+", name) and len(given.second_moment or ()) < 2:
            return "one second_moment stands for all storeys, I"
        return ""
    if name[0] in "EIc":
        return "its stiffness is given, k or k1 …"
    if name[0] == "l" and not given.p_delta:
        return "beside stiffness a height acts by p_delta = true alone"
    return ""
