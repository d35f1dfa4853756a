"""A case is read once; every problem has its key, value and cure."""

import re
from pathlib import Path

import numpy as np
import pytest

from alphacut.case.content import load
from alphacut.fuzzy import Interval, Triangular
from tests.alphacut.small import CELL, FRAME, refusals

ROOT = Path(__file__).parents[3]


def read(folder, text, changes=()):
    path = folder / "case.toml"
    path.write_text(text, encoding="utf-8")
    return load(path, changes).content


def problems(folder, text, changes=()):
    path = folder / "case.toml"
    path.write_text(text, encoding="utf-8")
    return refusals(path, *changes)


def test_sections_hold_objects_in_si_and_change_from_the_command_line(tmp_path):
    changes = ["envelope.fuzzy=E,m1", "envelope.alpha=0,1", "frame.modulus=[20, 30] GPa"]
    changed = read(tmp_path, FRAME, changes)
    assert changed.envelope.fuzzy == ("E", "m1")
    assert changed.envelope.alpha == (0.0, 1.0)
    assert changed.frame.modulus == Interval(20e9, 30e9)
    content = read(tmp_path, FRAME)
    assert content.frame.modulus == Triangular(22e9, 24e9, 26e9)
    assert content.envelope.duration == 2.0
    assert content.envelope.tolerance.value == 1e-4
    assert content.structure.inputs(("E", "m")).keys() == {"E", "m1"}


def test_a_cell_is_round_or_an_image(tmp_path):
    assert read(tmp_path, CELL).particle_cell.particles == "cylinders"
    path = ROOT / "cases/composite.toml"
    assert load(path).content.image_cell.pairs[0][0] == Triangular(19e9, 20e9, 21e9)
    (line,) = refusals(path, "modulus.method=series")
    assert "modulus.method is series; allowed: auto for this cell" in line


WRONG = [  # text in the case, its replacement; key, and what the message says
    ('"10 mm"', '"10 q"', "frame.displacements[1]", 'unit "q"'),
    ('"3 m"', '"-3 m"', "frame.lengths[1]", "above 0"),
    ('"3 m"', "3", "frame.lengths[1]", "the unit is missing"),
    ("[22, 24, 26]", "[24, 22, 26]", "frame.modulus", "rise"),
    ("lengths", "lenghts", "frame.lenghts", "did you mean lengths?"),
    ("[frame]", "[frmae]", "frmae", "unknown section; did you mean frame?"),
    ('"graph-follower"', '"graph-folower"', "envelope.method", "did you mean graph-follower?"),
    ('"ground"', '"floor"', "frame.damper_placement", "ground"),
    ('fuzzy = ["E", "m"]', 'fuzzy = ["E", "n"]', "envelope.fuzzy", "n; allowed"),
    ('fuzzy = ["E", "m"]', 'fuzzy = ["E", "E"]', "envelope.fuzzy", "each name once"),
    ("[0, 0.5, 1]", "[0.5, 0, 1]", "envelope.alpha", "rising order"),
    ("[0, 0.5, 1]", "0.5", "envelope.alpha", "write alpha = [0.5]"),
    ('"3 m"', '"2 kg"', "frame.lengths[1]", '"kg" is a unit of mass, and no unit of length'),
    ("[0, 0.5, 1]", "[0, 2]", "envelope.alpha[2]", "up to 1"),
    ('duration = "2 s"', "", "envelope.duration", "is missing"),
    ('step = "0.02 s"', 'step = "0.03 s"', "envelope.duration", "whole multiples"),
    ('displacements = "10 mm"', "", "frame.displacements", "nothing moves the frame"),
    ('step = "0.02 s"', 'step = "20 s"', "envelope.duration", "envelope.step is longer, 20 s"),
    ('step = "0.02 s"', "step = 0.02 s", "", 'quantities stand in quotes, as "0.01 s"'),
    ('stages = ["envelope"]', "stages = envelope", "", "texts stand in quotes"),
    ('tolerance = "0.1 mm"', 'tolerance = "1 kg"', "envelope.tolerance", "a fraction"),
    ('second_moment = "1e-5 m^4"', "", "frame.second_moment", "or stiffness"),
    ('stages = ["envelope"]', 'stages = ["modulus"]', "radius", "stage modulus needs"),
    ('stages = ["envelope"]', "stages = []", "stages", "one entry"),
    ('masses = ["[9, 10, 11] t"]', "masses = []", "masses", "one entry or more"),
    ('"[9, 10, 11] t"', '"9 t", "9 t"', "envelope.fuzzy", "fuzzy"),
    ("title", "tilte", "tilte", "did you mean title?"),
    ("[envelope]", "[envelope]\ncertify = 3", "envelope.certify", "is an unknown key"),
    ('"1e-5 m^4"', '"1e-5 m^4" "x"', "", "is not TOML"),
    ("[envelope]", "outputs = []\n[envelope]", "frame.outputs", "one entry or more"),
    (
        "[envelope]",
        '[decision]\nlimits = ["mean q1 <= 1 mm"]\n[envelope]',
        "decision.limits",
        "[records]",
    ),
]


