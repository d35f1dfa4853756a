"""BLAS on one thread, for results that are the same bits on any machine setting.

With more threads BLAS splits its sums otherwise and rounds otherwise, which an optimisation or a
proof turns into differences of 1e-9; small matrices are also several times slower with them.
"""

from collections.abc import Callable
from functools import wraps
from typing import ParamSpec, TypeVar

from threadpoolctl import threadpool_limits

P = ParamSpec("P")
T = TypeVar("T")


def on_one_blas_thread(function: Callable[P, T]) -> Callable[P, T]:
    """Decorator: BLAS uses one thread while the function runs."""

    @wraps(function)
    def wrapper(*args: P.args, **kwargs: P.kwargs) -> T:
        with threadpool_limits(limits=1, user_api="blas"):
            return function(*args, **kwargs)

    return wrapper
