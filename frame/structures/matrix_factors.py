"""Factors of a structure's arrays: numbers, parameter names, smooth functions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from alphacut.frame.calculus.jet import Jet, variables


def require_factors(kind: str, terms: Any, parameters: Mapping[str, float]) -> None:
    """Refuse terms that are no pairs, and factors without derivatives.

    Args:
        kind: What the terms make up: mass, damping or stiffness.
        terms: Pairs (factor, array).
        parameters: All parameters with their modal values.

    Raises:
        ValueError: There is one.
    """
    for term in terms:
        if not isinstance(term, Sequence) or isinstance(term, str) or len(term) != 2:
            raise ValueError(
                f"{kind}: {type(term).__name__} is no term; give a list of pairs (factor, array),"
                " as [('m', array)]"
            )
        factor = term[0]
        if isinstance(factor, str) and factor not in parameters:
            raise ValueError(
                f"{kind}: factor '{factor}' is no parameter; known are {', '.join(parameters)}"
            )
        if callable(factor):
            _require_smooth(kind, factor, parameters)
        elif not isinstance(factor, str) and (
            np.ndim(factor) or np.asarray(factor).dtype.kind not in "iuf" or not np.isfinite(factor)
        ):
            raise ValueError(
                f"{kind}: factor {factor!r} is not allowed; give a number, the name of a parameter"
                " or a function of all"
            )


def _require_smooth(kind: str, factor: Any, parameters: Mapping[str, float]) -> None:
    names, values = list(parameters), np.array([list(parameters.values())], float)
    try:
        found = factor(variables(values, names, names[:1]))
    except KeyError as unknown:
        raise ValueError(
            f"{kind}: a factor asks for {unknown}, which is no parameter; known are"
            f" {', '.join(parameters)}"
        ) from None
    except (TypeError, AttributeError, ValueError) as failure:
        cure = "use plain arithmetic, such as p['k'] ** 0.5, and frame.jet.sin, cos and exp"
        raise ValueError(
            f"{kind}: a factor cannot take parameters with derivatives ({failure}); {cure}"
        ) from None
    if not isinstance(found, Jet | float | int | np.number):
        raise ValueError(
            f"{kind}: a factor gives a {type(found).__name__}; it must give one number"
        )
