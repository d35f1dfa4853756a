"""Progress never runs backwards, however many computations in a row report it."""

import time

import numba
import numpy as np
import pytest

from alphacut.base.kernels import kernel, shared_folder
from alphacut.base.progress_bar import Foretold, foretelling, progress_reporter, searching


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
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path))  # read as it is imported
    shared_folder.cache_clear()  # another test may have asked for the user's
    _twice.__module__ = "alphacut.base.kernels"  # whose text is part of the name in the cache
    twice = kernel()(_twice)
    with progress_reporter(None):
        assert twice(2) == 4
        assert twice(3) == 6
    assert capsys.readouterr().err == "  0% after 22 s, compiling, once\n"


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


def test_a_stage_that_stands_still_is_not_said_to_end_soon(monkeypatch, capsys):
    # A second of the clock of the display is a fiftieth of a second here: lines are 8 s apart.
    begun = time.monotonic()
    monkeypatch.setattr(
        "alphacut.base.progress_bar.monotonic", lambda: 50 * (time.monotonic() - begun)
    )
    monkeypatch.setattr("alphacut.base.progress_bar.REPEAT", 0.02)
    with progress_reporter(None) as report:
        report(Foretold(0.3, 60.0))
        time.sleep(3.0)
    lines = capsys.readouterr().err.splitlines()
    left = [float(line.split()[5]) for line in lines if "left" in line]
    assert 20.0 <= min(left) <= max(left) <= 60.0
    assert "left" not in lines[-1]


def foretold(course, monkeypatch):
    """The times left that are told in a course of (work, fraction), and those that are right."""
    clock = [0.0]
    monkeypatch.setattr("alphacut.base.progress_bar.monotonic", lambda: clock[0])
    found = []
    report = foretelling(lambda told: found.append((told.seconds_left, course[-1][0] - clock[0])))
    for work, fraction in course:
        clock[0] = work
        report(fraction)
    return found


def test_times_of_stages_of_speeds_within_a_factor_of_three_are_right_within_it(monkeypatch, rng):
    for _ in range(20):
        speeds = rng.uniform(1.0, 3.0, 60)
        fractions = np.cumsum(speeds) / speeds.sum()
        course = [(1.0 + k, float(x)) for k, x in enumerate(fractions)]
        for told, right in foretold(course, monkeypatch)[:-1]:
            assert told is None or right / 3 <= told <= 3 * right
    even = [(1.0 + k, (1.0 + k) / 60) for k in range(60)]
    told = [seconds for seconds, _ in foretold(even, monkeypatch)]
    assert told[:11] == [None] * 11  # up to a fifth of the way
    assert told[11:] == pytest.approx([48.0 - k for k in range(49)], abs=1e-9)


@pytest.mark.parametrize("power", [0.3, 3.0])
def test_stages_that_slow_down_or_jump_foretell_nothing(monkeypatch, power):
    course = [(1.0 + k, ((1.0 + k) / 60) ** power) for k in range(60)]
    assert {told for told, _ in foretold(course, monkeypatch)} == {None}
    jump = [(1.0 + k, 0.0 if k < 50 else 0.5 + (k - 50) / 100) for k in range(60)]
    assert {told for told, _ in foretold(jump, monkeypatch)} == {None}


def test_a_search_foretells_nothing():
    told = []
    report = foretelling(told.append)
    for fraction in (0.1, 0.5, 1.0):
        searching(report)(fraction)
    assert told == [0.1, 0.5, 1.0]
    assert {type(x) for x in told} == {Foretold}
    assert {x.seconds_left for x in told} == {None}
