"""The benchmarks of the microstructure, in small."""

import importlib.util
import sys
from dataclasses import replace
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


def test_a_micrograph_is_judged_by_its_very_discs(monkeypatch):
    benchmark = program("micrographs")
    for name, value in (("COUNTS", (120, 120)), ("RADII", (9.0, 9.0))):
        monkeypatch.setattr(benchmark, name, value)
    row = benchmark.judged(4, 8, 1, 128)
    assert row.right_fraction
    assert row.holds
    assert 0.4 < row.fraction < 0.5
    assert row.true_low <= row.true_high < 1.02 * row.true_low
    assert not replace(row, fraction_found=1.03 * row.fraction).right_fraction
    assert not replace(row, chain_low=1.01 * row.true_high).holds
    assert "MISSED" in benchmark.told(replace(row, chain_low=1.01 * row.true_high))


def test_statistics_of_spheres(tmp_path, capsys):
    few = ["--spheres", "150", "--sections", "6", "--specimens", "1", "--out", str(tmp_path)]
    assert program("sphere_statistics").main([*few, "--seed", "3"]) in (0, 1)
    out = capsys.readouterr().out
    assert "150 spheres packed and tessellated in" in out
    assert "standard errors from the volume fraction 0.2092" in out
    assert "p-box of 300 circles" in out
    assert len((tmp_path / "sphere_statistics.csv").read_text().splitlines()) == 2


@pytest.mark.slow
def test_hundred_thousand_discs_tile_their_box():
    timing = program("packing").measure("log-normal, 0.2", 100_000)
    assert timing.error < 1e-10
