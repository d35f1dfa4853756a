"""Records of the ground's acceleration as they are read."""

from __future__ import annotations

from pathlib import Path

import pytest

from alphacut.io.problem import BadInput
from alphacut.stages.vibration.accelerogram import accelerogram


def test_rounded_times_do_not_shift_the_end_of_a_record(tmp_path: Path) -> None:
    rows = "".join(f"{k / 30:.9f},{k % 7 - 3}\n" for k in range(901))
    file = tmp_path / "record.csv"
    file.write_text(f"time [s],acceleration [m/s^2]\n{rows}")
    found = accelerogram(file)
    assert found.step * 900 == pytest.approx(30, abs=1e-9)
    assert len(found.acceleration) == 901


def test_a_record_may_have_semicolons_and_decimal_commas(tmp_path: Path) -> None:
    file = tmp_path / "record.csv"
    file.write_text("time [s];acceleration [g]\n0,0;0\n0,02;1,5\n0,04;-,5\n", encoding="utf-8")
    found = accelerogram(file)
    assert found.step == pytest.approx(0.02)
    assert found.acceleration / 9.80665 == pytest.approx([0, 1.5, -0.5])
    file.write_text("time [s];acceleration [g]\n0,0;0\n0.02;1\n0,04;2\n", encoding="utf-8")
    with pytest.raises(BadInput, match=r"row 2 holds '0,0', a decimal comma, and row 3 '0.02'"):
        accelerogram(file)


def test_a_record_that_blanks_part_is_told_what_parts_columns(tmp_path: Path) -> None:
    file = tmp_path / "record.csv"
    file.write_text("time [s] acceleration [g]\n0 0\n0.02 1\n0.04 2\n", encoding="utf-8")
    with pytest.raises(BadInput, match=r"no comma found: .* allowed: time \[s\],acceleration"):
        accelerogram(file)
    file.write_text("time [s]\tacceleration [g]\n0\t0\n0.02\t1\n0.04\t2\n", encoding="utf-8")
    assert len(accelerogram(file).acceleration) == 3


@pytest.mark.parametrize(
    "header", ["Time(s)\tAcc(g)", "t [s]\ta [g]", "TIME (s)\tAcceleration (g)"]
)
def test_a_header_may_have_parentheses_and_short_names(tmp_path: Path, header: str) -> None:
    file = tmp_path / "record.txt"
    file.write_text(f"{header}\n0\t0\n0.02\t1\n0.04\t2\n", encoding="utf-8")
    assert accelerogram(file).acceleration / 9.80665 == pytest.approx([0, 1, 2])


AT2 = """PEER NGA STRONG MOTION DATABASE RECORD
Own Hill, 1/2/2003, Station 7, 90
ACCELERATION TIME SERIES IN UNITS OF G
NPTS=      7, DT=   .0050 SEC,
  .0000000E+00  .1000000E+00 -.2000000E-01  .3000000E-02  .4000000E+00
 -.5000000E+00  .0000000E+00
"""


def test_a_record_of_peer_is_read_as_it_comes(tmp_path: Path) -> None:
    file = tmp_path / "RSN7.AT2"
    file.write_text(AT2, encoding="utf-8")
    found = accelerogram(file)
    assert found.step == 0.005
    assert found.acceleration / 9.80665 == pytest.approx([0, 0.1, -0.02, 0.003, 0.4, -0.5, 0])


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("ACCELERATION", "VELOCITY", "do not say that the values are accelerations in g"),
        ("OF G", "OF CM/S2", "do not say that the values are accelerations in g"),
        ("=      7", "=      8", "7 numbers follow NPTS = 8"),
        (".0050", ".0000", "at a step above 0"),
        ("-.5000000E+00", "nan", "as many finite numbers"),
        ("-.5000000E+00", "end", "could not convert"),
        ("=      7", "=       ", "lacks NPTS; allowed: NPTS= 4000, DT= .0050 SEC"),
        ("   .0050", "        ", "lacks DT; allowed"),
        (".0050 SEC", ".0050", "lacks SEC as its unit; allowed"),
        ("7, DT=   .0050 SEC", " , DT=", "lacks NPTS and DT and SEC as its unit; allowed"),
    ],
)
def test_a_record_of_peer_that_is_none_is_refused(
    tmp_path: Path, old: str, new: str, told: str
) -> None:
    file = tmp_path / "RSN7.AT2"
    file.write_text(AT2.replace(old, new), encoding="utf-8")
    with pytest.raises(BadInput, match=told):
        accelerogram(file)


