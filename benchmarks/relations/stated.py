"""What results state of the same quantities, and where two of them contradict each other.

A statement is a dataset of upper bounds of (−output, output), over side, output and more: `bound`,
its declared `error` (NaN for none), what is `attained` and what is `proved`; NaN or infinite where
nothing is stated.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import xarray as xr

ROUNDING = 1e-9
"""Share of an output's size that rounding explains where both results are proved or exact."""


def of_dataset(data: xr.Dataset) -> xr.Dataset:
    """Statement of α-cuts or of an envelope, this one also in the middle between its nodes."""
    axes = ("side", *data["lower"].dims)
    ends = np.stack([-data["lower"], data["upper"]])
    error = np.stack(2 * [data["error"].values])
    guaranteed, attained = ((data["nature"] == x).values for x in ("guaranteed", "attained"))
    inner, outer = (_ends(data, kind, ends.shape) for kind in ("inner", "proved"))
    tables = {
        "bound": (axes, ends),
        "error": (axes, np.where(attained, np.nan, error)),
        "attained": (axes, np.where(guaranteed, inner, ends - error)),
        "proved": (axes, np.where(guaranteed, ends, -outer)),
    }
    stated = xr.Dataset(tables, {"side": [-1, 1], **{x: data[x].values for x in axes[1:]}})
    return _with_middles(stated, data) if "time" in axes else stated


def _ends(data: xr.Dataset, kind: str, shape: tuple[int, ...]) -> np.ndarray:
    """Attained or proved ends beside the bounds, negative infinite where there are none."""
    if f"{kind}_lower" not in data:
        return np.full(shape, -np.inf)
    sign = 1 if kind == "inner" else -1
    return sign * np.stack([-data[f"{kind}_lower"].values, data[f"{kind}_upper"].values])


def _with_middles(stated: xr.Dataset, data: xr.Dataset) -> xr.Dataset:
    """The statement also at the middle of steps: proved there by `between`."""
    time = data["time"].values
    before, after = (
        stated.isel(time=part).assign_coords(time=(time[1:] + time[:-1]) / 2)
        for part in (slice(None, -1), slice(1, None))
    )
    middles = after * np.nan
    if "between" in data:
        middles["proved"] = np.maximum(before.proved, after.proved) + data["between"].values[1:]
    return xr.concat([stated, middles], "time").sortby("time")


def of_values(values: Mapping[str, tuple[float, float]]) -> xr.Dataset:
    """Statement of single numbers by name, each with an error that it does not pass."""
    value, error = np.array([*values.values()], float).T
    bound, error = (np.stack(pair) for pair in ((-value, value), (error, error)))
    parts = {"bound": bound, "error": error, "attained": bound - error, "proved": bound + error}
    tables = {name: (("side", "output"), part) for name, part in parts.items()}
    return xr.Dataset(tables, {"side": [-1, 1], "output": [*values]})


def scaled(stated: xr.Dataset, factors: Mapping[str, float], time: float = 1.0) -> xr.Dataset:
    """The statement with outputs by name, and times, multiplied by factors."""
    names = [str(name) for name in stated.output.values]
    stated = stated * xr.DataArray([factors[name] for name in names], {"output": names})
    return stated.assign_coords(time=stated.time * time) if "time" in stated.dims else stated


def contradictions(one: xr.Dataset, two: xr.Dataset, *, within: float | None = None) -> list[str]:
    """Contradictions of two results on what both speak of, a line each; empty if there are none.

    What is attained in one may not lie outside what is proved in the other, and bounds differ by
    no more than both declared errors.

    Args:
        one: Statement.
        two: Another.
        within: Share of an output's size within which every number is to be the same; None: no.
    """
    first, second = xr.align(*map(_with_rounded_times, (one, two)), join="inner")
    if not first.bound.size:
        raise ValueError("the two results share no output, level and time")
    over = [name for name in first.bound.dims if name != "output"]
    size = np.maximum(np.abs(first.bound), np.abs(second.bound)).max(over)
    allowed = ROUNDING if within is None else within
    if within is None:
        left = first.attained - second.proved, second.attained - first.proved
        apart = np.abs(first.bound - second.bound) - (first.error + second.error)
        excess = {"attained leaves what is proved": np.maximum(*left)}
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


def _with_rounded_times(stated: xr.Dataset) -> xr.Dataset:
    """The statement with times that compare equal in spite of rounding."""
    if "time" not in stated.dims:
        return stated
    return stated.assign_coords(time=np.round(stated.time.values, 9))
