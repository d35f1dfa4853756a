"""Matrices in CSV as programs of several countries write them: read, or one line with the cure."""

import numpy as np
import pytest

from alphacut.frame import read_matrix
from tests.refused import refuses

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
    ("text", "key"),
    [
        ("q1,q2\n1,2\n3,4\n", "k.csv, line 1"),
        ("1,2\n3\n", "k.csv, line 2"),
        ("1\n2,3\n4,5\n", "k.csv, line 1"),
        ("1,5,2\n3,5,4,5\n6,5,7,5\n", "k.csv, line 1"),
        ("1,2,\n3,4,\n", "k.csv, line 1"),
        ("1,5 2,5\n3,5 4,5\n", "k.csv, line 1"),
        ('"1","0"\n"0","1"\n', "k.csv, line 1"),
        ("1D3,0\n0,1D3\n", "k.csv, line 1"),
        ("[[1,0],\n[0,1]]\n", "k.csv, line 1"),
        ("%%MatrixMarket matrix\n1 1\n", "k.csv, line 1"),
        ("", "k.csv"),
    ],
)
def test_what_is_no_matrix_is_one_line_with_the_cure(tmp_path, text, key):
    with refuses(key) as caught:
        read_matrix(saved(tmp_path, text))
    assert len(str(caught.value).splitlines()) == 1


@pytest.mark.parametrize(
    ("name", "key"),
    [("k.txt", "k.txt"), ("k.mat", "k.mat"), ("k.xlsx", "k.xlsx"), ("k.mm", "k.mm")],
)
def test_files_of_other_types_are_told_what_to_write(tmp_path, name, key):
    with refuses(key):
        read_matrix(saved(tmp_path, "1,0\n0,1\n", name))
