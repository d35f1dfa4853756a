"""Whole files: what stands there is replaced only where it is a file."""

import os
import shutil
import tempfile
import threading
from types import SimpleNamespace

import pytest

from alphacut.base.kept_files import locked, whole_file, write_text
from alphacut.fuzzy import FailedError
from tests.refused import refuses


def test_a_link_stays_and_its_target_is_replaced(tmp_path):
    real, link = tmp_path / "real.json", tmp_path / "link.json"
    real.write_text("old", encoding="utf-8")
    link.symlink_to(real)
    write_text(link, "new")
    assert link.is_symlink()
    assert real.read_text(encoding="utf-8") == "new"


def test_a_pipe_is_written_to_and_stays(tmp_path):
    pipe, read = tmp_path / "pipe.json", []
    os.mkfifo(pipe)
    reader = threading.Thread(target=lambda: read.append(pipe.read_text(encoding="utf-8")))
    reader.start()
    write_text(pipe, "told")
    reader.join(10)
    assert read == ["told"]
    assert pipe.is_fifo()


def test_a_file_that_fails_leaves_the_old_one(tmp_path):
    path = tmp_path / "a.txt"
    write_text(path, "old")
    with pytest.raises(FileNotFoundError), whole_file(path):
        (tmp_path / "nowhere").read_text(encoding="utf-8")
    assert [x.name for x in tmp_path.iterdir()] == ["a.txt"]
    assert path.read_text(encoding="utf-8") == "old"


def test_a_second_run_into_the_same_folder_is_refused_while_the_first_writes(tmp_path):
    place = tmp_path / "out"
    with locked("--out", place), refuses("--out"):
        locked("--out", place).__enter__()
    with locked("--out", place):
        assert not list(place.iterdir())


def failing(path, error):
    with whole_file(path):
        raise error


def test_a_full_disk_is_named_whatever_the_writer_says(tmp_path, monkeypatch):
    monkeypatch.setattr(shutil, "disk_usage", lambda _: SimpleNamespace(free=0))
    full = r"the disk of .* is full; free some space"
    for error in (RuntimeError("NetCDF: HDF error"), OSError(28, "No space left on device")):
        with pytest.raises(FailedError, match=full):
            failing(tmp_path / "a.nc", error)
    monkeypatch.setattr(tempfile, "gettempdir", lambda: str(tmp_path))
    with pytest.raises(FailedError, match="or set TMPDIR to another folder"):
        failing(tmp_path / "stage" / "a.nc", RuntimeError("NetCDF: HDF error"))
    assert not list((tmp_path / "stage").iterdir())
