"""Lines of the benchmark of elements, and dolfinx_mpc's whole periodic cell as their peer."""

import numpy as np
import pytest

pytest.importorskip("dolfinx")
from benchmarks.rve.sphere_elements import __main__ as benchmark
from benchmarks.rve.sphere_elements import declared as measured
from benchmarks.rve.sphere_elements.declared import Draws, Fuzzy


def test_the_order_is_that_of_the_error_of_e():
    line = benchmark.order((0.3, 0.22, 0.16))
    assert line.kept
    assert 2.7 <= float(line.value) <= 6


def test_a_declared_error_that_does_not_cover_breaks_a_line(monkeypatch):
    line = benchmark.declared(2, seed=5)
    assert line.kept, line
    draws = Draws(np.array([1e-4, 1e-4]), np.array([2e-5, 1.2e-4]))
    monkeypatch.setattr(measured, "random_cells", lambda count, seed: draws)
    assert not benchmark.declared(2).kept


@pytest.mark.parametrize(
    ("found", "kept"),
    [
        (Fuzzy(100.0, 9e-5, 1e-5), True),
        (Fuzzy(301.0, 9e-5, 1e-5), False),
        (Fuzzy(100.0, 1.1e-4, 1e-5), False),
        (Fuzzy(100.0, 9e-5, 9.1e-5), False),
    ],
)
def test_a_fuzzy_modulus_that_is_late_or_wrong_breaks_a_line(monkeypatch, found, kept):
    monkeypatch.setattr(measured, "fuzzy_modulus", lambda tolerance, workers: found)
    assert benchmark.fuzzy().kept is kept


@pytest.mark.slow
def test_a_fuzzy_modulus_of_elements_covers_its_error():
    line = benchmark.fuzzy(2e-3)
    assert line.kept, line


def test_ranks_that_differ_break_a_line(monkeypatch):
    def fake(ranks, size):
        return {"moduli": [1.0, 2.0, 3.0 + (ranks - 1) * gap]}

    monkeypatch.setattr(benchmark, "on_ranks", fake)
    gap = 1e-9
    assert not benchmark.same_on_ranks().kept
    gap = 1e-11
    assert benchmark.same_on_ranks().kept


@pytest.mark.slow
def test_one_rank_and_two_and_the_peer_agree():
    assert benchmark.same_on_ranks(0.25).kept
    line = benchmark.beside_peer(0.4)
    assert line.kept, line


@pytest.mark.slow
def test_a_run_that_fails_on_its_ranks_is_an_error():
    with pytest.raises(RuntimeError, match="the mesh size is 7"):
        benchmark.on_ranks(1, 7.0)
