"""A cluster of dask as executor: all its slots at work, quick samples in batches, the same bits."""

import time
from concurrent.futures import Executor
from contextlib import closing
from types import SimpleNamespace

import numpy as np
import pytest

from alphacut.fuzzy import Interval, Store, Triangular
from alphacut.fuzzy.campaign import dispatch
from alphacut.fuzzy.campaign.sample_store import Shelf
from benchmarks.fuzzy.overhead import Points, nothing
from tests.fuzzy.general import propagate

distributed = pytest.importorskip("distributed")
SLOTS = 16
UNIT = {"a": Interval(0, 1), "b": Interval(0, 1)}


def model(a, b):
    return {"y": a * b + a / 3, "z": [a, b * b]}


def sleep(a, b):
    start = time.monotonic()
    time.sleep(0.1)
    return {"start": start, "end": time.monotonic()}


@pytest.fixture(scope="module")
def executor():
    with (
        distributed.LocalCluster(
            n_workers=1, threads_per_worker=SLOTS, processes=False, dashboard_address=None
        ) as cluster,
        distributed.Client(cluster) as client,
    ):
        yield client.get_executor()


def at_once(values, share):
    """Mean number of samples that run at once, from when a share of them has begun to the last."""
    start, end = values.output("start"), values.output("end")
    since, until = np.quantile(start, share), start.max()
    work = (end.clip(since, until) - start.clip(since, until)).sum()
    return float(work / (until - since))


@pytest.mark.slow  # a time
def test_all_slots_work(executor):
    found = propagate(sleep, UNIT, Points(320), alpha=[0.0], executor=executor)
    assert at_once(found.values, 0) >= 14


def test_load_doubles_until_slots_are_full_and_no_further(monkeypatch):
    """Calls of 0.1 s at an executor of 16 slots that does not say so, on a clock of its own."""
    now = [0.0]
    monkeypatch.setattr(dispatch, "perf_counter", lambda: now[0])
    load, call = dispatch._Load(4, _since=0.0), SimpleNamespace(seconds=0.1)
    for _ in range(500):
        now[0] += call.seconds / min(load.room, 16)
        load.note([[call]])
    assert load.room == 32


@pytest.mark.slow  # a time
def test_an_executor_that_does_not_say_is_filled_as_it_takes_more(executor):
    class Silent(Executor):
        def submit(self, function, /, *args, **kwargs):
            return executor.submit(function, *args, **kwargs)

    found = propagate(sleep, UNIT, Points(480), alpha=[0.0], executor=Silent())
    assert at_once(found.values, 0.5) >= 14


def test_quick_samples_go_in_batches(executor):
    tasks = []

    class Counted(Executor):
        def submit(self, function, /, *args, **kwargs):
            tasks.append(args)
            return executor.submit(function, *args, **kwargs)

    found = propagate(nothing, UNIT, Points(5000), alpha=[0.0], executor=Counted())
    assert len(tasks) < found.runs / 4


def test_the_store_holds_the_same_bits(executor, tmp_path):
    inputs = {"a": Triangular(0.0, 0.3, 1.0), "b": Triangular(-1.0, 0.0, 2.0)}
    rows = []
    for name, workers in (("here", None), ("dask", executor)):
        with Store(tmp_path / name) as store:
            found = propagate(model, inputs, store=store, identity={"m": 1}, executor=workers)
            with closing(Shelf(store, {"m": 1}, ["a", "b"])) as shelf:
                keys = [shelf.key(point) for point in found.points]
                stored = shelf.stored(keys)
                rows.append({key: stored[key].row.tobytes() for key in keys})
    assert rows[0] == rows[1]


def test_a_client_is_no_executor(executor):
    with pytest.raises(ValueError, match=r"the executor is a Client; .* client.get_executor\(\)"):
        propagate(model, UNIT, executor=distributed.get_client())
    with pytest.raises(ValueError, match="workers and an executor are both given"):
        propagate(model, UNIT, executor=executor, workers=2)
