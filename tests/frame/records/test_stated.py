"""What files state wherever it stands: taken, or refused with both where the user says another."""

import numpy as np
import pytest

from alphacut.base.stated import Stated, settled
from alphacut.frame import read_record
from alphacut.fuzzy import RefusedError
from tests.refused import refuses

G = 9.80665
VALUES = np.array([float(f"{x:.6f}") for x in 12 * np.sin(0.31 * np.arange(60)) + 0.5])
SERIES = "series"
"""Rows of five numbers in place of a column."""
TIMED = "timed"
"""Times every 0.01 s beside the numbers."""


def rows_of(layout):
    if layout == SERIES:
        return "".join(
            "".join(f"{x:14.6E}" for x in VALUES[k : k + 5]) + "\n" for k in range(0, 60, 5)
        )
    if layout == TIMED:
        return "".join(f"{0.01 * k:.2f},{x:.6f}\n" for k, x in enumerate(VALUES))
    separator = "," if layout == 3 else " "
    return "".join(separator.join([f"{x:.6f}"] * layout) + "\n" for x in VALUES)


def saved(folder, head, layout):
    path = folder / "record.txt"
    path.write_text(head + rows_of(layout), encoding="utf-8")
    return path


JMA = "SITE CODE= ABC,37.5,137.2,16,7.6\n LAT.=   37.5000\n SAMPLING RATE= 100Hz\n"
JMA += " UNIT  = gal(cm/s/s)\n INITIAL TIME = 2026 01 01 16 10 00\n NS,EW,UD\n"
AFAD = "STATION ALTITUDE (m)   : 100.0\nNUMBER OF DATA         : 60\n"
AFAD += "SAMPLING INTERVAL (sec): 0.010000\nRAW PGA VALUES (gal)   : 12.5 12.5 12.5\n"
AFAD += "RECORD DATA : \n N-S E-W U-D\n"
RSPMATCH = "Time history matched to spectrum: TARGET.TGT, run 3\n  60 0.0100 656\n"


@pytest.mark.parametrize(
    ("head", "layout", "channel", "factor"),
    [
        (JMA, 3, "NS", 0.01),
        (AFAD, 3, "n-s", 0.01),
        ("# unit: cm/s2\nTime [s],Acceleration\n", TIMED, "", 0.01),
    ],
    ids=["JMA", "AFAD", "comment"],
)
def test_unit_and_step_above_the_columns_are_taken_and_compared(
    tmp_path, head, layout, channel, factor
):
    path = saved(tmp_path, head, layout)
    record = read_record(path, channel=channel)
    assert record.step == pytest.approx(0.01)
    assert record.samples == pytest.approx(factor * VALUES)
    assert not record.remarks
    for said in ({"unit": "g"}, {"step": 0.005}, {"unit": "mg", "step": 0.01}):
        key = next(iter(said))
        with pytest.raises(RefusedError, match=f"said to be of {key} ") as caught:
            read_record(path, channel=channel, **said)
        assert "(line" in str(caught.value) or "(by its times)" in str(caught.value)
        other = read_record(path, channel=channel, override=[key], **said)
        assert any("is overridden by" in remark for remark in other.remarks)
    assert read_record(path, channel=channel, unit="g", override=["unit"]).samples == (
        pytest.approx(G * VALUES)
    )


def test_a_row_of_count_and_step_above_as_many_numbers_is_a_head(tmp_path):
    path = saved(tmp_path, RSPMATCH, SERIES)
    with pytest.raises(RefusedError, match=r"say records.unit: no line states"):
        read_record(path)
    record = read_record(path, unit="g")
    assert (record.step, len(record.samples)) == (0.01, 60)
    with pytest.raises(RefusedError, match=r"allowed: step 0\.0100 s \(line 2\)"):
        read_record(path, unit="g", step=0.02)


