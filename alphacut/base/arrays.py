"""Types of NumPy arrays for all packages, and a decorator for BLAS on one thread."""

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
    """Decorate a function so that BLAS uses one thread while it runs.

    The result then has the same bits on every machine with the same libraries. With more threads
    BLAS divides its sums in other ways, and an optimisation or a proof turns the rounding into
    differences of 1e-9. Products of small matrices are also several times slower with them.
    """

    @wraps(function)
    def wrapper(*args: P.args, **kwargs: P.kwargs) -> T:
        with _thread_pools(len(sys.modules)).limit(limits=1, user_api="blas"):
            return function(*args, **kwargs)

    return wrapper


@lru_cache(maxsize=1)
def _thread_pools(_modules: int) -> "ThreadpoolController":
    """Return a controller of the libraries in this process that have threads, such as OpenBLAS.

    Looking for them takes 20 ms, so that the last controller is cached. They are looked for again
    where the number of loaded modules has changed, since a new module may have brought a library.

    Args:
        _modules: Number of loaded modules; it only decides whether the cached one is returned.
    """
    from threadpoolctl import ThreadpoolController

    return ThreadpoolController()
