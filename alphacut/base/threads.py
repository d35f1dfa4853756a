"""Pools of threads that call compiled kernels."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor


class KernelThreads(ThreadPoolExecutor):
    """A pool of threads whose compiled kernels have been called before it has a thread.

    At each call of a kernel Numba looks the types of its arguments up in a table of the process.
    Tuples and Booleans of a new type are added there, while other threads may run. Debian's build
    of Numba 0.61 ends the process where two threads add the same type at once ("_hashtable.cpp …
    Assertion `entry == NULL' failed"); other builds drop the assertion.

    Args:
        workers: Largest number of threads.
        call_kernels: Function that calls each kernel of the tasks that takes such arguments once,
            with arguments of the same types. It is called here, by the thread that makes the pool.
    """

    def __init__(self, workers: int, call_kernels: Callable[[], object]) -> None:
        call_kernels()
        super().__init__(workers)
