"""Check that given values are lists of numbers."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from alphacut.fuzzy.refused import real, require


def require_numbers(name: str, values: object) -> None:
    """Refuses what is no sequence of real and finite numbers.

    Raises:
        RefusedError: It is a text or a single number, or holds something else.
    """
    listed = isinstance(values, Collection) and not isinstance(values, str)
    require(listed, name, repr(values), "a list of numbers")
    for value in np.ravel(values).tolist() if isinstance(values, np.ndarray) else values:  # type: ignore[attr-defined]
        real(name, value)
