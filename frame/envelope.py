"""Envelopes: α-cut bounds of the outputs over time (eq. 20)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Self

import numpy as np

from alphacut.base.arrays import Array
from alphacut.fuzzy.result import Bounds, Ends

if TYPE_CHECKING:
    import xarray

__all__ = ["Ends", "Envelope"]


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Envelope(Bounds):
    """Discrete fuzzy mapping of the outputs: `Bounds` at the nodes, with what lies between them.

    Args:
        between: What an output may exceed the bounds at both ends of the step to a node by, within
            the step, shape (T, m), in the units of the outputs: proved where the bounds are
            guaranteed, else estimated from some trajectories. None where none was made.
        attained_error: What the exact motion at `lower_at` and `upper_at` may exceed the attained
            bounds `inner` by, shape (T, m); None for rounding alone.
        least_peaks: Proved lower bound of the smallest peak of the output in each cut, and the
            smallest that some motion does not exceed, between nodes too, each (A, m); None for what
            the bounds say.
        searched_peaks: Bounds of the largest magnitude of each output, (A, m), where peaks were
            searched for themselves; None for what the bounds say.
        facts: Further numbers by name. A length is that of the first displacement, of the first
            output where none is one, and a share of each peak where the tolerance was relative.
            `step_error`: what time stepping adds; `gain`: predicted gain worth a graph;
            `model_error`, `degree`: of the polynomials of the modes; `gap`, `boxes`, `parts`: of a
            proof; `estimated_error`: the largest error, not of attained bounds, of which it is not
            known how far other motions go; `between_nodes`: the largest value of `between`;
            `motions_tested`: exact motions that were compared with proved bounds.
        tested_structures: Their structures as arrays with axes, for `alphacut verify`.
    """

    time: Array
    between: Array | None = None
    attained_error: Array | None = None
    least_peaks: Ends | None = None
    searched_peaks: Bounds | None = None
    facts: Mapping[str, float] = field(default_factory=dict)
    tested_structures: Mapping[str, tuple[tuple[str, ...], Array]] = field(default_factory=dict)

    def _extremes(self, column: int) -> tuple[Array, Array, Array]:
        """Return bounds of an output over time, and their error, (A,) each."""
        between = None if self.between is None else self.between[:, column]
        lower = -within_steps(-self.lower[..., column], between).max(axis=1)
        upper = within_steps(self.upper[..., column], between).max(axis=1)
        # of those at the nodes, and what the steps between them add
        error, added = (
            self.error[..., column].max(axis=1),
            0.0 if between is None else between.max(),
        )
        return lower, upper, error + added

    def without_attained(self) -> Self:
        """As of `Bounds`; nor is it known which motions of the enclosed set have small peaks."""
        found, least, searched = super().without_attained(), self.least_peaks, self.searched_peaks
        return replace(
            found,
            attained_error=None,
            least_peaks=least and Ends(least.lower, np.full_like(least.upper, np.inf)),
            searched_peaks=searched and searched.without_attained(),
        )

    def to_dataset(self) -> xarray.Dataset:
        """Return the envelope as an xarray dataset with units, ready for NetCDF.

        To the variables of `Bounds` it adds inner and proved bounds, deviations between nodes,
        smallest peaks and the structures of the self-test, where there are any.
        """
        dataset = super().to_dataset()
        band = ("alpha", "time", "output")
        for kind, pair in (("inner", self.inner), ("proved", self.outer)):
            for end, values in zip(Ends._fields, pair or (), strict=False):
                dataset[f"{kind}_{end}"] = (band, values)
        if self.between is not None:
            dataset["between"] = (("time", "output"), self.between)
        if self.least_peaks is not None:
            for end, values in zip(("proved", "reached"), self.least_peaks, strict=True):
                dataset[f"least_peak_{end}"] = (("alpha", "output"), values)
        if self.attained_error is not None:
            dataset["attained_error"] = (("time", "output"), self.attained_error)
        dataset["time"].attrs["units"] = "s"
        units = sorted(set(self.units)) or ["SI"]
        for name in set(dataset.data_vars) - {"lower_at", "upper_at", "nature", "label"}:
            dataset[name].attrs["units"] = units[0] if len(units) == 1 else "SI, by output"
        for name in ("lower_at", "upper_at"):
            dataset[name].attrs["units"] = "SI, by parameter"
        if self.tested_structures:
            ends = [[number.cut(float(a)) for number in self.inputs.values()] for a in self.alpha]
            dataset["cut"] = (("alpha", "parameter", "end"), np.array(ends, float))
            dataset = dataset.assign(self.tested_structures)
        notes: dict[str, str | int] = {"nature": str(self.nature), "notes": "; ".join(self.notes)}
        notes["trajectories"] = self.evaluations
        return dataset.assign_attrs(notes | dict(self.facts))


def within_steps(size: Array, between: Array | None) -> Array:
    """Return upper bounds of a function over the step before each node, shape (…, T).

    `size` is an upper bound at nodes, shape (…, T), and `between` what it may exceed both ends of
    each step by, the same shape; None for nothing.
    """
    if between is None:
        return size
    inside = np.maximum(size[..., 1:], size[..., :-1]) + between[..., 1:]
    return np.concatenate([size[..., :1], inside], axis=-1)
