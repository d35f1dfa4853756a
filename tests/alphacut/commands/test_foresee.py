"""Pieces that a run is counted to do by `check`, and their times from parts of the work."""

import json
import re

import numpy as np
import pytest

from alphacut import main
from alphacut.case.content import load
from alphacut.commands import foresee as module
from alphacut.commands.foresee import begun_seconds, foresee, whole_seconds
from alphacut.commands.pieces import pieces_of
from alphacut.frame.analyses import tolerances
from alphacut.stages.store import Stage, StageResult
from tests.alphacut.small import CELL, FRAME, TWO_FLOORS, summary_of, written

STUDIES = """
[[study]]
name = "short"
fuzzy = ["E"]
duration = "1 s"
[[study]]
name = "long"
fuzzy = ["E", "m"]
duration = "2 s"
"""
SUITE = """
[records]
files = ["a.csv", "b.csv", "c.csv"]
"""
IMAGE = """
title = "Image"
stages = ["modulus"]
[cell]
image = "image.npy"
pixel = "1 µm"
labels = [0, 1]
modulus = ["20 GPa", "[75, 80, 85] GPa"]
poisson = 0.3
[modulus]
alpha = [0, 0.5, 1]
"""


def foreseen(case):
    """Pieces by the name of their stage, counted alike with and without their times."""
    content = load(case).content
    timed = list(foresee(content, {}))
    assert [stage._replace(seconds=None) for stage in timed] == list(pieces_of(content, {}))
    return {stage.stage: stage for stage in timed}


@pytest.fixture
def ran(monkeypatch):
    """Names of the stages that runs compute, as they are computed."""
    names, run = [], Stage.run

    def counted(self, context):
        names.append(self.name)
        return run(self, context)

    monkeypatch.setattr(Stage, "run", counted)
    return names


def run_of(case):
    out = case.parent / "out"
    assert main(["run", str(case), "--quiet", "--no-figures", "--out", str(out)]) == 0
    return summary_of(out)


@pytest.mark.parametrize("plan", ["reduced", "general"])
def test_as_many_samples_are_foreseen_as_a_run_takes(tmp_path, plan):
    case = written(tmp_path, CELL, **{'"reduced"': f'"{plan}"'})
    assert foreseen(case)["modulus"].number == run_of(case)["modulus"]["samples"] > 5


def test_as_many_studies_are_foreseen_as_a_run_takes(tmp_path, ran):
    case = written(tmp_path, FRAME + STUDIES)
    number = foreseen(case)["envelopes"].number
    run_of(case)
    assert number == sum(name.startswith("envelope_") for name in ran) == 2


def test_scales_of_tolerances_are_foreseen_within_a_factor_of_two(tmp_path, monkeypatch):
    scales, envelope = [], tolerances.envelope
    case = written(tmp_path, TWO_FLOORS, **{'"2 s"': '"1 s"'})
    found = foreseen(case)
    monkeypatch.setattr(
        tolerances, "envelope", lambda *x, **given: scales.append(0) or envelope(*x, **given)
    )
    run_of(case)
    assert found["tolerances"].number / 2 <= len(scales) <= 2 * found["tolerances"].number
    assert "probability" in found


def test_as_many_records_are_foreseen_as_a_run_takes(tmp_path, ran, rng):
    for name in "abc":
        rows = "".join(f"{0.1 * k:g},{a:.4f}\n" for k, a in enumerate(rng.normal(size=20)))
        (tmp_path / f"{name}.csv").write_text(f"time [s],acceleration [m/s^2]\n{rows}")
    text = FRAME.replace('displacements = "10 mm"\n', 'damping_ratio = "5 %"\n')
    text = text.replace('dampers = "50 N s/m"\ndamper_placement = "ground"\n', "")
    text = text.replace('method = "graph-follower"\ntolerance = "0.1 mm"\n', "")
    case = written(tmp_path, text.replace('integrator = "exact"\n', "") + SUITE)
    number = foreseen(case)["records"].number
    run_of(case)
    assert number == sum(name.startswith("record_") for name in ran) == 3


