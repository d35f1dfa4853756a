"""No exact motion leaves a dual bound; and the bounds are near."""

import numpy as np
import pytest

from alphacut.frame import Accelerogram, DualProof, MatrixStructure, StoreyFrame, envelope
from alphacut.fuzzy import Nature, Triangular
from tests.frame.motions import exact_motions, random_points, require_inside


def record(seconds=6.0, step=0.02, seed=1):
    """Filtered noise that rises and fades, 3 m/s² at most."""
    rng, count = np.random.default_rng(seed), int(seconds / step) + 1
    noise = np.convolve(rng.normal(size=count + 9), np.hanning(11)[1:], "same")[:count]
    rise = np.linspace(0, 3, count)
    shaped = noise * np.minimum(rise, 1) * np.exp(-rise)
    return Accelerogram(step, 3 * shaped / np.abs(shaped).max())


def near(value, share):
    return Triangular(value * (1 - share), value, value * (1 + share))


def each_storey(n, stiffness=0.08, mass=0.05):
    own = {f"k{z + 1}": near(1.2e8, stiffness) for z in range(n)}
    return own | {f"m{z + 1}": near(6e4, mass) for z in range(n)}


def storeys(n, **values):
    return StoreyFrame(masses=(6e4,) * n, stiffness=(1.2e8,) * n, **values)


def coupled():
    """Three masses in a triangle of springs, from matrices."""
    springs = [np.outer(row, row) for row in ([1, 0, 0], [1, -1, 0], [0, 1, -1], [1, 0, -1])]
    return MatrixStructure(
        {"a": 4e4, "b": 2e4, "m": 100.0, "z": 0.03},
        mass=[("m", np.diag([1.0, 0.5, 0.7]))],
        stiffness=[
            ("a", springs[0]),
            (lambda p: p["a"] * p["b"] ** 0.5 / 200, springs[1]),
            ("b", springs[2]),
            (5e3, springs[3]),
        ],
        observed={"q1": np.array([1.0, 0, 0]), "v3": np.array([0, 0, 0, 0, 0, 1.0])},
        v0=np.array([0.0, 1.0, -0.5]),
        ratios=("z",),
    )


CASES = {
    "record": (
        storeys(
            3,
            damping_ratio=0.03,
            ground=record(),
            outputs=("q3", "drift1", "v2", "a3", "base_shear"),
        ),
        each_storey(3) | {"zeta": Triangular(0.02, 0.03, 0.04)},
    ),
    "free, start and Rayleigh fuzzy": (
        storeys(
            2,
            q0=(0.01, 0.02),
            v0=(-0.5, 0.2),
            rayleigh=(0.4, 1e-3),
            outputs=("q1", "drift2", "a1", "shear2"),
        ),
        each_storey(2, 0.05, 0.03)
        | {
            "rayleigh_mass": near(0.4, 0.2),
            "rayleigh_stiffness": near(1e-3, 0.2),
            "q2_0": near(0.02, 0.1),
            "v2_0": near(0.2, 0.3),
        },
    ),
    "columns with weights, record and start": (
        StoreyFrame(
            masses=(2e4, 1e4),
            lengths=(3.0, 2.8),
            modulus=3e10,
            second_moment=4e-4,
            gravity=9.81,
            damping_ratio=0.02,
            ground=record(seed=3),
            v0=(0.1, 0.2),
            outputs=("q2", "shear1", "a2"),
        ),
        {
            "E": near(3e10, 0.06),
            "I": near(4e-4, 0.03),
            "l1": near(3.0, 0.01),
            "m1": near(2e4, 0.05),
            "m2": near(1e4, 0.05),
        },
    ),
    "matrices": (
        coupled(),
        {
            "a": near(4e4, 0.1),
            "b": near(2e4, 0.1),
            "m": near(100.0, 0.05),
            "z": Triangular(0.02, 0.03, 0.05),
        },
    ),
}


@pytest.fixture(scope="module", params=list(CASES))
def case(request):
    model, fuzzy = CASES[request.param]
    given = {"duration": 2.0, "step": 0.05, "alpha": (0, 1), "progress": False}
    return model, envelope(model, fuzzy, method=DualProof(), **given)


def test_no_exact_motion_leaves_a_bound_and_peaks_have_small_gaps(case, rng):
    model, found = case
    for level, alpha in enumerate(found.alpha):
        points = random_points(found.inputs, 400, rng, alpha)
        motions = exact_motions(model, points, found.inputs, 2.0, 0.05)
        require_inside(motions, found, level, slack=1e-9)
    assert found.nature == Nature.GUARANTEED
    assert found.facts["gap_of_peaks"] < 0.06
    assert (np.nanmedian(found.error[1], 0) <= 0.08 * np.abs(found.upper[1]).max(0)).all()


def test_a_motion_in_other_units_has_the_same_bounds():
    def bounds(factor):
        shaken = Accelerogram(0.02, factor * record(2.0).samples)
        frame = storeys(2, damping_ratio=0.03, ground=shaken, outputs=("q2", "drift1", "a2"))
        return envelope(frame, each_storey(2), DualProof(), duration=0.6, step=0.02, alpha=(0,))

    metres = bounds(1.0)
    allowed = 1e-9 * metres.upper.max((0, 1))
    for unit in (1e-6, 3e5):
        others = bounds(unit)
        assert (np.abs(others.upper / unit - metres.upper) <= allowed).all()
        assert (np.abs(others.lower / unit - metres.lower) <= allowed).all()
