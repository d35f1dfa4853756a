"""The safe scaling of tolerances: proved inside, refuted just outside."""

from dataclasses import replace

import numpy as np
import pytest

from alphacut.frame import StoreyFrame
from alphacut.frame.decisions import safe_scale as module
from alphacut.frame.decisions.limit_search import LimitSearch
from alphacut.frame.decisions.safe_scale import _easily, limit_search, safe_scale, scaled
from alphacut.frame.dynamics.flow import LinearFlow
from alphacut.frame.dynamics.integrators import Exact

TIME = {"duration": 5, "step": 0.01}


def one_floor(shape):
    return StoreyFrame([1e3], [3.0], 2.5e10, 1e-6, **shape)


def test_a_monotone_peak_is_cut_off_where_it_is_known():
    # without damping |q| = v0 / omega, omega² = 24 E I / (l³ m): the peak rises with the mass
    frame, rigidity = one_floor({"v0": [0.5]}), 24 * 2.5e10 * 1e-6 / 27
    limit = 0.5 * np.sqrt(1.15e3 / rigidity)
    centre = np.array([1e3])
    reach = scaled(centre, 0.1 * centre, 0.1 * centre)
    found = safe_scale(frame, {"m1": 1e3}, reach, {"q1": limit}, duration=5, step=0.001)
    assert found.safe < 1.5 + 1e-3
    assert found.safe == pytest.approx(1.5, rel=0.01)
    assert found.unsafe == pytest.approx(1.5, rel=0.01)
    assert found.nature == "guaranteed"


def safe_and_truth(seed):
    rng = np.random.default_rng(seed)
    frame = StoreyFrame(
        rng.uniform(800, 2000, 2),
        [3.0, 3.0],
        2.5e10,
        1e-6,
        v0=rng.uniform(-0.2, 0.2, 2),
        dampers=rng.uniform(20, 200, 2),
    )
    nominal = {"E": 2.5e10, "m1": float(frame.masses[0])}
    centre = np.array([*nominal.values()])
    flow = LinearFlow(replace(frame, outputs=("drift2",)), tuple(nominal), 5, 0.01, Exact())
    least = np.abs(flow.values(centre[None])).max()
    most = np.abs(flow.values(centre * (1 + 0.1 * rng.uniform(-1, 1, (500, 2))))).max()
    limit = least + 0.6 * (most - least)
    reach = scaled(centre, 0.1 * centre, 0.1 * centre)
    return safe_scale(frame, nominal, reach, {"drift2": limit}, **TIME), flow, limit, rng


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_the_safe_box_is_safe_and_the_witness_is_not(seed):
    found, flow, limit, rng = safe_and_truth(seed)
    points = rng.uniform(-1, 1, (4000, 2))
    points[::2] = np.sign(points[::2])
    middle, half = (found.lower + found.upper) / 2, (found.upper - found.lower) / 2
    assert np.abs(flow.values(middle + half * points)).max() <= limit
    assert np.abs(flow.values(found.witness[None])).max() > limit
    assert 0 <= found.gap <= 0.01
    assert found.nature == "guaranteed"


def test_a_limit_that_is_only_reached_is_not_exceeded():
    # pulled by the limit and let go: no motion goes beyond it, for any modulus
    frame = one_floor({"q0": [0.01], "dampers": [50.0]})
    reach = scaled(np.array([2.5e10]), np.array([1e9]), np.array([1e9]))
    tie = safe_scale(frame, {"E": 2.5e10}, reach, {"q1": 0.01}, **TIME)
    assert (tie.safe, tie.witness, tie.nominal_share) == (0.0, None, pytest.approx(1.0, abs=1e-12))
    over = safe_scale(frame, {"E": 2.5e10}, reach, {"q1": 0.01 * (1 - 1e-9)}, **TIME)
    assert over.safe is None
    # where stiffness decides, a motion beyond is found all the same
    swing = one_floor({"q0": [0.01], "v0": [0.05]})
    peak = np.abs(LinearFlow(swing, ("E",), 5, 0.01, Exact()).values(np.array([[2.5e10]]))).max()
    assert safe_scale(swing, {"E": 2.5e10}, reach, {"q1": peak}, **TIME).witness is not None


def test_a_limit_that_is_never_reached_or_always_broken_is_said_to_be():
    frame = one_floor({"q0": [0.01]})
    reach = scaled(np.array([2.5e10]), np.array([1e9]), np.array([1e9]))
    free = safe_scale(frame, {"E": 2.5e10}, reach, {"q1": 0.011}, **TIME)
    assert (free.safe, free.witness, free.gap) == (2.0, None, np.inf)
    broken = safe_scale(frame, {"E": 2.5e10}, reach, {"q1": 0.009}, **TIME)
    assert broken.safe is None
    assert broken.share == pytest.approx(0.01 / 0.009)


