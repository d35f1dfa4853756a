"""Tables of numbers as people bring them: read, or one line that names cause and cure."""

import numpy as np
import pytest

from alphacut.frame import read_record
from alphacut.frame.records.tables import read_force_history
from alphacut.fuzzy import RefusedError
from tests.refused import refuses

G = 9.80665
STEP = 1 / 256
N_SAMPLES = 403
VALUES = np.array([round(x, 5) for x in 0.3 * np.sin(0.11 * np.arange(N_SAMPLES))])


def saved(folder, rows, head=""):
    path = folder / "r.csv"
    path.write_text("\n".join([head] * bool(head) + list(rows)) + "\n", encoding="utf-8")
    return path


def refused(path, channel="", step=None, unit=""):
    with pytest.raises(RefusedError) as caught:
        read_record(path, channel=channel, step=step, unit=unit)
    assert len(str(caught.value).splitlines()) == 1
    return str(caught.value)


@pytest.mark.parametrize("per_line", [2, 5, 8])
def test_bare_numbers_several_a_line_are_read_by_step_and_unit(tmp_path, per_line):
    starts = range(0, N_SAMPLES, per_line)
    rows = [" ".join(f"{x:14.7E}" for x in VALUES[k : k + per_line]) for k in starts]
    path = saved(tmp_path, rows)
    record = read_record(path, step=0.02, unit="g")
    assert record.step == 0.02
    assert record.samples == pytest.approx(G * VALUES, abs=1e-6)
    assert "records.step" in refused(path) or "records.unit" in refused(path)
    titled = saved(tmp_path, rows, "El Centro, 1940, NS")
    if per_line > 2:
        assert len(read_record(titled, step=0.02, unit="g").samples) == N_SAMPLES


def components(fmt="{:.6f} {:.5f} {:.5f} {:.5f}"):
    waves = (VALUES, 0.8 * VALUES[::-1], 0.2 * np.cos(0.07 * np.arange(N_SAMPLES)))
    return [fmt.format(k * STEP, *(wave[k] for wave in waves)) for k in range(N_SAMPLES)]


@pytest.mark.parametrize("head", ["", "t [s] NS [g] EW [g] V [g]", "time [s],NS [g],EW [g],V [g]"])
def test_a_column_of_times_and_three_components_is_chosen(tmp_path, head):
    path = saved(tmp_path, components(), head)
    for channel, expected in {"2": VALUES, "3": 0.8 * VALUES[::-1]}.items():
        record = read_record(path, channel=channel, unit="" if head else "g")
        assert record.step == pytest.approx(STEP, rel=1e-6)
        assert record.samples == pytest.approx(G * expected, abs=1e-4)
    if head:
        assert read_record(path, channel="ew").samples == pytest.approx(
            G * 0.8 * VALUES[::-1], abs=1e-4
        )
        assert "one of: 2 or ns; 3 or ew; 4 or v" in refused(path)
    else:
        assert "one of: 2; 3; 4" in refused(path, "", None, "g")
        assert "say records.unit" in refused(path, "2")
    assert "channel 9" in refused(path, "9", None, "g")


def test_components_without_times_are_no_series_of_numbers(tmp_path):
    path = saved(tmp_path, [row.partition(" ")[2] for row in components()])
    message = refused(path, "", 0.01, "g")
    assert "3 columns, each smoother than the rows" in message
    assert "r.csv#1" in message
    record = read_record(path, channel="1", step=0.01, unit="g")
    assert record.samples == pytest.approx(G * VALUES, abs=1e-4)


@pytest.mark.parametrize("digits", [".3f", ".2e"])
def test_times_that_lost_digits_are_read_by_the_step_that_the_line_names(tmp_path, digits):
    rows = [f"{k * STEP:{digits}},{x:.5f}" for k, x in enumerate(VALUES[:30])]
    path = saved(tmp_path, rows, "time [s],acceleration [g]")
    message = refused(path)
    assert "digits of the times were lost" in message
    assert "say records.step" in message
    record = read_record(path, step=STEP)
    assert record.step == STEP
    assert record.samples == pytest.approx(G * VALUES[:30], abs=1e-4)
    assert any("rounded to" in remark for remark in record.remarks)
    assert "step" in refused(path, "", 2 * STEP)  # a step that does not fit the times