def written(tmp_path: Path, times: list[str]) -> Path:
    file = tmp_path / "times.csv"
    rows = "".join(f"{time},{k % 7 - 3}\n" for k, time in enumerate(times))
    file.write_text(f"time [s],acceleration [m/s^2]\n{rows}")
    return file


@pytest.mark.parametrize("form", [".3f", ".5g", ".9f", "g", ".17g"])
def test_even_times_may_be_rounded_to_their_last_digit(tmp_path: Path, form: str) -> None:
    times = [format(k / 128, form) for k in range(3000)]
    found = accelerogram(written(tmp_path, times))
    assert found.step == pytest.approx(1 / 128, rel=3e-5)
    assert found.step == float(times[-1]) / 2999


def test_rounding_to_milliseconds_is_one_in_milliseconds_too(tmp_path: Path) -> None:
    file = written(tmp_path, [f"{1000 * k / 128:.0f}" for k in range(500)])
    file.write_text(file.read_text(encoding="utf-8").replace("[s]", "[ms]"), encoding="utf-8")
    assert accelerogram(file).step == pytest.approx(1 / 128, rel=1e-3)


@pytest.mark.parametrize("gap", [1, 2, 250, 498, 499])
def test_a_missing_row_is_no_rounding(tmp_path: Path, gap: int) -> None:
    times = [f"{0.0041 * k:.3f}" for k in range(501) if k != gap]
    with pytest.raises(BadInput, match=r"not evenly spaced: .* resample to them"):
        accelerogram(written(tmp_path, times))


@pytest.mark.parametrize(
    ("times", "told"),
    [
        (["0.00", "0.01", "0.01", "0.02", "0.03"], r"csv:4: .* 0 s to this row, mostly 0.01 s"),
        (["0", "1", "2", "4", "5"], r"csv:5: .* 2 s to this row, mostly 1 s"),
        (["0", "0", "0"], r"allowed: even steps above 0 s"),
        (["0", "-1", "-2"], r"allowed: even steps above 0 s"),
        (["10.00", "10.01", "10.02"], r"csv:2: .*begin at 10 s; .* subtract the first time"),
    ],
)
def test_uneven_times_and_a_late_start_are_refused_with_a_cure(
    tmp_path: Path, times: list[str], told: str
) -> None:
    with pytest.raises(BadInput, match=told):
        accelerogram(written(tmp_path, times))


def test_the_cures_of_refused_times_work(tmp_path: Path) -> None:
    late = [10 + 0.0075 * k for k in range(100)]
    times = [f"{time - late[0]:.4f}" for time in late]
    assert accelerogram(written(tmp_path, times)).step == pytest.approx(0.0075)


@pytest.mark.parametrize(("step", "end", "gap"), [(0.05, 10, 100), (0.005, 10, 1500)])
def test_a_missing_row_is_no_rounding_of_a_short_last_time(
    tmp_path: Path, step: float, end: int, gap: int
) -> None:
    """The last time, "10" after "9.95", is written to seconds: its half unit is above the step."""
    times = [f"{step * k:.10g}" for k in range(round(end / step) + 1) if k != gap]
    with pytest.raises(BadInput, match=r"not evenly spaced: .* resample to them"):
        accelerogram(written(tmp_path, times))
