"""Command tolerances: the largest scaling of supports that keeps a limit."""

import json
import re

import pytest

from alphacut.entry import main
from alphacut.fuzzy import CampaignError
from alphacut.stages.vibration import tolerances

CASE = """
schema = 1
title = "Two floors"
about = "A frame of two floors, for tests."
source = "made up"
stages = ["envelope"]

[frame]
modulus = "[22, 25, 27] GPa"
second_moment = "1e-6 m^4"
masses = ["[900, 1000, 1100] kg", "1000 kg"]
lengths = ["3 m", "3 m"]
dampers = ["50 N s/m"]
damper_placement = "storey"
displacements = ["0 mm"]
velocities = ["0.1 m/s", "0.2 m/s"]

[envelope]
fuzzy = ["E", "m1"]
duration = "4 s"
step = "0.01 s"

[exceedance]
output = "drift1"
limit = "LIMIT"
"""


def written(tmp_path):
    path = tmp_path / "two.toml"
    path.write_text(CASE.replace("LIMIT", "44 mm"), encoding="utf-8")
    return path


def told(tmp_path, limit, *more, text=CASE):
    path = tmp_path / "two.toml"
    path.write_text(text.replace("LIMIT", limit), encoding="utf-8")
    return main(["tolerances", str(path), "--quiet", *more])


def test_the_safe_supports_are_told_and_a_witness(tmp_path, capfd):
    assert told(tmp_path, "44 mm", "--json", "-") == 0
    found = json.loads(capfd.readouterr().out)
    assert found["nature"] == "guaranteed"
    assert found["between_nodes"] == "the motion between nodes is not included"
    assert 0 < found["safe_scale"] < found["unsafe_scale"] < 2
    assert found["gap"] <= 0.01
    low, high = found["safe"]["E"]
    assert low == pytest.approx(25e9 - found["safe_scale"] * 3e9)
    assert high == pytest.approx(25e9 + found["safe_scale"] * 2e9)
    assert found["witness_share"] > 1
    assert found["units"] == {"E": "Pa", "m1": "kg"}


def test_safe_supports_are_printed_with_their_units(tmp_path, capfd):
    assert main(["tolerances", str(written(tmp_path))]) == 0
    told = capfd.readouterr().out
    assert re.search(r"\n  E: 2\d\.\d+ GPa … 2\d\.\d+ GPa\n  m1: [\d.]+ kg … [\d.]+ kg\n", told)
    assert re.search(
        r"unsafe at .*: E = [\d.]+ GPa, m1 = [\d.]+ kg\n"
        r"  there \|drift1\| passes the limit by [\d.e-]+ %\n",
        told,
    )


def test_a_limit_below_the_nominal_motion_leaves_no_tolerance(tmp_path, capfd):
    assert told(tmp_path, "1 mm", "--json", "-") == 0
    assert json.loads(capfd.readouterr().out)["safe_scale"] is None


@pytest.mark.parametrize(
    ("more", "text", "message"),
    [
        (("--most", "0"), CASE, "--most.*greater than 0"),
        ((), CASE[: CASE.index("[exceedance]")], "exceedance.*missing"),
        ((), CASE.replace("drift1", "drift7"), "exceedance"),
    ],
)
def test_bad_input_is_told_in_one_line(more, text, message, tmp_path, capfd):
    assert told(tmp_path, "44 mm", *more, text=text) == 2
    error = capfd.readouterr().err
    assert re.search(message, error), error
    assert "Traceback" not in error


def test_fuzzy_inputs_that_are_held_fixed_are_told(tmp_path, capfd):
    path = written(tmp_path)
    path.write_text(path.read_text(encoding="utf-8").replace('["E", "m1"]', '["E"]'))
    assert main(["tolerances", str(path)]) == 0
    fixed = "\nfixed at the middle of the top cut, since no study names them: m1\n"
    assert fixed in capfd.readouterr().out
    assert main(["tolerances", str(path), "--json", "-"]) == 0
    assert json.loads(capfd.readouterr().out)["fixed"] == ["m1"]


