"""The same problem said otherwise, and the same case run otherwise, gives no contradiction."""

import os
import random
import time
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from benchmarks.relations import cases
from benchmarks.relations.__main__ import KINDS

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
method = "proof"
duration = "0.4 s"
step = "0.04 s"
"""
OTHERWISE = {
    **cases.PLAIN,
    **{"assertions": "off", "hash seed": "7", "threads": "3", "figures": "yes"},
    **{"folder": cases.WAYS["folder"][1], "locale": "C.UTF-8"},
}


@pytest.mark.parametrize("kind", KINDS)
def test_a_random_problem_said_otherwise_gives_no_contradiction(kind):
    chance, of = np.random.default_rng(60), KINDS[kind]
    relations = [x for x in of.relations if "processes" not in x.name]
    chosen = [relations[k] for k in chance.permutation(len(relations))[:3]]
    found = dict(of.checked(of.drawn(chance), chance, chosen))
    assert not {name: lines for name, lines in found.items() if lines}


def arrays_of(folder):
    """Arrays of all results of a run, without the seconds in their attributes."""
    return {path.name: xr.load_dataset(path) for path in sorted(Path(folder).glob("*.nc"))}


@pytest.mark.slow
def test_runs_otherwise_and_killed_at_random_times_have_the_same_bits(tmp_path):
    seed = int(os.environ.get("SEED", random.randrange(10**9)))
    print("seed", seed)
    (tmp_path / "small.toml").write_text(CASE, encoding="utf-8")
    case, plain_out = cases.problem(tmp_path / "small.toml"), tmp_path / "plain"
    draw, way, begun = random.Random(seed), cases.PLAIN | {"figures": "yes"}, time.monotonic()
    summary = cases.summary_of(cases.start(case, plain_out, way), plain_out)
    seconds, plain, kills = time.monotonic() - begun, arrays_of(plain_out), 0
    for trial in range(20):
        out = tmp_path / str(trial)
        otherwise = OTHERWISE | {"workers": draw.choice(["1", "2"])}
        for _ in range(draw.randint(1, 3)):
            started = cases.start(case, out, otherwise)
            kills += cases.was_killed(started, draw.uniform(0.1, 1.0) * seconds)
        found = cases.summary_of(cases.start(case, out, otherwise), out)
        assert not cases.differences(*map(cases.numbers, (summary, found))), trial
        assert [*arrays_of(out)] == [*plain]
        assert all(data.equals(plain[name]) for name, data in arrays_of(out).items()), trial
        if kills >= 12:
            return
    pytest.fail(f"{kills} kills only")
