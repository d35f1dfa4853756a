"""Progress never runs backwards, however many computations in a row report it."""

import numpy as np

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
