"""The trace of a call: the operations that it did with its inputs, and the lines that it ran."""

from __future__ import annotations

import dis
import sys
from collections.abc import Callable, Mapping
from types import CodeType, FrameType
from typing import TYPE_CHECKING, NoReturn, TypeVar

if TYPE_CHECKING:
    from _typeshed import TraceFunction

Result = TypeVar("Result")
Path = dict[CodeType, set[object]]
_APART = {  # code that goes other ways with tracers and may
    f"{__package__}.{name}" for name in ("trace", "tracer", "enclosure", "interval_arithmetic")
}


class Trace:
    """One call of a function: the operations it did, in their order, and why it proves nothing.

    Args:
        reason: What could not be enclosed; empty if all could.
        steps: Each operation with the numbers of its operands, or their values.
    """

    def __init__(self) -> None:
        self.reason = ""
        self.steps: list[tuple[object, ...]] = []

    def refuse(self, what: str) -> NoReturn:
        """Note what has no enclosure.

        Raises:
            TypeError: Always.
        """
        self.reason = self.reason or what
        raise TypeError(what)

    def step(self, *what: object) -> int:
        """Note an operation; the number of its result."""
        self.steps.append(what)
        return len(self.steps) - 1


def path(call: Callable[[], Result]) -> tuple[Result, Path]:
    """The result of a call, with its path.

    A path holds for all code that runs in Python its lines and the kinds of its exceptions, caught
    ones included. Two calls of a function that does the same arithmetic with numbers and with
    tracers take one path through the code that both run.
    """
    found: Path = {}

    def inside(frame: FrameType, event: str, argument: object) -> TraceFunction:
        if event in ("line", "exception"):
            kind = argument[0] if isinstance(argument, tuple) else frame.f_lineno
            found[frame.f_code].add(kind)
        return inside

    def enter(frame: FrameType, event: str, argument: object) -> TraceFunction | None:
        if frame.f_code.co_filename.startswith("<frozen") or _apart(frame.f_globals):
            return None
        found.setdefault(frame.f_code, set())
        return inside

    before = sys.gettrace()
    sys.settrace(enter)
    try:
        return call(), found
    finally:
        sys.settrace(before)


def _apart(names: Mapping[str, object]) -> bool:
    """Whether code with these global names is numpy's or this arithmetic's own."""
    module = str(names.get("__name__", ""))
    return module in _APART or module.partition(".")[0] == "numpy"


def same_path(one: Path, other: Path) -> bool:
    """Whether two calls took one path through the code that both ran."""
    return all(one[code] == other[code] for code in one.keys() & other.keys())


def asks_for_types(calls: Path) -> str:
    """The first function on a path that asks for the type of something by `type`; empty if none."""
    for code in calls:
        for step in dis.get_instructions(code):
            if step.argval == "type" and step.opname.startswith(("LOAD_GLOBAL", "LOAD_NAME")):
                return code.co_name
    return ""
