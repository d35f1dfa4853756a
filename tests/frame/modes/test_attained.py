"""Exact motions at single inputs agree with forty digits, and their rounding with its bound."""

from dataclasses import replace

import mpmath as mp
import numpy as np
import pytest
from scipy.linalg import eigh

from alphacut.frame import Accelerogram, DualProof, StoreyFrame, envelope
from alphacut.frame.bounds.box import Box
from alphacut.frame.modes.superposition import _curvature_bound, modes_at
from alphacut.fuzzy import Interval
from tests.frame.calculus.test_taylor_model import exact_value
from tests.frame.modes.test_blocks import masses_on_springs
from tests.frame.response.test_responses import exact_response

UNDAMPED_MODES = "alphacut.frame.modes.superposition.undamped_modes"
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
    [(1, RECORD, {}), (1e4, RECORD, {}), (1, None, STARTED), (1e6, SLOW, STARTED)],
    ids=["record", "stiff storey", "free", "stiff storey, slow record and start"],
)
def test_motions_are_off_by_their_rounding_at_most(stiff, ground, start):
    frame, box, rng = drawn(int(np.log10(stiff)), stiff, ground, **start)
    unit = np.vstack([np.zeros((4, 6)), rng.uniform(-1, 1, (4, 6))])
    node, output = rng.integers(1, 61, 8), np.arange(8) % 4
    value, error = box.exact_values(unit, node, output)
    motion = box.midpoint_response()
    values, errors = (
        np.append(x, of_all[node[:4], output[:4]])
        for x, of_all in zip((value, error), motion, strict=True)
    )
    points = np.vstack([box.inputs(unit), np.tile(box.midpoint, (4, 1))])
    shares = []
    with mp.workdps(40):
        for i, point in enumerate(points):
            time, name = box.time[node[i % 8]], frame.outputs[i % 4]
            true = exact_output(frame, point[:3], point[3:], time, name)
            shares.append(float(abs(true - mp.mpf(float(values[i])))) / errors[i])
    assert IDLE <= np.max(shares) <= 1


def test_eigenvalues_move_with_squared_frequencies_as_far_as_stated():
    """Damped by the springs so that σ moves along the real axis alone: that is its decay's slope."""
    stiffness = 50.0
    frame = StoreyFrame([1.0], stiffness=[stiffness], rayleigh=(0, (2 / stiffness) ** 0.5))
    box = Box(
        frame, ("k1",), np.arange(2.0), np.array([0.9 * stiffness]), np.array([1.1 * stiffness])
    )
    unit = np.array([[-1e-5], [0.0], [1e-5]])
    found = modes_at(frame, box.structure, ("k1",), box.inputs(unit), unit)
    slope = np.abs(np.ptp(found.sigma.real) / np.ptp(found.eigenvalues))
    stated = 1 / (2 * found.sigma.imag[1, 0])
    assert slope <= stated * (1 + 1e-6) <= 1.001 * slope


@pytest.mark.parametrize("source", ["velocity", "start"])
def test_responses_bend_with_eigenvalues_as_far_as_stated(source, rng):
    """Against differences of forty digits, with all three kinds of damping, heavy ones too."""
    reached = 0.0
    with mp.workdps(40):
        for _ in range(300):
            order, time = int(rng.integers(0, 3)), mp.mpf(rng.uniform(0, 3))
            eigenvalue = 10 ** rng.uniform(-1, 3)
            damping = rng.dirichlet(np.ones(4))[:3] * rng.uniform(0, 1.2) ** 2
            a, b, zeta = damping * [2 * eigenvalue**0.5, 2 / eigenvalue**0.5, 1.0]

            def response(x, a=a, b=b, zeta=zeta, order=order, time=time):
                decay = (a + b * x) / 2 + zeta * mp.sqrt(x)
                sigma = mp.mpc(-decay, mp.sqrt(x - decay**2))
                G = sigma**order * mp.exp(sigma * time)
                if source == "start":
                    return G.real + decay / sigma.imag * G.imag
                return G.imag / sigma.imag

            decay = (a + b * eigenvalue) / 2 + zeta * eigenvalue**0.5
            if decay**2 >= 0.95 * eigenvalue:
                continue
            step = mp.mpf(eigenvalue) * mp.mpf(10) ** -10
            below, at, above = (response(mp.mpf(eigenvalue) + k * step) for k in (-1, 0, 1))
            bend = float(abs(above - 2 * at + below) / step**2)
            sigma = np.array([[-decay + 1j * np.sqrt(eigenvalue - decay**2)]])
            given = [np.array([[x]]) for x in (order, 1.0, float(time))]
            bound = _curvature_bound(source, sigma, *given)[0, 0]
            assert bend <= bound
            reached = max(reached, bend / bound)
    assert reached > 0.3


