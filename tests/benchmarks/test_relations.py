"""The same problem said otherwise, and the same case run otherwise, gives no contradiction."""

import os
import random
import time
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from alphacut.fuzzy import Interval, Knowledge, Signed, propagate
from benchmarks.relations import cases, frames, functions
from benchmarks.relations.__main__ import KINDS
from benchmarks.relations.relation import checked
from benchmarks.relations.stated import Stated, contradictions

CASE = """title = "Packings and a frame"
stages = ["microstructure", "modulus", "envelope"]
modulus = { method = "series", plan = "signed", alpha = [0, 1], tolerance = 1e-4 }
[microstructure]
limits = [0.13, 0.87]
seed = 1
[microstructure.packing]
particles = 20
packings = 5
fraction = 0.2
smallest_radius = "1.6 mm"
largest_radius = "4 mm"
[cell]
particles = "cylinders"
matrix_modulus = "20 GPa"
matrix_poisson = 0.3
inclusion_modulus = "80 GPa"
inclusion_poisson = 0.3
[frame]
second_moment = "1e-6 m^4"
masses = ["[19, 20, 21] t", "10 t"]
lengths = ["2.5 m"]
dampers = ["50 N s/m"]
damper_placement = "ground"
displacements = ["10 mm", "30 mm"]
velocities = ["0 m/s"]
[[study]]
name = "E"
fuzzy = ["E"]
duration = "0.4 s"
[[study]]
name = "m1"
fuzzy = ["m1"]
duration = "0.4 s"
[envelope]
fuzzy = ["E", "m1"]
alpha = [0, 1]
method = "search"
duration = "0.4 s"
step = "0.04 s"
"""
OTHERWISE = {
    **cases.PLAIN,
    **{"workers": "2", "assertions": "off", "hash seed": "7", "threads": "3"},
    **{"folder": cases.WAYS["folder"][1], "locale": "C.UTF-8", "killed": "yes"},
}


@pytest.mark.parametrize("kind", KINDS)
def test_a_random_problem_said_otherwise_gives_no_contradiction(kind):
    chance = np.random.default_rng(60)
    relations = [x for x in KINDS[kind][1] if "processes" not in x.name]
    drawn = [relations[k] for k in chance.permutation(len(relations))[:3]]
    found = dict(checked(KINDS[kind][0].drawn(chance), drawn, chance))
    assert not {name: lines for name, lines in found.items() if lines}


@pytest.mark.slow
def test_a_case_has_one_set_of_numbers_however_it_is_run(tmp_path):
    case = tmp_path / "small.toml"
    case.write_text(CASE, encoding="utf-8")
    (found,) = cases.ways_checked(cases.CaseRun(case), [OTHERWISE], np.random.default_rng(1))
    assert found[1] == [], found


def arrays_of(folder):
    """Arrays of all results of a run, without the seconds in their attributes."""
    return {path.name: xr.load_dataset(path) for path in sorted(Path(folder).glob("*.nc"))}


@pytest.mark.slow
def test_runs_killed_at_random_times_are_taken_up_to_the_bit(tmp_path):
    seed = int(os.environ.get("SEED", random.randrange(10**9)))
    print("seed", seed)
    draw, case = random.Random(seed), tmp_path / "small.toml"
    case.write_text(CASE, encoding="utf-8")
    way = cases.PLAIN | {"figures": "yes"}
    begun = time.monotonic()
    summary = cases.CaseRun(case, way=way).run(tmp_path / "plain")
    seconds, plain, kills = time.monotonic() - begun, arrays_of(tmp_path / "plain"), 0
    for trial in range(20):
        out, workers = tmp_path / str(trial), draw.choice(["1", "2"])
        other = cases.CaseRun(case, way=way | {"workers": workers})
        words = cases.command(case, (), out, other.way)
        given = {"env": cases.surroundings(other.way), "start_new_session": True}
        for _ in range(draw.randint(1, 3)):
            kills += cases.killed_after(draw.uniform(0.1, 1.0) * seconds, words, given)
        found = other.run(out)
        assert not cases.differences(*map(cases.numbers, (summary, found))), trial
        assert [*arrays_of(out)] == [*plain]
        assert all(data.equals(plain[name]) for name, data in arrays_of(out).items()), trial
        if kills >= 12:
            return
    pytest.fail(f"{kills} kills only")


def test_ways_hold_every_pair_of_factors():
    rows = cases.pairwise(np.random.default_rng(1))
    assert len(rows) < 25
    for one in cases.WAYS:
        for two in cases.WAYS:
            wanted = {(a, b) for a in cases.WAYS[one] for b in cases.WAYS[two] if one != two}
            assert wanted <= {(row[one], row[two]) for row in rows}


def test_summaries_differ_by_a_bit_or_an_order_but_not_by_times():
    one = {"E": [1.0, {"seconds": 2.0}], "command": "a", "x": 1}
    assert not cases.differences(*(cases.numbers(x) for x in (one, one | {"command": "b"})))
    for two in (one | {"E": [1.0 + 2**-52, {}]}, {"x": 1, "E": [1.0, {}]}, one | {"x": True}):
        assert cases.differences(*(cases.numbers(x) for x in (one, two)))


def ends(low, high, inner):
    """Statements of guaranteed bounds that are attained up to a share."""
    inputs = {"x": Interval(low, high)}
    made = propagate(lambda x: x, inputs, Signed(), knowledge=Knowledge({"x": 1}), progress=False)
    return Stated.of_bounds(made).data.assign(attained=lambda x: inner * x.bound)


def test_what_leaves_a_guarantee_or_both_errors_is_seen():
    wide, narrow = (Stated(ends(-x, x, 0.95)) for x in (1.0, 0.9))
    assert not contradictions(wide, wide)
    assert "attained leaves what is proved: y by 0.05" in contradictions(wide, narrow)[0]
    one, near, far = (Stated.of_values({"E": (x, 0.1)}) for x in (1.0, 1.19, 1.21))
    assert not contradictions(one, near)
    assert contradictions(one, far)
    assert contradictions(one, near, within=1e-6)


@dataclass(frozen=True)
class ByPosition(functions.Waves):
    """A function that an order of the inputs matters to."""

    def __call__(self, **inputs):
        names = dict(zip(self.units, inputs.values(), strict=True))
        return super().__call__(**names)


def test_an_order_of_inputs_that_matters_is_seen():
    inputs = {"x1": (0.0, 0.1, 0.2), "x2": (0.5, 0.6, 1.0)}
    waves = ByPosition(np.array([[1.0, 0.3]]), np.zeros(1), dict.fromkeys(inputs, 1.0))
    subject = functions.Propagation(waves, inputs, "automatic")
    other = replace(subject, fuzzy=dict(reversed(inputs.items())))
    assert contradictions(subject.stated(), other.stated())


def test_a_tolerance_in_metres_is_seen():
    frame = frames.Frame(
        *(np.array([1e7]), np.array([1e4]), (0.5, 1e-3), {"k1": 0.1}, ("q1",)),
        *(np.sin(np.arange(30.0)), 0.02, 20, 0.04),
        tolerance=1e-4,
        relative=False,
    )
    smaller = replace(frame, powers=(8, 0, 0))
    assert contradictions(frame.stated(), smaller.stated(), within=1e-6)
