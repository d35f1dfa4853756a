"""Types of NumPy arrays, for all packages, and BLAS on one thread."""

from collections.abc import Callable
from functools import wraps
from typing import ParamSpec, TypeVar

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Ints = NDArray[np.intp]
P = ParamSpec("P")
T = TypeVar("T")


def on_one_blas_thread(function: Callable[P, T]) -> Callable[P, T]:
    """Decorator: BLAS uses one thread while the function runs, so that its result is the same bits.

    With more threads BLAS splits its sums otherwise, and an optimisation or a proof turns the
    rounding into differences of 1e-9. Small matrices are also several times slower with them.
    """

    @wraps(function)
    def wrapper(*args: P.args, **kwargs: P.kwargs) -> T:
        from threadpoolctl import threadpool_limits

        with threadpool_limits(limits=1, user_api="blas"):
            return function(*args, **kwargs)

    return wrapper
