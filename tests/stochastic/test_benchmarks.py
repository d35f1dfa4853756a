"""The benchmarks of the microstructure, in small."""

import importlib.util
import sys
from pathlib import Path

import pytest


def program(name: str):
    path = Path(__file__).parents[2] / "benchmarks" / "stochastic" / f"{name}.py"
    spec = importlib.util.spec_from_file_location(name, path)
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module


def test_packing_times(tmp_path, capsys):
    program("packing").main(["--discs", "100", "300", "--out", str(tmp_path)])
    assert capsys.readouterr().out.count("sum off by") == 6
    assert len((tmp_path / "packing.csv").read_text().splitlines()) == 7
    assert (tmp_path / "packing.png").stat().st_size > 1000


def test_readings_of_the_papers_data(tmp_path, capsys):
    benchmark = program("paper_data")
    found = {reading.what: reading for reading, _ in benchmark.readings(discs=600, number=5)}
    described, wider = (
        next(r for what, r in found.items() if word in what)
        for word in ("as described", "factor 30")
    )
    assert described.within > 0.998
    assert wider.within < described.within - 0.004
    assert wider.a2 < described.a2
    benchmark.main(["--discs", "200", "--packings", "5", "--out", str(tmp_path)])
    assert capsys.readouterr().out.count("within") >= 6
    assert (tmp_path / "paper_data.svg").stat().st_size > 1000


@pytest.mark.slow
def test_hundred_thousand_discs_tile_their_box():
    timing = program("packing").measure("log-normal, 0.2", 100_000)
    assert timing.error < 1e-10
