"""Exact motions at single inputs agree with forty digits, and with the judge of the proofs."""

import mpmath as mp
import numpy as np
import pytest

from alphacut.frame import (
    Accelerogram,
    DualProof,
    Force,
    History,
    StoreyFrame,
    UnprovedError,
    envelope,
)
from alphacut.frame.bounds.box import Box
from alphacut.frame.bounds.box_proof import ROUNDING_MARGIN
from alphacut.frame.modes.point_modes import PointModes
from alphacut.frame.verification.self_test import structures_at
from alphacut.fuzzy import Crisp, Interval
from tests.frame.calculus.test_taylor_model import exact_value
from tests.frame.modes.test_blocks import masses_on_springs
from tests.frame.response.test_responses import exact_response

IDLE = 0.01
"""Share of a bound of rounding that the largest of some errors reaches at least."""


def exact_modes(springs, masses):
    """λ and shapes of unit mass, one a mode, of a shear frame by 40 digits."""
    n = len(springs)
    k, m = ([mp.mpf(x) for x in values] for values in (springs, masses))
    matrix = mp.zeros(n)
    for i in range(n):
        matrix[i, i] = (k[i] + (k[i + 1] if i + 1 < n else 0)) / m[i]
        if i:
            matrix[i, i - 1] = matrix[i - 1, i] = -k[i] / mp.sqrt(m[i] * m[i - 1])
    squared, vectors = mp.eigsy(matrix)
    return squared, [[vectors[i, e] / mp.sqrt(m[i]) for i in range(n)] for e in range(n)]


def exact_output(frame, springs, masses, time, output):
    """An output of a shear frame at one time by 40 digits."""
    n, z = len(springs), int(output[-1]) - 1
    m = [mp.mpf(float(x)) for x in masses]
    squared, shapes = exact_modes(springs, masses)
    order, total = {"v": 1, "a": 2}.get(output[0], 0), mp.mpf(0)
    for e, x in enumerate(shapes):
        decay = mp.mpf(frame.damping_ratio) * mp.sqrt(squared[e])
        sigma = mp.mpc(-decay, mp.sqrt(squared[e] - decay**2))
        read = x[z] - (x[z - 1] if z and output.startswith("drift") else 0)
        free = sigma**order * mp.exp(sigma * mp.mpf(float(time)))
        start, speed = (
            mp.fsum(x[i] * m[i] * mp.mpf(float(values[i])) for i in range(n) if len(values))
            for values in (frame.q0, frame.v0)
        )
        wave = (speed + decay * start) * free.imag / sigma.imag + start * free.real
        if frame.ground is not None:
            driven = mp.fsum(x[i] * m[i] for i in range(n))
            rho = exact_response(sigma, frame.ground, time)
            wave -= driven * (sigma**order * rho).imag / sigma.imag
        total += read * wave
    return total


def drawn(seed, stiff, ground, **start):
    """A frame of three storeys, the lowest `stiff` times stiffer, and a box around it."""
    rng = np.random.default_rng(seed)
    masses, springs = rng.uniform(1e4, 5e4, 3), rng.uniform(3e7, 1e8, 3)
    springs[0] *= stiff
    frame = StoreyFrame(
        masses=masses,
        stiffness=springs,
        damping_ratio=0.02,
        ground=ground,
        outputs=("q3", "drift2", "v1", "a2"),
        **start,
    )
    names = ("k1", "k2", "k3", "m1", "m2", "m3")
    centre, time = np.r_[springs, masses], np.arange(61) * 0.017
    return frame, Box(frame, names, time, 0.9 * centre, 1.1 * centre), rng


RECORD = Accelerogram(0.02, np.random.default_rng(2).normal(size=40))
SLOW = Accelerogram(0.3, np.random.default_rng(2).normal(size=6))
STARTED = {"q0": (0.01, 0.0, 0.02), "v0": (0.1, -0.5, 0.2)}


@pytest.mark.parametrize(
    ("stiff", "ground", "start"),
    [(1, RECORD, {}), (1e3, RECORD, {}), (1, None, STARTED), (1e3, SLOW, STARTED)],
    ids=["record", "stiff storey", "free", "stiff storey, slow record and start"],
)
def test_motions_agree_with_forty_digits(stiff, ground, start):
    frame, box, rng = drawn(int(np.log10(stiff)), stiff, ground, **start)
    unit = np.vstack([np.zeros((4, 6)), rng.uniform(-1, 1, (4, 6))])
    node, output = rng.integers(1, 61, 8), np.arange(8) % 4
    found = box.exact_values(unit, node, output)
    size = np.abs(box.midpoint_modes.response(box.time)).max(0)
    with mp.workdps(40):
        for i, point in enumerate(box.inputs(unit)):
            time, name = box.time[node[i]], frame.outputs[i % 4]
            true = exact_output(frame, point[:3], point[3:], time, name)
            assert abs(found[i] - float(true)) <= ROUNDING_MARGIN * size[i % 4]


