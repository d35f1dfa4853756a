"""Universal files: modes as pyuff writes them, histories by the columns of the format."""

import numpy as np
import pytest

from alphacut.fuzzy.refused import RefusedError
from alphacut.records.read import read_recording
from alphacut.records.uff import phase_collinearity, uff_mode_rows
from tests.alphacut.records.samples import uff58

FLOORS = {"11.x": 1, "12.x": 2, "13.x": 3}
SHAPE = np.array([0.4, 0.8, 1.0])


def test_collinearity_of_a_turned_shape_is_one_and_of_a_running_wave_zero():
    assert phase_collinearity(SHAPE * np.exp(0.7j)) == pytest.approx(1.0)
    assert phase_collinearity(np.exp(1j * np.array([0, np.pi / 2]))) == pytest.approx(0, abs=1e-12)


def written(path, sets):
    pyuff = pytest.importorskip("pyuff")
    pyuff.UFF(str(path)).write_sets(sets, mode="overwrite")
    return path


def mode(number, **changes):
    column = np.zeros(4)
    lines = {f"id{k}": "NONE" for k in range(1, 6)}
    values = {"r1": np.append(SHAPE, 9.0), "r2": column, "r3": column}
    own = {"node_nums": [11, 12, 13, 40], "mode_n": number, "freq": 1.5 * number, "load_case": 0}
    kinds = {"type": 55, "model_type": 1, "analysis_type": 2, "data_ch": 2, "spec_data_type": 8}
    damping = {"modal_m": 1, "modal_damp_vis": 0.01, "modal_damp_his": 0, "data_type": 2}
    return {**lines, **kinds, **damping, **own, **values, "n_data_per_node": 3, **changes}


def test_modes_are_read_with_their_floors(tmp_path):
    path = written(tmp_path / "modes.uff", [mode(2), mode(1)])
    first, second = uff_mode_rows(path, FLOORS)
    assert [first.mode, second.mode] == [1, 2]
    assert second.frequencies == pytest.approx([3.0])
    assert [first.amplitudes[k][0] for k in (1, 2, 3)] == pytest.approx(SHAPE)


def complex_mode(turn):
    phases = np.exp(1j * np.array([0.3, 0.3 + turn, 0.3, 0.0]))
    other = {"r1": np.append(SHAPE, 9.0) * phases, "r2": np.zeros(4, complex), "data_type": 5}
    own = {"eig": -0.1 + 6.0j, "modal_a": 1 + 0j, "modal_b": 1 + 0j, "analysis_type": 3}
    return mode(1, r3=np.zeros(4, complex), spec_data_type=8, **other, **own)


def test_a_complex_shape_is_turned_to_its_real_one_or_refused(tmp_path):
    (row,) = uff_mode_rows(written(tmp_path / "a.uff", [complex_mode(0.0)]), FLOORS)
    ratios = [row.amplitudes[k][0] / row.amplitudes[3][0] for k in (1, 2)]
    assert ratios == pytest.approx(SHAPE[:2], rel=1e-4)  # five digits in the file
    assert row.frequencies == pytest.approx(abs(-0.1 + 6.0j) / (2 * np.pi), rel=1e-4)
    with pytest.raises(RefusedError, match="complex: 0"):
        uff_mode_rows(written(tmp_path / "b.uff", [complex_mode(1.2)]), FLOORS)


def test_complex_modes_with_rotations_are_read_by_their_translations(tmp_path):
    pytest.importorskip("pyuff")
    values = [f"{x * np.cos(0.3):13.5E}{x * np.sin(0.3):13.5E}" for x in SHAPE]
    zeros = f"{0:13.5E}" * 4
    lines = ["    -1", "    55", *["NONE"] * 5, "".join(f"{k:10d}" for k in (1, 3, 3, 8, 5, 6))]
    lines += ["".join(f"{k:10d}" for k in (2, 6, 0, 1)), f"{-0.1:13.5E}{6:13.5E}" + zeros]
    for node, value in enumerate(values, start=11):
        lines += [f"{node:10d}", value + zeros, f"{7:13.5E}" * 6]
    path = saved(tmp_path, "\n".join([*lines, "    -1", ""]).encode())
    (row,) = uff_mode_rows(path, FLOORS)
    assert row.frequencies == pytest.approx([0.955065], rel=1e-5)
    ratios = [row.amplitudes[k][0] / row.amplitudes[3][0] for k in (1, 2)]
    assert ratios == pytest.approx(SHAPE[:2], rel=1e-5)  # six digits in the file


