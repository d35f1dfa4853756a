"""Files of records and modes: what is wrong has its line."""

import numpy as np
import pytest

from alphacut.fuzzy.refused import RefusedError
from alphacut.io.measured import accelerogram, mode_rows

RECORD = "time [s],acceleration [g]\n0,0\n0.01,0.1\n0.02,-0.2\n"


def test_a_record_is_read(tmp_path):
    path = tmp_path / "record.csv"
    path.write_text(RECORD)
    record = accelerogram(path)
    assert record.step == pytest.approx(0.01)
    assert record.acceleration == pytest.approx(np.array([0, 0.1, -0.2]) * 9.80665)


def test_a_record_of_peer_is_read(tmp_path):
    path = tmp_path / "record.at2"
    head = "PEER\nX\nACCELERATION TIME SERIES IN UNITS OF G\nNPTS= 4, DT= .0050 SEC\n"
    path.write_text(head + ".1 .2\n.3 -.1\n")
    record = accelerogram(path)
    assert record.step == 0.005
    assert record.acceleration == pytest.approx(np.array([0.1, 0.2, 0.3, -0.1]) * 9.80665)


@pytest.mark.parametrize(
    ("old", "new", "line"),
    [
        ("[g]", "[kg]", 1),
        ("time", "zeit", 1),
        ("0.01,0.1", "0.01,1_0", 3),
        ("0.01,0.1", "0.01,٣", 3),
        ("0.01,0.1", "0.01", 3),
        ("0.01,0.1", "0.01,nan", 3),
        ("0.01,0.1", "0.013,0.1", 3),
        ("0,0\n", "1,0\n", 2),
    ],
)
def test_a_wrong_row_is_named(tmp_path, old, new, line):
    path = tmp_path / "record.csv"
    path.write_text(RECORD.replace(old, new, 1))
    with pytest.raises(RefusedError) as caught:
        accelerogram(path)
    assert caught.value.key.startswith(f"record.csv, {'header' if line == 1 else f'row {line}'}")


@pytest.mark.parametrize("content", [b"", b"\xff\xfe", b"time [s],acceleration [g]\n"])
def test_a_file_that_is_no_record_is_refused(tmp_path, content):
    path = tmp_path / "record.csv"
    path.write_bytes(content)
    with pytest.raises(RefusedError):
        accelerogram(path)


MODES = "mode,frequency [Hz],q1,q2\n1,1.5,0.5,1\n1,1.6,0.52,1\n2,4,-1,0.5\n"


def test_modes_are_read(tmp_path):
    path = tmp_path / "modes.csv"
    path.write_text(MODES)
    first, second = mode_rows(path)
    assert (first.mode, second.mode) == (1, 2)
    assert first.frequencies == pytest.approx([1.5, 1.6])
    assert second.amplitudes[1] == pytest.approx([-1])


@pytest.mark.parametrize(("old", "new"), [("1.5", "x"), ("q1", "u1"), ("2,4", "0,4")])
def test_wrong_modes_are_refused(tmp_path, old, new):
    path = tmp_path / "modes.csv"
    path.write_text(MODES.replace(old, new, 1))
    with pytest.raises(RefusedError):
        mode_rows(path)
