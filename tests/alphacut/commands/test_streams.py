"""Commands whose standard output is closed, full or a pipe: one line, and no traceback."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.alphacut.small import told_by, written

ROOT = Path(__file__).parents[3]


def failure(folder, before, words):
    """The one line on standard error of a command that fails in a shell."""
    written(folder)
    command = f"{before} exec {sys.executable} -m alphacut {words}"
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    ended = subprocess.run(
        ["sh", "-c", command], cwd=folder, env=environment, capture_output=True, text=True
    )
    assert ended.returncode == 1
    assert len(ended.stderr.splitlines()) == 1, ended.stderr
    return ended.stderr


@pytest.mark.parametrize(
    ("redirection", "words"),
    [(">&-", "standard output is closed"), (">/dev/full", "No space left on device")],
)
def test_an_answer_that_cannot_be_written_is_one_line(tmp_path, redirection, words):
    assert words in failure(tmp_path, "", f"check case.toml {redirection}")


def test_a_pipe_is_no_folder_of_results(tmp_path):
    case = written(tmp_path)
    os.mkfifo(tmp_path / "pipe")
    told = told_by("run", case, "--out", tmp_path / "pipe", status=2)
    assert "--out" in told
    assert "the name of a folder" in told


@pytest.mark.parametrize("blocks", [1, 12, 40])
def test_a_run_under_a_limit_of_file_sizes_is_one_line(tmp_path, blocks):
    told = failure(tmp_path, f"ulimit -f {blocks};", "run case.toml --out out --quiet")
    assert told.endswith("File too large\n")
