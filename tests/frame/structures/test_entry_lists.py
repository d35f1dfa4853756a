"""Matrices as Abaqus and CalculiX write them, with the names of their unknowns."""

from itertools import product

import numpy as np
import pytest

from alphacut.frame import read_matrix, read_unknowns
from tests.refused import refuses

NAMES = ("2.1", "2.2", "10.1")
MATRIX = np.array([[4.0, -1.5, 0.25], [-1.5, 3.0, 0.0], [0.25, 0.0, 2.0]])


def abaqus_text(matrix, names, *, order=None, is_full=False, separator=","):
    """Entries by node and direction, column by column, in the order of the program's equations."""
    order = range(len(names)) if order is None else order
    lines = []
    for (i, column), (j, row) in product(enumerate(order), enumerate(order)):
        if (is_full or j >= i) and (matrix[row, column] or i == j):
            place = f"{names[row]}.{names[column]}".replace(".", separator)
            lines.append(f"{place}{separator} {matrix[row, column]:.15e}")
    return "\n".join(lines) + "\n"


@pytest.mark.parametrize("is_full", [False, True])
@pytest.mark.parametrize("separator", [",", " ", ",   "])
@pytest.mark.parametrize("order", [(0, 1, 2), (2, 0, 1)])
def test_abaqus_names_unknowns_in_any_order_of_equations(tmp_path, is_full, separator, order):
    path = tmp_path / "job_STIF1.mtx"
    text = abaqus_text(MATRIX, NAMES, order=order, is_full=is_full, separator=separator)
    path.write_text("** of JOB\n" + text)
    assert read_unknowns(path) == NAMES
    assert np.array_equal(read_matrix(path), MATRIX)


@pytest.mark.parametrize("is_full", [False, True])
def test_abaqus_writes_coordinates_without_names(tmp_path, is_full):
    path = tmp_path / "job_STIF1.mtx"
    path.write_text(abaqus_text(MATRIX, "123", is_full=is_full, separator=" "))
    assert np.array_equal(read_matrix(path), MATRIX)
    with refuses("job_STIF1.mtx"):
        read_unknowns(path)


def test_unknowns_that_abaqus_holds_are_left_out(tmp_path):
    held = MATRIX.copy()
    held[1, 1] = 1e36
    (tmp_path / "STIF.mtx").write_text(abaqus_text(held, NAMES))
    (tmp_path / "MASS.mtx").write_text(abaqus_text(np.diag([5.0, 6.0]), ("2.1", "2.2")))
    names = read_unknowns(tmp_path / "STIF.mtx")
    assert names == ("2.1", "10.1")
    stiffness = read_matrix(tmp_path / "STIF.mtx", unknowns=names)
    mass = read_matrix(tmp_path / "MASS.mtx", unknowns=names)
    assert np.array_equal(stiffness, [[4, 0.25], [0.25, 2]])
    assert np.array_equal(mass, [[5, 0], [0, 0]])


def test_rows_come_in_the_order_of_the_names_asked_for(tmp_path):
    (tmp_path / "k.mtx").write_text(abaqus_text(MATRIX, NAMES))
    order = [2, 0, 1]
    matrix = read_matrix(tmp_path / "k.mtx", unknowns=[NAMES[k] for k in order])
    assert np.array_equal(matrix, MATRIX[np.ix_(order, order)])
    with refuses("k.mtx"):
        read_matrix(tmp_path / "k.mtx", unknowns=["2.x", "2.y", "10.x"])
    with refuses("k.mtx"):
        read_matrix(tmp_path / "k.mtx", max_rows=2)


def calculix(folder, matrix=MATRIX, names=NAMES, ending="sti"):
    """Entries of the upper triangle, column by column, and the names of the equations."""
    path = folder / f"beam.{ending}"
    lines = []
    for column in range(len(matrix)):
        for row in range(column + 1):
            lines.append(f"{row + 1} {column + 1}  {matrix[row, column]:.13e}\n")
    path.write_text("".join(lines))
    path.with_suffix(".dof").write_text("".join(f"{name}\n" for name in names))
    return path


@pytest.mark.parametrize("ending", ["sti", "mas"])
def test_calculix_names_unknowns_in_a_file_beside(tmp_path, ending):
    path = calculix(tmp_path, ending=ending)
    assert np.array_equal(read_matrix(path), MATRIX)
    assert read_unknowns(path) == NAMES
    path.with_suffix(".dof").unlink()
    assert np.array_equal(read_matrix(path), MATRIX)
    with refuses(path.name):
        read_unknowns(path)


@pytest.mark.parametrize(
    ("names", "key"),
    [
        (NAMES[:2], "beam.dof"),
        (("2.1", "2.1", "2.2"), "beam.dof"),
        (("2.1", "2-2", "2.3"), "beam.dof, line 2"),
    ],
)
def test_names_that_do_not_fit_the_matrix_are_refused(tmp_path, names, key):
    with refuses(key):
        read_matrix(calculix(tmp_path, names=names))


@pytest.mark.parametrize(
    ("text", "key"),
    [
        ("1,1, 1,1, 2.0\n1,1, 1,1\n", "k.mtx"),
        ("1,1, 1,1, 2.0\n1,1, 1,1, x\n", "k.mtx"),
        ("1 2\n", "k.mtx"),
        ("*MATRIX,TYPE=STIFFNESS\n1.0\n", "k.mtx"),
        ("1,1, 1,1, 2.0\n1,1, 1,1, 3.0\n", "k.mtx"),
        ("1,1, 1,1, 2.0\n2,1, 1,1, 3.0\n", "k.mtx"),
        ("1 1 2.0\n2 1 3.0\n", "k.mtx"),
        ("0 0 2.0\n", "k.mtx"),
        ("1 1.5 2.0\n", "k.mtx"),
        ("1 900000000 2.0\n", "k.mtx"),
        ("3 3 3\n1 1 2.0\n2 2 5.0\n3 3 1.0\n", "k.mtx"),
        ("1 1 1\n2 2 1\n3 3 1\n2 1 .5\n1 2 .5\n3 1 .5\n", "k.mtx"),
        ("1 1 1e999\n", "k.mtx"),
    ],
)
def test_lists_that_make_no_matrix_are_one_line_with_the_cure(tmp_path, text, key):
    (tmp_path / "k.mtx").write_text(text)
    with refuses(key) as caught:
        read_matrix(tmp_path / "k.mtx")
    assert len(str(caught.value).splitlines()) == 1
