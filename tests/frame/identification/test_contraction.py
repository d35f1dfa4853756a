"""The box of parameters that agree with frequencies alone holds them, and little more."""

import numpy as np
import pytest

from alphacut.frame import StoreyFrame, identify, measured_mode
from alphacut.fuzzy import Interval


def frequencies_of(stiffness, masses):
    """Natural frequencies in Hz of many frames of two storeys, shape (frames, 2)."""
    first, second = np.moveaxis(stiffness, -1, 0)
    matrix = np.stack(
        [np.stack([first + second, -second], -1), np.stack([-second, second], -1)], -2
    )
    root = 1 / np.sqrt(masses)
    squares = np.linalg.eigvalsh(matrix * np.outer(root, root))
    return np.sqrt(squares) / (2 * np.pi)


def test_two_frequencies_give_the_box_of_the_set(rng):
    masses = rng.uniform(1e3, 2e3, 2)
    true = rng.uniform(2e6, 4e6, 2)
    (exact,) = frequencies_of(true[np.newaxis], masses)
    prior = [(0.3 * x, 3 * x) for x in true]
    scatter = rng.uniform(0.99, 1.01, (5, 2))
    scatter /= scatter.mean(axis=0)  # any two ratios may be those of no frame
    modes = [measured_mode(n, exact[n - 1] * scatter[:, n - 1]) for n in (1, 2)]
    frame = StoreyFrame(list(masses), stiffness=list(true))
    inputs = {f"k{i + 1}": Interval(*ends) for i, ends in enumerate(prior)}
    learned = identify(frame, inputs, modes, alpha=[0.1])
    low, high = np.array([(x.low, x.high) for x in learned.evidence.modes(0.1)]).T

    def agreeing(factor):
        """Frames with such frequencies of two grids: a prior that is wider by a factor, and the box.

        The box is widened by 5 %, and cut by that prior.
        """
        wide = np.array(prior).T * np.array([[1 / factor], [factor]])
        near = np.array([learned.lower[0] / 1.05, learned.upper[0] * 1.05])
        points = np.concatenate([
            np.stack(np.meshgrid(*np.geomspace(*ends, 700).T), -1).reshape(-1, 2)
            for ends in (wide, np.clip(near, *wide))
        ])  # fmt: skip
        squares = (2 * np.pi * frequencies_of(points, masses)) ** 2
        return points[((squares >= low) & (squares <= high)).all(axis=1)]

    agree = agreeing(1.0)
    assert len(agree) > 0
    assert (agree >= learned.lower[0]).all()
    assert (agree <= learned.upper[0]).all()
    # The box reaches to their sides; frames just beyond the prior may not be told from those in it.
    around = agreeing(1.01)
    spacing = np.array([np.log(1.01**2 * b / a) for a, b in prior]) / 699
    beyond_low = np.log(around.min(axis=0) / learned.lower[0])
    beyond_high = np.log(learned.upper[0] / around.max(axis=0))
    width = np.log(learned.upper[0] / learned.lower[0])
    allowed = 0.03 * width + 10 * spacing
    assert (beyond_low < allowed).all()
    assert (beyond_high < allowed).all()


def test_a_frequency_that_no_frame_has_refutes_it(rng):
    frame = StoreyFrame([1.0, 1.0], stiffness=[100.0, 100.0])
    inputs = {"k1": Interval(90, 110), "k2": Interval(90, 110)}
    mode = measured_mode(1, list(2.0 * rng.uniform(0.99, 1.01, 4)))
    assert identify(frame, inputs, [mode], alpha=[0.1]).is_refuted


def test_a_measured_frequency_that_tells_nothing_leaves_the_prior():
    frame = StoreyFrame([1.0, 1.0], stiffness=[100.0, 100.0])
    inputs = {"k1": Interval(99, 101), "k2": Interval(99, 101)}
    mode = measured_mode(1, [0.9, 1.0, 1.1])
    learned = identify(frame, inputs, [mode], alpha=[0.1])
    assert learned.narrowed["k1"] == pytest.approx(1.0)
