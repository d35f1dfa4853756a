"""Interface of the cell's models, the table of their names, and their cross-check."""

from __future__ import annotations

from collections.abc import Sequence
from importlib import import_module
from typing import Any, Protocol

from alphacut.fuzzy.refused import FailedError, RefusedError
from alphacut.rve.result import Homogenised
from alphacut.stochastic import RadiusMap

MODELS = {  # name → module and class, imported when named
    "prism": ("alphacut.rve.prism.model", "PrismModel"),
    "slices": ("alphacut.rve.slices.model", "SlicesModel"),
    "series": ("alphacut.rve.series.model", "SeriesModel"),
}


class Model(Protocol):
    """A way to homogenise the cell; a frozen dataclass of its resolution."""

    @property
    def name(self) -> str:
        """Name in `MODELS`."""

    def solve(
        self, radius_map: RadiusMap, matrix: Any, inclusions: Sequence[Any]
    ) -> list[Homogenised]:
        """One result for each of `inclusions`, in their order; what they share is done once.

        Raises:
            FailedError: The model does not reach what it declares.
        """


def named(name: str, **options: object) -> Model:
    """The model called `name` with its own options, e.g. ``named("slices", order=3)``.

    Raises:
        RefusedError: No such model, no such option of it, or a value out of range.
    """
    if name not in MODELS:
        raise RefusedError("model", repr(name), ", ".join(MODELS))
    module, kind = MODELS[name]
    maker = getattr(import_module(module), kind)
    unknown = sorted(set(options) - set(maker.__dataclass_fields__))
    if unknown:
        raise RefusedError(f"option of {name}", unknown[0], ", ".join(maker.__dataclass_fields__))
    model: Model = maker(**options)
    return model


def cross_check(
    first: Sequence[Homogenised], second: Sequence[Homogenised], *, tolerance: float
) -> float:
    """The largest relative difference in E between two models' results of the same cells.

    Raises:
        RefusedError: Both are results of one model.
        FailedError: The difference is above `tolerance`.
    """
    same = {a.method for a in first} & {b.method for b in second}
    if same:
        raise RefusedError("models of a cross-check", min(same), "results of two models")
    gaps = [abs(a.modulus - b.modulus) / abs(b.modulus) for a, b in zip(first, second, strict=True)]
    worst = max(range(len(gaps)), key=gaps.__getitem__)
    if not gaps[worst] <= tolerance:
        a, b = first[worst], second[worst]
        raise FailedError(
            f"{a.method} gives E = {a.modulus:.10g} Pa and {b.method} {b.modulus:.10g} Pa:"
            f" {gaps[worst]:.2e} apart, {tolerance:.2e} is allowed",
            "refine the coarser of the two or allow more",
        )
    return gaps[worst]