@pytest.mark.parametrize("unit", ["", "g"])
@pytest.mark.parametrize(
    ("head", "layout", "words"),
    [
        ("time [s],acceleration [m/s2] x10^-3\n", TIMED, "a unit without a factor"),
        (
            "PEER STRONG MOTION DATABASE RECORD\nSomewhere 1/1/2026\nVELOCITY TIME SERIES\n"
            "NPTS=  60, DT= .0100 SEC\n",
            SERIES,
            "this is a velocity",
        ),
        ("# motion in units of cm/s\ntime [s],v\n", TIMED, "its column is a velocity by its unit"),
        ("# values are in mm/s^2\n# acceleration, gal\ntime [s],a\n", TIMED, "unit mm/s\\^2"),
    ],
)
def test_factors_other_quantities_and_two_units_are_refused(tmp_path, head, layout, words, unit):
    with pytest.raises(RefusedError, match=words) as caught:
        read_record(saved(tmp_path, head, layout), unit=unit)
    assert '= "g"' not in str(caught.value)


def test_numbers_that_touch_are_read_by_their_format_or_said_to_touch(tmp_path):
    # Four digits more of each number: the columns of 14 characters touch where one is negative.
    numbers = -np.abs(VALUES)
    text = "".join(
        "".join(f"{x:14.7E}" for x in numbers[k : k + 5]) + "\n" for k in range(0, 60, 5)
    )
    path = tmp_path / "glued.txt"
    path.write_text(text)
    with pytest.raises(RefusedError, match="numbers touch"):
        read_record(path, unit="m/s^2", step=0.01)
    path.write_text("accelerations (5E14.7)\n" + text)
    record = read_record(path, unit="m/s^2", step=0.01)
    assert record.samples == pytest.approx(numbers)


@pytest.mark.parametrize("mark", ["  # ", " ; ", " // ", " ! "])
def test_comments_behind_numbers_are_comments(tmp_path, mark):
    path = saved(tmp_path, f"1.5{mark}gal, dt=0.01 s\n", COLUMN)
    record = read_record(path)
    assert (record.step, len(record.samples)) == (0.01, 61)
    assert record.samples[1:] == pytest.approx(0.01 * VALUES)


@pytest.mark.parametrize("count", [58, 60, 61])
def test_a_row_of_count_and_step_above_as_many_rows_is_a_head(tmp_path, count):
    path = tmp_path / "record.txt"
    path.write_text(f"{count} 0.01\n" + rows_of(TIMED).replace(",", " "))
    with pytest.raises(RefusedError, match=r"say records\.unit"):
        read_record(path)
    if count == 60:
        assert read_record(path, unit="gal").samples == pytest.approx(0.01 * VALUES)
    else:
        with pytest.raises(RefusedError, match=f"{count} samples .line 1"):
            read_record(path, unit="gal")


def test_statements_are_settled_by_one_rule():
    gal, g = Stated(0.01, "gal", "line 3"), Stated(G, "g")
    assert settled("f", "unit", []) is None
    assert settled("f", "unit", [], g) == g
    assert settled("f", "unit", [gal, gal]) == gal
    assert settled("f", "unit", [gal], g, override=["unit"]).value == G
    for stated, said in (([gal, g], None), ([gal], g)):
        with refuses("f"):
            settled("f", "unit", stated, said)
    assert settled("f", "step", [Stated(0.0049, "")], Stated(0.005, ""), tolerance=0.05)
    assert settled("f", "unit", [], g, unsure=[gal, g]) == g
    with refuses("f"):
        settled("f", "unit", [], g, unsure=[gal])


