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
    if parent_process() is not None:
        return 1
    here = hasattr(os, "sched_getaffinity")  # Linux
    return min(MOST, len(os.sched_getaffinity(0)) if here else os.cpu_count() or 1)


def each(function: Callable[[T], R], parts: Iterable[T]) -> list[R]:
    """The function's value for each part, in their order, the same for any number of threads."""
    listed, count = list(parts), threads()
    if count == 1 or len(listed) < 2:
        return [function(part) for part in listed]
    with ThreadPoolExecutor(min(count, len(listed))) as pool:
        return list(pool.map(function, listed))
