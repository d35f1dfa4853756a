"""Figures of a structure of storeys: what they show is what was computed."""

from dataclasses import replace

import matplotlib.pyplot as plt
import numpy as np

from alphacut.base.number_text import ShownUnit
from alphacut.figures.structure import families, loops, profiles, sketch
from alphacut.frame import Accelerogram, Peak, StoreyFrame
from alphacut.frame.analyses.storey_table import assumptions, storey_table
from alphacut.fuzzy.result import Nature


def peak(*ends):
    """A peak on two levels with guaranteed bounds."""
    low, high = np.array(ends, float).T
    return Peak(np.array([0.0, 1.0]), low, high, 0 * low, high, low, high, Nature.GUARANTEED)


def test_outputs_of_several_storeys_are_families():
    names = dict.fromkeys(["drift10", "drift2", "q1", "max q1", "q2", "base_shear", "roof_1"])
    assert families(names) == {
        "drift": [(2, "drift2"), (10, "drift10")],
        "q": [(1, "q1"), (2, "q2")],
    }


def test_a_profile_is_drawn_in_the_unit_shown():
    peaks = {
        "a1": peak((1, 3), (2, 2)),
        "a2": peak((2, 6), (4, 4)),
        "base_shear": peak((1, 2), (1, 1)),
    }
    units = dict.fromkeys(peaks, ShownUnit("g", 0.1))
    figure = profiles(peaks, units)
    (axes,) = figure.axes
    assert axes.get_xlabel() == "acceleration (g)"
    drawn = [line.get_xdata() for line in axes.lines]
    assert any(np.allclose(x, [0.2, 0.4]) for x in drawn)  # the highest level
    assert any(np.allclose(x, [0.3, 0.6]) for x in drawn)  # attained
    assert profiles({"q1": peaks["a1"]}, units) is None
    plt.close(figure)


def test_loops_show_drift_and_shear_of_storeys_that_yield():
    frame = StoreyFrame(
        masses=[5e4, 4e4],
        stiffness=[6e7, 5e7],
        yield_force=[1e5, 9e4],
        hardening=[0.05, 1.0],
        damping_ratio=0.05,
        ground=Accelerogram(0.01, 6 * np.sin(8 * np.arange(501) * 0.01)),
    )
    worst = replace(peak((1, 3), (2, 2)), reached_at={"k1": 6.6e7})
    figure = loops(frame, {"drift1": worst}, duration=5.0, step=0.01)
    (axes,) = figure.axes  # the second storey stays elastic
    nominal, other = axes.lines[:2]
    drift, shear = nominal.get_data()
    assert np.ptp(drift) > 2 * 1e5 / 6e7  # beyond yielding in both directions
    # Within most steps the storey is elastic, or it yields with a twentieth of the stiffness.
    slopes = np.diff(shear) / np.diff(drift)
    is_either = np.isclose(slopes, 6e7, rtol=1e-6) | np.isclose(slopes, 3e6, rtol=1e-6)
    assert is_either.mean() > 0.8
    assert not np.allclose(other.get_xdata(), drift)
    plt.close(figure)


def test_the_table_and_the_sketch_say_what_the_frame_is():
    frame = StoreyFrame(
        masses=[2e3, 1e3],
        stiffness=[4e6, 2e6],
        lengths=[4.0, 3.0],
        gravity=9.81,
        yield_drift=[0.01, 0.02],
        hardening=[0.1, 1.0],
    )
    table = storey_table(frame)
    assert table.head == (
        "storey",
        "weight",
        "stiffness",
        "height",
        "P/(k l)",
        "yields at",
        "hardening",
    )
    assert table.rows[-1] == (
        "1",
        "19.61 kN",
        "4.000 MN/m",
        "4.000 m",
        "0.18%",
        "40.00 kN",
        "10.0%",
    )
    words = " ".join(assumptions(frame))
    for part in ("given stiffness", "P-Delta", "bilinearly", "Nothing damps"):
        assert part in words
    figure = sketch(frame)
    texts = {text.get_text() for text in figure.axes[0].texts}
    assert {"19.61 kN", "2.000 MN/m", "3.000 m"} <= texts
    plt.close(figure)
