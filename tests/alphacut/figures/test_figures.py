"""Figures: which are drawn, when they are drawn anew, what they show."""

import itertools
import os
import shutil
from types import SimpleNamespace

import matplotlib.pyplot as plt
import numpy as np
import pytest
import xarray

from alphacut.base.number_text import ShownUnit
from alphacut.figures import answers, envelope, material
from alphacut.figures.style import figure_style, prefix_axis
from alphacut.frame import (
    Accelerogram,
    Limit,
    Output,
    Peak,
    StoreyFrame,
    decide,
    fragility,
    propagation,
)
from alphacut.fuzzy import Nature, Triangular
from tests.alphacut.small import summary_of, two_floors_run


def test_figures_are_drawn_once_and_anew_where_the_case_changed(two_floors, tmp_path):
    folder = shutil.copytree(two_floors, tmp_path / "out")
    drawn = folder / "figures" / "decision.png"
    os.utime(drawn, (1, 1))
    two_floors_run(tmp_path)
    assert drawn.stat().st_mtime == 1
    drawn.unlink()
    two_floors_run(tmp_path)
    assert drawn.is_file()
    before = drawn.stat().st_mtime_ns
    two_floors_run(tmp_path, "--set", "decision.limits=['q2 <= 10 mm']")
    assert drawn.stat().st_mtime_ns > before


def test_every_figure_has_both_forms(two_floors):
    names = summary_of(two_floors)["figures"]
    stems = {name.removeprefix("figures/").rpartition(".")[0] for name in names}
    assert {"decision", "probability", "tolerances"} <= stems
    assert set(names) == {f"figures/{stem}.{kind}" for stem in stems for kind in ("svg", "png")}
    assert all((two_floors / name).stat().st_size > 1000 for name in names)


