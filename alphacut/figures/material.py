"""The fuzzy modulus of a cell (Fig. 18), and the proved modulus of an image or volume."""

from __future__ import annotations

from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import xarray
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from alphacut.base.number_text import axis_prefix
from alphacut.figures import style
from alphacut.figures.style import BLUE, HEIGHT, INK, ORANGE, WIDTH, Look
from alphacut.fuzzy import FuzzyNumber
from alphacut.stages.cell import GPA
from alphacut.stages.modulus import ModulusResult
from alphacut.stages.store import StageResult


def fuzzy_modulus(result: StageResult[ModulusResult], stated: FuzzyNumber | None) -> Figure:
    """Draw fuzzy Young's modulus beside the one that the case states, and Poisson's ratio below."""
    size = (WIDTH, 1.75 * HEIGHT)
    figure, (axes, below) = plt.subplots(2, 1, figsize=size, height_ratios=(3, 2))
    dataset, average = result.arrays, result.numbers.average
    alpha = dataset["alpha"].values
    style.shaded_cuts(axes, alpha, *(dataset["E"].values / GPA).T)
    if stated is not None:
        cuts = np.array([stated.cut(level) for level in (0.0, 1.0)]) / GPA
        line: Look = {"color": BLUE, "lw": 1.2, "ls": "--", "label": "quoted in the case"}
        axes.plot(style.outline(*cuts.T), [0, 1, 1, 0], **line)
        axes.plot([], [], color=INK, marker="o", ms=3.5, lw=1.2, label="computed here")
        axes.legend(loc="upper left")
    style.membership_axes(axes, f"effective Young's modulus E, {average} (GPa)")
    style.shaded_cuts(below, alpha, *dataset["nu"].transpose("bound", "alpha").values)
    style.membership_axes(below, "effective Poisson's ratio ν of the same")
    return figure


def image(dataset: xarray.Dataset) -> Figure:
    """Draw the phases of an image, or of a volume on three planes in its middle, and α-cuts of E.

    Pixels and voxels whose phase the fuzzy threshold leaves open on the lowest level are orange.
    """
    phase = dataset["phase"]
    is_volume = phase.ndim == 3
    # One picture for each axis across it; of an image there is one picture, across no axis.
    planes = [str(axis) for axis in phase.dims[::-1]] if is_volume else [""]
    mosaic: Any = [planes, ["E"] * 3] if is_volume else [["", "E"]]
    figure = plt.figure(figsize=(WIDTH, 5.6 if is_volume else 3.8))
    axes = figure.subplot_mosaic(mosaic)
    for across in planes:
        draw_plane(axes[across], dataset, across)

    names = np.atleast_1d(dataset.attrs["phases"])  # a file holds one name as a text
    patches = [
        Patch(facecolor=grey, edgecolor=INK, lw=0.5, label=name)
        for grey, name in zip(phase_greys(dataset), names, strict=True)
    ]
    if dataset["is_open"].values.any():
        level, fraction = dataset["alpha"].values[0], float(dataset["is_open"].mean())
        kind = "voxels" if is_volume else "pixels"
        label = f"open at α = {level:g}: {fraction:.2%} of the {kind}"
        patches.append(Patch(facecolor=ORANGE, label=label))
    figure.legend(handles=patches, loc="outside lower left", ncols=len(patches))

    lower, upper = dataset["E"].transpose("bound", "alpha").values / GPA
    style.shaded_cuts(axes["E"], dataset["alpha"].values, lower, upper)
    where = "" if is_volume else ", plane strain"
    style.membership_axes(axes["E"], f"Young's modulus E{where} (GPa)")
    return figure


def draw_plane(axes: Axes, dataset: xarray.Dataset, across: str) -> None:
    """Draw the phases of an image, or of the plane of a volume in the middle of the axis `across`.

    `across` is empty for an image. The axes are lengths with the prefix that fits all of the cell.
    """
    phase = dataset["phase"]
    pixel = dict(zip(phase.dims, dataset.attrs["lengths"], strict=True))  # its sides in m
    factor, unit = axis_prefix(max(phase.sizes[axis] * pixel[axis] for axis in phase.dims), "m")
    middle = {across: phase.sizes[across] // 2} if across else {}
    up, right = phase.isel(middle).dims
    ends = [factor * pixel[axis] * phase.sizes[axis] for axis in (right, up)]
    look: Look = {"origin": "lower", "extent": (0, ends[0], 0, ends[1]), "interpolation": "nearest"}
    greys = ListedColormap(phase_greys(dataset))
    axes.imshow(phase.isel(middle).values, cmap=greys, vmin=-0.5, vmax=greys.N - 0.5, **look)
    open_pixels = np.where(dataset["is_open"].isel(middle).values, 1.0, np.nan)
    axes.imshow(open_pixels, cmap=ListedColormap([ORANGE]), **look)
    axes.set(xlabel=f"{right} ({unit})", ylabel=f"{up} ({unit})")
    axes.grid(visible=False)
    if across:
        axes.set_title(f"{across} = {factor * pixel[across] * middle[across]:.4g} {unit}")


def phase_greys(dataset: xarray.Dataset) -> list[tuple[float, float, float]]:
    """Return a grey for each phase, from dark to light, none as light as the paper."""
    count = np.size(dataset.attrs["phases"])
    return [(x, x, x) for x in np.linspace(0.45, 0.95, count)]
