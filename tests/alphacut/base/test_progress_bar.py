"""Progress never runs backwards, however many computations in a row report it."""

import time

import numpy as np

from alphacut.base.kernels import kernel
from alphacut.base.progress_bar import progress_reporter


def test_what_begins_anew_does_not_run_backwards():
    told = []
    with progress_reporter(told.append) as report:
        for fraction in (0.0, 0.4, 0.8, 0.0, 0.5, 0.9, 1.0):
            report(fraction)
    assert told == [0.0, 0.4, 0.8, 0.9, 1.0]


def test_a_terminal_shows_the_largest_fraction(monkeypatch, capsys):
    times = iter(np.arange(0.0, 500.0, 11.0))
    monkeypatch.setattr("alphacut.base.progress_bar.monotonic", lambda: next(times))
    with progress_reporter(None) as report:
        for fraction in (0.5, 0.1, 0.7):
            report(fraction)
    shown = [line.split("%")[0].strip() for line in capsys.readouterr().err.splitlines()]
    assert shown == ["50", "70"]


def test_a_line_says_that_a_kernel_is_compiled(monkeypatch, capsys, tmp_path):
    times = iter(np.arange(0.0, 500.0, 11.0))
    monkeypatch.setattr("alphacut.base.progress_bar.monotonic", lambda: next(times))
    monkeypatch.setattr("alphacut.base.progress_bar.REPEAT", 1e3)
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    _twice.__module__ = "alphacut.base.kernels"  # whose text is part of the name in the cache
    twice = kernel()(_twice)
    with progress_reporter(None):
        assert twice(2) == 4
        assert twice(3) == 6
    assert capsys.readouterr().err == "  0% after 11 s, compiling, once\n"


def _twice(number):
    return 2 * number


def test_lines_go_on_while_nothing_is_reported(monkeypatch, capsys):
    # A second of the clock of the display is a fiftieth of a second here.
    begun = time.monotonic()
    monkeypatch.setattr(
        "alphacut.base.progress_bar.monotonic", lambda: 50 * (time.monotonic() - begun)
    )
    with progress_reporter(None) as report:
        report(0.3)
        time.sleep(3.5)
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) >= 3
    assert all(line.startswith(" 30% after ") for line in lines)
    written = [float(line.split()[2]) for line in lines]
    assert written == sorted(set(written))
    time.sleep(1.5)
    assert capsys.readouterr().err == ""
