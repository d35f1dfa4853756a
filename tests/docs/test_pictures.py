"""Every picture of README and documentation is drawn by a command that `make charts` runs."""

import csv
import re
from pathlib import Path

import pytest

from benchmarks.pictures import COMMANDS

ROOT = Path(__file__).parents[2]
RESULTS = ROOT / "benchmarks/results"
MAKEFILE = (ROOT / "Makefile").read_text(encoding="utf-8")
CHARTS = re.search(r"^charts:.*\n((?:\t.*\n)+)", MAKEFILE, re.MULTILINE)[1]


def shown():
    """Pictures that pages show, by their paths in the project."""
    for page in (ROOT / "README.md", *(ROOT / "docs").rglob("*.md")):
        for link in re.findall(r"!\[[^\]]*\]\(([^)]+)\)", page.read_text(encoding="utf-8")):
            yield (page.parent / link).resolve().relative_to(ROOT).as_posix()


def test_each_picture_that_a_page_shows_has_its_command_and_no_other_is_kept():
    assert set(shown()) == set(COMMANDS)
    pictures = {x.relative_to(ROOT).as_posix() for x in (ROOT / "docs/pictures").iterdir()}
    assert pictures <= set(COMMANDS)


@pytest.mark.parametrize("picture", COMMANDS)
def test_make_charts_runs_the_command_of_each_picture(picture):
    assert f"{COMMANDS[picture]}\n" in CHARTS.replace("$(IN) ", "")
    program = COMMANDS[picture].partition("python ")[2].split()
    file = Path(*program[1].split(".")).with_suffix(".py") if program[0] == "-m" else program[0]
    assert (ROOT / file).is_file()


def column(name, key):
    with (RESULTS / name).open(newline="", encoding="utf-8") as file:
        return list(dict.fromkeys(row[key] for row in csv.DictReader(file)))


def test_names_in_charts_are_those_of_the_code(tmp_path):
    pytest.importorskip("alphacut.rve.fenicsx")
    from benchmarks.frame.envelopes import METHODS
    from benchmarks.rve import one_shape

    assert column("one_shape.csv", "way") == list(one_shape.ways(tmp_path))
    assert column("frame_envelopes.csv", "method") == [repr(method) for method in METHODS]
