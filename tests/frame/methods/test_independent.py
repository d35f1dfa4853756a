"""What followers may have missed enters their error; where trajectories part there is none."""

import numpy as np
import pytest

from alphacut.frame import GraphFollower, ImprovedFollower, LagrangianFlow, envelope, pendulum
from alphacut.frame.boxes import Boxes, UnitFlow
from alphacut.frame.methods import graph_follower, improved_follower
from alphacut.frame.methods.independent import independent_excess
from alphacut.fuzzy import Interval, Nature

METHODS = {graph_follower: GraphFollower(), improved_follower: ImprovedFollower()}


@pytest.mark.parametrize("module", METHODS)
def test_what_an_independent_sample_reaches_beyond_the_bounds_counts_twice(monkeypatch, module):
    monkeypatch.setattr(
        module, "independent_excess", lambda flow, bounds, progress: (np.full((1, 2), 30.0), 5)
    )
    inputs, motion = {"l": Interval(0.99, 1.01)}, {"duration": 0.5, "step": 0.05, "alpha": (0,)}
    error = envelope(pendulum(), inputs, method=METHODS[module], **motion).error
    assert error == pytest.approx(60, abs=2)


def test_bounds_that_are_too_narrow_are_left_by_as_much():
    cut = Boxes(("l",), np.zeros(1), np.array([[0.99]]), np.array([[1.01]]), np.ones(1))
    flow = UnitFlow(LagrangianFlow(pendulum(), ("l",), 0.5, 0.05), cut)
    ends = flow.values(np.linspace(*flow.boxes.unit(0), 200))
    bounds = np.stack([-ends.min(0), ends.max(0)], axis=-1)[None]
    size = 0.1 * np.ptp(ends, axis=(0, 1))
    told: list[float] = []
    missed, _ = independent_excess(flow, bounds - size[:, None], told.append)
    assert missed[0] == pytest.approx(size, rel=1e-2)
    assert independent_excess(flow, bounds + size[:, None], told.append)[0].max() == 0


@pytest.mark.parametrize(("start", "nature"), [(2.9, Nature.ESTIMATED), (3.14, Nature.ATTAINED)])
def test_bounds_about_a_separatrix_are_attained_and_no_more(start, nature):
    """A pendulum let go near its top falls to either side."""
    system = pendulum(phi0=start, damping=0.0)
    found = envelope(
        system,
        {"phi_0": Interval(start - 0.05, start + 0.05)},
        duration=3.0,
        step=0.05,
        alpha=(0,),
        method=ImprovedFollower(1e-2, budget=200),
    )
    assert found.nature is nature
