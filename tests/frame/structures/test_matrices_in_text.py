"""Matrices in CSV as programs of several countries write them: read, or one line with the cure."""

import numpy as np
import pytest

from alphacut.frame import read_matrix
from alphacut.fuzzy import RefusedError

MATRIX = np.array([[2.5e6, -1.25, 0], [-1.25, 3e-3, 7], [0, 7, 1]])


def saved(folder, text, name="k.csv"):
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.parametrize("mark", [",", ";", " ", "\t", "   ", " ; "])
def test_commas_semicolons_and_blanks_part_numbers(tmp_path, mark):
    text = "\n".join(mark.join(map(repr, row)) for row in MATRIX.tolist())
    assert (read_matrix(saved(tmp_path, text + "\n")) == MATRIX).all()
    if ";" in mark:  # where commas are decimal
        assert (read_matrix(saved(tmp_path, text.replace(".", ","))) == MATRIX).all()


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("q1,q2\n1,2\n3,4\n", "line 1 is q1,q2; .* no head"),
        ("q1,1,2\nq2,3,4\n", "line 1 is q1,1,2; .* no head and no names"),
        ("1,2\n3\n", "line 2 is 3; .* it has 1 numbers, and 1 of 2 rows have 2"),
        ("1\n2,3\n4,5\n", "line 1 is 1; .* it has 1 numbers, and 2 of 3 rows have 2"),
        ("1,5,2\n3,5,4,5\n6,5,7,5\n", "if commas are decimal ones, part the numbers by semic"),
        ("1,2,\n3,4,\n", "cells are empty"),
        ("1,,2\n3,4,5\n", "cells are empty"),
        ("1,5 2,5\n3,5 4,5\n", "write decimal points"),
        ("1'500,0\n0,1\n", "thousands without separators"),
        ('"1","0"\n"0","1"\n', "numbers without quotes"),
        ("1D3,0\n0,1D3\n", "1e3 in place of 1D3"),
        ("1 kN,0\n0,1 kN\n", "in SI units"),
        ("[[1,0],\n[0,1]]\n", "without brackets"),
        ("1+2j,0\n0,1\n", "a matrix is real"),
        ("1,nan\n0,1\n", "nan at row 1, column 2"),
        ("%%MatrixMarket matrix\n1 1\n", "NAME.mtx"),
        ("", "k.csv is"),
    ],
)
def test_what_is_no_matrix_is_one_line_with_the_cure(tmp_path, text, words):
    with pytest.raises(RefusedError, match=words) as caught:
        read_matrix(saved(tmp_path, text))
    assert len(str(caught.value).splitlines()) == 1


@pytest.mark.parametrize(
    ("name", "cure"),
    [("k.txt", "rename"), ("k.mat", "loadmat"), ("k.xlsx", "save the sheet"), ("k.mm", "mtx")],
)
def test_files_of_other_types_are_told_what_to_write(tmp_path, name, cure):
    with pytest.raises(RefusedError, match=cure):
        read_matrix(saved(tmp_path, "1,0\n0,1\n", name))


def test_arrays_that_are_no_matrix_are_told_what_they_are(tmp_path):
    for array, words in (
        (MATRIX * 1j, "complex128 of shape"),
        (MATRIX.astype(object), "a sparse matrix by scipy.sparse.save_npz"),
        (np.zeros((2, 2, 2)), "an array of 2 × 2 × 2"),
    ):
        np.save(tmp_path / "k.npy", array)
        with pytest.raises(RefusedError, match=words):
            read_matrix(tmp_path / "k.npy")
