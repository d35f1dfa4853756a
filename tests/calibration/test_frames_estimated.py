"""Estimated bounds of random frames, the hard kinds among them: their errors cover."""

from dataclasses import replace

import numpy as np
import pytest

from alphacut.frame import GraphFollower, ImprovedFollower, envelope
from alphacut.frame.structures.linear import frequencies
from alphacut.fuzzy import Interval, Nature
from tests.calibration.declared import MOST, Calibration, free_seed
from tests.calibration.motions import exact_flow, judged, random_frame, reached

TOLERANCE = 1e-3
METHODS = [GraphFollower(tolerance=TOLERANCE), ImprovedFollower(TOLERANCE)]


def usual(rng):
    """Up to nine inputs."""
    return random_frame(rng, inputs=int(rng.integers(1, 10)))


def undamped(rng):
    """Nothing forgets its phase."""
    return random_frame(rng, inputs=int(rng.integers(1, 6)), damped=False)


def large_steps(rng):
    """Undamped, with nodes half of the longest period apart."""
    drawn = undamped(rng)
    step = np.pi / float(frequencies(drawn.system)[0])
    return replace(drawn, step=step, duration=20 * step)


def wide(rng):
    """One stiffness from a thirtieth of its value to thirty times it."""
    drawn = random_frame(rng, inputs=1)
    value = drawn.system.parameters["k1"]
    return replace(drawn, inputs={"k1": Interval(0.03 * value, 30 * value)})


def coupled(rng):
    """Seven inputs or more, and a dashpot that couples the modes, which `auto` follows."""
    drawn = random_frame(rng, inputs=int(rng.integers(7, 10)), storeys=(3, 5))
    at_first = (2e4, *(0.0,) * (len(drawn.system.masses) - 1))
    return replace(drawn, system=replace(drawn.system, dampers=at_first))


def require_reached(found, flow, rng, count=20):
    """Requires that the motions which an envelope names take its values, at random nodes."""
    _, nodes, outputs = found.upper.shape
    at = rng.integers(nodes, size=count), rng.integers(outputs, size=count)
    for bound, points in ((found.lower, found.lower_at), (found.upper, found.upper_at)):
        values = flow.values(points[0][at])[np.arange(count), *at]
        size = np.abs(bound[0]).max(0)[at[1]]
        assert (np.abs(values - bound[0][at]) <= 1e-6 * size).all()


KINDS = {"usual": usual, "undamped": undamped, "large steps": large_steps, "wide": wide}
KINDS["coupled"] = coupled


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_errors_of_searches_and_followers_cover(kind):
    seed = free_seed(kind)
    table = Calibration(f"frames under estimate, {kind}: declared over true", seed)
    natures = set()
    for number in range(6):
        rng = np.random.default_rng([seed, number])
        drawn = KINDS[kind](rng)
        ends = reached(exact_flow(drawn), drawn.inputs, rng)
        for method in METHODS[1:] if kind == "coupled" else METHODS:
            found = envelope(
                drawn.system, drawn.inputs, method=method, integrator="exact", **drawn.motion
            )
            natures.add(found.nature)
            case = number, method.name, *drawn.inputs
            judged(table, found, ends, method.name, case, tolerance=TOLERANCE)
            if found.nature is Nature.ATTAINED:  # which promises what some motion does
                require_reached(found, exact_flow(drawn), rng)
    if natures != {Nature.ATTAINED}:
        # From nodes half a period apart nobody sees which basin goes on: errors cover, and are wide.
        table.judge(np.inf if kind == "large steps" else MOST)
