"""Pictures of particles show whole cells up to the edge and say what they show."""

from itertools import combinations

import matplotlib.pyplot as plt
import numpy as np
import pytest
from matplotlib.text import Text

from alphacut.stochastic.figures.all import draw_cells, draw_neighbours
from alphacut.stochastic.figures.style import figure_style, save
from alphacut.stochastic.particles.packing import Packing
from alphacut.stochastic.particles.radius_laws import LogNormalRadii
from alphacut.stochastic.tessellation.apollonius import apollonius

EQUAL = Packing(120, 0.2, LogNormalRadii(1e-3, 1e-3)).make(np.random.default_rng(1))
MANY = Packing(800, 0.2, LogNormalRadii(1e-3, 4e-3)).make(np.random.default_rng(2))


@pytest.fixture(autouse=True)
def closed():
    """No figure stays open."""
    yield
    plt.close("all")


def test_a_corner_of_a_section_has_the_cells_of_the_whole_and_says_so():
    whole = draw_cells(apollonius(EQUAL)).get_suptitle()
    assert whole.startswith("one section of")
    assert whole.endswith("with 120 discs")
    diagram = apollonius(MANY)
    drawn = draw_cells(diagram)
    assert drawn.get_suptitle().startswith("a corner of one section")
    axes = drawn.axes[1]
    view = np.array([axes.get_xlim()[1], axes.get_ylim()[1]])
    assert view == pytest.approx(1e3 * MANY.size * np.sqrt(120 / 800))
    shown = np.concatenate(axes.collections[1].get_segments())
    assert (shown.max(axis=0) > view).all()  # cells go on beyond the corner
    assert (shown.max(axis=0) < 1.5 * view).all()  # and no more of them than needed


def test_neighbours_are_of_the_sections_own_discs_and_texts_stand_apart(tmp_path):
    with figure_style():
        figure = draw_neighbours(MANY)
        save(figure, tmp_path / "neighbours")
        figure.canvas.draw()
    widths = figure.axes[0].collections[0].get_widths()
    assert np.isin(np.round(widths, 9), np.round(2e3 * MANY.radii, 9)).all()
    assert np.ptp(widths) > 1.0  # mm
    boxes = [x.get_window_extent() for x in figure.findobj(Text) if x.get_text()[:1].isalpha()]
    assert len(boxes) == 3 + 4  # titles and labels
    assert not any(a.overlaps(b) for a, b in combinations(boxes, 2))
    assert min(box.y0 for box in boxes) >= 0  # nothing is cut off
