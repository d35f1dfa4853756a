"""Mistakes that people make: each is named with what was most likely meant, or remarked on where it
might be right.
"""

import re
from pathlib import Path

import pytest

from alphacut.entry import main, pasted
from alphacut.io.provenance import door

CASES = Path(__file__).parents[3] / "cases"
BUILDING = (CASES / "building.toml").read_text(encoding="utf-8")
CONCRETE = (CASES / "concrete.toml").read_text(encoding="utf-8")
RECORD = "time [s],acceleration [m/s^2]\n0,0\n0.01,1\n0.02,0\n"


def told(text, tmp_path, capfd, *files, status=2):
    """What `check` says on a case beside some files."""
    path = tmp_path / "own.toml"
    path.write_text(text, encoding="utf-8")
    (tmp_path / "building.record.csv").write_text(RECORD, encoding="utf-8")
    for name, content in files:
        (tmp_path / name).write_text(content, encoding="utf-8")
    assert main(["check", str(path)]) == status
    out, err = capfd.readouterr()
    assert "Traceback" not in err
    return err + out


@pytest.mark.parametrize(
    ("old", "new", "pattern"),
    [
        (
            '"40 t", "40 t"',
            '"40 tons", "40 t"',
            'unit "tons" means several things; write t for 1000 kg',
        ),
        (
            'rayleigh_mass = "[0.40, 0.50, 0.60] 1/s"',
            "damping_ratio = 5",
            'frame.damping_ratio.*such as 0.05 or "5 %"',
        ),
        ('random = ["E"]', "random = 3", "exceedance.random"),
        (
            'fuzzy = ["E", "m8"',
            'fuzzy = [] # ["E", "m8"',
            "envelope.fuzzy.*empty.*one name or more",
        ),
    ],
)
def test_wrong_values_are_told_with_what_was_meant(old, new, pattern, tmp_path, capfd):
    assert old in BUILDING
    assert re.search(pattern, told(BUILDING.replace(old, new, 1), tmp_path, capfd))


@pytest.mark.parametrize(
    ("record", "pattern"),
    [
        (RECORD.replace("m/s^2", "kg"), 'unit "kg" is wrong'),
        (RECORD.replace("0.01,1", "0.01,0"), "the acceleration is zero throughout"),
    ],
)
def test_records_that_cannot_be_are_refused(record, pattern, tmp_path, capfd):
    text = BUILDING.replace("building.record.csv", "own.csv")
    assert re.search(pattern, told(text, tmp_path, capfd, ("own.csv", record)))


def test_what_is_most_likely_a_wrong_unit_is_remarked_on(tmp_path, capfd):
    strong = BUILDING.replace("building.record.csv", "own.csv")
    assert "a peak of 9.81e+03 m/s²" in told(
        strong, tmp_path, capfd, ("own.csv", RECORD.replace("0.01,1", "0.01,9810")), status=0
    )
    tall = BUILDING.replace('"3.2 m"', '"3200 m"')
    assert re.search(
        r"a first natural period of [\de.+]+ s is unusual", told(tall, tmp_path, capfd, status=0)
    )


@pytest.mark.parametrize(
    ("table", "pattern"),
    [
        ("fc [MPa]\n30\n31\n", "'fc .MPa.' is not a modulus.*E \\[GPa\\]"),
        ("Ecm [MPa]\n30000\n31000\n", ""),
        ("Young's modulus [GPa]\n30\n31\n", ""),
    ],
)
def test_only_moduli_are_taken_for_measured_moduli(table, pattern, tmp_path, capfd):
    text = BUILDING.replace(
        'method = "auto"\ntolerance = 1e-5\nplan = "signed"',
        'measured = "m.csv"\nbounds = "[28, 33] GPa"',
    )
    assert 'measured = "m.csv"' in text
    found = told(text, tmp_path, capfd, ("m.csv", table), status=2 if pattern else 0)
    assert re.search(pattern, found), found


def test_a_measured_modulus_alone_is_nothing_to_compute(tmp_path, capfd):
    text = BUILDING.replace(
        'method = "auto"\ntolerance = 1e-5\nplan = "signed"', 'value = "[24, 25, 26] GPa"'
    )
    text = text.replace('stages = ["modulus", "envelope"]', 'stages = ["modulus"]')
    assert "there is nothing to compute: modulus.value stands in" in told(text, tmp_path, capfd)


def test_particles_and_a_radius_map_besides_contradict_each_other(tmp_path, capfd):
    text = CONCRETE.replace(
        "[cell]", "[radius]\na1 = 0.2\na2 = 0.3\na3 = 0.8\na4 = 0.3\n\n[cell]", 1
    )
    assert "radius: stage microstructure makes this section" in told(text, tmp_path, capfd)
    lacking = CONCRETE.replace('"microstructure", ', "", 1)
    assert (
        'section [radius] is missing; stage modulus needs it; allowed: or "microstructure" among'
        in told(lacking, tmp_path, capfd)
    )


