"""Records and suites read from files in Python."""

import numpy as np
import pytest

from alphacut.frame import Accelerogram, read_matrix, read_modes, read_record, read_suite
from alphacut.fuzzy import RefusedError
from tests.refused import refuses


def write_column(path, samples):
    path.write_text("".join(f"{x:.17g}\n" for x in samples))
    return path


def test_a_column_is_read_with_its_step_and_unit(tmp_path, rng):
    samples = rng.normal(size=30)
    path = write_column(tmp_path / "north south.txt", samples)
    record = read_record(path, step=0.02, unit="gal")
    assert isinstance(record, Accelerogram)
    assert (record.name, record.step) == ("north_south", 0.02)
    assert record.samples == pytest.approx(0.01 * samples, rel=1e-15)
    centred = read_record(str(path), step=0.02, unit="gal", baseline="mean")
    assert centred.samples == pytest.approx(0.01 * (samples - samples.mean()), abs=1e-15)


def test_a_suite_is_read_by_the_names_of_its_files(tmp_path, rng):
    all_samples = {name: rng.normal(size=10) for name in ("b", "a", "c")}
    for name, samples in all_samples.items():
        write_column(tmp_path / f"{name}.txt", samples)
    options = {"step": 0.02, "unit": "m/s^2", "baseline": "mean"}
    suite = read_suite(f"{tmp_path}/*.txt", **options)
    assert [record.name for record in suite] == ["a", "b", "c"]
    for record in suite:
        samples = all_samples[record.name]
        assert record.samples == pytest.approx(samples - samples.mean(), abs=1e-15)
    listed = read_suite([tmp_path / "c.txt", f"{tmp_path}/[ab].txt"], **options)
    assert [record.name for record in listed] == ["c", "a", "b"]


def test_what_is_unusual_is_a_remark(tmp_path):
    path = tmp_path / "late.csv"
    rows = "".join(f"{10 + 0.02 * k:.2f},{60 * np.sin(k)}\n" for k in range(80))
    path.write_text(f"time [s],acceleration [m/s^2]\n{rows}")
    with refuses("late.csv, line 1"):
        read_record(path, unit="g")
    remarks = "; ".join(read_record(path).remarks)
    for words in ("begin at 10 s", "peak is 6.12 g"):
        assert words in remarks
    other = read_record(path, unit="g", override=["unit"])
    assert other.samples == pytest.approx(9.80665 * read_record(path).samples)
    assert "its own unit, m/s^2 (line 1), is overridden by g" in other.remarks
    with refuses("late.csv, line 1"):
        read_record(path, step=0.01)
    assert read_record(path, step=0.01, override=["step"]).step == 0.01
    with refuses("override"):
        read_record(path, override=["peak"])


@pytest.mark.parametrize(
    ("files", "options", "key"),
    [
        ([], {}, "files"),
        (["a.txt", "a.txt"], {}, "files"),
        ("a.txt", {"step": 0.0}, "step"),
        ("a.txt", {"step": 200}, "step"),
        ("a.txt", {"baseline": "median"}, "baseline"),
        ("a.txt", {"unit": "furlongs"}, "unit"),
        ("a.txt", {"channel": 2}, "channel"),
        (300 * "a", {}, "files"),
        ("missing.txt", {}, "files"),
    ],
)
def test_other_files_and_arguments_are_refused(tmp_path, files, options, key):
    write_column(tmp_path / "a.txt", [1.0, 2.0])
    is_one = isinstance(files, str)
    paths = f"{tmp_path}/{files}" if is_one else [f"{tmp_path}/{name}" for name in files]
    with refuses(key):
        read_suite(paths, **{"step": 0.02, "unit": "g"} | options)


@pytest.mark.parametrize("read", [read_record, read_suite, read_modes, read_matrix])
@pytest.mark.parametrize("path", [None, 3, b"a.csv"])
def test_what_is_no_path_is_refused_before_it_is_opened(read, path):
    with pytest.raises(RefusedError, match="allowed: the path of a file"):
        read(path)


@pytest.mark.parametrize("read", [read_record, read_matrix])
def test_a_name_that_is_too_long_is_said_to_be(read):
    with refuses(
        "aaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaa…"
    ):
        read(300 * "a" + ".csv")
