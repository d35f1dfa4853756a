"""Parts of a search that are kept, so that one that was stopped goes on from there."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Protocol

from alphacut.frame.calculus.jet import Array

Progress = Callable[[float], None]


class Kept(Protocol):
    """Keeps arrays by name, for one search and no other."""

    def load(self, name: str) -> Mapping[str, Array] | None:
        """What was saved under a name; None if nothing was."""

    def save(self, name: str, found: Mapping[str, Array]) -> None:
        """Keep arrays under a name, in place of what it had."""


def share(progress: Progress | None, first: float, last: float) -> Progress:
    """Progress of a part of a task, from `first` to `last` of the whole."""
    if progress is None:
        return lambda done: None
    return lambda done: progress(first + (last - first) * done)


def stage(progress: Progress | None, what: str) -> None:
    """Tell a progress that shows it what is being done from now on."""
    if (tell := getattr(progress, "stage", None)) is not None:
        tell(what)
