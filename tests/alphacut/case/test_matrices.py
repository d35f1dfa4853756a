"""Structures from the matrices of a frame program: factors, unknowns by name, files, refusals."""

import numpy as np
import pytest
import scipy.io
import scipy.sparse

from alphacut.case.content import load
from alphacut.frame import Exact, LinearFlow, StoreyFrame
from alphacut.frame.structures.matrix import Monomial
from alphacut.fuzzy import RefusedError
from tests.alphacut.small import refusals

CASE = """
title = "Two storeys as matrices"
stages = ["envelope"]
[matrices]
unknowns = ["1.x", "2.x"]
mass = [["m", "masses.csv"]]
stiffness = [["12*E*I*l^-3", "lower.mtx"], ["2*k2", "upper.npz:springs"]]
damping_ratio = "2 %"
direction = "x"
accelerogram = "record.csv"
[matrices.parameters]
m = "20 t"
E = "30 GPa ± 5 %"
I = "2e-4 m^4"
l = "3 m"
k2 = "10 MN/m"
[matrices.outputs]
roof = { row = { "2.x" = 1.0 } }
shear = { row = { "1.x" = 1.0 }, unit = "N", factor = "12*E*I*l^-3" }
[envelope]
fuzzy = ["E"]
alpha = [0, 1]
duration = "1 s"
step = "0.02 s"
"""


@pytest.fixture
def folder(tmp_path):
    np.savetxt(tmp_path / "masses.csv", np.diag([1.0, 0.5]), delimiter=",")
    scipy.io.mmwrite(tmp_path / "lower.mtx", scipy.sparse.coo_matrix([[1.0, 0.0], [0.0, 0.0]]))
    springs = np.array([[1.0, -1.0], [-1.0, 1.0]])
    np.savez(tmp_path / "upper.npz", springs=springs, other=np.eye(2))
    (tmp_path / "short.csv").write_text("1,0\n")
    np.save(tmp_path / "diagonal.npy", np.ones(2))
    (tmp_path / "upper.csv").write_text("9,3\n0,4\n")
    np.save(tmp_path / "zeros.npy", np.zeros((2, 2)))
    times = 0.02 * np.arange(40)
    rows = [f"{t:.2f},{np.sin(9 * t):.8f}" for t in times]
    (tmp_path / "record.csv").write_text("time [s],acceleration [m/s^2]\n" + "\n".join(rows))
    return tmp_path


def changed(folder, old="", new=""):
    path = folder / "case.toml"
    path.write_text(CASE.replace(old, new), encoding="utf-8")
    return path


def loaded(folder, old="", new=""):
    return load(changed(folder, old, new)).content


MODULI = np.linspace(28.5e9, 31.5e9, 5)[:, None]