@pytest.mark.parametrize(("old", "new", "key", "words"), WRONG)
def test_what_is_wrong_is_said_with_its_key(tmp_path, old, new, key, words):
    assert old in FRAME
    first, *_ = problems(tmp_path, FRAME.replace(old, new))
    assert key in first
    assert words in first
    assert len(first) <= 1010


def test_all_problems_come_at_once_with_their_file(tmp_path):
    text = FRAME.replace("10 mm", "10 q").replace("3 m", "3 q").replace('"2 s"', '"2 q"')
    every = problems(tmp_path, text)
    keys = "frame.lengths[1]", "frame.displacements[1]", "envelope.duration"
    for key, line in zip(keys, every, strict=True):
        assert re.match(rf"alphacut: {tmp_path}/case.toml(, line \d+)?: {re.escape(key)} is ", line)


CELLS = [
    ("a3 = 0.6", "a3 = 1.6", "radius.a3"),
    ("a2 = [0.1, 0.2, 0.3]", "a2 = 9", "radius"),
    ("a2 = [0.1, 0.2, 0.3]\n", "", "radius.a2"),
    ("matrix_poisson = 0.3", "matrix_poisson = 0.5", "cell.matrix_poisson"),
    ('method = "series"', 'method = "prism"\n[cell2]\n', "cell2"),
    ('"series"', '"slices"', "modulus.method"),
    ("a1 = 0.3\na2 = [0.1, 0.2, 0.3]\na3 = 0.6\na4 = 0.2", "theta = [-3, 3]", "radius.a1"),
]


@pytest.mark.parametrize(("old", "new", "key"), CELLS)
def test_what_is_wrong_with_a_cell(tmp_path, old, new, key):
    text = CELL.replace("[cell]", '[cell]\nparticles = "spheres"') if "slices" in new else CELL
    assert any(f" {key} is " in line for line in problems(tmp_path, text.replace(old, new)))


FRACTION = """
title = "Particles of one size"
stages = ["modulus"]
[cell]
particles = "PARTICLES"
fraction = FRACTION
matrix_modulus = "20 GPa"
matrix_poisson = 0.2
inclusion_modulus = "60 GPa"
inclusion_poisson = 0.2
[modulus]
alpha = [0, 1]
"""


def fraction_case(particles, fraction):
    return FRACTION.replace("PARTICLES", particles).replace("FRACTION", str(fraction))


@pytest.mark.parametrize(
    ("particles", "factor", "power"), [("spheres", np.pi / 6, 3), ("cylinders", np.pi / 4, 2)]
)
def test_a_fraction_is_a_map_that_is_crisp_over_theta(tmp_path, particles, factor, power):
    radius, _ = read(tmp_path, fraction_case(particles, "[0.2, 0.3, 0.4]")).radius_and_cell
    radii = radius(np.linspace(-3, 3, 5))
    assert factor * radii**power == pytest.approx(np.full(5, 0.3), rel=1e-14)


@pytest.mark.parametrize(
    ("particles", "least", "most"),
    [("spheres", 0.5235, 0.5236), ("cylinders", "[0.7, 0.785]", "[0.7, 0.786]"),
     ("ellipses(4, 0)", 0.19, 0.2)],
)  # fmt: skip
def test_a_fraction_ends_where_particles_touch(tmp_path, particles, least, most):
    assert read(tmp_path, fraction_case(particles, least)).radius_and_cell
    found = problems(tmp_path, fraction_case(particles, most))
    assert any(" cell.fraction is " in line for line in found)