def test_supports_are_not_scaled_to_where_an_input_has_no_meaning(tmp_path, capfd):
    damped = CASE.replace('["50 N s/m"]\ndamper_placement = "storey"', '["50 N s/m"]').replace(
        'dampers = ["50 N s/m"]', 'damping_ratio = "[1, 3, 6] %"'
    )
    wide = damped.replace('["E", "m1"]', '["m1", "zeta"]')
    assert told(tmp_path, "1 m", "--json", "-", text=wide) == 0
    found = json.loads(capfd.readouterr().out)
    assert found["safe_scale"] == pytest.approx(found["most"])
    assert found["most"] == pytest.approx(0.9 * 1.5)  # zeta is 0 at 1.5
    assert found["safe"]["zeta"][0] > 0
    assert found["most_reason"].startswith("zeta, which must be 0 or greater")
    assert not found["undecided"]


def test_what_is_neither_proved_nor_refuted_is_told_and_smaller_boxes_are_tried(tmp_path, capfd):
    wide = CASE.replace("[900, 1000, 1100] kg", "[500, 1000, 1500] kg")
    wide = wide.replace('"1000 kg"]', '"[400, 1000, 1600] kg"]').replace('"m1"]', '"m"]')
    wide = wide.replace('"4 s"', '"1.5 s"').replace('"0.01 s"', '"0.02 s"')
    assert told(tmp_path, "90 mm", "--json", "-", text=wide) == 0
    found = json.loads(capfd.readouterr().out)
    assert found["safe_scale"] > 0
    assert found["undecided"] == (found["unsafe_scale"] is None)
    assert main(["tolerances", str(tmp_path / "two.toml")]) == 0
    assert ("undecided between" in capfd.readouterr().out) == found["undecided"]


@pytest.mark.parametrize("light", ["10 kg", "300 kg"])
def test_the_supports_of_the_case_are_within_reach_however_near_the_end_they_are(
    light, tmp_path, capfd
):
    wide = CASE.replace("[900, 1000, 1100] kg", f"[{light[:-3]}, 1000, 1100] kg")
    wide = wide.replace('["E", "m1"]', '["m1"]')
    assert told(tmp_path, "1 m", "--json", "-", text=wide) == 0
    found = json.loads(capfd.readouterr().out)
    limit = 1000 / (1000 - float(light[:-3]))
    assert found["most"] == pytest.approx(max(1, 0.9 * limit))
    assert told(tmp_path, "1 m", "--json", "-", "--most", f"{0.95 * limit:.3f}", text=wide) == 0
    assert "most_reason" not in json.loads(capfd.readouterr().out)


def test_a_cell_without_a_modulus_ends_the_scales_and_not_the_command(monkeypatch):
    def moduli(cell, scale):
        if scale > cell:
            raise CampaignError([({}, "ValueError: Young's modulus is -1 Pa")], 2)
        return 10 - scale, 10 + scale

    monkeypatch.setattr(tolerances, "_moduli", moduli)
    reach, most, ended = tolerances._cell_range(1.5, 2.0)
    assert most == 1.5
    assert reach(1.5) == pytest.approx((8.5, 11.5))
    assert ended == "at 1.667 the cell has no modulus: Young's modulus is -1 Pa"
    assert tolerances._cell_range(3, 1.7)[1:] == (1.7, "")
    assert tolerances._cell_range(1.01, 1.7)[1] == 1
    with pytest.raises(CampaignError):
        tolerances._cell_range(0.9, 1.7)


def test_ratios_of_damping_stay_below_the_critical(tmp_path, capfd):
    wide = CASE.replace(
        'dampers = ["50 N s/m"]\ndamper_placement = "storey"', "damping_ratio = 0.5"
    )
    wide = wide.replace("damping_ratio = 0.5", 'damping_ratio = "[0.4, 0.5, 0.8]"')
    wide = wide.replace('["E", "m1"]', '["zeta"]')
    assert told(tmp_path, "1 m", "--json", "-", "--most", "4", text=wide) == 0
    found = json.loads(capfd.readouterr().out)
    assert found["most"] == pytest.approx(0.9 * 0.5 / 0.3)
    assert found["safe"]["zeta"][1] < 1


def test_a_default_stays_away_from_scales_at_which_a_mode_no_longer_oscillates(tmp_path, capfd):
    soft = CASE.replace("[22, 25, 27] GPa", "[12.51, 25, 26] GPa")
    soft = soft.replace('["50 N s/m"]', '["1.5 kN s/m"]').replace('["E", "m1"]', '["E"]')
    assert told(tmp_path, "1 m", "--json", "-", text=soft) == 0
    assert json.loads(capfd.readouterr().out)["most"] == pytest.approx(0.9 * 25 / 12.49)
    assert told(tmp_path, "1 m", "--most", "2", text=soft) == 1
    error = capfd.readouterr().err
    assert "oscillate" in error
    assert error.endswith("less damping, narrower supports or a smaller --most\n")
    assert "graph-follower" not in error