@pytest.mark.parametrize("mark", [";", "\t", " ", " ; "])
def test_decimal_commas_between_other_marks_are_read(tmp_path, mark):
    rows = [f"{k * STEP:.8f}{mark}{x:.5f}".replace(".", ",") for k, x in enumerate(VALUES)]
    record = read_record(saved(tmp_path, rows, "time [s];acceleration [m/s^2]"))
    assert record.step == pytest.approx(STEP, rel=1e-6)
    assert record.samples == pytest.approx(VALUES)
    quoted = [f'"{k * STEP:.8f}","{x:.5f}"'.replace(".", ",") for k, x in enumerate(VALUES)]
    quoted = [row.replace('",,"', '","') for row in quoted]
    assert read_record(saved(tmp_path, quoted, "time [s],a [m/s^2]")).samples == pytest.approx(
        VALUES
    )


@pytest.mark.parametrize(
    ("heads", "factor"),
    [
        ("time,acc\ns,g", G),
        ("time,acceleration\n[s],[m/s2]", 1.0),
        ('"Time";"Accel"\n"(s)";"(cm/s^2)"', 0.01),
    ],
)
def test_units_in_a_line_below_the_names_are_read(tmp_path, heads, factor):
    """As loggers write them."""
    mark = ";" if ";" in heads else ","
    rows = [f"{k * STEP:.8f}{mark}{x:.5f}" for k, x in enumerate(VALUES)]
    samples = read_record(saved(tmp_path, rows, heads)).samples
    assert samples == pytest.approx(factor * VALUES)


def test_one_column_of_decimal_commas_is_one_column(tmp_path):
    path = saved(tmp_path, [f"{x:.5f}".replace(".", ",") for x in VALUES])
    assert read_record(path, step=0.01, unit="g").samples == pytest.approx(G * VALUES)
    counted = saved(tmp_path, [f"{k},{k % 9}" for k in range(N_SAMPLES)])  # two columns
    assert "say records.step" in refused(counted, "", None, "g")
    record = read_record(counted, step=0.01, unit="g")
    assert record.step == 0.01
    assert len(record.samples) == N_SAMPLES


@pytest.mark.parametrize("mark", [",", ";", "\t"])
@pytest.mark.parametrize(
    "row",
    [
        "00:00:00.010,0.1",
        "2020-01-01,0.1",
        "0.01,1,234.5",
        "0.01,nan",
        "0.01,",
        "0.01,0,15",
        ",0.1",
        "max,0.3",
        "0.01s,0.3",
        "0.01 s,0.3",
        "0.01,-",
        "0.01,1.5E-02-2.5E-02",
        "1.1O,2",
    ],
)
def test_rows_of_no_numbers_are_named(tmp_path, row, mark):
    rows = [x.replace(",", mark) for x in ("0.00,0.5", row, "0.02,0.3", "0.03,0.4")]
    message = refused(saved(tmp_path, rows, f"time [s]{mark}acceleration [g]"))
    assert message.startswith("r.csv, line 3 is ")
    assert ("numbers touch" in message) == ("-02-" in row)


def test_times_of_a_clock_that_jitters_are_remarked(tmp_path, rng):
    for jitter, words in ((2e-4, "its times are uneven by up to 0.000"), (4e-6, "")):
        times = 0.01 * np.arange(N_SAMPLES) + rng.uniform(-jitter, jitter, N_SAMPLES)
        times[0] = 0
        rows = [f"{t:.7f},{x:.5f}" for t, x in zip(times, VALUES, strict=True)]
        record = read_record(saved(tmp_path, rows, "time [s],acceleration [g]"))
        assert "".join(record.remarks).startswith(words)
        assert bool(record.remarks) == bool(words)


def test_units_tell_what_names_in_another_language_do_not(tmp_path):
    rows = [f"{0.01 * k:.2f};{x:.5f}".replace(".", ",") for k, x in enumerate(VALUES)]
    path = saved(tmp_path, rows, "Zeit [s];Beschleunigung [m/s²]")
    for unit in ("", "m/s^2"):
        assert read_record(path, unit=unit).samples == pytest.approx(VALUES)
    assert "unit m/s2" in refused(path, "", None, "g")


@pytest.mark.parametrize(
    ("times", "line"),
    [
        ((0, 1, 2, 5, 6, 7), 5),
        ((0, 1, 2, 3, 0, 1, 2, 3), 6),
        ((0, 1, 2, 3, 5, 7, 9), 3),
        ((0, 0, 0, 0, 0), 3),
    ],
)
def test_uneven_times_are_named(tmp_path, times, line):
    rows = [f"{0.01 * k:.2f},{0.1 * k * k % 1:.3f}" for k in times]
    with refuses(f"r.csv, line {line}"):
        read_record(saved(tmp_path, rows, "time [s],acceleration [g]"))


