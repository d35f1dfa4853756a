"""Progress moves from the first sample to the last; what is interrupted says what it keeps."""

import inspect
import io
import re
import sys
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise

import numpy as np
import pytest

from alphacut import frame, fuzzy
from alphacut.frame.decisions.exceeding import exceeding
from alphacut.frame.decisions.safe_scale import safe_scale as frame_safe_scale
from alphacut.frame.exceedance import exceedance, exceedances
from alphacut.fuzzy import (
    Automatic,
    Chebyshev,
    Extended,
    General,
    Metamodel,
    Optimisation,
    QuasiMonteCarlo,
    Reduced,
    Signed,
    Triangular,
    decide,
    progress_bar,
    propagate,
    safe_scale,
    width_shares,
)
from alphacut.fuzzy.decisions.measure_next import measure_next
from alphacut.fuzzy.joint_outputs import joint_outputs

X = {"x": Triangular(0, 1, 2), "y": Triangular(1, 2, 4)}
PLANS = (
    *(Automatic(), Chebyshev(), Extended(), General(), Metamodel(), Optimisation()),
    *(Optimisation(way, budget=50) for way in ("shgo", "direct")),
    *(QuasiMonteCarlo(8), Reduced(), Signed()),
)


def bent(x, y):
    return (x - 0.7) ** 2 * y + x


def rises(shares):
    return all(a < b for a, b in pairwise(shares)) and shares[0] > 0 and shares[-1] <= 1


@pytest.mark.parametrize("plan", PLANS, ids=lambda plan: type(plan).__name__)
def test_progress_moves_with_every_sample_of_every_plan(plan):
    calls, at, shares = [], [], []

    def counted(x, y):
        calls.append(x)
        return bent(x, y)

    propagate(
        counted, X, plan, progress=lambda share: (at.append(len(calls)), shares.append(share))
    )
    assert rises(shares)
    assert shares[-1] == 1
    assert max(b - a for a, b in pairwise([0, *at])) <= 2


def test_questions_of_many_propagations_tell_their_share_too():
    def bounds(inputs):
        return propagate(bent, inputs, Reduced(), progress=False).bounds()

    for ask in (
        lambda tell: decide(bent, X, {"y": 5}, tolerance=1e-2, progress=tell),
        lambda tell: safe_scale(bent, {"x": 1, "y": 1}, {"x": 0.1}, {"y": 2}, progress=tell),
        lambda tell: width_shares(bounds, X, progress=tell),
        lambda tell: measure_next(bent, X, Reduced(), progress=tell),
    ):
        shares = []
        ask(lambda share, shares=shares: shares.append(share))
        assert len(shares) > 2
        assert 0 < min(shares) < 0.6
        assert 0.9 < max(shares) <= 1
        assert shares == sorted(shares)


def test_a_bar_shows_itself_on_a_terminal_and_leaves_nothing(monkeypatch):
    screen = io.StringIO()
    screen.isatty = lambda: True
    monkeypatch.setattr(sys, "stderr", screen)
    propagate(bent, X, Reduced())
    assert not screen.getvalue()  # over within a second
    monkeypatch.setattr(progress_bar, "_WAIT", 0.0)
    propagate(bent, X, Reduced(), progress=False)
    assert not screen.getvalue()
    propagate(bent, X, Reduced())
    assert re.search(r"█+░* +\d+ %", screen.getvalue().replace("%", " %"))
    assert screen.getvalue().endswith("\r\x1b[K")


def test_nothing_is_shown_without_a_terminal(monkeypatch, capfd):
    monkeypatch.setattr(progress_bar, "_WAIT", 0.0)
    propagate(bent, X, Reduced())
    assert capfd.readouterr().err == ""


@pytest.mark.parametrize("progress", [3, "bar"])
def test_progress_is_a_function(progress):
    with pytest.raises(ValueError, match="it must be a function of the share done"):
        propagate(bent, X, progress=progress)


def test_an_interrupt_says_what_is_kept_and_the_same_call_goes_on(tmp_path):
    calls = []

    def stopped(x, y):
        calls.append(x)
        if len(calls) == 20:
            raise KeyboardInterrupt
        return bent(x, y)

    given = {"store": tmp_path / "s.db", "identity": {"v": 1}}
    with pytest.raises(
        KeyboardInterrupt, match=r"^interrupted; the 19 samples of this call are in .*s\.db: the"
    ):
        propagate(stopped, X, **given)
    assert propagate(bent, X, spot_check=0, **given).reused == 19
    held = propagate(bent, X, spot_check=0, **given).samples
    calls.clear()
    with pytest.raises(KeyboardInterrupt, match=r"s\.db, which holds \d+ more: the") as caught:
        propagate(stopped, X, Metamodel(), spot_check=0, **given)
    own, more = re.findall(r" (\d+) ", str(caught.value))
    assert int(own) + int(more) == held + 19
    calls[:] = range(19)
    with pytest.raises(KeyboardInterrupt, match="no sample of this call is in"):
        propagate(stopped, X, Metamodel(), **{**given, "identity": {"v": 2}})
    calls.clear()
    with pytest.raises(
        KeyboardInterrupt, match="19 samples were done and none is kept: `propagate` keeps them"
    ):
        propagate(stopped, X)