@pytest.mark.parametrize("strong", [False, True], ids=["light", "one mode without oscillation"])
def test_motions_with_dashpots_are_those_of_the_judge(strong, rng):
    """With forces, a record and a start; at nodes of one motion, and at single nodes of several."""
    n = 4
    masses, springs = rng.uniform(1e4, 5e4, n), rng.uniform(3e7, 1e8, n)
    dampers = rng.uniform(0.01, 0.1, n) * np.sqrt(masses * springs)
    if strong:
        dampers[0] = 8 * np.sqrt(masses.sum() * springs[0])
    frame = StoreyFrame(
        masses,
        stiffness=springs,
        dampers=dampers,
        damper_placement="storey",
        ground=RECORD,
        loads=[Force(n, 1e5, History(0.05, rng.normal(size=12)))],
        v0=rng.normal(size=n),
        outputs=("q1", "v2", "a4", "drift3"),
    )
    names, time = ("k1", "d2"), np.arange(61) * 0.017
    points = np.array([springs[0], dampers[1]]) * rng.uniform(0.9, 1.1, (5, 2))
    judged = np.stack([x.outputs(time).values for x in structures_at(frame, names, points)])
    size = ROUNDING_MARGIN * np.abs(judged).max((0, 1))
    modes = PointModes.of_system(frame, names, points)
    assert (np.abs(modes.response(time) - judged[0]) <= size).all()
    point, node, output = rng.integers(5, size=40), rng.integers(61, size=40), np.arange(40) % 4
    found = modes.values(point, node, output, time)
    assert (np.abs(found - judged[point, node, output]) <= size[output]).all()
    fine = np.linspace(0, time[-1], 8 * 60 + 1)
    values = modes.response(fine)
    chords = np.array([np.interp(fine, time, x) for x in values[::8].T]).T
    off = np.abs(values - chords)[1:].reshape(60, 8, -1).max(1)
    assert (off <= modes.interpolation_error(time)[1:] + size).all()


def test_equal_frequencies_do_not_lift_the_rounding():
    """Two alike masses on two alike springs: the modes of the pair are any two of a plane."""
    centre, time = np.array([3.0, 3.0, 7.0]), np.arange(0, 9.01, 0.5)
    box = Box(masses_on_springs(centre), ("a", "b", "c"), time, 0.9 * centre, 1.1 * centre)
    value = box.midpoint_modes.response(time)
    exact = np.sum(np.sin(np.sqrt(centre) * time[:, None]) / np.sqrt(centre), 1)
    assert np.abs(value[:, 0] - exact).max() <= 1e-13


def test_the_margin_alone_holds_the_judges_motion_at_crisp_inputs(rng):
    """Guaranteed and attained bounds are one motion there, from which the judge's differs."""
    frame = drawn(int(rng.integers(1000)), 1, RECORD, **STARTED)[0]
    value = frame.parameters["k1"]
    given = {"duration": 1.02, "step": 0.017, "alpha": [0.0], "progress": False}
    found = envelope(frame, {"k1": Crisp(value)}, DualProof(workers=1), **given)
    (judge,) = structures_at(frame, ("k1",), np.array([[value]]))
    values = judge.outputs(found.time).values
    assert (values <= found.upper[0]).all()
    assert (values >= found.lower[0]).all()
    peak = np.abs(values).max(0)
    assert (np.ptp([found.lower[0], found.upper[0]], axis=0).max(0) <= 1e-8 * peak).all()


def test_a_gap_below_what_rounding_may_be_is_refused():
    frame, _, _ = drawn(1, 1, RECORD)
    value = frame.parameters["k1"]
    given = {"duration": 0.34, "step": 0.017, "alpha": [0.0], "progress": False}
    with pytest.raises(UnprovedError, match="rounding of the response may be"):
        envelope(frame, {"k1": Interval(value, 1.01 * value)}, DualProof(peaks=5e-9), **given)


@pytest.mark.parametrize("stiff", [1.0, 1e4])
def test_modes_over_a_narrow_box_are_off_by_their_rounding_at_most(stiff):
    """In 1e-9 of each input, what the series leave out is far below rounding."""
    frame, box, rng = drawn(1, stiff, RECORD)
    radius = 1e-9 * box.midpoint
    narrow = Box(frame, box.names, box.time, box.midpoint - radius, box.midpoint + radius)
    single = narrow.level().models.oscillators
    assert len(single) == 3
    ends = [
        (mp.mpf(float(a)), mp.mpf(float(b))) for a, b in zip(narrow.low, narrow.high, strict=True)
    ]
    shares = {"omega": [], "share": []}
    with mp.workdps(40):
        for u in rng.uniform(-1, 1, (6, 6)):
            unit = [mp.mpf(float(x)) for x in u]
            p = [(a + b) / 2 + (b - a) / 2 * x for (a, b), x in zip(ends, unit, strict=True)]
            for mode, squared, x in zip(single, *exact_modes(p[:3], p[3:]), strict=True):
                omega = mp.sqrt(squared * (1 - mp.mpf(frame.damping_ratio) ** 2))
                share = x[2] * mp.fsum(x[i] * p[3 + i] for i in range(3))
                pairs = ("omega", mode.omega, omega), ("share", mode.participation[0, 0], share)
                for name, model, true in pairs:
                    off = abs(exact_value(model, unit) - true)
                    shares[name].append(float(off) / float(model.remainder))
    for values in shares.values():
        assert IDLE <= np.max(values) <= 1
