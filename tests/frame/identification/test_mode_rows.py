"""Files of modes: what is wrong has its line."""

import pytest

from alphacut.frame.identification.mode_rows import mode_rows
from alphacut.fuzzy import RefusedError

MODES = "mode,frequency [Hz],q1,q2\n1,1.5,0.5,1\n1,1.6,0.52,1\n2,4,-1,0.5\n"


@pytest.mark.parametrize(("old", "new"), [("1.5", "x"), ("q1", "u1"), ("2,4", "0,4")])
def test_wrong_modes_are_refused(tmp_path, old, new):
    path = tmp_path / "modes.csv"
    path.write_text(MODES.replace(old, new, 1))
    with pytest.raises(RefusedError):
        mode_rows(path)


def test_modes_and_deviations_of_an_operational_analysis_are_read(tmp_path):
    """Columns as the how-to writes them from pyOMA2's arrays Fn, Fn_std, Phi and Phi_std."""
    path = tmp_path / "modes.csv"
    path.write_text(MODES)
    first, second = mode_rows(path)
    assert (first.mode, second.mode) == (1, 2)
    assert first.frequencies == pytest.approx([1.5, 1.6])
    assert first.frequency_deviation is None
    head = "mode,frequency [Hz],frequency_std [Hz],shape_std,q1,q2"
    path.write_text(f"{head}\n1,1.5,0.015,0.03,0.5,1\n2,4,0.08,0.02,-1,0.5\n")
    first, second = mode_rows(path)
    assert first.frequency_deviation == pytest.approx(0.01)
    assert second.frequency_deviation == pytest.approx(0.02)
    assert first.shape_deviation == pytest.approx(0.03)
    assert second.amplitudes[1] == pytest.approx([-1.0])