@pytest.mark.parametrize(("limits", "most"), [({"q1": -1.0}, 1), ({}, 1), ({"q1": 1.0}, 0)])
def test_limits_without_a_meaning_are_refused(limits, most):
    reach = scaled(np.array([2.5e10]), np.array([1e9]), np.array([1e9]))
    with pytest.raises(ValueError, match=r"must be (positive|numbers by name)"):
        safe_scale(one_floor({"q0": [0.01]}), {"E": 2.5e10}, reach, limits, most=most, **TIME)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(10, 40))
def test_random_frames_have_a_tight_safe_scale(seed):
    found, flow, limit, rng = safe_and_truth(seed)
    points = rng.choice([-1.0, 1.0], (100_000, 2)) * rng.choice([1, 1, 0.5], (100_000, 2))
    middle, half = (found.lower + found.upper) / 2, (found.upper - found.lower) / 2
    for part in np.array_split(middle + half * points, 50):
        assert np.abs(flow.values(part)).max() <= limit
    assert found.gap <= 0.01


def swaying() -> LimitSearch:
    frame, rigidity = one_floor({"v0": [0.5]}), 24 * 2.5e10 * 1e-6 / 27
    centre = np.array([1e3])
    reach = scaled(centre, 0.1 * centre, 0.1 * centre)
    limit = 0.5 * np.sqrt(1.15e3 / rigidity)  # passed from scale 1.5 on
    return limit_search(frame, {"m1": 1e3}, reach, {"q1": limit}, 5, 0.01)


def test_a_rough_model_proves_no_box_that_holds_what_passes_a_limit(monkeypatch):
    search = swaying()
    left = 1 - search.share(search.nominal)
    assert _easily(search, left, 1.2, 100, 1)[0]
    monkeypatch.setattr(LimitSearch, "witness", lambda *_: None)
    assert not _easily(search, left, 1.6, 100, 1)[0]


def test_a_rough_model_whose_error_is_sampled_proves_nothing(monkeypatch):
    search, fit = swaying(), LimitSearch.fit

    def sampled(self, size):
        fit(self, size)
        self.reason = "sampled"

    monkeypatch.setattr(LimitSearch, "fit", sampled)
    assert not _easily(search, 1 - search.share(search.nominal), 0.5, 100, 1)[0]


def test_progress_never_falls_where_smaller_scales_follow(monkeypatch):
    def hopeless(search, refuted, most, budget, workers, progress):
        search.reason = ""
        for share in (0.1, 0.5, 1.0):
            progress(share)
        return 0.0, np.inf, None, 1

    monkeypatch.setattr(module, "_easily", lambda *_: (False, 0))
    monkeypatch.setattr(module, "_refuted", lambda *_: (np.inf, None))
    monkeypatch.setattr(module, "_proved", hopeless)
    frame, shares = StoreyFrame([1e3], [3.0], 2.5e10, 1e-6, v0=[0.5]), []
    reach = scaled(np.array([2.5e10]), np.array([1e9]), np.array([1e9]))
    common = {"duration": 0.2, "step": 0.01, "progress": shares.append}
    safe_scale(frame, {"E": 2.5e10}, reach, {"q1": 0.2}, **common)
    assert len(shares) == 3 * len(module.HALVED)
    assert shares == sorted(shares)
    assert shares[-1] <= 1


def test_broken_limits_met_between_a_proof_and_a_limit_are_kept(monkeypatch):
    """A first search that finds no more than a corner of the largest box."""
    frame = one_floor({"v0": [0.4], "dampers": [50.0]})
    nominal, centre = {"m1": 1e3, "I": 1e-6}, np.array([1e3, 1e-6])
    reach = scaled(centre, 0.2 * centre, 0.2 * centre)
    flow = LinearFlow(frame, tuple(nominal), 3, 0.02, Exact())
    corner = np.array([1.4e3, 0.6e-6])
    least, most = (np.abs(flow.values(p[None])).max() for p in (centre, corner))
    limit = 0.7 * least + 0.3 * most
    monkeypatch.setattr(module, "_refuted", lambda *_: (2.0, corner))
    monkeypatch.setattr(module, "_proved", lambda *_: (0.0, 2.0, corner, 0))
    found = safe_scale(frame, nominal, reach, {"q1": limit}, duration=3, step=0.02)
    assert found.nature == "guaranteed"
    assert 0 < found.safe < found.unsafe < 1.5 * found.safe
    lower, upper = reach(found.unsafe * (1 + 1e-9))
    assert ((lower <= found.witness) & (found.witness <= upper)).all()
    assert np.abs(flow.values(found.witness[None])).max() > limit
    ends = np.random.default_rng(1).uniform(*reach(found.safe), (2000, 2))
    assert np.abs(flow.values(ends)).max() <= limit
