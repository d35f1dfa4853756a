"""Envelopes: α-cut bounds of the outputs over time, where attained, at what cost."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from alphacut.frame.calculus.jet import Array
from alphacut.frame.structures.quantities import Output
from alphacut.fuzzy.drawing import draw_bands, new_axes
from alphacut.fuzzy.tables import html_table, write_csv

if TYPE_CHECKING:
    import xarray
    from matplotlib.axes import Axes

    from alphacut.frame.boxes import UnitFlow


def error_name(*, inside: bool) -> str:
    """What the error of certified bounds, which hold it, and that of others are called."""
    return "error within the bounds" if inside else "error to be added"


@dataclass(frozen=True, eq=False, repr=False)
class Envelope:
    """Discrete fuzzy mapping of an output quantity (eq. 20).

    Args:
        alpha: Levels, rising, shape (A,).
        time: Nodes, shape (T,), in s.
        outputs: Names of the observed quantities, m of them.
        parameters: Names of the uncertain parameters, d of them.
        lower: Lower bounds of the nature stated below, shape (A, T, m), in SI units; of a certified
            envelope the proved ones.
        upper: Upper bounds, shape (A, T, m).
        lower_at: Parameters that reach the lower bounds, of a certified envelope `inner_lower`,
            shape (A, T, m, d), in SI units.
        upper_at: Parameters that reach the upper bounds, shape (A, T, m, d).
        method: Name of the method.
        nature: "inner": attained by the given parameters; "estimated": with `error`; "searched":
            with `error`, but that no better optimum is left rests on samples alone: more than six
            parameters, motion that is not linear, modes without polynomials that lead, or nodes far
            apart; "verified by sampling" or "guaranteed": certified.
        trajectories: Number of trajectories (or eigen-analyses) computed.
        seconds: Wall time of computing.
        error: Estimated envelope error, shape (A, T, m), in the units of the outputs; None where
            none was made.
        inner_lower: Of a certified envelope what `lower_at` attains at most, less what the model of
            the motion may be wrong by, so that the true lower bound lies between `lower` and this;
            shape (A, T, m). None without a certificate.
        inner_upper: The same for the upper bound. Where it lies below `inner_lower`, no width is
            proved.
        between: What an output may exceed the bounds at both ends of the step to a node by, within
            the step, shape (T, m), in the units of the outputs: proved where the bounds are
            guaranteed, else estimated from some trajectories. None where none was made.
        proved_lower: Guaranteed lower bounds of the exact motion beside those of a Graph Follower,
            shape (A, T, m); None without.
        proved_upper: The same, upper bounds.
        facts: Further numbers and words by name, see below.

    The facts that are there depend on the method. "The unit" is that of the first displacement
    among the outputs, else of the first output; where the tolerance was relative, it is a share of
    each output's peak.

    - integrator: Name of the time stepping. step_error: Estimate of what it is wrong by, from the
      modal parameters and the widest box's corners, in the unit of the first displacement; added to
      `error`, for each output in its own unit, where that was estimated.
    - dominant_error: Said where time stepping adds more to an output than the search.
    - gain: What the Graph Follower computed a graph for, in the unit.
      judged_by: What `error` was found with, where the method itself has no estimate.
      order: Degree of its Taylor models.
      corners: Trajectories at corners, beside `trajectories`.
    - degree: Of the polynomials of the modes. model_error: What trajectories of theirs are wrong by
      at most at held-out parameters, the optima found and the corners of the box, over all outputs;
      of a certified envelope the bound that went into it, in the unit.
    - search_error: What the search may have missed, at most, in the unit: what Newton's method
      still promises and three times what the last independent pass gained; the rest of `error` is
      that of the polynomials and of time stepping.
    - estimated_error: Largest error, in the unit. second_pass: By how much the bounds
      of two passes that share no starting points differ, in the unit.
    - gap: Largest distance of attained and proved bounds, in the unit, which is that of gap_output.
      proved_gap: The same of the proved bounds beside a Graph Follower's.
      boxes: Parts of the parameters' box that the proof looked at, a count.
      unproved: Why the bounds of a linear structure are not guaranteed.
      kernel: What examined them, C or NumPy. proof: What is proved and what sampled.
    - between_nodes: Largest value of `between`, in the unit.
    - claim: What the cuts claim of how often they hold, and which parameters are opinions.
    - reason: Why the method was taken, or what it fell short of.
    """

    alpha: Array
    time: Array
    outputs: tuple[str, ...]
    parameters: tuple[str, ...]
    lower: Array
    upper: Array
    lower_at: Array
    upper_at: Array
    method: str
    nature: str
    trajectories: int
    seconds: float
    error: Array | None = None
    inner_lower: Array | None = None
    inner_upper: Array | None = None
    between: Array | None = None
    proved_lower: Array | None = None
    proved_upper: Array | None = None
    facts: Mapping[str, float | str] = field(default_factory=dict)

    def __repr__(self) -> str:
        """Summary in a few lines: outputs, time, lowest level, method, error."""
        span = f"{self.time[0]:g} … {self.time[-1]:g} s ({len(self.time)} nodes)"
        levels = ", ".join(f"{a:g}" for a in self.alpha)
        lines = [
            f"Envelope of {', '.join(self.outputs)} over {span}, α = {levels}, uncertain"
            f" {', '.join(self.parameters)}"
        ]
        for k, name in enumerate(self.outputs):
            unit = _unit(name)
            error = (
                "" if self.error is None else f", error up to {self.error[..., k].max():.2g}{unit}"
            )
            ends = np.array([self.minimum[0, k], self.maximum[0, k]])
            low, high = np.where(np.abs(ends) > 1e-9 * np.abs(ends).max(), ends, 0.0)
            lines.append(f"  {name}: {low:.6g} … {high:.6g}{unit} at α = {self.alpha[0]:g}{error}")
        count = (
            f"{self.trajectories} {'eigen-analyses' if self.method == 'modal' else 'trajectories'}"
        )
        cost = f"  {self.method}: {count}, {self.seconds:.2g} s, {self._natured()}"
        claim = [f"  {self.facts['claim']}"] if "claim" in self.facts else []
        return "\n".join([*lines, cost, *claim])

    def _natured(self) -> str:
        """Nature of the bounds, where they hold, and what the steps between may add."""
        said = f"bounds {self.nature} at nodes every {self.time[1] - self.time[0]:.6g} s"
        more = [] if self.between is None else self.between.max(0).tolist()
        peak = 0.01 * np.maximum(self.maximum, -self.minimum).max(0)
        least = peak if self.error is None else np.maximum(peak, self.error.max((0, 1)))
        told = [
            f"{high:.3g}{_unit(name)} more" + (f" ({name})" if len(self.outputs) > 1 else "")
            for name, high, counts in zip(self.outputs, more, least, strict=False)
            if high > counts
        ]
        return said + ("; between them up to " + ", ".join(told) if told else "")

    def _repr_html_(self) -> str:
        """Extremes over time of every output and level as a table, for notebooks."""
        rows = [
            (name, _unit(name).strip(), f"{alpha:g}", f"{low:.6g}", f"{high:.6g}")
            for k, name in enumerate(self.outputs)
            for alpha, low, high in zip(
                self.alpha, self.minimum[:, k], self.maximum[:, k], strict=True
            )
        ]
        return html_table(("output", "unit", "α", "least", "greatest"), rows, below=repr(self))

    def plot(self, output: str | None = None, axes: Axes | None = None) -> Axes:
        """Draw one output's band over time for every level (Fig. 33).

        Args:
            output: Name of the output; the last one if not given.
            axes: Where to draw; a new figure if not given.

        Returns:
            The axes drawn on.

        Raises:
            ValueError: There is no such output.
        """
        output = self.outputs[-1] if output is None else output
        if output not in self.outputs:
            raise ValueError(f"there is no output {output!r}; there are {', '.join(self.outputs)}")
        k = self.outputs.index(output)
        axes = new_axes(axes)
        draw_bands(axes, self.time, self.alpha, self.lower[..., k], self.upper[..., k])
        unit = _unit(output)
        axes.set(xlabel="time in s", ylabel=f"{output} in{unit}" if unit else output)
        axes.set_title(f"bounds {self.nature} at nodes", fontsize="medium")
        return axes

    def on_levels(self, alpha: Array, which: Array) -> Envelope:
        """The envelope on levels `alpha` (A,), each with the bounds of one of its own.

        Args:
            alpha: Levels, rising.
            which: Place of each among the own levels, shape (A,).
        """
        by_level = ["lower", "upper", "lower_at", "upper_at", "error"]
        by_level += ["inner_lower", "inner_upper", "proved_lower", "proved_upper"]
        parts = {name: getattr(self, name) for name in by_level}
        taken = {name: part[which] for name, part in parts.items() if part is not None}
        return replace(self, alpha=alpha, **taken)

    @property
    def minimum(self) -> Array:
        """Least value over time, shape (A, m)."""
        return np.asarray(self.lower.min(1))

    @property
    def maximum(self) -> Array:
        """Greatest value over time, shape (A, m)."""
        return np.asarray(self.upper.max(1))

    def to_csv(self, path: str | Path) -> None:
        """Write a CSV file with a row for each output, level and node.

        Its columns are output, unit, alpha, time [s], lower, upper, where there is one `error
        within the bounds` (certified) or `error to be added`, in the same unit, then for each
        parameter where the bounds are reached, in SI units: `NAME at lower`, `NAME at upper`.

        Args:
            path: The file; one that is there is replaced.

        Raises:
            ValueError: It cannot be written there.
        """
        places = [f"{name} at {end}" for end in ("lower", "upper") for name in self.parameters]
        bands = [self.lower, self.upper, *([] if self.error is None else [self.error])]
        numbers = np.concatenate([np.stack(bands, axis=3), self.lower_at, self.upper_at], axis=3)
        rows = (
            (name, Output(name).unit, float(alpha), float(time), *numbers[a, t, k].tolist())
            for k, name in enumerate(self.outputs)
            for a, alpha in enumerate(self.alpha)
            for t, time in enumerate(self.time)
        )
        error = error_name(inside=self.inner_lower is not None)
        bounds = ("lower", "upper", error)[: len(bands)]
        write_csv(path, ("output", "unit", "alpha", "time [s]", *bounds, *places), rows)

    def to_dataset(self) -> xarray.Dataset:
        """The envelope as an xarray dataset with units; ready for NetCDF."""
        import xarray

        band, at = ("alpha", "time", "output"), ("alpha", "time", "output", "parameter")
        data: dict[str, Any] = {name: (band, getattr(self, name)) for name in ("lower", "upper")}
        data |= {name: (at, getattr(self, name)) for name in ("lower_at", "upper_at")}
        data |= {
            name: (band, getattr(self, name))
            for name in ("error", "inner_lower", "inner_upper", "proved_lower", "proved_upper")
            if getattr(self, name) is not None
        }
        if self.between is not None:
            data["between"] = (("time", "output"), self.between)
        axes: dict[str, Any] = {"alpha": self.alpha, "time": self.time}
        axes |= {"output": list(self.outputs), "parameter": list(self.parameters)}
        counts = {"trajectories": self.trajectories, "seconds": self.seconds}
        dataset = xarray.Dataset(
            data, axes, {"method": self.method, "nature": self.nature, **counts, **self.facts}
        )
        dataset["time"].attrs["units"] = "s"
        units = sorted({Output(name).unit for name in self.outputs})
        for name in set(data) - {"lower_at", "upper_at"}:
            dataset[name].attrs["units"] = units[0] if len(units) == 1 else "SI, by output"
        for name in ("lower_at", "upper_at"):
            dataset[name].attrs["units"] = "SI, by parameter"
        return dataset


def signed_envelope(
    flow: UnitFlow,
    bounds: Array,
    at: Array,
    *,
    method: str,
    nature: str,
    trajectories: int,
    seconds: float,
    error: Array | None = None,
    between: Array | None = None,
    facts: Mapping[str, float | str] = MappingProxyType({}),
) -> Envelope:
    """Envelope from upper bounds of (−output, output), (A, T, m, 2), and their coordinates."""
    cuts = flow.boxes
    where = cuts.to_physical(at)
    ends = (-bounds[..., 0], bounds[..., 1], where[..., 0, :], where[..., 1, :])
    told = (*ends, method, nature, trajectories, seconds, error)
    return Envelope(
        cuts.alpha, flow.time, flow.outputs, cuts.names, *told, between=between, facts=facts
    )


def _unit(name: str) -> str:
    """The unit after a number; nothing where it is not known."""
    unit = Output(name).unit
    return "" if unit == "SI" else f" {unit}"
