"""What results state of the same quantities, and where two of them contradict each other."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import xarray as xr

from alphacut.fuzzy.result import Bounds

ROUNDING = 1e-9
"""Share of an output's size that rounding explains where both results are proved or exact."""


@dataclass(frozen=True)
class Stated:
    """Statements on upper bounds of (−output, output), with labels that two results share.

    Args:
        data: Variables `bound`, its declared `error` (NaN for none), `attained` and `proved` over
            side, output and more; NaN or infinite where nothing is stated.
    """

    data: xr.Dataset

    @classmethod
    def of_bounds(cls, result: Bounds) -> Stated:
        """Statements of α-cuts or of an envelope."""
        return cls.of_dataset(result.to_dataset())

    @classmethod
    def of_dataset(cls, data: xr.Dataset) -> Stated:
        """Statements of the dataset of a result, also between the nodes of an envelope."""
        ends = np.stack([-data["lower"], data["upper"]])
        axes = ("side", *data["lower"].dims)
        labels = {name: data[name].values for name in axes[1:]}
        guaranteed = (data["nature"] == "guaranteed").values
        attained_only = (data["nature"] == "attained").values
        error = np.stack(2 * [data["error"].values])
        inner, outer = (_ends(data, kind, ends.shape) for kind in ("inner", "proved"))
        tables = {
            "bound": (axes, ends),
            "error": (axes, np.where(attained_only, np.nan, error)),
            "attained": (axes, np.where(guaranteed, inner, ends - error)),
            "proved": (axes, np.where(guaranteed, ends, -outer)),
        }
        made = xr.Dataset(tables, {"side": [-1, 1], **labels})
        return cls(_with_middles(made, data) if "time" in labels else made)

    @classmethod
    def of_values(cls, values: Mapping[str, tuple[float, float]]) -> Stated:
        """Statements of single numbers by name, each with its declared error."""
        numbers = np.array([*values.values()], float)
        return cls.of_ends({k: (x - e, x + e) for k, (x, e) in values.items()}, numbers[:, 1])

    @classmethod
    def of_ends(
        cls, ends: Mapping[str, tuple[float, float]], error: np.ndarray | None = None
    ) -> Stated:
        """Statements of single numbers by name, each between two ends."""
        low, high = np.array([*ends.values()], float).T
        axes, proved, attained = ("side", "output"), np.stack([-low, high]), np.stack([-high, low])
        missing = np.full(len(low), np.nan) if error is None else error
        middle = np.stack([-(low + high) / 2, (low + high) / 2])
        tables = {"bound": (axes, middle), "error": (axes, np.stack([missing, missing]))}
        tables |= {"attained": (axes, attained), "proved": (axes, proved)}
        return cls(xr.Dataset(tables, {"side": [-1, 1], "output": [*ends]}))

    def scaled(self, factors: Mapping[str, float], time: float = 1.0) -> Stated:
        """The statements with outputs by name, and times, multiplied by factors."""
        names = [str(name) for name in self.data.output.values]
        by = xr.DataArray([factors[name] for name in names], {"output": names})
        data = self.data * by
        return Stated(data.assign_coords(time=data.time * time) if "time" in data.dims else data)


def _ends(data: xr.Dataset, kind: str, shape: tuple[int, ...]) -> np.ndarray:
    """Attained or proved ends beside the bounds, both negative infinite where there are none."""
    if f"{kind}_lower" not in data:
        return np.full(shape, -np.inf)
    sign = 1 if kind == "inner" else -1
    return sign * np.stack([-data[f"{kind}_lower"].values, data[f"{kind}_upper"].values])


def _with_middles(made: xr.Dataset, data: xr.Dataset) -> xr.Dataset:
    """The statements also at the middle of steps: where they are guaranteed by `between`."""
    time = data["time"].values
    middles = (time[1:] + time[:-1]) / 2
    there = made.isel(time=slice(1, None)).assign_coords(time=middles) * np.nan
    if "between" in data:
        before = made.proved.isel(time=slice(None, -1)).assign_coords(time=middles)
        after = made.proved.isel(time=slice(1, None)).assign_coords(time=middles)
        there["proved"] = np.maximum(before, after) + data["between"].values[1:]
    return xr.concat([made, there], "time").sortby("time")


def contradictions(one: Stated, two: Stated, *, within: float | None = None) -> list[str]:
    """Contradictions of two results on what both speak of, a line each; empty if there are none.

    What is attained in one may not lie outside what is proved in the other, and bounds differ by
    no more than both declared errors.

    Args:
        one: Statements.
        two: Others.
        within: Share of an output's size within which every number is to be the same; None: no.
    """
    tables = [_rounded_times(x.data) for x in (one, two)]
    first, second = xr.align(*tables, join="inner")
    if not first.bound.size:
        raise ValueError("the two results share no output, level and time")
    over = [name for name in first.bound.dims if name != "output"]
    size = np.maximum(np.abs(first.bound), np.abs(second.bound)).max(over)
    excess = {
        "attained leaves what is proved": np.maximum(
            first.attained - second.proved, second.attained - first.proved
        ),
        "bounds differ by more than both errors": np.abs(first.bound - second.bound)
        - (first.error + second.error),
    }
    allowed = ROUNDING if within is None else within
    if within is not None:
        excess = {f"{name} differs": np.abs(first[name] - second[name]) for name in first}
        excess = {name: gap.where(np.isfinite(gap)) for name, gap in excess.items()}
    lines = []
    for what, gap in excess.items():
        share = (gap / size.where(size > 0, 1.0)).max(over)
        for output in share.output.values[(share > allowed).values]:
            lines.append(f"{what}: {output} by {float(share.sel(output=output)):.2g} of its size")
    return lines


def _rounded_times(data: xr.Dataset) -> xr.Dataset:
    """The statements with times that compare equal in spite of rounding."""
    if "time" not in data.dims:
        return data
    return data.assign_coords(time=np.round(data.time.values, 9))
