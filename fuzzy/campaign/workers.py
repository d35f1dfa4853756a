"""Executors of samples (this process, a pool, or the caller's own) and the memory they need."""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Callable, Iterator
from concurrent.futures import BrokenExecutor, Executor, Future
from contextlib import contextmanager, suppress
from numbers import Integral
from pathlib import Path
from time import sleep
from typing import ParamSpec, TypeVar

P = ParamSpec("P")
T = TypeVar("T")
_WATCH = 0.2  # seconds between looks at the parent
_GROUP = [signal.SIGHUP] if hasattr(signal, "SIGHUP") else []  # not on Windows


class ProcessPool(Executor):
    """Fresh processes of this machine that end with this one and are replaced when they die.

    Functions go to them by value where they cannot be imported: those of a notebook, too.

    Args:
        workers: How many.
    """

    def __init__(self, workers: int) -> None:
        self._max_workers = workers
        self._inner = _processes(workers)

    def submit(self, fn: Callable[P, T], /, *args: P.args, **kwargs: P.kwargs) -> Future[T]:
        """Run a call in one of the processes, new ones if one of them has died."""
        try:
            return self._inner.submit(fn, *args, **kwargs)
        except BrokenExecutor:
            self.stop()
            self._inner = _processes(self._max_workers)
            return self._inner.submit(fn, *args, **kwargs)

    def alone(self, fn: Callable[P, T], /, *args: P.args, **kwargs: P.kwargs) -> T:
        """Run one call in a process of its own, which may die.

        Raises:
            BrokenExecutor: It died.
        """
        with _processes(1) as executor:
            return executor.submit(fn, *args, **kwargs).result()

    def stop(self) -> None:
        """End the processes in the middle of what they do: nobody waits for it any more."""
        for process in list(getattr(self._inner, "_processes", None) or {}):
            with suppress(ProcessLookupError):
                os.kill(process, signal.SIGTERM)

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """End the processes."""
        self._inner.shutdown(wait)


def _processes(workers: int) -> Executor:
    from joblib.externals.loky import ProcessPoolExecutor

    # loky's tracker of semaphores begins here and inherits what is blocked: it must outlive this
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, _GROUP) if _GROUP else None
    try:
        made: Executor = ProcessPoolExecutor(
            workers, initializer=_end_with_parent, initargs=(os.getpid(),)
        )
    finally:
        if mask is not None:
            signal.pthread_sigmask(signal.SIG_SETMASK, mask)
    return made


@contextmanager
def pool(workers: int) -> Iterator[Executor | None]:
    """A pool of `workers` processes, or None where one process does everything.

    Under `python -m mpi4py.futures` it is the pool of all MPI processes instead, whatever `workers`
    says.

    Raises:
        ValueError: `workers` is no whole number from 1.
    """
    require_workers(workers)
    if {"mpi4py.run", "mpi4py.futures"} <= sys.modules.keys():
        from mpi4py.futures import MPIPoolExecutor

        with MPIPoolExecutor() as executor:
            yield executor
    elif workers == 1:
        yield None
    else:
        processes = ProcessPool(int(workers))
        try:
            yield processes
        except BaseException:
            processes.stop()
            raise
        finally:
            processes.shutdown()


def submitted(
    executor: Executor | None, function: Callable[P, T], /, *args: P.args, **kwargs: P.kwargs
) -> Future[T]:
    """A call in one of the executor's processes, or done here and now where there is none."""
    if executor is not None:
        return executor.submit(function, *args, **kwargs)
    done: Future[T] = Future()
    done.set_result(function(*args, **kwargs))
    return done


def require_workers(workers: object) -> None:
    """Workers are a number of processes.

    Raises:
        ValueError: It is no whole number from 1.
    """
    if not isinstance(workers, Integral) or workers < 1:
        raise ValueError(
            f"the number of workers is {workers!r}; it must be a whole number, 1 or more"
        )


def require_executor(executor: object, workers: int) -> None:
    """An executor is one of `concurrent.futures`, and stands instead of workers.

    Raises:
        ValueError: It is something else, or both are given.
    """
    if executor is not None and not isinstance(executor, Executor):
        raise ValueError(
            f"the executor is a {type(executor).__name__}; it must be one of concurrent.futures"
            " (of a client of dask: client.get_executor())"
        )
    if executor is not None and workers != 1:
        raise ValueError("workers and an executor are both given; give one")


def _end_with_parent(parent: int) -> None:
    """Leave when the process that started this one is gone: a killed campaign leaves no orphans."""
    from threading import Thread

    # These reach the whole group; the parent decides
    for number in (signal.SIGINT, *_GROUP):
        signal.signal(number, signal.SIG_IGN)

    def watch() -> None:
        while os.getppid() == parent:
            sleep(_WATCH)
        os._exit(1)

    Thread(target=watch, daemon=True).start()


_NUMBER = 8  # bytes
_COPIES = 3  # a plan holds its samples, their sorted copy and the result's
_SMALL = 50_000_000  # bytes not worth a look
_SHARE = 0.9  # of what is free


class TooLargeError(ValueError):
    """A campaign needs more memory than there is."""


def available() -> int:
    """Bytes that this process may still take."""
    free = [_meminfo()]
    try:
        limit = Path("/sys/fs/cgroup/memory.max").read_text().strip()
        used = int(Path("/sys/fs/cgroup/memory.current").read_text())
        free += [int(limit) - used] if limit != "max" else []
    except (OSError, ValueError):
        pass
    return min(free)


def _meminfo() -> int:
    try:
        lines = dict(line.split(":", 1) for line in Path("/proc/meminfo").read_text().splitlines())
        return int(lines["MemAvailable"].split()[0]) * 1024
    except (OSError, KeyError, ValueError):
        return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")


def needed(samples: int, columns: int) -> int:
    """Bytes for so many samples of so many inputs and outputs."""
    return samples * columns * _NUMBER * _COPIES


def require(samples: int, columns: int) -> None:
    """Refuse a campaign that does not fit, before it starts.

    Args:
        samples: Samples of the campaign.
        columns: Inputs and outputs of each.

    Raises:
        TooLargeError: It does not fit.
    """
    what = f"{samples:,} samples of {columns} inputs and outputs"
    cure = "take fewer levels, a plan with fewer samples (reduced, signed), or fewer outputs"
    require_bytes(needed(samples, columns), what, cure)


def require_bytes(need: int, what: str, cure: str) -> None:
    """Refuse what does not fit, before it starts.

    Args:
        need: Bytes.
        what: They are for.
        cure: What to do else.

    Raises:
        TooLargeError: It does not fit.
    """
    if need > _SMALL and need > _SHARE * (free := available()):
        size = f"{need / 1e9:.3g} GB of memory and {free / 1e9:.3g} GB are free"
        raise TooLargeError(f"{what} need {size}; {cure}")