@pytest.mark.parametrize(
    ("head", "step", "cure"),
    [
        ("time [s],acceleration [g]", 1, "say records.step"),
        ("time [min],acceleration [g]", 0.01, "mend the head of the times"),
    ],
)
def test_times_whose_step_no_record_has_tell_their_cure(tmp_path, head, step, cure):
    rows = [f"{step * k:g},{0.1 * k * k % 1:.3f}" for k in range(20)]
    assert cure in refused(saved(tmp_path, rows, head))


@pytest.mark.parametrize(
    ("head", "cure"),
    [
        ("period [s],Sa [g]", "a spectrum"),
        ("frequency [Hz],acceleration [g]", "a spectrum"),
        ("time [s],jerk [m/s^3]", "a jerk"),
        ("time [s],acceleration [m/s]", "a velocity by its unit m/s"),
    ],
)
@pytest.mark.parametrize("unit", ["", "g"])
def test_heads_of_no_record_tell_what_they_are_whatever_the_case_states(tmp_path, head, cure, unit):
    rows = [f"{0.01 * k:.2f},{0.1 * k * k % 1:.3f}" for k in range(20)]
    assert cure in refused(saved(tmp_path, rows, head), "", None, unit)


@pytest.mark.parametrize("times", [[0] * 9, range(9), range(1, 10)])
def test_times_without_a_step_give_way_to_the_stated_one(tmp_path, times):
    rows = [f"{time},{0.1 * k * k % 1:.3f}" for k, time in enumerate(times)]
    record = read_record(saved(tmp_path, rows, "time [s],acceleration [g]"), step=0.01)
    assert record.step == 0.01
    assert any("the stated step is taken" in remark for remark in record.remarks)


@pytest.mark.parametrize("is_whole", [True, False])
def test_decimal_commas_between_commas_are_told_apart_by_the_head(tmp_path, is_whole):
    rows = [f"{0.01 * k:.2f},{k if is_whole else 0.1 * k:g}" for k in range(1, 30)]
    path = saved(tmp_path, [row.replace(".", ",") for row in rows], "time [s],acceleration [g]")
    assert "if these are decimal commas" in refused(path)


@pytest.mark.parametrize("start", [1, 1_709_290_000])
def test_times_that_begin_late_keep_their_step_and_raise_no_warning(tmp_path, recwarn, start):
    rows = [f"{start + 0.01 * k:.2f},{0.1 * k * k % 1:.3f}" for k in range(400)]
    record = read_record(saved(tmp_path, rows, "time [s],acceleration [g]"))
    assert record.remarks == (f"its times begin at {start:g} s, taken as 0",)
    assert record.step == pytest.approx(0.01, rel=1e-7)
    assert not recwarn.list


@pytest.mark.parametrize(
    ("head", "step", "key"),
    [
        ("acceleration [g],time [s]", 0.01, "r.csv, line 1"),
        ("sample,acceleration [g]", 1, "r.csv, line 1"),
        ("time [s],acceleration [g]", 1e-7, "r.csv, line 1"),
    ],
)
def test_columns_that_are_no_times_in_seconds_tell_their_cure(tmp_path, head, step, key):
    rows = [f"{step * k:.9g},{0.1 * k * k % 1:.3f}" for k in range(9)]
    with refuses(key):
        read_record(saved(tmp_path, rows, head))


@pytest.mark.parametrize(
    ("head", "key"),
    [
        ("time [s],force [kg]", "r.csv, line 1"),
        ("time [s],force [N/m]", "r.csv, line 1"),
        ("time,force [kN]", "r.csv, line 1"),
        ("time [s],pressure [kPa]", "r.csv, line 1"),
    ],
)
def test_heads_of_forces_tell_their_cure(tmp_path, head, key):
    rows = [f"{0.01 * k:.2f},{k % 7}" for k in range(30)]
    with refuses(key):
        read_force_history(saved(tmp_path, rows, head))


@pytest.mark.parametrize(
    ("change", "key"),
    [
        (lambda rows: rows[3:], "r.csv, line 2"),
        (lambda rows: [row.replace(".", ",") for row in rows], "r.csv, line 2"),
        (lambda rows: [*rows[:5], rows[6], rows[5], *rows[7:]], "r.csv, line 7"),
    ],
)
def test_times_of_forces_tell_their_cure(tmp_path, change, key):
    rows = [f"{0.01 * k:.2f},{k % 7}" for k in range(30)]
    with refuses(key):
        read_force_history(saved(tmp_path, change(rows), "time [s],force [kN]"))
