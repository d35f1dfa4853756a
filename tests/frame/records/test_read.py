"""Records as downloaded: the same samples from each format and head, or one line with the place."""

import sys
from types import SimpleNamespace

import numpy as np
import pytest

from alphacut.frame import read_record
from alphacut.fuzzy import RefusedError
from tests.frame.records import samples as written
from tests.refused import refuses

NAMED = "NPTS=   400, DT=   .0050 SEC,"
HEADS = (
    "time,acc (g)",
    "Time (sec),Acceleration (g)",
    "t [s] a [g]",
    "time [s];ag [g]",
    '"T","A, g"',
)
HEADS += ("Chopra\n\nTime  Ground acceleration\ns g", "Test of 2020\nTime\tAccel. [g]")


def saved(folder, text, name="record.AT2"):
    path = folder / name
    path.write_bytes(text.encode("latin-1"))
    return path


@pytest.mark.parametrize("mutations", [5, pytest.param(40, marks=pytest.mark.slow)])
@pytest.mark.parametrize("name", written.FORMATS)
def test_variants_give_the_same_samples_and_mutations_one_line(tmp_path, name, mutations, rng):
    path = tmp_path / "record.txt"
    for number in range(10):
        content, unit, rounding = written.variant(name, number)
        layout = {"step": written.STEP, "unit": unit} if unit else {}
        path.write_bytes(content)
        record = read_record(path, **layout)
        assert record.step == pytest.approx(written.STEP, rel=1e-6)
        expected = written.G * written.samples()
        assert record.samples == pytest.approx(expected, abs=written.G * rounding), number
        for _ in range(mutations):
            path.write_bytes(written.mutated(content, rng))
            outcome = recording_or_message(path, layout)
            if isinstance(outcome, str):
                assert len(outcome.splitlines()) == 1
                assert len(outcome) <= 300
            else:
                assert np.isfinite(outcome.samples).all()
                assert 0 < outcome.step < np.inf


def recording_or_message(path, layout):
    try:
        return read_record(path, **layout)
    except RefusedError as error:
        return str(error)


@pytest.mark.parametrize("head", HEADS)
def test_heads_of_another_wording_are_read_or_told_how(tmp_path, head):
    path = saved(tmp_path, head + "\n" + written.csv_text().partition("\n")[2])
    record = read_record(path, unit="g")
    assert record.samples == pytest.approx(written.G * written.samples(), abs=1e-6)
    assert read_record(path).samples == pytest.approx(record.samples)


@pytest.mark.parametrize(
    ("text", "channels", "words"),
    [
        (
            written.cosmos(),
            ("1", "90 deg", "hne", "2", "HNZ"),
            "1 or 90 deg or hne; 2 or up or hnz",
        ),
        (written.csmip(), ("1", "90 deg", "2", "up"), "1 or 90 deg; 2 or up"),
    ],
    ids=["COSMOS", "CSMIP"],
)
def test_channels_are_told_apart(tmp_path, text, channels, words):
    path = saved(tmp_path, text)
    for channel in channels:
        size = 0.5 if channel in ("2", "up", "HNZ") else 1.0
        record = read_record(path, channel=channel)
        assert record.samples == pytest.approx(size * written.G * written.samples(), abs=1e-5)
    with pytest.raises(RefusedError, match=f"not named; allowed: one of: {words}"):
        read_record(path)
    with pytest.raises(RefusedError, match="channel 7"):
        read_record(path, channel="7")


def test_columns_without_a_head_need_a_unit_and_one_column_a_step(tmp_path):
    two = saved(tmp_path, written.csv_text(mark=" ").partition("\n")[2], "record.csv")
    with refuses("record.csv, line 1"):
        read_record(two)
    other = saved(tmp_path, "s,m/s^2\n" + two.read_text(encoding="utf-8"), "other.csv")
    assert read_record(other).samples == pytest.approx(written.samples(), abs=1e-9)
    one = saved(tmp_path, written.lines(written.samples(), "15.7E", 1), "one.csv")
    with refuses("one.csv, line 1"):
        read_record(one, unit="g")