COLUMN = 1
OTHERS = "Schwinggeschwindigkeit|Schwingweg|Bodenverschiebung|strain gauge|velocità a terra"
OTHERS += "|a velocity record|déplacement|spostamento|velocidad|desplazamiento|速度|変位|Mio. m/s^2"
OTHERS += "|10^3 m/s^2|x1000, m/s^2|milli m/s^2|Faktor 9.81, m/s^2|multipliziert, m/s^2"
HEADS = [
    ("# ACCELERATION TIME HISTORY\n# DT = 0.01 sec   Units: cm/sec/sec\n", COLUMN, 0.01, 0.01),
    ("Station: ABC\nSample rate (Hz): 100\nAcceleration units: mg\nDATA\n", COLUMN, 0.01, G / 1000),
    ("date 2020-01-01\nsampling period = 10 ms\nvalues in g\n", COLUMN, 0.01, G),
    ("Time (s)\tAcc (milli-g)\n", ("\t", 1), 0.01, G / 1000),
    ("t_ms,acc_gal\n", (",", 1000), 0.01, 0.01),
    (
        "% time in milliseconds, acceleration in meters per second squared\ntime,acc\n",
        (",", 1000),
        0.01,
        1,
    ),
    (
        "Recorded by: ETNA2 sn 1234 sensitivity 1.25 V/g\nNPTS: 60  DELTA: 0.01\nUNIT: m/s**2\n",
        SERIES,
        0.01,
        1,
    ),
    ("Ground acceleration [m/s²], dt=0.01 s\n", SERIES, 0.01, 1),
    ("# fs = 200 Hz\n# a in %g\n", COLUMN, 0.005, G / 100),
    ("Elcentro NS comp, 0.02 sec intervals, g units, 8 per line\n", SERIES, 0.02, G),
    ("Velocity record\nunits cm/s\ntime,value\n", (",", 1), 0.01, None),
    ("displacement (cm)\n", COLUMN, 0.01, None),
    ("period (s), Sa (g)\n", (",", 1), 0.01, None),
    ("data type: relative velocity\ntime [s],y\n", (",", 1), 0.01, None),
    ("NUMBER OF POINTS = 61\nDT = 0.01 S\nUNITS = G\n", COLUMN, 0.01, None),
    ('# {"dt": 0.01, "unit": "cm/s^2", "component": "EW"}\n', COLUMN, 0.01, 0.01),
    ("SAMPLES/SEC 100\nACCEL. IN CM/SEC**2\n", SERIES, 0.01, 0.01),
    ("# acceleration / (m/s^2)\n# sampled every 0.01 s\n", COLUMN, 0.01, 1),
    ("Acc.(in/s^2)  1 G = 386.09 in/s^2\nsampling frequency 50 Hz\n", COLUMN, 0.02, 0.0254),
    ("time [s],acceleration [g] (x 0.001)\n", (",", 1), 0.01, None),
    ("scale factor: 0.001\ntime [s],acceleration [g]\n", (",", 1), 0.01, None),
    ("acc in 0.1 mg, dt 5 ms\n", COLUMN, 0.005, None),
    ("units: ft/s2, time step 0.005\n", SERIES, 0.005, 0.3048),
    ("Time history of acceleration; Unit: kine\n", COLUMN, 0.01, None),
    ("# amplitude unit: gravity (9.81 m/s2)\n# delta_t=0.01\n", COLUMN, 0.01, G),
    ("# centimeters per second per second\n# 200 samples per second\n", COLUMN, 0.005, 0.01),
    ("acceleration [cm/s^2]\n# step: 0.02\n", COLUMN, 0.02, 0.01),
    ("; Strong motion\n; dt[s]=0.01\n; acc[cm/s^2]\n", COLUMN, 0.01, 0.01),
    (
        "Vs30 = 500 m/s, site class B\nStation height 37 m\nunit=gal\nsampling=100Hz\n",
        COLUMN,
        0.01,
        0.01,
    ),
    ("INTERVAL(S) 0.01\nACCELERATION(CM/S2)\n", COLUMN, 0.01, 0.01),
    ("time (min),acceleration (g)\n", (",", 1 / 60), 0.01, G),
    ("time [us],acceleration [mm/s2]\n", (",", 1e6), 0.01, 0.001),
    ("t(s) a(g)\n", (" ", 1), 0.01, G),
    ("# cols: time/s acc/(m/s^2)\n", (" ", 1), 0.01, 1),
    ('"Time (sec)","Acceleration (cm/s/s)"\n', (",", 1), 0.01, 0.01),
    ("Corrected acceleration, 60 points, at 0.01 s, in cm/s2\n", SERIES, 0.01, 0.01),
    ("Acceleration in cm/s^2, dt = 0.01 s, 60 points\n", COLUMN, 0.01, 0.01),
    ("SAMPLING_RATE: 100 Hz\nUNITS: cm s^-2\n", COLUMN, 0.01, 0.01),
    ("frequency [Hz],amplitude [g]\n", (",", 1), 0.01, None),
    ("Fourier amplitude spectrum\nf,acc [g]\n", (",", 1), 0.01, None),
    ("counts, gain 1e-6\n", COLUMN, 0.01, None),
    ("sensor output [V]\n", COLUMN, 0.01, None),
    ("time;acc (mg)\n", (";", 1), 0.01, G / 1000),
    ("$ DT 0.01\n$ UNIT GAL\n", COLUMN, 0.01, 0.01),
    ("Acceleration of gravity g = 9.81 m/s2; record in g; dt = .01 s\n", COLUMN, 0.01, G),
    (
        "Filter: Butterworth 0.1-25 Hz\nSampling: 0.01 s\nUnits of acceleration are cm/sec^2\n",
        COLUMN,
        0.01,
        0.01,
    ),
    ("time_s,acc_mps2\n", (",", 1), 0.01, 1),
    ("time,acc\n# both in SI: s, m/s2\n", (",", 1), 0.01, 1),
    (
        "Peak velocity 10 cm/s, peak displacement 3 cm\nacceleration in gal every 0.01 sec\n",
        COLUMN,
        0.01,
        0.01,
    ),
    ("Sa spectrum matched record; units: g; dt: 0.01\n", COLUMN, 0.01, G),
    ("# acceleration multiplied by 1000, m/s2\ntime [s],acc\n", (",", 1), 0.01, None),
    ("time [s],acc\n# acc is given in units of 0.01 g\n", (",", 1), 0.01, None),
    ("; Units: length cm, time s\n; acceleration, dt 0.01\n", COLUMN, 0.01, 0.01),
    ("Acceleration [cm/s²] sampled with 250 Hz\n", COLUMN, 0.004, 0.01),
    ("#unit=m/s^2;rate=100Hz\n", COLUMN, 0.01, 1),
    ("a_x [m/s^2] @ 100 Hz\n", COLUMN, 0.01, 1),
    ("<meta unit='mm/s^2' dt='0.01'/>\n", COLUMN, 0.01, 0.001),
    ("acceleration in ft/sec/sec\nDigitized at 50 points/sec\n", SERIES, 0.02, 0.3048),
    ("*** accelerations in g's, delta t = 1/100 sec ***\n", COLUMN, 0.01, G),
    ("t/ms a/(cm/s²)\n", (" ", 1000), 0.01, 0.01),
    ("Time [s],Acceleration [g],\n", (",", 1), 0.01, G),
    ("acceleration (cm/s/s); 200 Hz sampling\n", COLUMN, 0.005, 0.01),
    ("acceleration in percent of gravity, interval .01\n", COLUMN, 0.01, G / 100),
    ("Time step = 0.01 (s), in units of m/s2 / 10\n", COLUMN, 0.01, None),
    ("time interval between points 0.005 sec; in cm per sec per sec\n", COLUMN, 0.005, 0.01),
    ("Rate: 100\nUnits: gal\n", COLUMN, 0.01, 0.01),
    ("Acceleration (g) vs time (1/100 s)\n", (",", 100), 0.01, G),
    ("UNIT.........: GAL\nDT...........: 0.01\n", COLUMN, 0.01, 0.01),
    ("Sample Interval (msec),10\nUnit,gal\n", COLUMN, 0.01, 0.01),
    ("dt/ms: 10\nacc/gal\n", COLUMN, 0.01, 0.01),
    ("Full-scale 2 g; data in gal; 100 sps\n", COLUMN, 0.01, 0.01),
    ("Outcrop motion, CGS units, dt=0.01\n", COLUMN, 0.01, 0.01),
    ("# SI units\n# dt = 0.01\n", COLUMN, 0.01, 1.0),
    ("values are fractions of g_n, dt = 0.01\n", COLUMN, 0.01, G),
    ("jerk (m/s^3)\ndt 0.01\n", COLUMN, 0.01, None),
    ("angular acceleration [rad/s^2], dt 0.01 s\n", COLUMN, 0.01, None),
    ("ground acceleration, g/100, dt 0.01 s\n", COLUMN, 0.01, None),
    ("normalised to 1 g, dt 0.01\n", COLUMN, 0.01, None),
    ("motion squared, gal^2, dt .01 s\n", COLUMN, 0.01, None),
    ("micrometers per second squared; 0.01-s intervals\n", COLUMN, 0.01, 1e-6),
    ("<record dt_ms=10 unit=gal>\n", COLUMN, 0.01, 0.01),
    ("Acceleration multiplied by mass, kN; dt 0.01 s\n", COLUMN, 0.01, None),
    ("# units ft/s/s; step 1.0e-2\n# 2 Hz high-pass, sampling 100 Hz\n", COLUMN, 0.01, 0.3048),
    ("t,a\n# in ms and gal\n", (",", 1000), 0.01, 0.01),
    ("time,accel_milli_g\n", (",", 1), 0.01, G / 1000),
    ("INTERVALO DE MUESTREO, C1-C3 (S) : /.01/.01/.01\ngal\n", COLUMN, 0.01, 0.01),
    ("ускорение, см/с², шаг 0,01 с\n", COLUMN, 0.01, 0.01),
    ("vitesse, dt 0.01 s\n", COLUMN, 0.01, None),
    ("milésimas de gal, dt=0.01\n", COLUMN, 0.01, None),
    ("Delta_X 0.01\nunit g\n", COLUMN, 0.01, G),
    ("multiply with 9.81 for m/s^2; dt 0.01\n", COLUMN, 0.01, None),
    ("sensor 1 V = 1 g; data in volts; 100 Hz\n", COLUMN, 0.01, None),
    ("response spectrum acceleration, g; dt 0.01 s\n", COLUMN, 0.01, None),
    *((f"{x}, dt 0.01 s\n", COLUMN, 0.01, None) for x in OTHERS.split("|")),
    ("accel. (cgs), tstep .01, f_s = 100 1/s\n", COLUMN, 0.01, 0.01),
]
"""Heads with the layout of the numbers, their step in s, and their unit in m/s²; None of others."""


