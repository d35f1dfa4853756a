"""No exact motion of any random frame leaves its dual bounds: free seeds, all kinds of outputs."""

import numpy as np
import pytest

from alphacut.frame import StoreyFrame, envelope
from alphacut.frame.calculus.unproved import UnprovedError
from alphacut.frame.dual.proof import DualProof
from alphacut.frame.dynamics.flow import LinearFlow
from alphacut.frame.dynamics.integrators import Exact
from alphacut.frame.structures.loads import Accelerogram
from alphacut.fuzzy import Interval

DURATION, STEP = 5.0, 0.05
POINTS = 10_000
OUTPUTS = 8
TIGHTEST = 6
"""Outputs, nodes and sides whose bounds are attacked by a search."""
NARROW = {"l": 0.3, "q": 1.0, "v": 1.0, "z": 2.0, "r": 2.0}
"""Multiples of the width by the first letter of an input."""


def record(rng):
    """Noise of a random band that rises and fades, 3 m/s² at most."""
    wave = np.convolve(rng.normal(size=250), np.hanning(rng.integers(3, 20)), "same")
    wave *= np.minimum(np.linspace(0, 4, 250), 1) * np.linspace(1, 0.2, 250)
    return Accelerogram(0.02, 3 * wave / np.abs(wave).max())


def frame(rng):
    """A frame of 2 to 10 storeys by columns or stiffnesses, under a record or free."""
    n = int(rng.integers(2, 11))
    own = {"masses": tuple(rng.uniform(2e4, 6e4, n))}
    if rng.random() < 0.5 and n > 2:
        own |= {"stiffness": tuple(rng.uniform(5e7, 2e8, n))}
    else:
        own |= {"lengths": tuple(rng.uniform(2.8, 4, n)), "modulus": 3e10}
        own |= {"second_moment": tuple(rng.uniform(2e-3, 6e-3, n))}
    if rng.random() < 0.5:
        own |= {"damping_ratio": float(rng.uniform(0.02, 0.06))}
    else:
        own |= {"rayleigh": (rng.uniform(0.2, 0.6), rng.uniform(5e-4, 2e-3))}
    free = rng.random() < 0.4
    if free or rng.random() < 0.3:
        own |= {"q0": tuple(rng.normal(0, 0.01, n)), "v0": tuple(rng.normal(0, 0.3, n))}
    if not free:
        own |= {"ground": record(rng)}
    kinds = [f"{kind}{z + 1}" for kind in ("q", "v", "a", "drift", "shear") for z in range(n)]
    outputs = rng.choice([*kinds, "base_shear"], OUTPUTS, replace=False)
    return StoreyFrame(**own, outputs=tuple(map(str, outputs)))


def inputs(structure, rng):
    """From 7 to 30 of the frame's parameters, ± 2 to 15 %."""
    names = [
        name for name, value in structure.parameters.items() if value and not name.startswith("d")
    ]
    count = min(int(rng.integers(7, 31)), len(names))
    width = rng.uniform(0.02, 0.15)
    fuzzy = {}
    for name in rng.choice(names, count, replace=False):
        value = structure.parameters[name]
        reach = abs(value) * width * NARROW.get(name[0], 1.0) * rng.uniform(0.3, 1)
        fuzzy[str(name)] = Interval(value - reach, value + reach)
    return fuzzy


def climbed(flow, ends, at, place):
    """Greatest side × output at a node that moves of single inputs reach from a point."""
    node, output, side = place
    best = -np.inf
    for _ in range(6):
        moves = np.repeat(at[None], 3 * len(at) + 1, 0)
        for i, (low, high) in enumerate(ends):
            moves[3 * i : 3 * i + 3, i] = low, (low + high) / 2, high
        values = side * flow.values(moves)[:, node, output]
        if values.max() <= best:
            break
        best, at = values.max(), moves[values.argmax()]
    return best


def leaves(structure, fuzzy, rng):
    """By how much the exact motion leaves its bounds at most, as a share of peaks; gap of peaks."""
    given = {"duration": DURATION, "step": STEP, "alpha": (0,), "progress": False}
    bounds = envelope(structure, fuzzy, method=DualProof(slabs=4, peaks=0.05), **given)
    flow = LinearFlow(structure, list(fuzzy), DURATION, STEP, Exact())
    ends = np.array([number.support for number in fuzzy.values()])
    outer = np.stack([-bounds.lower[0], bounds.upper[0]], -1)
    size, most = np.abs(outer).max((0, 2)), np.full(outer.shape, -np.inf)
    for piece in range(POINTS // 500):
        unit = rng.uniform(0, 1, (500, len(ends)))
        unit = unit.round() if piece % 2 else unit
        values = flow.values(ends[:, 0] + unit * (ends[:, 1] - ends[:, 0]))
        most = np.maximum(most, np.stack([-values.min(0), values.max(0)], -1))
    worst = float(((most - outer).max((0, 2)) / size).max())
    reached = np.maximum(most, np.stack([-bounds.inner.lower[0], bounds.inner.upper[0]], -1))
    tight = ((outer - reached) / size[:, None])[1:].ravel().argsort()[:TIGHTEST]
    points = np.stack([bounds.lower_at[0], bounds.upper_at[0]], 2)
    for node, output, side in zip(*np.unravel_index(tight, outer[1:].shape), strict=True):
        place = node + 1, output, (-1, 1)[side]
        at = points[node + 1, output, side]
        value = climbed(flow, ends, at, place)
        worst = max(worst, float((value - outer[node + 1, output, side]) / size[output]))
    return worst, bounds.facts["gap_of_peaks"], bounds.facts["single_modes"]


@pytest.mark.slow
@pytest.mark.parametrize("chunk", range(6))
def test_no_exact_motion_leaves_a_bound(chunk):
    gaps = []
    for _ in range(10):
        seed = int(np.random.SeedSequence().entropy % 2**32)
        rng = np.random.default_rng(seed)
        structure = frame(rng)
        fuzzy = inputs(structure, rng)
        try:
            worst, gap, single = leaves(structure, fuzzy, rng)
        except UnprovedError as error:
            print(f"seed {seed}: {len(fuzzy)} inputs, {structure.floors} storeys, {error}")
            continue
        print(
            f"seed {seed}: {len(fuzzy)} inputs, {structure.floors} storeys, {single} single, "
            f"gap {gap:.3g}, leaves {worst:.2g}"
        )
        assert worst <= 1e-9, f"seed {seed}"
        gaps.append(gap)
    print(f"median gap {np.median(gaps):.3g} of {len(gaps)}")
    assert len(gaps) > 4
