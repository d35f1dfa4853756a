"""Envelopes over time on every α-cut (Figs. 28 to 35)."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from textwrap import fill
from typing import TYPE_CHECKING

from alphacut.figures.style import INK, alpha_legend, colours, figure, prefix_axis
from alphacut.stages.pipeline import Study

if TYPE_CHECKING:
    import xarray
    from matplotlib.figure import Figure

WORDS = {
    "E": "modulus",
    "m": "masses",
    "l": "lengths",
    "c": "columns",
    "d": "dampers",
    "q0": "initial displacements",
    "v0": "initial velocities",
}
WORDS |= {
    "E_columns": "lower columns",
    "E_columns_top": "upper columns",
    "E_beams": "beams",
    "mass": "floor mass",
}
WORDS |= {
    "rayleigh_mass": "mass damping",
    "rayleigh_stiffness": "stiffness damping",
    "I": "second moment",
    "zeta": "damping ratio",
}


def drawings(study: Study, dataset: xarray.Dataset) -> Iterator[tuple[str, Callable[[], Figure]]]:
    """Name and function of each figure of a study."""
    outputs = [study.output] if study.output else [str(name) for name in dataset["output"].values]
    for index, output in enumerate(outputs):
        number = f"fig{study.figures[index]}-" if index < len(study.figures) else ""
        yield f"{number}envelope-{study.name}-{output}", partial(envelope, dataset, output, study)


def envelope(dataset: xarray.Dataset, output: str, study: Study) -> Figure:
    """Nested bands between lower and upper envelope, and the modal trajectory."""
    from alphacut.frame.outputs import output_unit

    drawn, axes = figure(7.2, 3.6)
    shown = dataset.sel(output=output)
    alpha, time = dataset["alpha"].values, dataset["time"].values
    for level, shade in enumerate(colours(alpha)[:-1]):
        band = shown.isel(alpha=level)
        axes.fill_between(time, band["lower"], band["upper"], color=shade, lw=0)
    for side in ("lower", "upper"):
        axes.plot(time, shown.isel(alpha=-1)[side], color=INK, lw=0.8)
        axes.plot(time, shown.isel(alpha=0)[side], color=INK, lw=0.3)
    axes.set_xlabel("time t, s")
    prefix_axis(axes, output, output_unit(output))
    axes.set_xlim(time[0], time[-1])
    # letters mean something else in a pendulum
    known = WORDS if output.startswith(("q", "v", "drift", "shear", "base", "roof")) else {}
    words = ", ".join(known.get(name, name) for name in study.task.fuzzy)
    axes.set_title(fill(f"{output}, fuzzy {words}", 84), loc="left", fontsize=10)
    alpha_legend(axes, alpha, loc="upper left", bbox_to_anchor=(1.0, 1.0))
    return drawn
