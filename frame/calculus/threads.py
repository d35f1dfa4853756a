"""Independent parts of a calculation on every core."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from multiprocessing import parent_process
from typing import TypeVar

T = TypeVar("T")
R = TypeVar("R")
MOST = 8
"""Threads, above which NumPy's own share of the work holds them up."""


def threads() -> int:
    """Cores of this process, at most `MOST`; one in a worker, whose siblings have the others."""
    own = getattr(os, "sched_getaffinity", lambda _: range(os.cpu_count() or 1))  # Linux
    return 1 if parent_process() is not None else min(MOST, len(own(0)))


def each(function: Callable[[T], R], parts: Iterable[T]) -> list[R]:
    """The function's value for each part, in their order, the same for any number of threads."""
    listed = list(parts)
    if (count := min(threads(), len(listed))) < 2:
        return [function(part) for part in listed]
    with ThreadPoolExecutor(count) as pool:
        return list(pool.map(function, listed))