@pytest.mark.parametrize(("head", "layout", "step", "factor"), HEADS)
def test_heads_of_many_kinds_are_read_as_they_state_or_refused(
    tmp_path, head, layout, step, factor
):
    path = tmp_path / "record.txt"
    rows = rows_of(layout) if isinstance(layout, int | str) else ""
    if not rows:
        mark, scale = layout
        rows = "".join(f"{0.01 * scale * k:.8f}{mark}{x:.6f}\n" for k, x in enumerate(VALUES))
    path.write_text(head + rows, encoding="utf-8")
    if factor is None:
        for said in ({}, {"unit": "g"}, {"unit": "g", "step": 0.01}):
            with pytest.raises(RefusedError):
                read_record(path, **said)
        return
    asked = {"step": step, "unit": "cm/s^2"} if "60 points, at" in head else {}
    record = read_record(path, **asked)
    assert record.step == pytest.approx(step, rel=1e-6)
    assert record.samples == pytest.approx(factor * VALUES)
    other = "gal" if factor > 0.5 else "g"
    with pytest.raises(RefusedError, match="of unit"):
        read_record(path, **asked | {"unit": other})


@pytest.mark.parametrize(
    ("head", "step"),
    [
        ("Nyquist 50 Hz\nacc in gal\n", 0.01),
        ("gal, one value in 10 ms\n", 0.01),
        ("Duration 0.6 s, gal\n", 0.01),
        ("Filter: Butterworth 0.1-25 Hz\nacc in gal\n", None),
        ("Peak 12.5 gal at 0.05 s\nacc in gal\n", None),
    ],
)
def test_a_step_that_is_said_is_compared_with_times_of_unknown_meaning(tmp_path, head, step):
    path = saved(tmp_path, head, COLUMN)
    with pytest.raises(RefusedError, match=r"say records\.step"):
        read_record(path)
    assert read_record(path, step=step or 0.02).samples == pytest.approx(0.01 * VALUES)
    if step is not None:
        with pytest.raises(RefusedError, match=r'override = \["step"\]'):
            read_record(path, step=2 * step)
        assert read_record(path, step=2 * step, override=["step"]).step == 2 * step


