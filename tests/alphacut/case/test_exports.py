"""A case whose stiffness follows from exports of a program for several parameters."""

import re

import numpy as np
import pytest
import scipy.io
import scipy.linalg

from alphacut.base.number_text import engineering
from alphacut.case.content import load
from alphacut.frame.structures.linear import nominal_modes
from tests.alphacut.small import told_by
from tests.frame.structures.test_affine import NOMINAL, beam

CASE = """title = "Cantilever on a spring"
stages = ["envelope"]

[matrices]
unknowns = ["2.w", "2.r", "3.w", "3.r", "4.w", "4.r"]
mass = [["1", "mass.mtx"]]
stiffness = [
EXPORTS]

[matrices.parameters]
E = "210 GPa ± 10 %"
k = "3.7e6 ± 20 %"

[matrices.outputs]
tip = { row = { "4.w" = 1.0 }, unit = "m" }

[[force]]
history = "harmonic, 9 Hz"
amplitude = { "4.w" = "1 kN" }

[envelope]
fuzzy = ["E", "k"]
alpha = [0, 1]
duration = "1 s"
step = "0.01 s"
"""
POINTS = [("210 GPa", 3.7e6), ("420 GPa", 3.7e6), ("315 GPa", 3.7e6), ("210 GPa", 7.4e6),
          ("210 GPa", 5.5e6), ("300 GPa", 5e6)]  # fmt: skip


@pytest.fixture
def case(tmp_path):
    """A case with a mass at two of three nodes, and files of nine digits."""
    mass = np.diag([0, 0, 40.0, 0.5, 60.0, 0.7])
    scipy.io.mmwrite(tmp_path / "mass.mtx", mass)
    rows = []
    for number, (modulus, spring) in enumerate(POINTS):
        stiffness = beam(1e9 * float(modulus.split()[0]), spring)
        scipy.io.mmwrite(tmp_path / f"k{number}.mtx", stiffness, precision=9)
        rows.append(f'{{ file = "k{number}.mtx", E = "{modulus}", k = {spring} }},\n')
    path = tmp_path / "case.toml"
    path.write_text(CASE.replace("EXPORTS", "".join(rows)))
    return path


def test_terms_of_exports_stand_in_the_structure(case):
    model = load(str(case)).content.structure.model
    assert [factor for factor, _ in model.stiffness] == ["E", "k"]
    for values in (NOMINAL, {"E": 1.9e11, "k": 4.4e6}):
        total = sum(values[factor] * array for factor, array in model.stiffness)
        assert total == pytest.approx(beam(*values.values()), rel=1e-6, abs=1.0)


def test_check_tells_unknowns_and_periods(case):
    told = told_by("check", case)
    assert "matrices: 6 unknowns in N, m, kg, s, 2 of them without mass: 2.w, 2.r\n" in told
    modes = nominal_modes(load(str(case)).content.structure.model)
    assert f"first periods: {', '.join(engineering(x, 's') for x in modes.periods)}" in told


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("k5.mtx", "k0.mtx", r"not affine in E and k: \S+ of the entry at \[2\.w, 2\.w\]"),
        ("k2.mtx", "k3.mtx", r"not affine in E: \S+ of the entry at \["),
        ('file = "k3.mtx"', 'name = "k3.mtx"', r"file = \"soft\.mtx\""),
        ("k = 5500000.0", "kk = 5500000.0", r"export 5 is of parameters E, kk; allowed: E, k"),
        ("k4.mtx", "mass.mtx", "not affine in k"),
        ('"4.w", "4.r"]', '"4.w"]', "mass.mtx is 6 × 6"),
    ],
)
def test_exports_of_another_model_are_refused_in_one_line(case, old, new, message):
    text = case.read_text()
    assert old in text
    case.write_text(text.replace(old, new, 1))
    told = told_by("check", case, status=2)
    assert sum("not affine" in line for line in told.splitlines()) <= 1
    assert re.search(message, told), told


def test_unknowns_that_are_not_named_are_told(case):
    folder = case.parent
    stiffness = beam(*NOMINAL.values())
    names = [(node, direction) for node in (2, 3, 4) for direction in (2, 6)]
    entries = [
        f"{n},{i}, {m},{j}, {stiffness[row, column]:.12e}\n"
        for row, (n, i) in enumerate(names)
        for column, (m, j) in enumerate(names[: row + 1])
    ]
    (folder / "job_STIF1.mtx").write_text("".join(entries))
    text = case.read_text()
    begin, end = text.index("unknowns = "), text.index("[matrices.parameters]")
    keys = """unknowns = UNKNOWNS
mass = [["7800", "job_STIF1.mtx"]]
stiffness = [["E", "job_STIF1.mtx"]]

"""
    text = (text[:begin] + keys + text[end:]).replace("4.w", "4.2").replace('"E", "k"', '"E"')
    told = {}
    for unknowns in ('"job_STIF1.mtx"', '["4.2", "4.6", "3.2"]'):
        case.write_text(text.replace("UNKNOWNS", unknowns))
        told[unknowns] = told_by("check", case)
    assert [("not named" in words) for words in told.values()] == [False, True]
    line = "warning: 3 unknowns of the files are not named, and so are held: 2.2, 2.6, 3.6\n"
    assert line in told['["4.2", "4.6", "3.2"]']


def test_two_exports_are_enough_where_the_case_says_that_they_are_affine(case):
    text = case.read_text()
    first = text.index("stiffness = [")
    listed = text[first : text.index("]\n", first)]
    ends = [f'{{ file = "k{n}.mtx", E = "{POINTS[n][0]}" }},\n' for n in (0, 1)]
    text = text.replace(listed, "stiffness = [\n" + "".join(ends))
    text = text.replace('k = "3.7e6 ± 20 %"\n', "").replace('["E", "k"]', '["E"]')
    case.write_text(text)
    told = told_by("check", case, status=2)
    assert "affine = true" in told
    case.write_text(text.replace("[matrices]", "[matrices]\naffine = true"))
    told_by("check", case)
    structure = load(str(case)).content.structure.model
    for modulus in (210e9, 500e9, 1.9e11):
        total = sum((modulus if f == "E" else 1.0) * k for f, k in structure.stiffness)
        assert total == pytest.approx(beam(modulus, 3.7e6), rel=1e-6, abs=1.0)
