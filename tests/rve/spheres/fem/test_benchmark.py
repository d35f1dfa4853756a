"""Lines of the benchmark of elements, and dolfinx_mpc's whole periodic cell as their peer."""

import pytest

pytest.importorskip("dolfinx")
from benchmarks.rve.sphere_elements import __main__ as benchmark


def test_the_order_is_that_of_the_error_of_e():
    line = benchmark.order((0.3, 0.22, 0.16))
    assert line.kept
    assert 2.7 <= float(line.value) <= 6


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
