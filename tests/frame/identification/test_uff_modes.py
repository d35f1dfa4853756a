"""Modes of universal files, written by the columns of the format."""

import re

import numpy as np
import pytest

from alphacut.frame import read_modes
from alphacut.fuzzy import RefusedError
from tests.frame.records.samples import uff55
from tests.refused import refuses

FLOORS = {"11.x": 1, "12.x": 2, "13.x": 3}
SHAPE = np.array([0.4, 0.8, 1.0])


def modes_of(folder, *sets, floors=FLOORS, **said):
    path = folder / "modes.uff"
    path.write_text("".join(sets))
    deviations = {"frequency_deviation": 0.01, "shape_deviation": 0.02}
    return read_modes(path, floors=floors, **deviations, **said)


@pytest.mark.parametrize("size", [3, 6])
def test_modes_are_read_with_their_floors(tmp_path, size):
    sets = (uff55(k, [*SHAPE, 9.0], frequency=1.5 * k, size=size) for k in (2, 1))
    first, second = modes_of(tmp_path, *sets)
    assert [first.mode, second.mode] == [1, 2]
    assert second.frequency.nominal == pytest.approx(3.0)
    assert first.reference == 3
    assert [first.shape[k].nominal for k in (1, 2)] == pytest.approx(SHAPE[:2], rel=1e-3)


@pytest.mark.parametrize("size", [3, 6])
def test_a_complex_shape_is_turned_to_its_real_one_or_refused(tmp_path, size):
    changes = {"eigenvalue": -0.1 + 6.0j, "size": size}
    phases = np.exp(1j * np.array([0.3, 0.3, 0.3, 0.0]))
    (row,) = modes_of(tmp_path, uff55(1, phases * [*SHAPE, 9.0], **changes))
    assert [row.shape[k].nominal for k in (1, 2)] == pytest.approx(SHAPE[:2], rel=1e-3)
    assert row.frequency.nominal == pytest.approx(abs(-0.1 + 6.0j) / (2 * np.pi), rel=1e-5)
    phases[1] *= np.exp(1.2j)
    with refuses("modes.uff, mode 1"):
        modes_of(tmp_path, uff55(1, phases * [*SHAPE, 9.0], **changes))
    running = np.array([1.0, 1.0j, 0.0, 9.0])
    with refuses("modes.uff, mode 1"):
        modes_of(tmp_path, uff55(1, running, **changes), floors={"11.x": 1, "12.x": 2})


def test_modes_that_are_not_there_are_refused(tmp_path):
    mode = uff55(1, [*SHAPE, 9.0])
    for sets, floors, key in (
        ([mode], {"99.x": 1}, "modes.uff, mode 1"),
        ([mode, mode], FLOORS, "modes.uff, mode 1"),
        ([mode], {"11.x": 1, "12.x": 1}, "floors"),
        ([uff55(1, [*SHAPE, 9.0], nodes=(11, 12, 13, 12))], FLOORS, "modes.uff"),
        (["no universal file\n"], FLOORS, "modes.uff"),
        ([mode.replace("         3\n", "         6\n", 1)], FLOORS, "modes.uff"),
        ([mode.replace("1.50000E+00", "0.00000E+00", 1)], FLOORS, "modes.uff, mode 1: frequency"),
    ):
        with refuses(key):
            modes_of(tmp_path, *sets, floors=floors)


def test_an_id_line_of_minus_one_and_exponents_without_their_letter(tmp_path):
    mode = uff55(1, [*SHAPE, 9.0])
    bare = re.sub(r"(\d\.\d+)E([-+])(\d\d)(?!\d)", r"\1\g<2>0\3", mode)
    assert bare != mode
    (row,) = modes_of(tmp_path, bare)
    assert row.frequency.nominal == pytest.approx(1.5)
    assert [row.shape[k].nominal for k in (1, 2)] == pytest.approx(SHAPE[:2], rel=1e-3)
    lines = mode.splitlines(keepends=True)
    lines[2] = "    -1\n"
    with refuses("modes.uff"):
        modes_of(tmp_path, "".join(lines))


def as_2414(mode, kind=8):
    """A data set 55 of the mode 3 at 2.5 Hz as one of 2414."""
    values = "".join(mode.splitlines(keepends=True)[10:-1])
    head = f"    -1\n  2414\n{1:10d}\nMode\n{1:10d}\n" + "NONE\n" * 5
    codes = "".join(f"{x:10d}" for x in (1, 2, 3, kind, 2, 3)) + "\n"
    counts = "".join(f"{x:10d}" for x in (0, 0, 1, 0, 0, 3, 0, 0)) + "\n         0         0\n"
    reals = "".join(f"{x:13.5E}" for x in (0, 2.5, 246.74, 0, 0.01, 0)) + "\n"
    return head + codes + counts + reals + f"{0:13.5E}" * 6 + "\n" + values + "    -1\n"


def test_modes_in_data_sets_2414_are_those_in_55(tmp_path):
    mode = uff55(3, [*SHAPE, 9.0], frequency=2.5)
    (found,), (expected,) = modes_of(tmp_path, as_2414(mode)), modes_of(tmp_path, mode)
    assert (found.mode, found.frequency.nominal) == (3, pytest.approx(2.5))
    for floor, number in expected.shape.items():
        assert found.shape[floor].nominal == pytest.approx(number.nominal)
    for kind in (2, 3, 10):  # stress, strain, kinetic energy
        with pytest.raises(RefusedError, match=f"of result type {kind}"):
            modes_of(tmp_path, as_2414(mode, kind))


def test_units_in_lines_of_text_and_those_of_the_user_are_those_of_the_format(tmp_path):
    mode = uff55(3, [*SHAPE, 9.0], frequency=2.5)
    for line in ("omega given in rad/sec", "Natural frequency [kHz]", "Values are periods in s"):
        with pytest.raises(RefusedError, match=r"modes\.uff"):
            modes_of(tmp_path, mode.replace("NONE", line, 1))
    known = mode.replace("NONE", "f = 2.5 Hz, omega = 15.708 rad/s, damping ratio 1 %", 1)
    for said in ({}, {"frequency_unit": "Hz"}):
        assert modes_of(tmp_path, known, **said)[0].frequency.nominal == pytest.approx(2.5)
    for unit in ("kHz", "mHz"):
        with pytest.raises(RefusedError, match=f"frequency_unit {unit}"):
            modes_of(tmp_path, mode, frequency_unit=unit)
    with pytest.warns(UserWarning, match="frequency_unit"):
        (found,) = modes_of(tmp_path, mode, frequency_unit="kHz", override=["frequency_unit"])
    assert found.frequency.nominal == pytest.approx(2500)
