"""Progress is shown on a terminal and nowhere else; charts run what they are asked for and say what they ran."""

import io
import json
import subprocess
import sys
from types import SimpleNamespace

import pytest

from alphacut import command_charts
from alphacut.entry import main
from alphacut.progress import progress


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


@pytest.mark.parametrize(("stream", "quiet", "rank"), [(io.StringIO(), False, "0"), (Terminal(), True, "0"), (Terminal(), False, "1")])
def test_nothing_is_shown_off_a_terminal_when_quiet_or_on_other_ranks(stream, quiet, rank, monkeypatch):
    monkeypatch.setattr(sys, "stderr", stream)
    monkeypatch.setenv("OMPI_COMM_WORLD_RANK", rank)
    with progress("Envelopes", quiet=quiet) as tick:
        assert tick is None
    assert stream.getvalue() == ""


def test_charts_run_what_is_named_and_say_which(monkeypatch, tmp_path, capfd):
    called = []

    def pretend(command, **options):
        called.append(command[-1])
        return SimpleNamespace(returncode=0 if command[-1] != "benchmarks.cell_sweep" else 3)

    monkeypatch.setattr(subprocess, "run", pretend)
    assert {"cell_sweep", "frame_tower", *command_charts.CHARTS} <= set(command_charts.programs())
    assert not {"rows", "frame_reference", "cell_methods"} & set(command_charts.programs())
    assert main(["charts", "frame_tower", "frame_integrators", "--json", str(tmp_path / "run.json")]) == 0
    assert called == ["benchmarks.frame_tower", "benchmarks.frame_integrators"]
    assert json.loads((tmp_path / "run.json").read_text())["run"] == ["frame_tower", "frame_integrators"]
    assert main(["charts", "cell_sweep"]) == 1
    assert "cell_sweep ended with status 3" in capfd.readouterr().err
    assert main(["charts", "nothing"]) == 2
