"""One mechanism keeps every stage; the case reaches few files."""

import json
from concurrent.futures import BrokenExecutor
from dataclasses import replace
from pathlib import Path
from types import FunctionType

import pytest
import xarray

import alphacut
from alphacut.base.progress_bar import progress_reporter
from alphacut.case.content import load
from alphacut.fuzzy import FailedError
from alphacut.io.results import ResultsFolder
from alphacut.stages import envelope
from alphacut.stages.store import RunProgress, Stage, StageResult, StageStore
from tests.alphacut.small import CELL, summary_of, told_by, written

ROOT = Path(alphacut.__file__).resolve().parents[1]


def store_in(folder, **options):
    """A store as a new process opens it."""
    return StageStore(ResultsFolder.read(folder), "the case", **options)


def test_a_stage_is_computed_once_until_its_inputs_change(tmp_path):
    calls, store = [], store_in(tmp_path)

    def compute(work):
        calls.append(work)
        return StageResult({"count": len(calls)}, xarray.Dataset({"x": ((), len(calls))}))

    def of(inputs):
        return Stage("thing", inputs, ("fuzzy",), dict[str, int], compute)

    results = [store.take(of(value)) for value in (1, 1, 2, 2)]
    assert [int(result.arrays.x) for result in results] == [1, 1, 2, 2]
    assert [result.numbers["count"] for result in results] == [1, 1, 2, 2]
    assert len(calls) == 2
    assert int(store_in(tmp_path, fresh=True).take(of(2)).arrays.x) == 3
    assert json.loads((tmp_path / "thing.json").read_text())["case"] == "the case"


def test_fingerprints_do_not_depend_on_where_functions_lie_in_memory():
    content = load(ROOT / "cases" / "pendulum.toml", ()).content
    (task,) = envelope.tasks(content.envelope, ())
    structure = content.pendulum.structure(None)
    function = structure.model.lagrangian
    copied = FunctionType(function.__code__, function.__globals__, function.__name__)
    moved = replace(structure, model=replace(structure.model, lagrangian=copied))
    assert copied is not function
    assert envelope.stage(moved, task).key == envelope.stage(structure, task).key


def test_a_run_has_one_progress_that_ends_once(tmp_path):
    """Whatever its stages are: one alone, several at once, or more than were foreseen."""
    told = []

    def compute(work):
        for share in (0.0, 0.5, 0.2, 1.0):
            work.tick(share)
        return StageResult({})

    stages = [Stage(f"stage_{k}", k, ("fuzzy",), dict, compute) for k in range(6)]
    with progress_reporter(told.append) as show:
        store = store_in(tmp_path, progress=RunProgress(show, seconds_left=5.0))
        store.take(stages[0])
        store.take_all(stages[1:4], None)
        assert told[-1] == pytest.approx(0.8)
        store.take(stages[4])
        store.take(stages[5])
    assert told == sorted(told)
    assert told.count(1.0) == told[told.index(1.0) :].count(1.0) > 0


def test_a_worker_that_dies_names_its_stage(tmp_path):
    def compute(work):
        raise BrokenExecutor("killed")

    stage = Stage("thing", 1, ("fuzzy",), dict, compute)
    with pytest.raises(FailedError, match="a worker process died in stage thing; out of memory"):
        store_in(tmp_path).take(stage)


def test_fingerprints_see_every_input(tmp_path):
    def key(*changes):
        content = load(written(tmp_path), changes).content
        (task,) = envelope.tasks(content.envelope, ())
        return envelope.stage(content.frame.structure(), task).key

    changes = ("frame.lengths=3.1 m", "frame.masses=[9, 10, 12] t")
    changes += ("envelope.alpha=0,1", "envelope.step=0.01 s", "envelope.gain=0.1")
    assert len({key(), *map(key, changes)}) == 1 + len(changes)
    assert key() == key("title=other")


def test_a_borrowed_folder_is_not_believed(tmp_path):
    folder = tmp_path / "out"
    told_by("run", written(tmp_path, CELL), "--out", folder, "--no-figures")
    results, summary = ResultsFolder.read(folder), summary_of(folder)
    told_by("report", folder, "--quiet")
    changed = json.dumps(summary | {"fingerprints": {"modulus": "other"}})
    results.put_text("summary.json", changed)
    assert "of another run" in told_by("report", folder, "--quiet", status=2)
    for text in ("", "[" * 100_000, '{"case": 1}'):
        (folder / "summary.json").write_text(text)
        assert "is changed" in told_by("report", folder, "--quiet", status=2)