def test_matrices_and_the_storey_frame_move_alike(folder):
    """Displacement of the roof and, with the factor of its member, the force of a storey."""
    structure = loaded(folder).structure
    by_matrices = LinearFlow(structure.model, ("E",), 1.0, 0.02, Exact()).values(MODULI)
    frame = StoreyFrame(
        masses=[20e3, 10e3],
        stiffness=[12 * 30e9 * 2e-4 / 27, 20e6],
        damping_ratio=0.02,
        ground=structure.model.ground,
        outputs=("q2", "shear1"),
    )
    stiffness = 12 * MODULI * 2e-4 / 27
    by_storeys = LinearFlow(frame, ("k1",), 1.0, 0.02, Exact()).values(stiffness)
    size = abs(by_storeys).max((0, 1))
    assert (abs(by_matrices - by_storeys).max((0, 1)) < 1e-9 * size).all()
    assert size[1] > 1e3
    assert structure.inputs(["E"])["E"].support == (28.5e9, 31.5e9)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('"lower.mtx"', '"nothing.mtx"', "a file, from the folder"),
        ("upper.npz:springs", "upper.npz", "one of springs, other"),
        ("12*E*I*l^-3", "sin(E)", "a product of powers"),
        ("12*E*I*l^-3", "E*J", "factor"),
        ('row = { "2.x"', 'row = { "9.x"', "matrices.outputs.roof.row"),
        ('direction = "x"', 'direction = "y"', "matrices.direction"),
        ('.x"', '"', "name the unknowns NODE.DIRECTION, as 1.x"),
        ('direction = "x"', 'direction = ["x", "y"]', "of a list make a table"),
        ('"1.x", "2.x"]\nmass', '"1.x", "2.x", "3.x"]\nmass', "of shape"),
        ('"lower.mtx"', '"short.csv"', "short.csv is of shape (1, 2); allowed: (2, 2); the case"),
        ('"lower.mtx"', '"diagonal.npy"', "of a diagonal make a matrix, by numpy.diag"),
        ('"lower.mtx"', '"upper.csv"', "upper.csv is not symmetric: [1.x, 2.x] is 3, [2.x, 1.x]"),
        ('"lower.mtx"', '"zeros.npy"', "zeros.npy is zeros throughout"),
        ('m = "20 t"', 'm = "20 parsec fuzz"', "a quantity"),
        (
            "roof =",
            '"roof drift" =',
            "matrices.outputs is 'roof drift'; allowed: names of a letter",
        ),
        ("roof =", '"roof\\u001b[31m" =', "matrices.outputs is 'roof\\x1b[31m'"),
        ("roof =", '"2nd" =', "matrices.outputs is '2nd'"),
        ("roof =", '"" =', "matrices.outputs is ''"),
        ('m = "20 t"', 'm = "20 t"\n"k 3" = 1', "matrices.parameters is 'k 3'"),
        ('unit = "N"', 'unit = "N\\u001b[2J"', "unit of shear is 'N\\x1b[2J'"),
        ('unit = "N"', 'unit = "kN"', "unit is kN; allowed: SI units, as m, N or N*m; write N;"),
        ('{ row = { "2.x" = 1.0 } }', "{ }", "matrices.outputs.roof.row is missing"),
    ],
)
def test_what_makes_no_structure_is_one_line(folder, old, new, message):
    lines = refusals(changed(folder, old, new))
    assert any(message in line for line in lines), lines


def test_a_fuzzy_parameter_in_no_factor_is_doubted(folder):
    section = loaded(folder, 'm = "20 t"', 'm = "20 t"\nmr = "1 ± 10 %"').structure_section
    (doubt,) = section.warnings(None)
    assert doubt.startswith("matrices.parameters.mr is in no factor")


@pytest.mark.parametrize(
    ("limit", "words"),
    [
        ("roof <= 40 kN", "is a unit of force, and no unit of length"),
        ("roof <= 40", "the unit is missing"),
        ("shear <= 40 mm", "no unit of force"),
        ("roof <= 40 mm", ""),
    ],
)
def test_a_limit_is_in_the_unit_of_its_output(folder, limit, words):
    section = f'step = "0.02 s"\n[decision]\nlimits = ["{limit}"]\n'
    if words:
        (line,) = refusals(changed(folder, 'step = "0.02 s"\n', section))
        assert words in line
    else:
        content = loaded(folder, 'step = "0.02 s"\n', section)
        (found,) = content.decision.limits_of(content.structure)
        assert found.value == 0.04


@pytest.mark.parametrize(
    ("text", "value"),
    [("1", 1.0), ("2*a", 6.0), ("a^2*b**-1", 4.5), ("b/a^2", 2 / 9), ("1e-3 * a / b", 1.5e-3)],
)
def test_monomials_are_read(text, value):
    assert Monomial.parse(text)({"a": 3.0, "b": 2.0}) == pytest.approx(value)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "a+b",
        "a^b",
        "(a)",
        "a**",
        "__import__('os')",
        "a*",
        "a b",
        "1/0",
        "0^-1",
        "9^999",
        "1e999",
    ],
)
def test_other_expressions_are_refused(text):
    with pytest.raises(RefusedError):
        Monomial.parse(text)
