"""Checks of a whole case that no broken key has a part in."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import replace

from alphacut.case.case import Case
from alphacut.io.problem import Problem


class Watched(Mapping[str, object]):
    """Values of a case that remember requests for a broken key.

    Args:
        values: The values that are right.
        broken: Keys whose values are not, or are missing.
    """

    def __init__(self, values: Mapping[str, object], broken: Collection[str]) -> None:
        self.values_, self.broken, self.asked = values, broken, False

    def __getitem__(self, key: str) -> object:
        self.asked |= key in self.broken
        return self.values_[key]

    def __iter__(self) -> Iterator[str]:
        yield from self.values_
        yield from (key for key in self.broken if key not in self.values_)

    def __len__(self) -> int:
        return len(self.values_) + sum(key not in self.values_ for key in self.broken)


def undoubted(
    check: Callable[[Case], Iterator[Problem]], case: Case, broken: Collection[str]
) -> Iterator[Problem]:
    """The problems that a check finds, but none that rests on a broken key."""
    values, written = Watched(case.values, broken), Watched(case.written, broken)
    found = check(replace(case, values=values, written=written))
    while True:
        values.asked = written.asked = False
        try:
            problem = next(found)
        except StopIteration:
            return
        except Exception:
            if not (values.asked or written.asked):
                raise
            return
        if not (values.asked or written.asked):
            yield problem