def shifted(shift, turn=0.0, rng=None):
    """A function for `undamped_modes` whose eigenvalues and shapes are wrong by these fractions."""

    def modes(M, K):
        of_matrices = zip(K.reshape(-1, *K.shape[-2:]), M.reshape(-1, *M.shape[-2:]), strict=True)
        found = [eigh(*pair) for pair in of_matrices]
        eigenvalues = np.reshape([x for x, _ in found], K.shape[:-1])
        shapes = np.reshape([x for _, x in found], K.shape)
        if turn:
            n = M.shape[-1]
            shapes = shapes @ (np.eye(n) + turn * rng.normal(size=(n, n)))
        return eigenvalues * (1 + shift), shapes

    return modes


def test_what_wrong_modes_do_to_second_order_is_in_the_error(monkeypatch):
    """Of two pulses the slope by the eigenvalue cancels, and the curvature does not."""
    omega, h = 32 * np.pi, 2.0**-7
    quarter = 2.0**-6  # a quarter of the period
    samples = np.zeros(400)
    samples[[64, 64 + 128]] = -(1 + quarter), 2 + quarter
    frame = StoreyFrame([1.0], stiffness=[omega**2], ground=Accelerogram(h, samples))
    end = h * 64 + 2 + quarter
    time, centre = np.array([0.0, end]), np.array([omega**2])
    box = Box(frame, ("k1",), time, 0.9 * centre, 1.1 * centre)
    given = np.zeros((1, 1)), np.ones(1, int), np.zeros(1, int)
    exact = box.exact_values(*given).value
    monkeypatch.setattr(UNDAMPED_MODES, shifted(1e-5))
    value, error = box.exact_values(*given)
    off = np.abs(value - exact)
    assert (off <= error).all()
    assert (off >= 0.5 * error).all()


@pytest.mark.parametrize("ratios", [0.02, (0.02, 0.03, 0.05)], ids=["one ratio", "three"])
@pytest.mark.parametrize("turn", [1e-10, 1e-7, 1e-5])
@pytest.mark.parametrize("ground", [None, RECORD], ids=["free", "record"])
def test_modes_that_are_wrong_on_purpose_are_off_by_their_error_at_most(
    turn, ratios, ground, monkeypatch, rng
):
    frame, box, _ = drawn(3, 1, ground, **(STARTED if ground is None else {}))
    frame = replace(frame, damping_ratio=ratios)
    box = replace(box, system=frame)
    unit = rng.uniform(-1, 1, (16, 6))
    node, output = rng.integers(1, 61, 16), np.arange(16) % 4
    exact = box.exact_values(unit, node, output).value
    monkeypatch.setattr(UNDAMPED_MODES, shifted(turn, turn, rng))
    value, error = box.exact_values(unit, node, output)
    shares = np.abs(value - exact) / error
    assert 1e-3 <= shares.max() <= 1


def test_equal_frequencies_do_not_lift_the_rounding():
    """Two alike masses on two alike springs: the modes of the pair are any two of a plane."""
    centre, time = np.array([3.0, 3.0, 7.0]), np.arange(0, 9.01, 0.5)
    box = Box(masses_on_springs(centre), ("a", "b", "c"), time, 0.9 * centre, 1.1 * centre)
    value, error = box.midpoint_response()
    exact = np.sum(np.sin(np.sqrt(centre) * time[:, None]) / np.sqrt(centre), 1)
    assert (np.abs(value[:, 0] - exact) <= error[:, 0] + 4e-16).all()
    assert error.max() < 1e-12


def test_rounding_of_attained_bounds_is_declared():
    """A storey that is stiffer by 1e6 is read as a difference of nearly equal displacements."""
    rng = np.random.default_rng(0)
    masses, springs = rng.uniform(1e4, 5e4, 3), np.array([5e7, 7e13, 8e7])
    frame = StoreyFrame(
        masses=masses, stiffness=springs, damping_ratio=0.05, ground=RECORD, outputs=("shear2",)
    )
    inputs = {"k1": Interval(4.9e7, 5.1e7), "m2": Interval(0.98 * masses[1], 1.02 * masses[1])}
    given = {"duration": 0.1, "step": 0.02, "alpha": (0,), "progress": False}
    found = envelope(frame, inputs, method=DualProof(), **given)
    assert found.attained_error.max() > 1e-9 * np.abs(found.upper).max()


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
