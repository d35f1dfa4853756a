"""Universal files, written by the columns of the format."""

import re

import numpy as np
import pytest

from alphacut.frame import read_record
from alphacut.frame.records.uff import floats
from tests.frame.records.samples import uff58
from tests.refused import refuses


def saved(folder, content):
    path = folder / "record.uff"
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


WAVE = np.sin(9 * 0.005 * np.arange(400))


@pytest.mark.parametrize("order", ["", "<", ">"])
@pytest.mark.parametrize("kind", [2, 4])
def test_text_and_bytes_of_single_and_double_reals_are_read(tmp_path, kind, order):
    content = uff58(WAVE, kind=kind, order=order)
    record = read_record(saved(tmp_path, content))
    assert record.samples == pytest.approx(WAVE, abs=1e-11 if kind == 4 else 1e-5)
    several = content + uff58(2 * WAVE, kind=kind, order=order).replace(
        b"         7   1", b"         8   1"
    )
    assert read_record(saved(tmp_path, several), channel="8.x").samples == pytest.approx(
        2 * WAVE, abs=2e-5
    )
    with refuses("record.uff"):
        read_record(saved(tmp_path, several))


def test_padding_is_dropped_and_a_missing_point_refused(tmp_path):
    content = uff58(WAVE)
    padded = content.replace(b"    -1\n", b" 0.00000E+00 0.00000E+00\n    -1\n")
    assert len(read_record(saved(tmp_path, padded)).samples) == len(WAVE)
    with refuses("record.uff, response 7.x"):
        read_record(saved(tmp_path, content.replace(b"       400", b"       401")))


@pytest.mark.parametrize("rate", [256, 200])
def test_times_that_are_even_but_for_their_digits_are_even(tmp_path, rate):
    wave = np.sin(np.arange(8000) / 40)
    times = np.arange(8000) / rate
    record = read_record(saved(tmp_path, uff58(wave, times=times)))
    assert record.step == pytest.approx(1 / rate, rel=1e-6)
    assert record.samples == pytest.approx(wave, abs=1e-5)
    times[4000:] += 0.4 / rate
    with refuses("record.uff, response 7.x"):
        read_record(saved(tmp_path, uff58(wave, times=times)))


@pytest.mark.parametrize(
    ("changes", "key"),
    [({"unit": "Pa"}, "record.uff, response 7.x"), ({"unit": "NONE"}, "record.uff, response 7.x"),
     ({"function": 4}, "record.uff, response 7.x"), ({"step": 0.0}, "record.uff, response 7.x"),
     ({"spec": 11}, "record.uff, response 7.x"),
 ({"unit": "cm/s"}, "record.uff, response 7.x")],
)  # fmt: skip
def test_what_is_no_acceleration_over_time_is_refused(tmp_path, changes, key):
    with refuses(key):
        read_record(saved(tmp_path, uff58(WAVE, **changes)))


@pytest.mark.parametrize("unit", ["ms", "[ms]"])
@pytest.mark.parametrize("has_times", [False, True])
def test_abscissas_in_milliseconds_are_read_as_such(tmp_path, unit, has_times):
    times = 5.0 * np.arange(400) if has_times else None
    content = uff58(WAVE, step=5.0, times=times)
    axis = f"{'Time':<20} {'s':<20}".encode()
    for words in (f"{'Time':<20} {unit:<20}", f"{'Time ' + unit:<20} {'NONE':<20}"):
        record = read_record(saved(tmp_path, content.replace(axis, words.encode())))
        assert record.step == pytest.approx(0.005, rel=1e-6)
    without = content.replace(axis, f"{'Time':<20} {'NONE':<20}".encode())
    with refuses("record.uff, response 7.x"):
        read_record(saved(tmp_path, without))


def test_data_sets_of_one_response_are_told_apart(tmp_path):
    runs = [uff58(k * WAVE).replace(b"made up", b"run %d  " % k) for k in (1, 2)]
    path = saved(tmp_path, b"".join(runs))
    with refuses("record.uff"):
        read_record(path)
    with refuses("record.uff"):
        read_record(path, channel="7.x")
    for channel, factor in {"7.x#1": 1, "7.X#2": 2, "run 2": 2}.items():
        samples = read_record(path, channel=channel).samples
        assert samples == pytest.approx(factor * WAVE, abs=2e-5)


def test_exponents_without_their_letter_are_read_as_fortran_does(tmp_path):
    content = uff58(WAVE)
    bare = re.sub(rb"(\d\.\d+)[eE]([-+])(\d\d)(?!\d)", rb"\1\g<2>0\3", content)
    assert bare != content
    record = read_record(saved(tmp_path, bare))
    assert record.step == pytest.approx(0.005)
    assert record.samples == pytest.approx(WAVE, abs=1e-5)
    assert floats("  8.82898-001 -1.00000+000 2 .5+001") == [0.882898, -1.0, 2.0, 5.0]
    assert floats("1.5 -100 12.5-33.5") == [1.5, -100.0, 12.5, -33.5]


def test_a_data_set_that_ends_in_its_head_is_told_why(tmp_path):
    content = uff58(WAVE)
    start, _, rest = content.partition(b"made up")
    _, _, below = rest.partition(b"\n")
    with refuses("record.uff"):
        read_record(saved(tmp_path, start + b"    -1\n" + below))
    with refuses("record.uff"):
        read_record(saved(tmp_path, start + b"NONE\n"))


def test_a_system_of_units_is_that_of_a_data_set_without_one(tmp_path):
    system = b"    -1\n   164\n         5 mm                           2\n"
    system += (
        b"  1.00000000000000000D+03  1.00000000000000000D+00  1.00000000000000000D+00\n    -1\n"
    )
    path = saved(tmp_path, system + uff58(WAVE, unit="NONE"))
    assert read_record(path).samples == pytest.approx(WAVE / 1000, abs=1e-8)
    with refuses("record.uff"):
        read_record(path, unit="g")
    path = saved(tmp_path, system.replace(b"D+03", b"D+02", 1) + uff58(WAVE, unit="m/s^2"))
    assert read_record(path).samples == pytest.approx(WAVE, abs=1e-5)


def test_a_name_of_another_quantity_is_refused_where_code_and_unit_say_nothing(tmp_path):
    path = tmp_path / "record.uff"
    content = uff58(np.sin(np.arange(40) / 5), unit="NONE", spec=0)
    path.write_bytes(content)
    assert read_record(path, unit="g")
    path.write_bytes(content.replace(b"Channel 1", b"Velocity "))
    with refuses("record.uff, response 7.x"):
        read_record(path, unit="g")
