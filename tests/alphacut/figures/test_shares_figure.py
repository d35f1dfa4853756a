"""Shares of inputs: the legend lies in the picture, and no two bars look alike."""

import matplotlib.pyplot as plt
import numpy as np
import pytest
import xarray

from alphacut.figures.shares import of_modulus

INPUTS = ("a2", "a4", "E_matrix", "nu_matrix", "E_particle", "nu_particle")


@pytest.fixture
def figure():
    shares = (("alpha", "cell_input"), np.full((2, len(INPUTS)), 0.3))
    coordinates = {"alpha": [0.0, 1.0], "cell_input": list(INPUTS)}
    drawn = of_modulus(xarray.Dataset({"modulus_share": shares}, coords=coordinates))
    drawn.canvas.draw()
    yield drawn
    plt.close(drawn)


def test_the_legend_lies_within_the_picture(figure):
    (legend,) = figure.legends
    box = legend.get_window_extent()
    assert box.x0 >= 0
    assert box.x1 <= figure.bbox.x1


def test_no_two_inputs_look_alike(figure):
    bars = figure.axes[0].patches
    assert len({(bar.get_facecolor(), bar.get_hatch()) for bar in bars}) == len(INPUTS)
