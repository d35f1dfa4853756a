"""How bounds leave: as text, as a table for notebooks, drawn, as CSV and as an xarray dataset."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from alphacut.fuzzy.arrays import Array
from alphacut.fuzzy.drawing import draw_bands, draw_membership, new_axes
from alphacut.fuzzy.tables import html_table, write_csv

if TYPE_CHECKING:
    import xarray
    from matplotlib.axes import Axes

    from alphacut.fuzzy.sets.numbers import FuzzyNumber

_ROWS = 25
"""Levels of all outputs that a text has at most."""


class Shown:
    """α-cuts as they are read, drawn and written; `Bounds` says what each field is."""

    alpha: Array
    lower: Array
    upper: Array
    lower_at: Array
    upper_at: Array
    error: Array
    nature: str
    outputs: tuple[str, ...]
    inputs: Mapping[str, FuzzyNumber]
    units: tuple[str, ...]
    method: str
    evaluations: int
    seconds: float
    basis: tuple[str, ...]
    time: Array | None
    budget: int

    def __str__(self) -> str:
        """Bounds of the first outputs, a line for each level, with nature and cost."""
        count = max(1, _ROWS // len(self.alpha))
        lines = [
            f"{name}, α = {alpha}: {low} … {high}, {self._worth(error, k)}"
            for k, name in enumerate(self._named[:count])
            for _, alpha, low, high, error in self._rows(k)
        ]
        hidden = len(self.outputs) - count
        more = [f"… and {hidden} outputs more: bounds(NAME) has them"] if hidden > 0 else []
        return "\n".join([self._head, *lines, *more, *self.said()])

    __repr__ = __str__

    def _repr_html_(self) -> str:
        """The same as a table, for notebooks."""
        count = max(1, _ROWS // len(self.alpha))
        rows = [row for k in range(min(count, len(self.outputs))) for row in self._rows(k)]
        header = ("output", "α", "lower", "upper", "error")
        return html_table(header, rows, below="\n".join([self._head, *self.said()]))

    @property
    def _head(self) -> str:
        """Nature, what it rests on, and what it cost."""
        rests = f" (given that {' and '.join(self.basis)})" if self.basis else ""
        over = "" if self.time is None else f" over {self.time[0]:g} … {self.time[-1]:g} s"
        most = f" of at most {self.budget:,}" if self.budget else ""
        cost = f"{self.evaluations:,} evaluations{most}, {self.seconds:.2g} s"
        return f"bounds {self.nature}{rests}{over} by the method {self.method}: {cost}"

    def _worth(self, error: str, column: int) -> str:
        """Error, and the nature where it is not that of all."""
        nature = self.nature_of(self.outputs[column])
        return f"error {error}" + (f", {nature}" if nature != self.nature else "")

    @property
    def _named(self) -> tuple[str, ...]:
        """Outputs with their units."""
        pairs = zip(self.outputs, self.units or ("",) * len(self.outputs), strict=True)
        return tuple(f"{name} [{unit}]" if unit else name for name, unit in pairs)

    def _rows(self, column: int) -> Iterator[tuple[str, ...]]:
        """Output, level, ends and error as texts; the extremes over time where there is one."""
        low, high, error = (x[..., column] for x in (self.lower, self.upper, self.error))
        if self.time is not None:
            low, high, error = low.min(axis=1), high.max(axis=1), error.max(axis=1)
        for row in zip(self.alpha, low, high, error, strict=True):
            alpha, *ends, miss = row
            yield (
                self._named[column],
                f"{alpha:g}",
                *(f"{x + 0.0:.6g}" for x in ends),
                _digits(miss),
            )

    def plot(self, output: str | None = None, axes: Axes | None = None) -> Axes:
        """Draw one output: a membership function, or bands over time, with its error.

        Args:
            output: Name of the output; the first one if not given.
            axes: Where to draw; a new figure if not given.

        Returns:
            The axes drawn on.
        """
        column = 0 if output is None else self.column(output)
        low, high, error = (x[..., column] for x in (self.lower, self.upper, self.error))
        axes, wide = new_axes(axes), np.nan_to_num(error)
        title = f"bounds {self.nature_of(self.outputs[column])}"
        title += f", error up to {_digits(wide.max())}, dotted" if wide.max() > 0 else ""
        axes.set_title(title, fontsize="medium")
        if self.time is not None:
            draw_bands(axes, self.time, self.alpha, low, high)
            for end in (low[0] - wide[0], high[0] + wide[0]):
                axes.plot(self.time, end, color="black", linestyle=":", linewidth=0.8)
            axes.set(xlabel="time [s]", ylabel=self._named[column])
            return axes
        draw_membership(axes, self.alpha, low, high, steps=True)
        for end in (low - wide, high + wide):
            axes.plot(end, self.alpha, color="black", linestyle=":", linewidth=0.8)
        axes.set_xlabel(self._named[column])
        return axes

    def column(self, output: str) -> int:
        """Index of an output."""
        raise NotImplementedError

    def said(self) -> tuple[str, ...]:
        """Sentences on the bounds that a reader must know."""
        raise NotImplementedError

    def nature_of(self, output: str) -> str:
        """Nature of one output's bounds."""
        raise NotImplementedError

    def to_csv(self, path: str | Path) -> None:
        """Write a table: a row for each output and level, or one for each node of time.

        Args:
            path: The file; one that is there is replaced.
        """
        if self.time is None:
            places = [f"{name} at {end}" for end in ("lower", "upper") for name in self.inputs]
            titles = ["output", "alpha", "lower", "upper", "error", *places]
            write_csv(path, titles, self._cells())
        else:
            write_csv(path, ["time [s]", *self._titles()], self._nodes())

    def _cells(self) -> Iterator[list[str]]:
        """Rows of a table without time: output, level, ends, error, places."""
        parts = (self.lower[..., None], self.upper[..., None], self.error[..., None])
        table = np.concatenate([*parts, self.lower_at, self.upper_at], axis=2)
        for column, name in enumerate(self._named):
            for level, alpha in enumerate(self.alpha):
                yield [name, f"{alpha:g}", *map(_digits, table[level, column])]

    def _titles(self) -> Iterator[str]:
        """Titles of a table over time, with units."""
        for name in self._named:
            for alpha in self.alpha:
                yield from (f"{name} {end} α={alpha:g}" for end in ("lower", "upper", "error"))

    def _nodes(self) -> Iterator[list[str]]:
        """Rows of a table over time."""
        table = np.stack([self.lower, self.upper, self.error], axis=-1)  # (A, T, m, 3)
        rows = np.moveaxis(table, 0, 2).reshape(table.shape[1], -1)
        times = () if self.time is None else self.time
        for time, row in zip(times, rows, strict=True):
            yield [f"{time:.6g}", *map(_digits, row)]

    def to_dataset(self) -> xarray.Dataset:
        """Bounds over (alpha, time, output), where they are attained over (…, parameter)."""
        import xarray

        middle = {} if self.time is None else {"time": self.time}
        axes = {"alpha": self.alpha, **middle, "output": list(self.outputs)}
        places = {**axes, "parameter": list(self.inputs)}
        tables = {name: (tuple(axes), getattr(self, name)) for name in ("lower", "upper", "error")}
        tables |= {name: (tuple(places), getattr(self, name)) for name in ("lower_at", "upper_at")}
        tables["nature"] = (("output",), np.array([str(self.nature_of(x)) for x in self.outputs]))
        tables["label"] = (("output",), np.array(self._named))
        facts = {"method": self.method, "evaluations": self.evaluations, "seconds": self.seconds}
        return xarray.Dataset(tables, places, {**facts, "basis": "; ".join(self.basis)})


def _digits(value: float) -> str:
    """A number with six digits; empty where it is not known."""
    return "" if np.isnan(value) else f"{value + 0.0:.6g}"