@pytest.mark.parametrize(
    ("change", "pattern"),
    [
        ("dampng_ratio=5 %", "did you mean frame.damping_ratio"),
        ("lenths=3 m", "did you mean frame.lengths"),
    ],
)
def test_a_misspelt_change_is_sought_in_the_case_s_own_sections(change, pattern, capfd):
    assert main(["check", str(CASES / "building.toml"), "--set", change]) == 2
    assert re.search(pattern, capfd.readouterr().err)


def test_the_next_command_can_be_pasted(tmp_path, capfd):
    folder = tmp_path / "mein Haus"
    assert (
        main(["run", str(CASES / "pendulum.toml"), "--quick", "--no-figures", "--out", str(folder)])
        == 0
    )
    assert f"report '{folder}'" in capfd.readouterr().err


def test_a_command_in_a_message_has_the_door_the_path_and_its_quotes(tmp_path, capfd, monkeypatch):
    monkeypatch.setenv("ALPHACUT_INSIDE", "1")
    path = tmp_path / "my house.toml"
    path.write_text(BUILDING, encoding="utf-8")
    (tmp_path / "building.record.csv").write_text(RECORD, encoding="utf-8")
    assert main(["envelope", str(path)]) == 2
    line = capfd.readouterr().err
    assert f"`./enter python -m alphacut modulus '{path}' --out modulus.nc`" in line
    assert pasted("run `python -m alphacut repair s.db`") == f"run `{door()} repair s.db`"


@pytest.mark.parametrize(
    ("name", "meant"),
    [("q02", "q2_0"), ("q0_2", "q2_0"), ("q2", "q2_0"), ("v_03", "v3_0"), ("q09", "q0"),
     ("mm1", "m1"), ("zetta1", ""), ("b1", "")],
)  # fmt: skip
def test_a_misspelt_input_of_a_frame_is_offered_its_like_alone(name, meant, capfd):
    assert main(["check", str(CASES / "paper.toml"), "--set", f'envelope.fuzzy=["{name}"]']) == 2
    (line,) = capfd.readouterr().err.splitlines()
    assert "zeta" not in line.replace(name, "")  # the frame has no damping ratio
    assert line.partition("did you mean ")[2].rstrip("?") == meant


@pytest.mark.parametrize(
    ("given", "name", "words"),
    [
        ("5 %", "zeta2", "zeta2: one damping_ratio stands for all modes, zeta"),
        ("[4, 5, 6] %", "zetta", "did you mean zeta?"),
        ("4 %,5 %,6 %", "zetta2", "did you mean zeta2?"),
    ],
)
def test_damping_ratios_of_modes_are_offered_where_they_are_given(given, name, words, capfd):
    sets = ["--set", f"frame.damping_ratio={given}", "--set", f"envelope.fuzzy={name}"]
    assert main(["check", str(CASES / "paper.toml"), *sets]) == 2
    assert words in capfd.readouterr().err


def test_one_argument_too_many_is_called_so(capfd):
    assert main(["check", str(CASES / "paper.toml"), "other.toml"]) == 2
    assert "check = other.toml: there is one argument too many" in capfd.readouterr().err


def test_a_certificate_that_cannot_become_a_guarantee_is_remarked_on(tmp_path, capfd):
    text = BUILDING.replace('method = "graph-follower"\ntolerance = "0.2 mm"', 'certify = "0.1 mm"')
    assert 'certify = "0.1 mm"' in text
    assert "verified by sampling" not in told(text, tmp_path, capfd, status=0)
    damped = text.replace(
        'rayleigh_mass = "[0.40, 0.50, 0.60] 1/s"\nrayleigh_stiffness = "[2.0, 2.5, 3.0] ms"',
        'damping_ratio = "[4, 5, 6] %"',
    )
    damped = damped.replace('"rayleigh_mass", "rayleigh_stiffness"', '"zeta"')
    assert "verified by sampling" not in told(damped, tmp_path, capfd, status=0)
    tower = [str(CASES / "tower.toml"), "--set", "envelope.certify=0.1 mm"]
    assert main(["check", *tower, "--set", "envelope.method=auto"]) == 0
    assert "envelope.certify: the error of the modal model of a tower" in capfd.readouterr().err


def test_a_gap_wider_than_the_named_tolerance_is_remarked_on(tmp_path, capfd):
    text = BUILDING.replace('method = "graph-follower"\ntolerance', 'certify = "3 mm"\ntolerance')
    assert 'certify = "3 mm"' in text
    found = told(text, tmp_path, capfd, status=0)
    assert "a gap of 0.003 m may leave errors above envelope.tolerance, 0.0002 m" in found
    narrow = told(text.replace('"3 mm"', '"0.1 mm"'), tmp_path, capfd, status=0)
    assert "may leave errors above" not in narrow