def test_a_fraction_stands_alone(tmp_path):
    radius = "[radius]\na1 = 0.3\na2 = 0\na3 = 0.4\na4 = 0\n"
    found = problems(tmp_path, fraction_case("spheres", 0.3) + radius)
    assert [" radius is " in line for line in found] == [True]


def test_damping_ratios_may_be_given_one_a_mode(tmp_path):
    floors = FRAME.replace('masses = ["[9, 10, 11] t"]', 'masses = ["[9, 10, 11] t", "9 t"]')
    key = "frame.damping_ratio"
    structure = read(tmp_path, floors, [f'{key}=["2 %", "[3, 4, 5] %"]']).frame.structure()
    assert structure.model.damping_ratio == (0.02, 0.04)
    cuts = {name: number.cut(0) for name, number in structure.inputs(("zeta",)).items()}
    assert cuts["zeta2"] == pytest.approx((0.03, 0.05))
    assert set(cuts) == {"zeta2"}  # zeta1 is one number
    (line,) = problems(tmp_path, floors, [f'{key}=["2 %", "3 %", "4 %"]'])
    assert key in line


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        (["nope=3"], "--set is nope=3, of an unknown key; allowed: KEY=VALUE"),
        (["duration=1 s"], "did you mean envelope.duration?"),
        (["envelope.durations=1 s"], "did you mean envelope.duration?"),
        (["duration"], "KEY=VALUE"),
        (["envelope.duration=1 s", "envelope.duration=2 s"], "each key once"),
        (["envelope.duration=1 q"], "command line: envelope.duration"),
    ],
)
def test_a_wrong_change_is_refused(tmp_path, changes, words):
    assert words in problems(tmp_path, FRAME, changes)[0]


def test_studies_have_names_of_files(tmp_path):
    study = '[[study]]\nname = "NAME"\nfuzzy = ["E"]\nduration = "1 s"\n'
    assert read(tmp_path, FRAME + study.replace("NAME", "E-1s")).study[0].name == "E-1s"
    for name in ("../x", "a/b", "", "x" * 65, "a..b", ".hidden", "a\\u0007"):
        (line,) = problems(tmp_path, FRAME + study.replace("NAME", name))
        assert " study[1].name is " in line
    both = study.replace("NAME", "E") * 2
    assert "a name of its own" in problems(tmp_path, FRAME + both)[0]


def test_files_are_beside_the_case(tmp_path):
    text = FRAME.replace('displacements = "10 mm"', 'accelerogram = "record.csv"')
    assert "a file, from the folder" in problems(tmp_path, text)[0]
    (tmp_path / "record.csv").write_text("time [s],acceleration [g]\n0,0\n0.02,0.1\n0.04,0\n")
    assert read(tmp_path, text).frame.accelerogram.step == pytest.approx(0.02)


def test_questions_have_sections(tmp_path):
    text = FRAME + '[decision]\nlimits = ["q1 <= 9 mm"]\n'
    assert set(read(tmp_path, text).questions) == {"decision"}
    for wrong, words in (("q1 < 9 mm", "<="), ("q1 <= 9 kg", "no unit of"), ("q1 <= 0 mm", "<=")):
        (line,) = problems(tmp_path, text.replace("q1 <= 9 mm", wrong))
        assert " decision.limits[1] is " in line
        assert words in line
    (line,) = problems(tmp_path, text.replace("q1 <=", "q9 <="))
    assert " decision.limits is " in line


def test_columns_that_yield_refuse_proofs_and_midpoint_steps_by_key():
    for key, value in (("method", "dual"), ("integrator", "midpoint")):
        (line,) = refusals(ROOT / "cases/yielding.toml", f"envelope.{key}={value}")
        assert re.search(rf"envelope\.{key} is {value}; .* columns yield", line)


def test_fragility_of_columns_that_yield_is_of_magnitudes_and_has_a_largest_measure():
    changes = ["frame.yield_drift=9 mm", "fragility.most=3"]
    assert load(ROOT / "cases/suite.toml", changes).content.fragility.most == 3
    for refused in (["fragility.most=3"], [*changes, "fragility.limits=['max drift1 <= 9 mm']"]):
        (line,) = refusals(ROOT / "cases/suite.toml", *refused)
        assert re.search(r"fragility\.(most|limits)", line)
