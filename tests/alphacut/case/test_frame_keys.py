"""Keys of a storey frame: stiffness in place of columns, weights, inputs named by their keys."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import xarray

from alphacut.case.load import load
from alphacut.case.overrides import apply_change
from alphacut.entry import main
from alphacut.frame.structures.linear import frequencies
from alphacut.stages.vibration.structure import structure
from alphacut.stages.vibration.structure_words import structure_words

CASE = """
schema = 1
title = "Three storeys of given stiffness"
about = "k from a pushover"
stages = ["envelope"]
[frame]
masses = ["20 t", "20 t", "[14, 15, 16] t"]
stiffness = ["[28, 30, 32] MN/m", "25 MN/m ± 5 %", "18 MN/m"]
damping_ratio = "3 %"
displacements = ["5 mm", "8 mm", "10 mm"]
velocities = "0 m/s"
outputs = ["q3", "drift1", "shear1"]
[envelope]
fuzzy = ["stiffness", "masses[3]"]
alpha = [0, 1]
duration = "0.2 s"
step = "0.02 s"
"""
HEIGHTS = 'lengths = "3 m"\np_delta = true\n'


def written(folder: Path, text: str) -> Path:
    path = folder / "own.toml"
    path.write_text(text, encoding="utf-8")
    return path


def more(line: str) -> str:
    return CASE.replace("damping_ratio", f"{line}\ndamping_ratio", 1)


def test_each_storeys_stiffness_is_read_and_named_by_its_key(tmp_path: Path) -> None:
    case = load(written(tmp_path, CASE))
    assert case.envelope.fuzzy == ("k", "m3")
    wanted = structure(case, None)
    assert list(wanted.inputs(case.envelope.fuzzy)) == ["k1", "k2", "m3"]
    assert tuple(wanted.numbers["k2"].support) == pytest.approx((23.75e6, 26.25e6))
    assert not {"E", "I", "c1", "l1"} & set(wanted.numbers)
    words = structure_words(case, wanted)
    assert words["sentences"][0] == "3 rigid floors on storeys whose stiffness is given."
    assert words["head"] == ["floor", "mass", "displacement", "stiffness"]
    assert words["rows"][0][-1] == "[28, 30, 32] MN/m"


def test_second_moments_may_be_fuzzy_each_by_itself(tmp_path: Path) -> None:
    columns = 'modulus = "30 GPa"\nlengths = "3 m"\nsecond_moment'
    text = CASE.replace("stiffness =", f"{columns} =", 1).replace("MN/m", "m^4")
    text = text.replace('"stiffness"', '"second_moment[1]", "I2"')
    wanted = structure(load(written(tmp_path, text)), None)
    assert tuple(wanted.inputs(["I"])["I2"].support) == pytest.approx((23.75, 26.25))
    assert list(wanted.inputs(["I"])) == ["I1", "I2"]


def test_weights_lower_the_first_frequency_and_are_told(tmp_path: Path) -> None:
    plain = structure(load(written(tmp_path, CASE)), None)
    case = load(written(tmp_path, more(HEIGHTS)))
    heavy = structure(case, None)
    assert plain.linear is not None
    assert heavy.linear is not None
    assert frequencies(heavy.linear)[0] < frequencies(plain.linear)[0]
    words = structure_words(case, heavy)
    share = 100 * 9.80665 * 55e3 / 3 / 30e6
    assert f"by up to {share:.2g} %" in words["sentences"][1]
    assert words["head"][-1] == "P-Delta"


@pytest.mark.parametrize(
    ("name", "found"),
    [
        ("stiffness[2]", "k2"),
        ("frame.masses[3]", "m3"),
        ("displacements[1]", "q1_0"),
        ("velocities", "v0"),
        ("damping_ratio[2]", "zeta2"),
        ("modulus", "E"),
        ("masses[0]", "masses[0]"),
        ("height", "height"),
    ],
)
def test_an_input_may_be_named_by_its_key(name: str, found: str) -> None:
    from alphacut.case.values import input_name

    assert input_name(name) == found


def test_the_command_line_takes_names_with_brackets(tmp_path: Path) -> None:
    case = load(written(tmp_path, CASE), ["envelope.fuzzy=stiffness[2],masses[3]"])
    assert case.envelope.fuzzy == ("k2", "m3")


@pytest.mark.parametrize(
    ("text", "pattern"),
    [
        (more('modulus = "25 GPa"'), "25 GPa: there is a stiffness besides"),
        (more('second_moment = "1e-6 m^4"'), "1e-6 m^4: there is a stiffness besides"),
        (more("columns = 4"), "frame.columns = 4: there is a stiffness besides"),
        (more("p_delta = true"), "frame.lengths: missing"),
        (CASE.replace("MN/m", "MN"), 'the unit "MN" is wrong'),
        (CASE.replace(', "18 MN/m"]', "]"), "frame.stiffness: got 2 values for 3 floors"),
        (CASE.replace('"18 MN/m"', '"0 MN/m"'), 'entry 3, "0 MN/m": out of range'),
        (CASE.replace('"stiffness", "m', '"stiffness[4]", "m'), "the frame has no input k4"),
        (CASE.replace('"stiffness", "m', '"k7", "m'), "or one floor: m1 to m3, k1 to k3"),
        (CASE.replace('"stiffness", "m', '"E", "m'), "no input E: its stiffness is given"),
        (CASE.replace('"stiffness", "m', '"l1", "m'), "l1: beside stiffness a height acts by p_d"),
        (more(HEIGHTS).replace('"18 MN/m"', '"[40, 50] kN/m"'), "P-Delta: storey 3 buckles"),
        (CASE.replace('["envelope"]', '["modulus", "envelope"]'), "makes no use of the modulus"),
        (CASE + '[field]\nof = "k"\nlength = "8 m"\n', "a field needs one fuzzy value"),
        (
            CASE + '[decision]\nlimits = ["drift1 <= 0.5 %"]\n',
            "a share of the storey's height needs frame.lengths",
        ),
        (
            CASE + '[exceedance]\noutput = "drift2"\nlimit = "0.5 %"\nrandom = ["k1"]\n',
            "a share of the storey's height needs frame.lengths",
        ),
        (
            CASE.replace("stiffness = [", 'lengths = "3 m"\ndampers = ["0 N s/m"] # [').replace(
                "damping_ratio", 'damper_placement = "ground"\ndamping_ratio'
            ),
            "frame.second_moment: missing",
        ),
    ],
    ids=range(17),
)
def test_what_does_not_go_together_is_named(
    text: str, pattern: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    assert main(["check", str(written(tmp_path, text))]) == 2
    found = capfd.readouterr().err
    assert pattern in " ".join(found.split())
    assert "Traceback" not in found


def test_a_modulus_is_not_handed_to_given_stiffnesses(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    path = str(written(tmp_path, CASE))
    assert main(["envelope", path, "--modulus", "25 GPa", "--json", "-"]) == 2
    assert "makes no use of the modulus" in capfd.readouterr().err


def test_accelerations_relative_to_the_ground_are_outputs_but_no_decision(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    record = "time [s],acceleration [g]\n0,0\n0.1,0.2\n0.2,-0.1\n"
    (tmp_path / "r.csv").write_text(record, encoding="utf-8")
    text = more('accelerogram = "r.csv"').replace('"q3", "drift1"', '"a3", "ar3"')
    path = written(tmp_path, text)
    assert main(["envelope", str(path), "--quiet", "--out", str(tmp_path / "e.nc")]) == 0
    with xarray.open_dataset(tmp_path / "e.nc") as found:
        assert found.attrs["nature"] == "guaranteed"
        ground = np.interp(found["time"], [0, 0.1, 0.2], [0, 1.96133, -0.980665])
        upper = found["upper"].isel(alpha=0)
        apart = (upper.sel(output="a3") - upper.sel(output="ar3")).values
    np.testing.assert_allclose(apart, ground, atol=1e-9)
    path.write_text(text + '[decision]\nlimits = ["ar3 <= 1 g"]\n', encoding="utf-8")
    assert main(["check", str(path)]) == 2
    assert "relative to the ground, and decisions are on absolute values" in capfd.readouterr().err


def test_a_run_with_weights_and_a_record_in_g_is_proved(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    record = "time [s],acceleration [g]\n0,0\n0.1,0.2\n0.2,-0.1\n"
    (tmp_path / "r.csv").write_text(record, encoding="utf-8")
    text = more(f'{HEIGHTS}accelerogram = "r.csv"')
    path = written(tmp_path, text)
    assert load(path).frame.p_delta
    wanted = structure(load(path), None)
    assert wanted.linear is not None
    assert wanted.linear.ground is not None
    assert wanted.linear.ground.acceleration.tolist() == [0, 1.96133, -0.980665]
    assert main(["envelope", str(path), "--json", "-"]) == 0
    found = json.loads(capfd.readouterr().out)
    assert "guaranteed" in json.dumps(found)


@pytest.mark.parametrize(
    ("value", "masses"),
    [
        ("10 t,[19, 20, 21] t,[4,5,6] t", ["10 t", "[19, 20, 21] t", "[4,5,6] t"]),
        ("[[19,20,21] t, 10 t, 5 t]", ["[19,20,21] t", "10 t", "5 t"]),
        ("[1,2] t, 3 t, [4,5] t", ["[1,2] t", "3 t", "[4,5] t"]),
        ("[1,2,3], [4,5,6]", ["[1,2,3]", "[4,5,6]"]),
        ('["20 t", "10 t"]', ["20 t", "10 t"]),
        ("[20 t, 10 t]", ["20 t", "10 t"]),
    ],
)
def test_commas_within_a_fuzzy_number_part_no_masses(value, masses):
    raw = {"frame": {"masses": []}}
    apply_change(raw, f"frame.masses={value}")
    assert raw["frame"]["masses"] == masses
