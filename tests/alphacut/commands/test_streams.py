"""Commands whose standard output is closed, full or a pipe: one line, and no traceback."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from alphacut import main
from alphacut.io.quantity import parse_fuzzy
from tests.alphacut.small import written

ROOT = Path(__file__).parents[3]


@pytest.mark.parametrize(
    ("redirection", "words"),
    [(">&-", "standard output is closed"), (">/dev/full", "No space left on device")],
)
def test_an_answer_that_cannot_be_written_is_one_line(tmp_path, redirection, words):
    case = written(tmp_path)
    command = f"exec {sys.executable} -m alphacut check {case} {redirection}"
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    ended = subprocess.run(
        ["sh", "-c", command], cwd=tmp_path, env=environment, capture_output=True, text=True
    )
    assert ended.returncode == 1
    assert len(ended.stderr.splitlines()) == 1, ended.stderr
    assert words in ended.stderr


def test_a_pipe_is_no_folder_of_results(tmp_path, capsys):
    case = written(tmp_path)
    os.mkfifo(tmp_path / "pipe")
    assert main(["run", str(case), "--out", str(tmp_path / "pipe")]) == 2
    told = capsys.readouterr().err
    assert "--out" in told
    assert "the name of a folder" in told


@pytest.mark.parametrize("unit", ["t,,,,", "t,", "t;", "t !", "t..", "t.", "t @", "t=", "t&"])
def test_a_unit_with_other_characters_is_no_unit(unit):
    with pytest.raises(ValueError, match="unit"):
        parse_fuzzy(f"50 {unit}", "kg")


@pytest.mark.parametrize(
    ("text", "si", "value"),
    [("2 N·s/m", "N*s/m", 2.0), ("3 m²", "m", None), ("2 N m^1.0", "N*m", 2.0), ("1 cm4", "m^4", 1e-8)],
)  # fmt: skip
def test_units_of_words_signs_and_powers_are_read(text, si, value):
    if value is None:
        with pytest.raises(ValueError, match="no unit of length"):
            parse_fuzzy(text, si)
    else:
        assert parse_fuzzy(text, si).nominal == pytest.approx(value, rel=1e-15)


@pytest.mark.parametrize("blocks", [1, 12, 40])
def test_a_run_under_a_limit_of_file_sizes_is_one_line(tmp_path, blocks):
    case = written(tmp_path)
    command = f"ulimit -f {blocks}; exec {sys.executable} -m alphacut run {case} --out out --quiet"
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    ended = subprocess.run(
        ["sh", "-c", command], cwd=tmp_path, env=environment, capture_output=True, text=True
    )
    assert ended.returncode == 1
    assert ended.stderr.endswith("File too large\n")
    assert len(ended.stderr.splitlines()) == 1, ended.stderr