def test_other_faults_of_a_cell_are_no_end_of_the_scales(monkeypatch):
    def moduli(cell, scale):
        if scale > 1.2:
            raise CampaignError([({}, "MemoryError: ")], 2)
        return 10 - scale, 10 + scale

    monkeypatch.setattr(tolerances, "_moduli", moduli)
    with pytest.raises(CampaignError):
        tolerances._cell_range(None, 2.0)


def test_a_limit_that_the_nominal_motion_only_reaches_is_told_with_a_cure(tmp_path, capfd):
    text = CASE.replace('["0 mm"]', '["44 mm"]').replace('["0.1 m/s", "0.2 m/s"]', '["0 m/s"]')
    text = text.replace('"50 N s/m"', '"500 N s/m"').replace("drift1", "q1")
    path = tmp_path / "two.toml"
    path.write_text(text, encoding="utf-8")
    cure = "reaches the limit itself; take a limit a little greater"
    for limit, undecided in (("44 mm", True), ("45 mm", False)):
        assert main(["tolerances", str(path), "--set", f"exceedance.limit={limit}"]) == 0
        assert (cure in capfd.readouterr().out) == undecided


WIDE = """
schema = 1
title = "Three floors"
about = "Supports so wide that no proof of the modes covers the unsafe scale."
stages = ["envelope"]

[frame]
masses = ["12 t", "12 t", "9 t"]
stiffness = ["[7, 8, 11] MN/m", "[6, 8, 10] MN/m", "[4.5, 6, 8] MN/m"]
lengths = "3 m"
damping_ratio = "3 %"
displacements = ["5 mm", "9 mm", "12 mm"]
velocities = "0 m/s"

[envelope]
fuzzy = ["k"]
duration = "2 s"
step = "0.02 s"

[exceedance]
output = "drift1"
limit = "LIMIT"
"""


def test_a_greater_limit_never_gives_a_smaller_proved_scale(tmp_path, capfd):
    scales = []
    for limit in ("5.2 mm", "6 mm"):
        assert told(tmp_path, limit, "--json", "-", text=WIDE) == 0
        found = json.loads(capfd.readouterr().out)
        assert found["nature"] == "guaranteed"
        scales.append(found["safe_scale"])
    assert scales[0] <= scales[1] < found["unsafe_scale"] / 1.1
    assert main(["tolerances", str(tmp_path / "two.toml")]) == 0
    assert "between the two it is undecided" in capfd.readouterr().out


def test_what_a_measurement_teaches_is_said_to_be_left_out(tmp_path, capfd):
    (tmp_path / "modes.csv").write_text("mode,frequency [Hz],q1\n1,0.4,1\n", encoding="utf-8")
    measured = '[update]\nmeasured = "modes.csv"\nlearn = ["E"]\nfrequency_deviation = 0.01\n'
    for text, words in ((CASE, False), (CASE + measured, True)):
        assert told(tmp_path, "44 mm", "--json", "-", text=text) == 0
        assert ("what [update] learns is not taken in" in capfd.readouterr().err) == words


def test_supports_are_not_scaled_to_where_the_weight_buckles_a_storey(tmp_path, capfd):
    heavy = CASE.replace("[900, 1000, 1100] kg", "[900, 1000, 4000] kg")
    heavy = heavy.replace("[envelope]", "p_delta = true\n\n[envelope]").replace('"4 s"', '"1 s"')
    assert told(tmp_path, "500 mm", "--json", "-", text=heavy) == 0
    found = json.loads(capfd.readouterr().out)
    # 24 (25 - 3 s) 1e3 N m² / (3 m)² = (2000 + 3000 s) kg g
    end = (24e3 * 25 / 9 - 2000 * 9.80665) / (24e3 * 3 / 9 + 3000 * 9.80665)
    assert found["most"] == pytest.approx(0.9 * end)
    what = "P-Delta: storey 1 buckles under the weight above it"
    assert found["most_reason"] == f"{what} from {end:.4g} on"
    assert 0 < found["safe_scale"] <= found["most"]
    assert told(tmp_path, "500 mm", "--most", "1.2", "--json", "-", text=heavy) == 0
    assert "most_reason" not in json.loads(capfd.readouterr().out)
