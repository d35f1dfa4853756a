"""Universal files, written by pyuff itself, are read; what has no meaning is refused."""

import numpy as np
import pytest

from alphacut.fuzzy.refused import RefusedError
from alphacut.records.read import read_recording
from alphacut.records.uff import phase_collinearity, uff_mode_rows

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


def history(node=7, **changes):
    prepare = pytest.importorskip("pyuff").prepare_58
    time = 0.005 * np.arange(400)
    own = {"func_type": 1, "rsp_node": node, "rsp_dir": 1, "ref_node": 1, "ref_dir": 1}
    own |= {"x": time, "data": np.sin(9 * time), "binary": 0, "ord_data_type": 4}
    own |= {"ordinate_axis_units_lab": "m/s^2", "ordinate_spec_data_type": 12}
    own |= {f"{axis}_spec_data_type": 0 for axis in ("orddenom", "z_axis")}
    own |= {"abscissa_spacing": 1, "num_pts": 400, "abscissa_inc": 0.005, "abscissa_min": 0.0}
    return prepare(**own | changes)


def test_a_time_history_is_a_record_and_another_function_is_refused(tmp_path):
    path = written(tmp_path / "record.uff", [history(), history(node=8)])
    record = read_recording(path, "8.x")
    assert record.step == pytest.approx(0.005, rel=1e-5)
    assert record.samples == pytest.approx(np.sin(9 * 0.005 * np.arange(400)), abs=1e-6)
    with pytest.raises(RefusedError, match=r"one of: 7\.x, 8\.x"):
        read_recording(path)
    other = written(tmp_path / "frf.uff", [history(func_type=4)])
    with pytest.raises(RefusedError, match="of function type 4"):
        read_recording(other)


def test_what_is_not_there_is_refused(tmp_path):
    path = written(tmp_path / "modes.uff", [mode(1)])
    with pytest.raises(RefusedError, match=r"without 99\.x"):
        uff_mode_rows(path, {"99.x": 1})
    (tmp_path / "text.uff").write_text("no universal file\n")
    with pytest.raises(RefusedError, match="mode"):
        uff_mode_rows(tmp_path / "text.uff", FLOORS)