def test_what_is_no_format_is_one_line_with_those_that_are_read(tmp_path):
    text = "SESAME ASCII data format (saf) v. 1\nNDAT = 500\n" + "1.0 2.0 3.0\n-1.0 2.0 3.0\n" * 250
    for name in ("record.at2", "record.txt", "record.csv", "record.v2"):
        with pytest.raises(RefusedError, match="3 columns without times") as caught:
            read_record(saved(tmp_path, text, name))
        assert "records.step" in caught.value.cure
        with pytest.raises(RefusedError, match="no format that is read") as caught:
            read_record(saved(tmp_path, "a letter\n", name))
        assert "CSMIP" in caught.value.allowed
        assert len(str(caught.value)) <= 300


def test_a_file_named_as_a_format_without_its_head_is_told_so(tmp_path):
    numbers = written.lines(written.samples(), "8.2f", 10)
    path = saved(tmp_path, numbers, "record.V2A")
    with refuses("record.V2A, line 1"):
        read_record(path)
    assert len(read_record(path, step=0.02, unit="g").samples) == len(written.samples())
    two = saved(tmp_path, written.csv_text(mark=" ").partition("\n")[2], "record.at2")
    assert len(read_record(two, unit="g").samples) == len(written.samples())


def test_what_is_unusual_is_said(tmp_path):
    doubts = {
        "vertical": written.smc(angle=0),
        "its times begin at 10 s": written.csv_text(start=10.0),
        "its peak is": written.at2(NAMED, numbers=written.lines(9 * written.samples(), "15.7E", 5)),
        "channel U-D is vertical": written.knet().replace("N-S", "U-D"),
        "channel HNZ is vertical": written.esm().replace("HNE", "HNZ"),
        "channel UP is vertical": written.at2(NAMED).replace("S 0", "UP"),
    }
    for words, text in doubts.items():
        (doubt,) = read_record(saved(tmp_path, text)).remarks
        assert words in doubt
    assert "vertical" in read_record(saved(tmp_path, written.cosmos()), channel="2").remarks[0]
    for text in (written.at2(NAMED), written.esm(), written.knet(), written.smc()):
        assert not read_record(saved(tmp_path, text)).remarks


@pytest.mark.parametrize("name", written.FORMATS[:-1])
@pytest.mark.parametrize("change", ["empty first lines", "lines in quotes"])
def test_files_that_an_editor_or_a_spreadsheet_saved_are_read(tmp_path, name, change):
    content, unit, rounding = written.variant(name, 0)
    layout = {"step": written.STEP, "unit": unit} if unit else {}
    if change == "empty first lines":
        content = b"\n \n" + content
    else:
        content = b"\n".join(b'"' + row + b'"' for row in content.splitlines())
    record = read_record(saved(tmp_path, content.decode("latin-1"), "record.txt"), **layout)
    expected = written.G * written.samples()
    assert record.samples == pytest.approx(expected, abs=written.G * rounding)


def test_the_peak_of_the_uncorrected_record_does_not_hide_that_of_the_corrected_one(tmp_path):
    uncorrected = f"Uncor Max  =  {written.PEAK:.3f} g, at   0.180 sec.\n"
    text = written.WITH_PEAK["CSMIP V2"](10.0).replace("text\n", uncorrected, 1)
    with refuses("record.AT2, line 29"):
        read_record(saved(tmp_path, text))
    alone = written.csmip(names=("1: 90 Deg",)).replace("text\n", uncorrected, 1)
    assert not read_record(saved(tmp_path, alone)).remarks
    another = alone.replace(f"{written.PEAK:.3f}", f"{1.3 * written.PEAK:.3f}")
    (doubt,) = read_record(saved(tmp_path, another)).remarks
    assert "its head states" in doubt


@pytest.mark.parametrize(("start", "expected"), [(b"000001D ", "MSEED"), (b"", "SAC")])
def test_obspy_is_told_the_format_so_that_it_loads_no_pickle(
    tmp_path, monkeypatch, start, expected
):
    """ObsPy loads a file that names its module in its first bytes as a pickle, unless it is told."""
    head = bytearray(632)
    head[304:308], head[316:320] = (6).to_bytes(4, "little"), (400).to_bytes(4, "little")
    content = start + bytes(504) if start else bytes(head) + bytes(1600)
    asked = []

    def read(source, *, format):  # ObsPy's own name of the argument
        asked.append((source.read(), format))
        raise ValueError("nothing there")

    monkeypatch.setitem(sys.modules, "obspy", SimpleNamespace(read=read))
    (tmp_path / "record").write_bytes(content)
    with refuses("record"):
        read_record(tmp_path / "record", unit="g")
    assert asked == [(content, expected)]


