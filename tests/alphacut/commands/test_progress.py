"""Progress is shown on a terminal and nowhere else. They say what
they ran.
"""

import io
import sys

import pytest

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
    [(io.StringIO(), False, "0"), (Terminal(), True, "0"), (Terminal(), False, "1")],
)
def test_nothing_is_shown_off_a_terminal_when_quiet_or_on_other_ranks(
    stream, quiet, rank, monkeypatch
):
    monkeypatch.setattr(sys, "stderr", stream)
    monkeypatch.setenv("OMPI_COMM_WORLD_RANK", rank)
    with progress("Envelopes", quiet=quiet) as tick:
        assert tick is None
    assert stream.getvalue() == ""
