"""Interface of the cell's models, the table of their names, and their cross-check."""

from __future__ import annotations

from collections.abc import Sequence
from importlib import import_module
from typing import Protocol

from alphacut.rve.cell import Phase
from alphacut.rve.result import Homogenised
from alphacut.stochastic import RadiusMap

MODELS = {  # name → module and class; imported when asked for, so that none is paid for in vain
    "prism": ("alphacut.rve.prism.model", "PrismModel"),
    "slices": ("alphacut.rve.slices.model", "SlicesModel"),
    "table": ("alphacut.rve.table.model", "TableModel"),
    "series": ("alphacut.rve.series.model", "SeriesModel"),
    "image": ("alphacut.rve.image.round_particle", "RasterModel"),
    "auto": ("alphacut.rve.auto.model", "AutoModel"),
}

SPHERES = "alphacut.rve.spheres.series.model.SphereSeriesModel(), its solve takes the same"


class Model(Protocol):
    """A way to homogenise the cell; a frozen dataclass of its resolution."""

    @property
    def name(self) -> str:
        """Name in `MODELS`."""

    def solve(
        self, radius_map: RadiusMap, matrix: Phase, inclusions: Sequence[Phase]
    ) -> list[Homogenised]:
        """One result for each of `inclusions`, in their order; what they share is done once.

        Raises:
            RuntimeError: The model does not reach what it declares; the message says why and what
                would help.
        """


def named(name: str, **options: object) -> Model:
    """The model called `name` with its own options, e.g. ``named("slices", order=3)``.

    Raises:
        ValueError: No such model, no such option of it, or a value out of range.
    """
    if name not in MODELS:
        ball = f"; spheres are solved by {SPHERES}" if "sphere" in str(name) else ""
        raise ValueError(f"the model is {name!r}; known models are {', '.join(MODELS)}{ball}")
    module, cls = MODELS[name]
    maker = getattr(import_module(module), cls)
    unknown = sorted(set(options) - set(maker.__dataclass_fields__))
    if unknown:
        allowed = ", ".join(maker.__dataclass_fields__)
        raise ValueError(
            f"the model {name} has no option {unknown[0]!r}; its options are {allowed}"
            + (f"; spheres are solved by {SPHERES}" if unknown[0] == "particles" else "")
        )
    model: Model = maker(**options)
    return model


class CrossCheckError(RuntimeError):
    """Two models of the same cell disagree."""


def cross_check(
    first: Sequence[Homogenised], second: Sequence[Homogenised], *, tolerance: float
) -> float:
    """The largest relative difference in E between two models' results of the same cells.

    Raises:
        ValueError: Both are results of one model.
        CrossCheckError: The difference is above `tolerance`.
    """
    same = {a.method for a in first} & {b.method for b in second}
    if same:
        raise ValueError(f"cross_check: both results are of the model {min(same)}; take two models")
    gaps = [abs(a.modulus - b.modulus) / abs(b.modulus) for a, b in zip(first, second, strict=True)]
    worst = max(range(len(gaps)), key=gaps.__getitem__)
    if not gaps[worst] <= tolerance:
        a, b = first[worst], second[worst]
        raise CrossCheckError(
            f"{a.method} gives E = {a.modulus:.10g} Pa and {b.method} {b.modulus:.10g} Pa:"
            f" {gaps[worst]:.2e} apart, {tolerance:.2e} is allowed; refine the coarser of the two"
            " or allow more"
        )
    return gaps[worst]
