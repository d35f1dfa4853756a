"""An image as it was segmented, and the proved bounds of E."""

from __future__ import annotations

from typing import TYPE_CHECKING

from alphacut.figures.style import WIDTH, membership_axes, shaded_cuts, title
from alphacut.stages.cell import GPA

if TYPE_CHECKING:
    import xarray
    from matplotlib.figure import Figure


def image(dataset: xarray.Dataset) -> Figure:
    """Phases as greys to the left, α-cuts of E to the right."""
    import matplotlib.pyplot as plt

    drawn, (picture, cuts) = plt.subplots(1, 2, figsize=(WIDTH, 3.4), width_ratios=(1, 1.4))
    picture.imshow(dataset["phase"].values, origin="lower", cmap="Greys_r")
    picture.set_xticks([])
    picture.set_yticks([])
    title(picture, "phases as segmented")
    lower, upper = dataset["E"].transpose("bound", "alpha").values / GPA
    shaded_cuts(cuts, dataset["alpha"].values, lower, upper)
    membership_axes(cuts, "Young's modulus E, plane strain (GPa)")
    return drawn