@pytest.mark.parametrize("file_format", ["MSEED", "SAC"])
def test_waveforms_give_the_same_samples(tmp_path, file_format):
    obspy = pytest.importorskip("obspy")
    data = (100 * written.G * written.samples()).astype("float32")
    trace = obspy.Trace(data, {"delta": written.STEP, "channel": "HNE"})
    path = tmp_path / "record"
    trace.write(str(path), format=file_format)
    record = read_record(path, unit="cm/s^2")
    assert record.step == pytest.approx(written.STEP)
    assert record.samples == pytest.approx(written.G * written.samples(), abs=1e-5)
    with pytest.raises(RefusedError, match="without a unit"):
        read_record(path)
    if file_format == "SAC":  # its head has the largest and the least sample, in its unit
        content = bytearray(path.read_bytes())
        content[4:12] = np.array([-0.01, 0.01], "<f4").tobytes()
        path.write_bytes(content)
        with pytest.raises(RefusedError, match="where its head states"):
            read_record(path, unit="cm/s^2")


def test_cosmos_with_numbers_that_touch(tmp_path):
    head, _, further = written.cosmos(names=("1: 90 deg",), width=15).partition("(5E15.7)\n")
    touching = written.lines(100 * written.G * written.samples(), "10.4f", 8)
    text = f"{head}(8F10.4)\n{touching}{further[further.index('End-of-data') :]}"
    record = read_record(saved(tmp_path, text))
    assert record.samples == pytest.approx(written.G * written.samples(), abs=1e-6)


@pytest.mark.parametrize(
    ("text", "key"),
    [
        (written.at2("NPTS=  401, DT= .0050 SEC"), "record.AT2, line 4"),
        (written.at2(NAMED, "VELOCITY TIME SERIES IN UNITS OF CM/S"), "record.AT2, line 3"),
        (written.at2(NAMED, "ACCELERATION TIME SERIES"), "record.AT2, line 4"),
        (written.at2("NPTS=  400"), "record.AT2, line 4"),
        (written.at2("NPTS=  400, DT= 0,0050 SEC"), "record.AT2, line 4"),
        (written.at2("NPTS=  0, DT= .0050 SEC"), "record.AT2, line 4"),
        (written.at2("  400   .5D-6   NPTS, DT"), "record.AT2, line 4"),
        (written.at2(NAMED).replace("E-01", "E-O1", 1), "record.AT2, line 5"),
        (written.knet().replace("Scale Factor", "Scale Fact."), "record.AT2, line 17"),
        (written.knet().replace("Time(s)  2", "Time(s)  3"), "record.AT2, line 12"),
        (written.esm().replace("DATA_TYPE: ACC", "DATA_TYPE: VEL "), "record.AT2, line 11"),
        (written.esm().replace("cm/s^2", "cm"), "record.AT2, line 8"),
        (
            written.csmip(names=("1: 90",)).replace("400 points of acc", "401 points of acc"),
            "record.AT2, line 28",
        ),
        (written.smc("4 DISPLACEMENT"), "record.AT2, line 1"),
        (written.smc(count=401), "record.AT2, line 12"),
        (written.cosmos(step=0.02, names=("1: 90 deg",)), "record.AT2, line 14"),
        (
            written.cosmos(names=("1: 90 deg",)).replace("400 acc", "450 acc"),
            "record.AT2, line 34",
        ),
        (
            written.csmip(names=("1: 90",)).replace("text", "At intervals of .02 sec", 1),
            "record.AT2, line 28",
        ),
        (
            written.esm().replace(": 1.995", ": 3.99"),
            "record.AT2, line 5",
        ),
        (written.smc().replace("*\n", "", 1), "record.AT2, line 17"),
        (
            written.csmip(False, ("1: 90",), "g", raw=True).replace("text\n", "", 1),
            "record.AT2, line 20",
        ),
        (written.smc().replace("|\n", ""), "record.AT2, line 12"),
        (written.smc("5 RESPONSE SPECTRA"), "record.AT2, line 1"),
    ],
    ids=lambda text: text[:12] if "\n" not in text else "file",
)
def test_what_does_not_fit_is_one_line_with_its_place(tmp_path, text, key):
    with refuses(key) as caught:
        read_record(saved(tmp_path, text))
    assert "\n" not in str(caught.value)
    assert "record.AT2, line" in str(caught.value)


RECORD = "time [s],acceleration [g]\n0,0\n0.01,0.1\n0.02,-0.2\n"


