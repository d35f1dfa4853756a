"""Types of NumPy arrays, for all packages, and BLAS on one thread."""

import sys
from collections.abc import Callable
from functools import lru_cache, wraps
from typing import TYPE_CHECKING, ParamSpec, TypeVar

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from threadpoolctl import ThreadpoolController

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
        with _thread_pools(len(sys.modules)).limit(limits=1, user_api="blas"):
            return function(*args, **kwargs)

    return wrapper


@lru_cache(maxsize=1)
def _thread_pools(_modules: int) -> "ThreadpoolController":
    """The libraries with threads; looked for (20 ms) again when more modules are loaded."""
    from threadpoolctl import ThreadpoolController

    return ThreadpoolController()
