"""Progress: a bar on a terminal, a line now and then elsewhere, nothing when quiet."""

import io
import sys

import pytest

from alphacut.fuzzy.progress_bar import stage
from alphacut.io import progress as told
from alphacut.io.progress import progress


class Terminal(io.StringIO):
    def isatty(self):
        return True


def test_a_terminal_sees_the_share_done_and_the_time_left(monkeypatch):
    shown = Terminal()
    monkeypatch.setattr(sys, "stderr", shown)
    monkeypatch.setenv("TERM", "xterm")
    with progress("Envelopes") as tick:
        tick(0.5)
        tick(1.0)
    assert "Envelopes" in shown.getvalue()
    assert "100%" in shown.getvalue()
    assert "left" in shown.getvalue()


@pytest.mark.parametrize(
    ("stream", "quiet", "rank"),
    [(io.StringIO(), True, "0"), (Terminal(), True, "0"), (Terminal(), False, "1")],
)
def test_nothing_is_shown_when_quiet_or_on_other_ranks(stream, quiet, rank, monkeypatch):
    monkeypatch.setattr(sys, "stderr", stream)
    monkeypatch.setenv("OMPI_COMM_WORLD_RANK", rank)
    with progress("Envelopes", quiet=quiet) as tick:
        assert tick is None
    assert stream.getvalue() == ""


def test_off_a_terminal_a_line_every_ten_seconds_says_the_share_and_the_time_left(monkeypatch):
    shown, clock = io.StringIO(), iter([0.0, 4.0, 12.0, 15.0, 24.0])
    monkeypatch.setattr(sys, "stderr", shown)
    monkeypatch.setattr(told.time, "monotonic", lambda: next(clock))
    with progress("Envelopes") as tick:
        for done in (0.1, 0.25, 0.3, 0.75):
            tick(done)
    lines = shown.getvalue().splitlines()
    assert [line.split("Envelopes: ")[1] for line in lines] == [
        "25% done after 12 s, some 36 s left",
        "75% done after 24 s, some 8 s left",
    ]


def test_a_line_says_what_is_done_and_no_share_of_nothing(monkeypatch):
    shown, clock = io.StringIO(), iter([0.0, 100.0, 110.0, 130.0])
    monkeypatch.setattr(sys, "stderr", shown)
    monkeypatch.setattr(told.time, "monotonic", lambda: next(clock))
    with progress("Envelopes") as tick:
        stage(tick, "search (unproved: it is too wide)")
        tick(0.0)
        tick(0.5)
    assert "Envelopes, search (unproved: it is too wide): begun, 110 s so far\n" in shown.getvalue()
    assert "Envelopes, search: 50% done after 130 s, some 30 s left\n" in shown.getvalue()


def test_a_time_left_that_has_passed_twice_is_not_told_again(monkeypatch):
    shown, clock = io.StringIO(), iter([0.0, 99.0, 113.0, 130.0])
    monkeypatch.setattr(sys, "stderr", shown)
    monkeypatch.setattr(told.time, "monotonic", lambda: next(clock))
    with progress("Envelopes") as tick:
        for done in (0.99, 0.99, 0.99):
            tick(done)
    lines = [line.split("Envelopes: ")[1] for line in shown.getvalue().splitlines()]
    assert lines[0] == "99% done after 99 s, some 1 s left"
    assert lines[1:] == [f"99% done after {spent} s; {told.UNKNOWN}" for spent in (113, 130)]


def test_an_interrupted_command_says_what_is_kept_and_where(tmp_path):
    from argparse import Namespace

    from alphacut.entry import interrupted

    assert "nothing is kept" in interrupted(Namespace(command="envelope", out=None))
    assert interrupted(Namespace(command="mesh", out="mesh.xdmf")) == "nothing is kept"
    bare = Namespace(command="modulus", store=None, resume=False)
    assert interrupted(bare) == "without --store or --resume nothing is kept"
    run = Namespace(command="run", out=str(tmp_path), case="own.toml", quick=False)
    envelope = Namespace(command="envelope", out=str(tmp_path / "x.nc"), case="own.toml")
    modulus = Namespace(command="modulus", store=str(tmp_path / "s.db"), case="own.toml")
    image = Namespace(command="image", out=str(tmp_path / "i.nc"), case="own.toml")
    (tmp_path / "s.db").touch()
    (tmp_path / "i.partial").mkdir()
    for kept in (run, envelope, modulus, image):
        assert interrupted(kept) == "nothing was finished yet, so nothing is kept"
    files = ("modulus.nc", "x.partial.npz", "s.db", "i.partial/a.npz", "image.partial/a.npz")
    (tmp_path / "image.partial").mkdir()
    for kept, name in zip((run, envelope, modulus, image, run), files, strict=True):
        (tmp_path / name).write_text("some", encoding="utf-8")
        place = tmp_path if kept is run else tmp_path / name.removesuffix("/a.npz")
        what = f"what was finished is kept in {place}, and the same command goes on from there"
        assert interrupted(kept) == what
        (tmp_path / name).unlink()
    gone = Namespace(command="run", out=str(tmp_path / "none"), case="own.toml", quick=False)
    assert "nothing is kept" in interrupted(gone)


def test_enter_knows_the_program_by_its_name():
    import subprocess
    from pathlib import Path

    enter = Path(__file__).parents[3] / "enter"
    done = subprocess.run(
        [enter, "alphacut", "--help"], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert "usage: alphacut" in done.stdout