@pytest.mark.parametrize(
    ("old", "new", "line"),
    [
        ("[g]", "[kg]", 1),
        ("acc", "up [g],acc", 2),
        ("0.01,0.1", "0.01,٣", 3),
        ("0.01,0.1", "0.01,nan", 3),
        ("0.01,0.1", "0.013,0.1", 3),
        ("0.02,-0.2\n", "0.02,0\n0.03,0\n0.09,0\n0.1,0\n", 6),
    ],
)
def test_a_wrong_row_of_a_csv_file_is_named(tmp_path, old, new, line):
    path = tmp_path / "record.csv"
    path.write_text(RECORD.replace(old, new, 1), encoding="utf-8")
    with refuses(f"record.csv, line {line}"):
        read_record(path)


@pytest.mark.parametrize(
    ("content", "key"),
    [
        (b"", "record.csv"),
        (b"\xff\xfet\0", "record.csv"),
        (b"time [s],acceleration [g]\n", "record.csv"),
        (b"<!DOCTYPE html>\n<html>\n", "record.csv"),
        (b"PK\3\4\0[Content_Types].xml", "record.csv"),
    ],
)
def test_a_file_that_is_no_record_is_refused(tmp_path, content, key):
    path = tmp_path / "record.csv"
    path.write_bytes(content)
    with refuses(key):
        read_record(path)


@pytest.mark.parametrize(
    ("head", "quantity"),
    [
        ("time [s],displacement [m]\n", "a displacement"),
        ("Time, Relative displ.\n", "a displacement"),
        ("# time [s] velocity [m/s]\n", "a velocity"),
        ("Time  Velocity\ns m\n", "a velocity"),
        ("t [s],force [kN]\n", "a force"),
        ("t [s],acc [N]\n", "a force"),
        ("t [s],acc [counts]\n", "counts"),
        ("t [s],acc [mV]\n", "a voltage"),
        ("t [s],acc [kPa]\n", "a pressure"),
        ("t [s],acc [deg]\n", "an angle"),
        ("t [s],acc [m s-1]\n", "a velocity"),
    ],
)
@pytest.mark.parametrize("unit", ["", "g"])
def test_a_column_of_another_quantity_is_no_acceleration(tmp_path, head, quantity, unit):
    rows = written.csv_text().partition("\n")[2]
    path = saved(tmp_path, head + rows)
    with pytest.raises(RefusedError, match=f"its column is .*{quantity.split()[-1]}"):
        read_record(path, unit=unit)


@pytest.mark.parametrize(("unit", "factor"), [("mg", 1e-3), ("%g", 1e-2)])
def test_small_fractions_of_gravity_are_units(tmp_path, unit, factor):
    path = saved(tmp_path, written.csv_text().replace("[g]", f"[{unit}]"))
    expected = factor * written.G * written.samples()
    assert read_record(path).samples == pytest.approx(expected, abs=1e-7)


@pytest.mark.parametrize("name", [*written.WITH_PEAK])
def test_the_peak_in_a_head_is_compared_with_the_samples(tmp_path, name):
    """Heads state the true peak, one of another processing, and one of another unit."""
    write = written.WITH_PEAK[name]
    assert not read_record(saved(tmp_path, write(1.0))).remarks
    assert not read_record(saved(tmp_path, write(-1.02))).remarks
    for factor in (1.3, 0.7):
        (doubt,) = read_record(saved(tmp_path, write(factor))).remarks
        assert "its head states" in doubt
    for factor in (10.0, -0.1):
        with pytest.raises(RefusedError, match=r"a peak of 0\.6 g, where its head states"):
            read_record(saved(tmp_path, write(factor)))


@pytest.mark.parametrize("line", ["", ",  SENSITIVITY =1.250 VDC/G", " RANGE 2 G", " 1.0 G/VOLT"])
def test_the_unit_of_volume_1_is_that_of_the_line_with_units(tmp_path, line):
    text = written.csmip(False, ("1: 90 Deg",), "G/10", raw=True)
    text = text.replace("text\n", f"DAMPING =0.7000{line}\n", 3)
    record = read_record(saved(tmp_path, text))
    assert record.samples == pytest.approx(written.G * written.samples(), abs=1e-4)
    without = text.replace("UNITS ARE SEC AND G/10", "text")
    with refuses("record.AT2, line 28"):
        read_record(saved(tmp_path, without))
