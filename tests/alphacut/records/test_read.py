"""Records as downloaded: the same samples from each format and head, or one line with the place."""

import random

import numpy as np
import pytest

from alphacut.fuzzy.refused import RefusedError
from alphacut.records.read import read_recording
from tests.alphacut.records import samples as written

NAMED, PLAIN = "NPTS=   2000, DT=   .0050 SEC,", "ACCELERATION TIME SERIES IN UNITS OF G"
FILES = {
    "NGA-West2, comma": written.at2(NAMED + " " * 40),
    "without SEC": written.at2("NPTS=  2000, DT= .0050"),
    "without a space": written.at2("NPTS=2000,DT=0.005SEC"),
    "spaces about =": written.at2("NPTS = 2000 , DT = 5.0E-03 sec"),
    "FORTRAN's D": written.at2("NPTS=  2000, DT= .5D-02 SEC"),
    "1999": written.at2(" 2000    0.0050    NPTS, DT"),
    "without NPTS": written.at2("DT= .0050 SEC"),
    "units are (g)": written.at2(NAMED, "Acceleration time history; units are (g)"),
    "in g's": written.at2(NAMED, "ACCELERATION TIME HISTORY IN G'S"),
    "D exponents": written.at2(
        NAMED, numbers=written.lines(written.samples(), "15.7E", 5).replace("E", "D")
    ),
    "one number a line": written.at2(NAMED, numbers=written.lines(written.samples(), "15.7E", 1)),
    "Windows": written.at2(NAMED).replace("\n", "\r\n"),
    "Latin-1": written.at2(NAMED).replace("S 0", "Cañón"),
    "K-NET": written.knet(),
    "ESM": written.esm(),
    "ITACA in g": written.esm("g"),
    "COSMOS": written.cosmos(names=("1: 90 deg",)),
    "COSMOS, milliseconds": written.cosmos(step=5.0, names=("1: 90 deg",)),
    "CSV in g": written.csv_text(),
    "CSV in gal": written.csv_text("gal", ";"),
    "CSV in m/s^2": written.csv_text("m/s^2", "\t"),
}


def saved(folder, text, name="record.AT2"):
    path = folder / name
    path.write_bytes(text.encode("latin-1"))
    return path


@pytest.mark.parametrize("name", FILES)
def test_every_head_gives_the_same_samples(tmp_path, name):
    record = read_recording(saved(tmp_path, FILES[name], "record.txt"))
    assert record.step == pytest.approx(written.STEP, rel=1e-12)
    assert record.samples == pytest.approx(written.G * written.samples(), abs=1e-6 * 6.3)


def test_channels_of_cosmos_are_told_apart(tmp_path):
    path = saved(tmp_path, written.cosmos())
    for channel, size in (("1", 1.0), ("90 deg", 1.0), ("hne", 1.0), ("2", 0.5), ("HNZ", 0.5)):
        record = read_recording(path, channel)
        assert record.samples == pytest.approx(size * written.G * written.samples(), abs=1e-5)
    with pytest.raises(RefusedError, match="one of: 1 or 90 deg or hne; 2 or up or hnz"):
        read_recording(path)
    with pytest.raises(RefusedError, match="channel 7"):
        read_recording(path, "7")


def test_cosmos_with_numbers_that_touch(tmp_path):
    text = written.cosmos(names=("1: 90 deg",), width=15)
    touching = written.lines(100 * written.G * written.samples(), "10.4f", 8).replace(
        "\n  ", "\n  "
    )
    start = text.index("(5E15.7)\n") + len("(5E15.7)\n")
    end = text.index("End-of-data")
    text = text[:start].replace("Format=(5E15.7)\n", "Format=(8F10.4)\n") + touching + text[end:]
    record = read_recording(saved(tmp_path, text))
    assert record.samples == pytest.approx(written.G * written.samples(), abs=1e-6)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (written.at2("NPTS=  2001, DT= .0050 SEC"), r"line 4 is 2001 samples, and 2000 follow"),
        (written.at2(NAMED, "VELOCITY TIME SERIES IN UNITS OF CM/S"), "line 3 is in units of CM/S"),
        (written.at2(NAMED, "ACCELERATION TIME SERIES"), "without a unit"),
        (written.at2("NPTS=  2000"), "without NPTS and DT"),
        (written.at2("NPTS=  2000, DT= 0.0 SEC"), "a step of 0 s"),
        (written.at2(NAMED).replace("E-01", "E-O1", 1), r"line \d+ is '.*E-O1'"),
        (written.knet().replace("Scale Factor", "Scale Fact."), "without Scale Factor"),
        (written.knet().replace("Time(s)  10", "Time(s)  11"), "2200 samples, and 2000 follow"),
        (written.esm().replace("DATA_TYPE: ACC", "DATA_TYPE: VEL "), "accelerations in"),
        (written.esm().replace("cm/s^2", "cm"), "in cm"),
        (written.cosmos(step=0.02, names=("1: 90 deg",)), "a step of 0.02 for 2000 samples in 10"),
    ],
)
def test_what_does_not_fit_is_one_line_with_its_place(tmp_path, text, message):
    with pytest.raises(RefusedError, match=message) as caught:
        read_recording(saved(tmp_path, text))
    assert "\n" not in str(caught.value)
    assert "record.AT2, line" in str(caught.value)


RECORD = "time [s],acceleration [g]\n0,0\n0.01,0.1\n0.02,-0.2\n"


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
def test_a_wrong_row_of_a_csv_file_is_named(tmp_path, old, new, line):
    path = tmp_path / "record.csv"
    path.write_text(RECORD.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(RefusedError) as caught:
        read_recording(path)
    assert caught.value.key == f"record.csv, line {line}"


@pytest.mark.parametrize("content", [b"", b"\xff\xfe\0", b"time [s],acceleration [g]\n", b"a\0b"])
def test_a_file_that_is_no_record_is_refused(tmp_path, content):
    path = tmp_path / "record.csv"
    path.write_bytes(content)
    with pytest.raises(RefusedError):
        read_recording(path)


def test_mutated_files_end_in_one_line_or_in_a_record(tmp_path):
    seed = random.SystemRandom().randrange(10**6)
    print("seed", seed)
    rng = random.Random(seed)
    for _ in range(120):
        text = FILES[rng.choice(list(FILES))]
        place = rng.randrange(min(len(text), 3000))
        change = rng.choice(["", "x", "-", "9" * 400, "\n", ",", "=", text[place : place + 50]])
        text = text[:place] + change + text[place + rng.randrange(40) :]
        outcome = recording_or_message(saved(tmp_path, text))
        if isinstance(outcome, str):
            assert "\n" not in outcome
            assert len(outcome) < 500
        else:
            assert np.isfinite(outcome.samples).all()
            assert outcome.step > 0


def recording_or_message(path):
    try:
        return read_recording(path)
    except RefusedError as error:
        return str(error)