WAVE = np.sin(9 * 0.005 * np.arange(400))


def saved(folder, content):
    path = folder / "record.uff"
    path.write_bytes(content)
    return path


@pytest.mark.parametrize("spec", [0, 1, 12, 15])
@pytest.mark.parametrize(("unit", "size"), [("m/s^2", 1.0), ("m/s²", 1.0), ("g", 9.80665)])
def test_the_stated_unit_says_what_a_history_is(tmp_path, spec, unit, size):
    record = read_recording(saved(tmp_path, uff58(WAVE, unit=unit, spec=spec)))
    assert record.step == pytest.approx(0.005, rel=1e-9)
    assert record.samples == pytest.approx(size * WAVE, abs=1e-4)


@pytest.mark.parametrize("order", ["", "<", ">"])
@pytest.mark.parametrize("kind", [2, 4])
def test_text_and_bytes_of_single_and_double_reals_are_read(tmp_path, kind, order):
    content = uff58(WAVE, kind=kind, order=order)
    record = read_recording(saved(tmp_path, content))
    assert record.samples == pytest.approx(WAVE, abs=1e-11 if kind == 4 else 1e-5)
    several = content + uff58(2 * WAVE, kind=kind, order=order).replace(
        b"         7   1", b"         8   1"
    )
    assert read_recording(saved(tmp_path, several), "8.x").samples == pytest.approx(
        2 * WAVE, abs=2e-5
    )
    with pytest.raises(RefusedError, match=r"one of: 7\.x, 8\.x"):
        read_recording(saved(tmp_path, several))


def test_padding_is_dropped_and_a_missing_point_refused(tmp_path):
    content = uff58(WAVE)
    padded = content.replace(b"    -1\n", b" 0.00000E+00 0.00000E+00\n    -1\n")
    assert len(read_recording(saved(tmp_path, padded)).samples) == len(WAVE)
    with pytest.raises(RefusedError, match="401 points, and 400 are there"):
        read_recording(saved(tmp_path, content.replace(b"       400", b"       401")))


@pytest.mark.parametrize("rate", [256, 200, 1000])
def test_times_that_are_even_but_for_their_digits_are_even(tmp_path, rate):
    wave = np.sin(np.arange(8000) / 40)
    times = np.arange(8000) / rate
    record = read_recording(saved(tmp_path, uff58(wave, times=times)))
    assert record.step == pytest.approx(1 / rate, rel=1e-9)
    assert record.samples == pytest.approx(wave, abs=1e-5)
    times[4000:] += 0.4 / rate
    with pytest.raises(RefusedError, match="uneven"):
        read_recording(saved(tmp_path, uff58(wave, times=times)))


@pytest.mark.parametrize(
    ("changes", "message"),
    [({"unit": "Pa"}, "in units of Pa"), ({"unit": "NONE"}, "in units of none"),
     ({"function": 4}, "of function type 4"), ({"step": 0.0}, "a step of 0 s")],
)  # fmt: skip
def test_what_is_no_acceleration_over_time_is_refused(tmp_path, changes, message):
    with pytest.raises(RefusedError, match=message):
        read_recording(saved(tmp_path, uff58(WAVE, **changes)))


def record_or_message(path):
    try:
        return read_recording(path)
    except RefusedError as error:
        return str(error)


def test_mutated_universal_files_end_in_one_line_or_in_a_record(tmp_path):
    seed = np.random.SeedSequence().entropy % 10**6
    print("seed", seed)
    rng = np.random.default_rng(seed)
    for _ in range(200):
        content = bytearray(uff58(WAVE[:60], order=str(rng.choice(["", "<"]))))
        place = int(rng.integers(len(content)))
        content[place : place + int(rng.integers(30))] = rng.bytes(int(rng.integers(20)))
        outcome = record_or_message(saved(tmp_path, bytes(content)))
        assert (
            "\n" not in outcome if isinstance(outcome, str) else np.isfinite(outcome.samples).all()
        )


def test_what_is_not_there_is_refused(tmp_path):
    path = written(tmp_path / "modes.uff", [mode(1)])
    with pytest.raises(RefusedError, match=r"without 99\.x"):
        uff_mode_rows(path, {"99.x": 1})
    (tmp_path / "text.uff").write_text("no universal file\n")
    with pytest.raises(RefusedError, match="mode"):
        uff_mode_rows(tmp_path / "text.uff", FLOORS)