@pytest.mark.parametrize(
    ("call", "ask"),
    [
        ("joint_outputs", lambda stopped: joint_outputs(lambda x, y: (stopped(x, y), x), X)),
        ("decide", lambda stopped: decide(stopped, X, {"y": 5})),
        ("safe_scale", lambda stopped: safe_scale(stopped, {"x": 1, "y": 1}, {"x": 0.1}, {"y": 2})),
    ],
)
def test_an_interrupted_call_without_a_store_offers_none(call, ask):
    calls = []

    def stopped(x, y):
        calls.append(x)
        if len(calls) == 20:
            raise KeyboardInterrupt
        return bent(x, y)

    with pytest.raises(KeyboardInterrupt, match=f"^interrupted; `{call}` keeps nothing: "):
        ask(stopped)


def test_what_to_measure_next_takes_an_executor_and_a_store(tmp_path):
    plain = measure_next(bent, X, Reduced())
    calls = []

    def counted(x, y):
        calls.append(x)
        return bent(x, y)

    given = {"store": tmp_path / "s.db", "identity": {"v": 1}}
    with ThreadPoolExecutor(2) as executor:
        found = measure_next(counted, X, Reduced(), executor=executor, **given)
    assert found == plain
    ran = len(calls)
    assert measure_next(counted, X, Reduced(), **given) == plain
    assert len(calls) - ran < ran  # of each answer one stored sample is run again


def taking_progress():
    """Functions and methods of the library that a user hands `progress` to."""
    given = [getattr(room, name) for room in (frame, fuzzy) for name in room.__all__]
    given += [exceedance, exceedances, exceeding, frame_safe_scale, measure_next]
    given += [method for one in given if inspect.isclass(one) for method in vars(one).values()]
    for one in given:
        if inspect.isfunction(one) and "progress" in inspect.signature(one).parameters:
            yield one


def test_every_function_takes_the_same_progress():
    asked = {
        one.__qualname__: inspect.signature(one).parameters["progress"].annotation
        for one in taking_progress()
    }
    assert {"propagate", "envelope", "exceedance", "IntervalQuasiMonteCarlo.run"} <= set(asked)
    inner = ("GraphFollower.run", "GraphFollower.follow", "GraphFollower._sweep")
    left = {name: given for name, given in asked.items() if name not in (*inner, "explain")}
    assert {name for name, given in left.items() if given != "Progress | bool | None"} == set()


def uniform(u, m):
    return m * u


def reach(size):
    return np.array([2.5e10 - size * 1e9]), np.array([2.5e10 + size * 1e9])


BUILDING = frame.StoreyFrame([1e3], [3.0], 2.5e10, 1e-6, v0=[0.5])
MODULUS, TIME = {"E": Triangular(2.4e10, 2.5e10, 2.6e10)}, {"duration": 0.2, "step": 0.01}
LIBRARY = {
    "probability": lambda tell: exceedance(
        BUILDING, MODULUS, {}, limit=0.01, alpha=(0,), spread=4, progress=tell, **TIME
    ),
    "safe scale": lambda tell: frame_safe_scale(
        BUILDING, {"E": 2.5e10}, reach, {"q1": 0.086}, progress=tell, **TIME
    ),
    "decision": lambda tell: exceeding(BUILDING, MODULUS, {"q1": 0.086}, progress=tell, **TIME),
    "quasi-Monte Carlo": lambda tell: fuzzy.IntervalQuasiMonteCarlo(points=2).run(
        bent,
        {"y": fuzzy.RandomInput(uniform, {"m": X["y"]})},
        {"x": X["x"]},
        alpha=(0, 1),
        progress=tell,
    ),
}


@pytest.mark.parametrize("ask", LIBRARY.values(), ids=LIBRARY)
def test_the_bar_is_there_unless_it_is_switched_off(ask, monkeypatch):
    screen = io.StringIO()
    screen.isatty = lambda: True
    monkeypatch.setattr(sys, "stderr", screen)
    monkeypatch.setattr(progress_bar, "_WAIT", 0.0)
    ask(False)
    assert not screen.getvalue()
    shares = []
    ask(shares.append)
    assert not screen.getvalue()
    for progress in (None, True):
        ask(progress)
        assert bool(screen.getvalue()) == bool(shares)
    with pytest.raises(ValueError, match="it must be a function of the share done"):
        ask("bar")
    assert shares