def told_by(folder, words):
    """The only stage in the JSON document of a check."""
    assert main(words) == 0
    (stage,) = json.loads((folder / "check.json").read_text())["foreseen"]
    return stage


def test_check_counts_at_once_and_says_which_option_times(tmp_path, capfd, monkeypatch):
    case = written(tmp_path, CELL)
    with monkeypatch.context() as patch:
        patch.setattr(Stage, "__init__", lambda *_, **__: pytest.fail("work is begun"))
        assert main(["check", str(case)]) == 0
    counted = capfd.readouterr().out
    assert "with --time: how long a run will take\n" in counted
    assert main(["check", str(case), "--time"]) == 0
    timed = capfd.readouterr().out
    assert "a run takes about" in timed
    assert re.search(r"^modulus +\d+ samples$", counted, re.MULTILINE)
    assert re.search(r"^modulus +\d+ samples +\S+ m?s$", timed, re.MULTILINE)


def test_levels_of_an_image_are_foreseen_and_told_as_json(tmp_path):
    labels = np.zeros((16, 16))
    labels[4:10, 4:10] = 1
    np.save(tmp_path / "image.npy", labels)
    case = written(tmp_path, IMAGE)
    words = ["check", str(case), "--quiet", f"--json={tmp_path}/check.json"]
    (counted, stage) = (told_by(tmp_path, [*words, *option]) for option in ([], ["--time"]))
    assert counted == stage | {"seconds": None}
    assert (stage["stage"], stage["pieces"]) == ("image", "levels")
    assert stage["number"] == len(run_of(case)["image"]["E_GPa"]["lower"]) == 3
    assert stage["seconds"] > 0


class Clock:
    """A clock that stands still but for the work that is done."""

    def __init__(self):
        self.now = 0.0

    def __call__(self):
        return self.now


@pytest.fixture
def clock(monkeypatch):
    found = Clock()
    monkeypatch.setattr(module, "perf_counter", found)
    return found


@pytest.mark.parametrize(("once", "slope"), [(0.01, 3.0), (0.2, 0.0), (0.0, 5.0)])
def test_the_time_of_the_whole_follows_from_parts(clock, once, slope):
    parts = []

    def run(fraction):
        clock.now += once + slope * fraction + (0.0 if parts else 0.5)  # the first compiles
        parts.append(fraction)
        return fraction

    assert whole_seconds(run) == pytest.approx(0.5 + once + slope, rel=0.02)
    assert max(parts) <= 1 / 16


def test_a_long_part_is_the_last_one(clock):
    parts = []

    def run(fraction):
        parts.append(fraction)
        clock.now += 30.0
        return fraction

    assert whole_seconds(run) == 30.0
    assert len(parts) == 1
    whole_seconds(run, fewest=3)
    assert len(set(parts)) == 2


@pytest.mark.parametrize(("power", "setup"), [(1.0, 0.0), (2.0, 0.0), (1.0, 7.0)])
def test_work_that_is_begun_is_interrupted_and_told_from_its_progress(clock, power, setup):
    done = []

    def compute(context):
        clock.now += setup
        for k in range(1, 101):
            clock.now += 40.0 * ((k / 100) ** power - ((k - 1) / 100) ** power)
            done.append(k)
            context.tick(k / 100)
        return StageResult(0)

    stage = Stage("name", [], (), int, compute)
    seconds = begun_seconds(stage, has_setup=bool(setup), power=power)
    assert seconds == pytest.approx(setup + 40.0, rel=0.01)
    assert len(done) < 40


def test_work_shorter_than_that_is_done_and_timed(clock):
    def compute(context):
        clock.now += 0.3
        return StageResult(0)

    assert begun_seconds(Stage("name", [], (), int, compute)) == pytest.approx(0.3)
