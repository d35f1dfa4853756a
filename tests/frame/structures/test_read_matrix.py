"""Matrices from files of every kind that is read, and files that are refused."""

import numpy as np
import pytest
import scipy.io
import scipy.sparse

from alphacut.base.errors import RefusedError
from alphacut.frame import read_matrix

MATRIX = np.array([[4.0, -1.5, 0.0], [-1.5, 3.0, -0.25], [0.0, -0.25, 2.0]])
WRITE = {
    "k.mtx": lambda path: scipy.io.mmwrite(path, scipy.sparse.coo_matrix(MATRIX)),
    "dense.mtx": lambda path: scipy.io.mmwrite(path, MATRIX),
    "k.npz": lambda path: scipy.sparse.save_npz(path, scipy.sparse.csr_matrix(MATRIX)),
    "k.npy": lambda path: np.save(path, MATRIX),
    "k.csv": lambda path: np.savetxt(path, MATRIX, delimiter=","),
}


@pytest.mark.parametrize("name", WRITE)
def test_a_matrix_is_read_as_it_was_written(tmp_path, name):
    WRITE[name](tmp_path / name)
    assert np.array_equal(read_matrix(tmp_path / name), MATRIX)
    assert np.array_equal(read_matrix(str(tmp_path / name)), MATRIX)


def test_one_of_several_arrays_is_named(tmp_path):
    np.savez(tmp_path / "both.npz", mass=np.eye(3), stiffness=MATRIX)
    assert np.array_equal(read_matrix(tmp_path / "both.npz", name="stiffness"), MATRIX)
    for name in ("", "damping"):
        with pytest.raises(RefusedError, match="one of mass, stiffness"):
            read_matrix(tmp_path / "both.npz", name=name)


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("k.txt", "1 2\n", "of type .txt"),
        ("k.csv", "1,2\n3\n", "a file .mtx"),
        ("k.csv", "1,nan\n", "no such array"),
        ("k.mtx", "no matrix\n", "a file .mtx"),
        ("k.npy", "no array", "a file .mtx"),
    ],
)
def test_what_is_no_matrix_is_refused(tmp_path, name, content, words):
    (tmp_path / name).write_text(content)
    with pytest.raises(RefusedError, match=words):
        read_matrix(tmp_path / name)
    with pytest.raises(RefusedError, match=f"missing{tmp_path.joinpath(name).suffix}"):
        read_matrix(tmp_path / f"missing{tmp_path.joinpath(name).suffix}")