@pytest.mark.parametrize(
    "line",
    [
        "# Zaaktempo: 200 odczytow na sekunde",
        "# náhodný krok vzorkování 0,005 sekundy",
        "# Samplingfrekvens (prøver per sekund): 200",
        "# Frekvencia vzorkovania: 200 vzoriek/s",
    ],
)
def test_a_number_in_words_of_other_languages_is_named_and_compared(tmp_path, line):
    path = saved(tmp_path, f"# Stanica 12, 2026-01-30\n{line}\n# 60 hodnot\n# gal\n", COLUMN)
    with pytest.raises(RefusedError, match=r"say records\.step: line 2, # "):
        read_record(path)
    assert read_record(path, step=0.005).step == 0.005
    for step in (0.01, 0.0025):
        with pytest.raises(RefusedError, match=r'override = \["step"\]'):
            read_record(path, step=step)
        assert read_record(path, step=step, override=["step"]).step == step


@pytest.mark.parametrize("encoding", ["utf-8", "cp1251"])
def test_words_of_another_script_are_held_for_the_unit_and_the_step(tmp_path, encoding):
    path = saved(tmp_path, "", COLUMN)
    column = path.read_text()
    path.write_bytes(f"Ускорение в миллиграммах, такт 0.02\n{column}".encode(encoding))
    with pytest.raises(RefusedError, match=r'override = \["step"\]'):
        read_record(path, unit="g", step=0.01)
    with pytest.raises(RefusedError, match=r'override = \["unit"\]'):
        read_record(path, unit="g", step=0.02)
    assert read_record(path, unit="g", step=0.02, override=["unit"]).step == 0.02


@pytest.mark.parametrize("title", ["Accel [furlong/s^2]", "# record of 3 May\n# Accel [EU]"])
def test_words_in_square_brackets_are_a_unit(tmp_path, title):
    path = saved(tmp_path, f"{title}\n# dt = 0.02 s\n", COLUMN)
    with pytest.raises(RefusedError, match=r'override = \["unit"\]'):
        read_record(path, unit="g")
    assert read_record(path, unit="g", override=["unit"]).step == 0.02


def test_a_unit_that_is_said_is_compared_with_a_letter_that_may_be_one(tmp_path):
    path = saved(tmp_path, "station x, g\ndt = 0.01 s\n", COLUMN)
    with pytest.raises(RefusedError, match=r"say records\.unit"):
        read_record(path)
    assert read_record(path, unit="g").samples == pytest.approx(G * VALUES)
    with pytest.raises(RefusedError, match=r'override = \["unit"\]'):
        read_record(path, unit="gal")
