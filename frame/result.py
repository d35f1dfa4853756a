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
        """Return bounds of one output at all times, also between the time nodes.

        What the output may add within a time step is included as far as it is known.

        Args:
            column: Index of the output.

        Returns:
            The smallest lower bound over time, the largest upper bound, and the largest error at a
            node plus the largest addition within a step (NaN for an unknown error), shape
            (levels,) each.
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
        """Return a copy in which no value counts as attained, for inputs that enclose a set.

        If the box of the inputs was only drawn around the set of admissible inputs, its bounds
        hold for the set, but the inputs that attain them may lie outside the set. Attained bounds
        `inner` and their error become None, the inputs that attain bounds become NaN, and upper
        bounds of the smallest peaks become +∞. Guaranteed bounds stay.
        """
        found = replace(super().without_attained(), attained_error=None)
        if self.least_peaks is not None:
            unknown = np.full_like(self.least_peaks.upper, np.inf)
            found = replace(found, least_peaks=Ends(self.least_peaks.lower, unknown))
        if self.searched_peaks is not None:
            found = replace(found, searched_peaks=self.searched_peaks.without_attained())
        return found

    def to_dataset(self) -> xarray.Dataset:
        """Return the envelope as an xarray dataset, ready for NetCDF.

        The variables `lower`, `upper` and `error` have the axes (alpha, time, output), the inputs
        that attain the bounds, `lower_at` and `upper_at`, a further axis parameter; `nature` and
        `label` are guarantee and name of each output. As far as they are known, there are also:

        - `inner_lower`, `inner_upper`: attained bounds; `proved_lower`, `proved_upper`: guaranteed
          bounds; (alpha, time, output);
        - `between`: what an output may add to the larger end of the step before a node, and
          `attained_error`: error of the attained bounds; (time, output);
        - `least_peak_proved`, `least_peak_reached`: lower bound of the smallest peak, and a peak
          that some response does not exceed; (alpha, output);
        - the structures that tested guaranteed bounds with their own axes, and, beside them, `cut`:
          the ends of each input; (alpha, parameter, end).

        The attribute `units` of a variable is the SI unit that all outputs share, "SI, by output"
        if they have different ones, and "SI, by parameter" for inputs. Method, cost, notes and the
        numbers in `facts` are attributes of the dataset.
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

        # NetCDF has one attribute for all outputs of a variable, so that only a unit that all
        # share can be written there.
        units = sorted(set(self.units)) or ["SI"]
        unit = units[0]
        if len(units) > 1:
            unit = "SI, by output"
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
        between: By how much the function may exceed the larger of its values at both ends of the
            step before each node, 0 or more, shape (times,) or that of `size`; the entry of the
            first node is not used. None if nothing is to be added.

    Returns:
        Upper bounds over the step before each node with both its ends, shape (…, times). Before
        the first node there is no step, and its entry is the bound at this node. If `between` is
        None, it is `size` itself: the bounds at the nodes alone.
    """
    if between is None:
        return size
    # Within a step the function exceeds the larger end by `between` at most.
    inside = np.maximum(size[..., 1:], size[..., :-1]) + between[..., 1:]
    return np.concatenate([size[..., :1], inside], axis=-1)
