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
    """Draw fuzzy Young's modulus, with the one that the case states, and Poisson's ratio below.

    Args:
        result: α-cuts of the cell: "E" in Pa and "nu" over the axes alpha and bound (lower, upper).
        stated: Young's modulus that the structure of the case states, in Pa; None without one.
    """
    size = (WIDTH, 1.75 * HEIGHT)
    figure, (axes, below) = plt.subplots(2, 1, figsize=size, height_ratios=(3, 2))
    dataset = result.arrays
    average = result.numbers.average
    alpha = dataset["alpha"].values
    lower, upper = dataset["E"].transpose("bound", "alpha").values / GPA
    style.shaded_cuts(axes, alpha, lower, upper)
    if stated is not None:
        # Support and core are enough: the stated number is linear between both.
        support = stated.support
        core = stated.cut(1.0)
        corners = np.array([support.lower, core.lower, core.upper, support.upper]) / GPA
        line: Look = {"color": BLUE, "lw": 1.2, "ls": "--", "label": "quoted in the case"}
        axes.plot(corners, [0, 1, 1, 0], **line)
        axes.plot([], [], color=INK, marker="o", ms=3.5, lw=1.2, label="computed here")
        axes.legend(loc="upper left")
    style.membership_axes(axes, f"effective Young's modulus E, {average} (GPa)")
    smallest, largest = dataset["nu"].transpose("bound", "alpha").values
    style.shaded_cuts(below, alpha, smallest, largest)
    style.membership_axes(below, "effective Poisson's ratio ν of the same")
    return figure


def image(dataset: xarray.Dataset) -> Figure:
    """Draw the phases of an image, or of a volume on three planes in its middle, and α-cuts of E.

    Pixels and voxels whose phase the fuzzy threshold leaves open on the lowest level are orange.

    Args:
        dataset: "phase" is the index of the phase of each pixel over the axes (y, x), or of each
            voxel over (z, y, x); "is_open" has the same axes; "E" in Pa has the axes alpha and
            bound (lower, upper). Attributes are "phases", the names, and "lengths", the sides of a
            pixel in m.
    """
    phase = dataset["phase"]
    is_volume = phase.ndim == 3
    # A volume has one picture for each axis across it; an image has one, across no axis.
    planes = [""]
    mosaic: list[Any] = [["", "E"]]
    height = 3.8
    kind = "pixels"
    where = ", plane strain"
    if is_volume:
        planes = [str(axis) for axis in phase.dims[::-1]]
        mosaic = [planes, ["E"] * 3]
        height = 5.6
        kind = "voxels"
        where = ""
    figure = plt.figure(figsize=(WIDTH, height))
    axes = figure.subplot_mosaic(mosaic)
    for across in planes:
        draw_plane(axes[across], dataset, across)

    names = np.atleast_1d(dataset.attrs["phases"])  # a file holds one name as a text
    patches = [
        Patch(facecolor=grey, edgecolor=INK, lw=0.5, label=name)
        for grey, name in zip(phase_greys(dataset), names, strict=True)
    ]
    if dataset["is_open"].values.any():
        level = dataset["alpha"].values[0]
        fraction = float(dataset["is_open"].mean())
        label = f"open at α = {level:g}: {fraction:.2%} of the {kind}"
        patches.append(Patch(facecolor=ORANGE, label=label))
    figure.legend(handles=patches, loc="outside lower left", ncols=len(patches))

    lower, upper = dataset["E"].transpose("bound", "alpha").values / GPA
    style.shaded_cuts(axes["E"], dataset["alpha"].values, lower, upper)
    style.membership_axes(axes["E"], f"Young's modulus E{where} (GPa)")
    return figure


def draw_plane(axes: Axes, dataset: xarray.Dataset, across: str) -> None:
    """Draw the phases of an image, or of the plane in the middle of a volume across an axis.

    The axes show lengths, with the prefix that fits the longest side of the whole cell.

    Args:
        axes: Axes that are drawn on.
        dataset: "phase", the index of the phase, and "is_open" have the axes (y, x), or (z, y, x)
            for a volume. Attributes are "phases", the names, and "lengths", the sides of a pixel or
            voxel in m in the order of the axes.
        across: Axis that the plane of a volume is perpendicular to, "x", "y" or "z"; empty for an
            image.
    """
    phase = dataset["phase"]
    pixel = dict(zip(phase.dims, dataset.attrs["lengths"], strict=True))  # its sides in m
    factor, unit = axis_prefix(max(phase.sizes[axis] * pixel[axis] for axis in phase.dims), "m")
    middle = {}
    if across:
        middle = {across: phase.sizes[across] // 2}
    up, right = phase.isel(middle).dims
    width = factor * pixel[right] * phase.sizes[right]
    height = factor * pixel[up] * phase.sizes[up]
    # Row 0 of the array is at y = 0, which "lower" draws at the bottom.
    look: Look = {"origin": "lower", "extent": (0, width, 0, height), "interpolation": "nearest"}
    greys = ListedColormap(phase_greys(dataset))
    axes.imshow(phase.isel(middle).values, cmap=greys, vmin=-0.5, vmax=greys.N - 0.5, **look)
    # NaN is transparent, so that only open pixels are painted over.
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
