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
        axes = ("side", *data["lower"].dims)
        ends, error = (
            np.stack([-data["lower"], data["upper"]]),
            np.stack(2 * [data["error"].values]),
        )
        guaranteed = (data["nature"] == "guaranteed").values
        inner, outer = (_ends(data, kind, ends.shape) for kind in ("inner", "proved"))
        tables = {
            "bound": (axes, ends),
            "error": (axes, np.where((data["nature"] == "attained").values, np.nan, error)),
            "attained": (axes, np.where(guaranteed, inner, ends - error)),
            "proved": (axes, np.where(guaranteed, ends, -outer)),
        }
        stated = xr.Dataset(tables, {"side": [-1, 1], **{x: data[x].values for x in axes[1:]}})
        return cls(_with_middles(stated, data) if "time" in axes else stated)

    @classmethod
    def of_values(cls, values: Mapping[str, tuple[float, float]]) -> Stated:
        """Statements of single numbers by name, each with its declared error."""
        stated = cls.of_ends({name: (x - error, x + error) for name, (x, error) in values.items()})
        errors = xr.DataArray([error for _, error in values.values()], {"output": [*values]})
        return cls(stated.data.assign(error=stated.data.error.fillna(errors)))

    @classmethod
    def of_ends(cls, ends: Mapping[str, tuple[float, float]]) -> Stated:
        """Statements of single numbers by name, each proved to lie between two ends."""
        low, high = np.array([*ends.values()], float).T
        middle = (low + high) / 2
        sides = {"bound": (-middle, middle), "attained": (-high, low), "proved": (-low, high)}
        sides["error"] = (np.full(len(low), np.nan),) * 2
        tables = {name: (("side", "output"), np.stack(pair)) for name, pair in sides.items()}
        return cls(xr.Dataset(tables, {"side": [-1, 1], "output": [*ends]}))

    def scaled(self, factors: Mapping[str, float], time: float = 1.0) -> Stated:
        """The statements with outputs by name, and times, multiplied by factors."""
        names = [str(name) for name in self.data.output.values]
        data = self.data * xr.DataArray([factors[name] for name in names], {"output": names})
        return Stated(data.assign_coords(time=data.time * time) if "time" in data.dims else data)


def _ends(data: xr.Dataset, kind: str, shape: tuple[int, ...]) -> np.ndarray:
    """Attained or proved ends beside the bounds, both negative infinite where there are none."""
    if f"{kind}_lower" not in data:
        return np.full(shape, -np.inf)
    sign = 1 if kind == "inner" else -1
    return sign * np.stack([-data[f"{kind}_lower"].values, data[f"{kind}_upper"].values])


def _with_middles(stated: xr.Dataset, data: xr.Dataset) -> xr.Dataset:
    """The statements also at the middle of steps: where they are guaranteed by `between`."""
    time = data["time"].values
    before, after = (
        stated.isel(time=part).assign_coords(time=(time[1:] + time[:-1]) / 2)
        for part in (slice(None, -1), slice(1, None))
    )
    middles = after * np.nan
    if "between" in data:
        middles["proved"] = np.maximum(before.proved, after.proved) + data["between"].values[1:]
    return xr.concat([stated, middles], "time").sortby("time")


def contradictions(one: Stated, two: Stated, *, within: float | None = None) -> list[str]:
    """Contradictions of two results on what both speak of, a line each; empty if there are none.

    What is attained in one may not lie outside what is proved in the other, and bounds differ by
    no more than both declared errors.

    Args:
        one: Statements.
        two: Others.
        within: Share of an output's size within which every number is to be the same; None: no.
    """
    first, second = xr.align(*(_rounded_times(x.data) for x in (one, two)), join="inner")
    if not first.bound.size:
        raise ValueError("the two results share no output, level and time")
    over = [name for name in first.bound.dims if name != "output"]
    size = np.maximum(np.abs(first.bound), np.abs(second.bound)).max(over)
    allowed = ROUNDING if within is None else within
    if within is None:
        attained = first.attained - second.proved, second.attained - first.proved
        apart = np.abs(first.bound - second.bound) - (first.error + second.error)
        excess = {"attained leaves what is proved": np.maximum(*attained)}
        excess["bounds differ by more than both errors"] = apart
    else:
        gaps = {f"{name} differs": np.abs(first[name] - second[name]) for name in first}
        excess = {name: gap.where(np.isfinite(gap)) for name, gap in gaps.items()}
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
