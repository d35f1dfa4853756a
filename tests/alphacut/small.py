"""Cases of a second for the tests of the front door, and one that asks every question."""

import io
import json
import tomllib
from contextlib import redirect_stderr, redirect_stdout
from functools import cache
from pathlib import Path

from alphacut import main

TABLES = Path(__file__).parent / "case" / "refused"
"""Base cases with the mistakes that are refused in them, one file each."""


@cache
def table_of(name):
    """A base case by its name: the text `case`, and the mistakes `refused` in it."""
    return tomllib.loads((TABLES / f"{name}.toml").read_text(encoding="utf-8"))


FRAME = table_of("frame")["case"]
CELL = table_of("cell")["case"]
TWO_FLOORS = """
title = "Two floors <script>alert(1)</script>"
about = "A frame that asks every question, made by `a <b> command`"
stages = ["envelope"]
[frame]
modulus = "[24, 25, 26] GPa"
second_moment = "1e-6 m^4"
masses = ["[8.5, 9, 9.5] t", "7 t"]
lengths = ["2.4 m", "3 m"]
dampers = ["90 N s/m", "60 N s/m"]
damper_placement = "storey"
displacements = ["50 mm", "0 mm"]
velocities = ["0 m/s", "0.4 m/s"]
outputs = ["q2", "drift1"]
[envelope]
fuzzy = ["E", "m1"]
alpha = [0, 0.5, 1]
duration = "2 s"
step = "0.02 s"
[probability]
limits = ["q2 <= 300 mm", "drift1 <= 5 %"]
random = ["m1"]
samples = 20
[decision]
limits = ["q2 <= 300 mm", "drift1 <= 5 %"]
[tolerances]
limits = ["q2 <= 280 mm"]
most = 3
"""


def replaced(text, changes):
    """A text with others in place of some of its parts, each of which must be there."""
    for old, new in changes.items():
        assert old in text
        text = text.replace(old, new)
    return text


def written(folder, text=FRAME, **changes):
    """A case file with texts replaced, each of which must be there."""
    path = folder / "case.toml"
    path.write_text(replaced(text, changes), encoding="utf-8")
    return path


def summary_of(folder):
    """The summary in a folder of results."""
    return json.loads((folder / "summary.json").read_text(encoding="utf-8"))


def summary_of_run(case, *options):
    """The summary of a run of a case without figures, into the folder beside it."""
    out = case.parent / "out"
    words = ["--quiet", "--no-figures", "--out", str(out), *options]
    assert main(["run", str(case), *words]) == 0
    return summary_of(out)


def refusals(case, *changes):
    """What `check` says of a case that it refuses, one line for each problem."""
    told = io.StringIO()
    with redirect_stderr(told):
        assert main(["check", str(case), "--quiet", *(f"--set={x}" for x in changes)]) == 2
    return told.getvalue().splitlines()


def two_floors_run(folder, *options):
    """The folder of the results of the frame of two floors."""
    case = folder / "two-floors.toml"
    case.write_text(TWO_FLOORS, encoding="utf-8")
    assert main(["run", str(case), "--quiet", "--out", str(folder / "out"), *options]) == 0
    return folder / "out"


def told_by(*words, status=0):
    """What a command prints, on both streams; it must end with a status."""
    told = io.StringIO()
    with redirect_stdout(told), redirect_stderr(told):
        ended = main([str(word) for word in words])
    assert ended == status, told.getvalue()
    return told.getvalue()
