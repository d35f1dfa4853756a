"""Envelopes: α-cut bounds of the outputs of a structure over time (eq. 20)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Self

import numpy as np

from alphacut.base.arrays import Array
from alphacut.fuzzy.result import Bounds, Ends, Extremes

if TYPE_CHECKING:
    import xarray

__all__ = ["Ends", "Envelope"]


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Envelope(Bounds):
    """Discrete fuzzy mapping of the outputs: `Bounds` at time nodes, and what lies between them.

    Args:
        between: By how much an output may exceed the bounds at both ends of the step before each
            node within the step, shape (times, outputs), in the units of the outputs. It is
            guaranteed if the bounds are, and otherwise estimated from some responses; None if it
            was not determined.
        attained_error: By how much the exact response at `lower_at` and `upper_at` may exceed the
            attained bounds `inner`, shape (times, outputs); None for rounding alone.
        least_peaks: Guaranteed lower bound of the smallest peak of each output over each cut, and a
            peak that some response does not exceed, at all times, shape (levels, outputs) each;
            None if nothing more is known than the bounds say.
        searched_peaks: Bounds of the largest magnitude of each output, shape (levels, outputs), if
            the peaks themselves were searched; None if nothing more is known than the bounds say.
        facts: Further numbers by name. A length is that of the first displacement (of the first
            output if there is none), or a fraction of each peak if the tolerance is relative.
            `step_error`: what time stepping adds; `gain`: predicted gain that is worth a
            trajectory; `model_error`, `degree`: of the polynomials of the modes; `gap`, `boxes`,
            `parts`: of a proof; `estimated_error`: the largest error, not for attained bounds, for
            which it is not known how far other responses go; `between_nodes`: the largest value of
            `between`; `motions_tested`: exact responses that were compared with guaranteed bounds.
        tested_structures: The structures of these responses as arrays with axes, for `alphacut
            verify`.
    """

    time: Array
    between: Array | None = None
    attained_error: Array | None = None
    least_peaks: Ends | None = None
    searched_peaks: Bounds | None = None
    facts: Mapping[str, float] = field(default_factory=dict)
    tested_structures: Mapping[str, tuple[tuple[str, ...], Array]] = field(default_factory=dict)

    def extremes_over_time(self, column: int) -> Extremes:
        """Return bounds of the output with an index at all times, and their largest error.

        The error is that at the nodes, and what the steps between them add.
        """
        error = self.error[..., column].max(axis=1)
        between = None
        if self.between is not None:
            between = self.between[:, column]
            error = error + between.max()
        return Extremes(
            lower=-within_steps(-self.lower[..., column], between).max(axis=1),
            upper=within_steps(self.upper[..., column], between).max(axis=1),
            error=error,
        )

    def without_attained(self) -> Self:
        """Return the bounds without attained values, as `Bounds.without_attained` does.

        Nor is it known which responses of the enclosed set have small peaks.
        """
        found = replace(super().without_attained(), attained_error=None)
        if self.least_peaks is not None:
            unknown = np.full_like(self.least_peaks.upper, np.inf)
            found = replace(found, least_peaks=Ends(self.least_peaks.lower, unknown))
        if self.searched_peaks is not None:
            found = replace(found, searched_peaks=self.searched_peaks.without_attained())
        return found

    def to_dataset(self) -> xarray.Dataset:
        """Return the envelope as an xarray dataset with units, ready for NetCDF.

        To the variables of `Bounds` it adds attained and guaranteed bounds, deviations between the
        nodes, smallest peaks and the structures of the self-test, as far as they are known.
        """
        dataset = super().to_dataset()
        band = ("alpha", "time", "output")
        peaks = ("alpha", "output")
        deviation = ("time", "output")
        if self.inner is not None:
            dataset["inner_lower"] = (band, self.inner.lower)
            dataset["inner_upper"] = (band, self.inner.upper)
        if self.outer is not None:
            dataset["proved_lower"] = (band, self.outer.lower)
            dataset["proved_upper"] = (band, self.outer.upper)
        if self.between is not None:
            dataset["between"] = (deviation, self.between)
        if self.least_peaks is not None:
            dataset["least_peak_proved"] = (peaks, self.least_peaks.lower)
            dataset["least_peak_reached"] = (peaks, self.least_peaks.upper)
        if self.attained_error is not None:
            dataset["attained_error"] = (deviation, self.attained_error)

        units = sorted(set(self.units)) or ["SI"]
        # One attribute serves all outputs of a variable.
        unit = units[0] if len(units) == 1 else "SI, by output"
        for name in set(dataset.data_vars) - {"nature", "label"}:
            is_input = name in ("lower_at", "upper_at")
            dataset[name].attrs["units"] = "SI, by parameter" if is_input else unit
        dataset["time"].attrs["units"] = "s"
        if self.tested_structures:
            cuts = [[number.cut(float(a)) for number in self.inputs.values()] for a in self.alpha]
            dataset["cut"] = (("alpha", "parameter", "end"), np.array(cuts, float))
            dataset = dataset.assign(self.tested_structures)
        return dataset.assign_attrs(
            nature=str(self.nature),
            notes="; ".join(self.notes),
            trajectories=self.evaluations,
            **self.facts,
        )


def within_steps(size: Array, between: Array | None) -> Array:
    """Return upper bounds of a function over the time step before each node.

    Args:
        size: Upper bound of the function at the nodes, shape (…, times).
        between: By how much the function may exceed both ends of each step, shape (times,) or that
            of `size`; None for nothing.

    Returns:
        Upper bounds, shape (…, times). The first one is that at the first node.
    """
    if between is None:
        return size
    # Within a step the function exceeds the larger end by `between` at most.
    inside = np.maximum(size[..., 1:], size[..., :-1]) + between[..., 1:]
    return np.concatenate([size[..., :1], inside], axis=-1)
