"""Samples by one process, by several, by any executor: the same bits, one count, one line."""

import os
import re
import signal
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from math import exp, sin

import numpy as np
import pytest

from alphacut.fuzzy import (
    Automatic,
    FailedError,
    General,
    Reduced,
    Triangular,
    propagate,
)
from tests.refused import refuses

calls = []
INPUTS = {"a": Triangular(0.0, 0.3, 1.0), "b": Triangular(-1.0, 0.0, 2.0)}


def model(a, b):
    return {"y": sin(3 * a) * exp(b), "z": [a / 3, b**2]}


def grouped(points):
    calls.append(len(points))
    assert len({point["a"] for point in points}) == 1
    return [model(**point) for point in points]


def arrays(a, b):
    calls.append(len(a))
    return {"y": np.sin(3 * a) * np.exp(b), "z": np.stack([a / 3, b**2], axis=-1)}


def bits(result):
    parts = (result.lower, result.upper, result.lower_at, result.samples.values.array)
    return b"".join(part.tobytes() for part in parts)


def run(function=model, method=None, **options):
    return propagate(function, INPUTS, method or General(), progress=False, **options)


@pytest.mark.parametrize(
    ("options", "key"),
    [
        ({"alpha": 5}, "alpha"),
        ({"knowledge": {"a": 1}}, "knowledge"),
        ({"store": 3, "identity": {"version": 1}}, "store"),
    ],
)
def test_arguments_of_another_kind_are_refused(options, key):
    with refuses(key):
        run(**options)


def test_an_output_without_entries_is_refused():
    with pytest.raises(FailedError, match=r"output none is \[\]"):
        run(lambda a, b: {"y": a, "none": []}, Reduced(), alpha=[1.0])


def test_shared_calls_and_arrays_give_the_same_with_fewer_calls():
    calls.clear()
    one, together = run(), run(grouped, shared=("a",))
    assert (one.evaluations, len(calls), sum(calls)) == (55, 15, 55)
    array = run(arrays, vectorised=True)
    assert calls[15:] == [55]
    assert bits(together) == bits(one)
    np.testing.assert_allclose(array.lower, one.lower, rtol=1e-14)


def test_the_bits_do_not_depend_on_who_runs_the_samples():
    one, general = bits(run(method=Automatic())), bits(run())
    assert bits(run(workers=2)) == general
    with ThreadPoolExecutor(3) as threads:
        assert bits(run(method=Automatic(), executor=threads)) == one
    with ProcessPoolExecutor(2) as processes:
        assert bits(run(executor=processes)) == general


def test_a_cluster_of_dask_is_an_executor():
    distributed = pytest.importorskip("distributed")
    options = {"n_workers": 1, "threads_per_worker": 4, "processes": False}
    with (
        distributed.LocalCluster(dashboard_address=None, **options) as cluster,
        distributed.Client(cluster) as client,
    ):
        assert bits(run(executor=client.get_executor())) == bits(run())
        with refuses("executor"):
            run(executor=client)


@pytest.mark.parametrize("workers", [1, 2])
def test_failures_name_their_points_after_all_others_have_run(workers):
    def broken(a, b):
        if a == 1.0:
            raise ArithmeticError(f"no value at {b:g}")
        return a * b

    with pytest.raises(FailedError) as failed:
        run(broken, Reduced(), workers=workers)
    assert failed.value.what.startswith(
        "2 of 17 samples failed, the others are done: at a = 1, b ="
    )
    assert failed.value.failures[0] == ({"a": 1.0, "b": -1.0}, "ArithmeticError: no value at -1")


def test_a_program_that_ends_itself_ends_its_sample_only():
    def leaving(a, b):
        raise SystemExit(3)

    with pytest.raises(FailedError, match="SystemExit: 3"):
        run(leaving)


def test_a_worker_that_dies_is_told_in_one_line():
    def dying(a, b):
        os.kill(os.getpid(), signal.SIGKILL)

    with pytest.raises(FailedError) as failed:
        run(dying, workers=2)
    words = r"a worker process died at or near sample \d+ \(a = .*, b = .*\)"
    assert re.fullmatch(words, failed.value.what)
    assert "\n" not in str(failed.value)


def test_outputs_must_agree_between_samples():
    def changing(a, b):
        outputs = {"y": a, "z": b}
        return outputs if a < 0.5 else dict(reversed(outputs.items()))

    with pytest.raises(FailedError, match="where others have"):
        run(changing)


def test_progress_never_falls_and_ends_at_one():
    shares = []
    propagate(model, INPUTS, Automatic(), progress=shares.append)
    assert shares == sorted(shares)
    assert shares[-1] == 1.0