def image_dataset(young, shape=(4, 6)):
    """Result of an image or volume of two phases, of which one cell is open."""
    axes = ("z", "y", "x")[-len(shape) :]
    phase, is_open = np.zeros(shape), np.zeros(shape, np.uint8)
    phase[..., 3:] = 1
    is_open[tuple(n // 2 for n in shape)] = 1
    variables = {"E": (("alpha", "bound"), young), "phase": (axes, phase)}
    variables["is_open"] = (axes, is_open)
    attributes = {"lengths": (2e-6, 3e-6, 1e-6)[-len(shape) :], "phases": ["dark", "bright"]}
    return xarray.Dataset(variables, {"alpha": [0.0, 1.0], "bound": ["lower", "upper"]}, attributes)


VOLUME = [("y (µm)", "z (µm)", "x = 3 µm"), ("x (µm)", "z (µm)", "y = 6 µm"),
          ("x (µm)", "y (µm)", "z = 2 µm")]  # fmt: skip


@pytest.mark.parametrize(
    ("shape", "across", "share"),
    [
        ((4, 6), [("x (µm)", "y (µm)", "")], "4.17% of the pixels"),
        ((2, 4, 6), VOLUME, "2.08% of the voxels"),
    ],
)
def test_an_image_has_scales_a_legend_and_its_open_pixels(shape, across, share):
    young = 1e9 * np.array([[20.0, 30.0], [24.0, 26.0]])
    with figure_style():
        figure = material.image(image_dataset(young, shape))
        figure.draw_without_rendering()
        *pictures, cuts = figure.axes
        labels = [(x.get_xlabel(), x.get_ylabel(), x.get_title(loc="left")) for x in pictures]
        extents = [(x.get_xlim(), x.get_ylim()) for x in pictures]
        legend = [text.get_text() for text in figure.legends[0].get_texts()]
        overlays = [picture.images[1].get_array() for picture in pictures]
        plt.close(figure)
    assert labels == across
    assert extents[-1] == ((0, 6), (0, 12))
    assert legend == ["dark", "bright", f"open at α = 0: {share}"]
    assert [overlay.count() for overlay in overlays] == [1] * len(pictures)
    assert cuts.get_xlabel().startswith("Young's modulus E")


@pytest.mark.parametrize("width", [1e-6, 1e-4, 1e-2, 1.0])
def test_numbers_of_a_narrow_axis_stand_apart_and_whole(width):
    young = 29.8821e9 * np.array([[1 - width / 2, 1 + width / 2], [1.0, 1.0]])
    data = image_dataset(young)
    with figure_style():
        figure = material.image(data)
        figure.draw_without_rendering()
        axis = figure.axes[-1].xaxis
        low, high = axis.get_view_interval()
        labels = [x for x in axis.get_ticklabels() if low <= x.get_position()[0] <= high]
        boxes = [label.get_window_extent() for label in labels]
        plt.close(figure)
    assert len(boxes) >= 2
    assert all(left.x1 < right.x0 for left, right in itertools.pairwise(boxes))
    assert axis.get_offset_text().get_text() == ""
    ends = [float(label.get_text()) for label in (labels[0], labels[-1])]
    assert ends == pytest.approx([x.get_position()[0] for x in (labels[0], labels[-1])], rel=1e-9)


@pytest.mark.parametrize(
    ("nature", "peak", "lines", "words"),
    [
        ("estimated", None, 2, "± 250 mm (dashed)"),
        # as the table of peaks has it, with what lies between nodes
        ("estimated", 0.5, 2, "peak ± 500 mm (at nodes dashed)"),
        ("guaranteed", None, 0, ""),
    ],
)
def test_the_error_is_drawn_outside_bounds_that_it_may_pass(nature, peak, lines, words):
    one = np.ones((1, 2, 11))
    ends = {"lower": -one, "upper": one, "error": 0.25 * one}
    dataset = xarray.Dataset(
        {name: (("output", "alpha", "time"), values) for name, values in ends.items()},
        coords={"output": ["q1"], "alpha": [0.0, 1.0], "time": np.linspace(0, 1, 11)},
        attrs={"nature": nature},
    )
    task = SimpleNamespace(fuzzy=("k",))
    found = peak and SimpleNamespace(error=np.array([peak, 0.4]))
    unit = ShownUnit("mm", 1e3)
    with figure_style():
        (axes,) = envelope.envelope(dataset, Output("q1", "m"), task, unit, peak=found).axes
    dashed = [line for line in axes.lines if line.get_linestyle() == "--"]
    assert sorted(float(line.get_ydata()[0]) for line in dashed) == [-1.25, 1.25][:lines]
    title = " ".join(axes.get_title("left").split())
    assert words in title
    assert ("±" in title) == bool(words)


def test_numbers_and_bounds_are_drawn_with_their_own_ends():
    number = Triangular(1.0, 2.0, 4.0)
    with figure_style():
        _, axes = plt.subplots()
        (line,) = number.plot(axes, color="red").lines
        assert line.get_xydata().tolist() == [[1, 0], [1, 0], [2, 1], [2, 1], [4, 0], [4, 0]]
        frame, given = StoreyFrame([1e3], stiffness=[4e4], q0=[0.1]), {"duration": 1.0, "step": 0.1}
        motion = propagation.envelope(frame, {"m1": 1e3}, **given, alpha=[0, 1])
        bands = motion.plot(plt.subplots()[1]).collections
    ends = [band.get_paths()[0].get_extents() for band in bands]
    assert len(ends) == 2
    assert ends[0].ymax == pytest.approx(motion.upper[0].max())


def test_a_limit_of_zero_leaves_room_for_the_bars_of_others():
    bounds = [np.array([x]) for x in (0.01, 0.02, 0.0, 0.02, 0.0, 0.02)]
    peak = Peak(np.zeros(1), *bounds, Nature.ESTIMATED, side="max")
    limits = [Limit("q1", size, largest=True, event=f"{size}") for size in (0.0, 0.02)]
    (axes,) = answers.draw_decision(decide({"max q1": peak}, limits)).axes
    assert max(abs(end) for end in axes.get_xlim()) < 3


def fragility_of(rng, **asked):
    """Fragility of a floor under three records at random."""
    suite = [Accelerogram(0.02, rng.normal(size=40), name=f"r{x}") for x in range(3)]
    frame = StoreyFrame([2e4], stiffness=[8e6], damping_ratio=0.05)
    times = {"duration": 1.0, "step": 0.02, "alpha": (0, 1), "intensity": "PGA"}
    return fragility(frame, {"k1": Triangular(7.5e6, 8e6, 8.5e6)}, suite, **asked, **times)


def test_every_limit_of_a_fragility_is_drawn_with_its_fit_and_the_highest_level_as_a_line(rng):
    limits = [Limit("drift1", 0.01), Limit("q1", 0.02), Limit("a1", 4.0)]
    answer = fragility_of(rng, limits=limits)
    with figure_style():
        panels = answers.draw_fragility(answer).axes
    titles = [axes.get_title(loc="left") for axes in panels]
    assert titles == ["|drift1| ≤ 10.00 mm", "|q1| ≤ 20.00 mm", "|a1| ≤ 4.000 m/s²"]
    for axes in panels:
        assert len(axes.collections) == 1  # the band of the lowest level alone
        styles = [line.get_linestyle() for line in axes.lines]
        assert styles.count("-") == 2
        assert styles.count(":") in (1, 2)


def test_damage_states_share_a_figure_with_the_crossings_of_the_records(rng):
    states = {"slight": Limit("drift1", 0.01), "severe": Limit("drift1", 0.02)}
    answer = fragility_of(rng, states=states)
    with figure_style():
        (axes,) = answers.draw_states(answer).axes
    points, fit, _, of_severe, *_ = axes.lines
    crossings = answer.limits["slight"].critical.first_crossings
    # A point lies between the bounds of a crossing, and their orders keep the sorted ones apart.
    assert (np.sort(crossings.lower[-1]) <= points.get_xdata() * (1 + 1e-12)).all()
    assert (points.get_xdata() <= np.sort(crossings.upper[-1]) * (1 + 1e-12)).all()
    # Twice the limit of a linear frame is exceeded at twice the measure, with the same bounds.
    assert of_severe.get_xdata() == pytest.approx(2 * points.get_xdata(), rel=1e-12)
    # The median of the drawn curve is known to the distance of the drawn measures.
    median = answer.nominal_fit("slight").median
    x = fit.get_xdata()
    assert np.interp(0.5, fit.get_ydata(), x) == pytest.approx(median, rel=0, abs=x[1] - x[0])
    texts = [text.get_text() for text in axes.get_legend().get_texts()]
    assert [text.split(":")[0] for text in texts] == ["slight", "severe"]


def test_an_axis_takes_the_unit_that_is_shown():
    with figure_style():
        figure, axes = plt.subplots()
        axes.plot([0, 1], [0, 0.02])
        prefix_axis(axes, "drift", "m", shown=ShownUnit("cm", 100.0))
        figure.draw_without_rendering()
        assert axes.get_ylabel() == "drift (cm)"
        assert "2" in [label.get_text() for label in axes.get_yticklabels()]
        plt.close(figure)
