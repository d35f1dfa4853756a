"""Fuzzy number (Fig. 19) and fuzzy mapping (Fig. 20), with the case's numbers."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from alphacut.figures.style import BLUE, INK, ORANGE, figure, membership_axes, prefix_axis
from alphacut.stages.material.cell import GPA
from alphacut.stages.pipeline import Results

if TYPE_CHECKING:
    import xarray
    from matplotlib.figure import Figure

SHOWN_LEVEL = 0.5


def membership(dataset: xarray.Dataset) -> Figure:
    """Fig. 19: membership function of a convex fuzzy parameter and one of its α-cuts."""
    drawn, axes = figure()
    alpha, ends = dataset["alpha"].values, dataset["E"].values / GPA
    lower, upper = (float(np.interp(SHOWN_LEVEL, alpha, ends[:, side])) for side in (0, 1))
    axes.plot(
        np.concatenate([ends[:, 0], ends[::-1, 1]]),
        np.concatenate([alpha, alpha[::-1]]),
        color=INK,
        lw=1.5,
    )
    axes.plot([lower, upper], [SHOWN_LEVEL] * 2, color=ORANGE, lw=3, solid_capstyle="butt")
    axes.vlines([lower, upper], 0, SHOWN_LEVEL, color=ORANGE, lw=0.8, ls=":")
    axes.annotate(
        f"α-cut at {SHOWN_LEVEL:g}: {lower:.2f} … {upper:.2f}",
        ((lower + upper) / 2, SHOWN_LEVEL + 0.03),
        ha="center",
        color=ORANGE,
    )
    axes.annotate(
        "modal value" if np.ptp(ends[-1]) <= 1e-9 * ends[-1].max() else "core",
        (ends[-1].mean(), 1.0),
        xytext=(8, -2),
        textcoords="offset points",
        va="center",
    )
    membership_axes(axes, "fuzzy parameter, here E in GPa")
    return drawn


def mapping(results: Results, *, count: int = 40, duration: float = 5.0) -> Figure:
    """Fig. 20: trajectories for parameters inside an α-cut, and the envelope that encloses them."""
    from alphacut.frame.outputs import output_unit

    study = next((s for s in results.studies if len(s.task.fuzzy) > 1), results.studies[0])
    dataset = results.envelopes[study.name].isel(alpha=0)
    output = str(dataset["output"].values[-1 if "q" in str(dataset["output"].values[-1]) else 0])
    wanted = results.structure
    assert wanted is not None
    inputs = wanted.inputs(study.task.fuzzy)
    end = min(duration, study.task.duration)
    end = round(end / study.task.step) * study.task.step
    flow = wanted.flow(
        tuple(inputs),
        end,
        study.task.step,
        study.task.scheme if wanted.linear else study.task.integrator,
    )
    ends = np.array([number.cut(float(dataset["alpha"])) for number in inputs.values()])
    points = np.random.default_rng(0).uniform(ends[:, 0], ends[:, 1], (count, len(ends)))
    curves = flow.values(points)[:, :, list(flow.outputs).index(output)]
    drawn, axes = figure()
    axes.plot(flow.time, curves.T, color=BLUE, lw=0.5, alpha=0.5)
    axes.plot([], [], color=BLUE, lw=0.8, label=f"{count} random trajectories")
    shown = dataset.sel(output=output).isel(time=slice(0, len(flow.time)))
    for side in ("lower", "upper"):
        axes.plot(
            flow.time, shown[side], color=INK, lw=1.3, label="envelope" if side == "lower" else None
        )
    axes.set_xlabel("time t, s")
    prefix_axis(axes, output, output_unit(output))
    axes.set_title(
        f"Fuzzy mapping of {output} at α = {float(dataset['alpha']):g}", loc="left", fontsize=10
    )
    axes.legend(
        loc="lower left", bbox_to_anchor=(0.45, 1.0), ncols=2, fontsize=8, borderaxespad=0.2
    )
    return drawn
