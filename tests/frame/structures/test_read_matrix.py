"""Matrices from files of every kind that is read, and files that are refused."""

from zipfile import ZipFile

import numpy as np
import pytest
import scipy.io
import scipy.sparse

from alphacut.base import memory
from alphacut.frame import read_matrix
from alphacut.fuzzy import RefusedError

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
        ("k.csv", "1,2\n3\n", "1 of 2 rows have 2"),
        ("k.csv", "1,nan\n", "nan at row 1, column 2"),
        ("k.mtx", "no matrix\n", "k.mtx is no matrix; allowed: %%MatrixMarket"),
        ("k.npy", "no array", "an array of real numbers as numpy.save"),
    ],
)
def test_what_is_no_matrix_is_refused(tmp_path, name, content, words):
    (tmp_path / name).write_text(content)
    with pytest.raises(RefusedError, match=words):
        read_matrix(tmp_path / name)
    with pytest.raises(RefusedError, match=f"missing{tmp_path.joinpath(name).suffix}"):
        read_matrix(tmp_path / f"missing{tmp_path.joinpath(name).suffix}")


def refuse_calls(*_, **__):
    raise AssertionError("a library was handed a file that is not checked")


@pytest.fixture(autouse=True)
def _no_library_reads(monkeypatch):
    monkeypatch.setattr(scipy.io, "mmread", refuse_calls)
    monkeypatch.setattr(scipy.sparse, "load_npz", refuse_calls)
    monkeypatch.setattr(np, "load", refuse_calls)


def random_sparse(rng, *, is_square):
    rows = int(rng.integers(1, 12))
    columns = rows if is_square else int(rng.integers(1, 12))
    values = rng.normal(size=(rows, columns)) * (rng.uniform(size=(rows, columns)) < 0.3)
    return scipy.sparse.coo_matrix(values)


@pytest.mark.parametrize("symmetry", ["general", "symmetric"])
@pytest.mark.parametrize("field", ["real", "integer"])
@pytest.mark.parametrize("is_dense", [False, True])
def test_files_of_scipy_give_the_matrices_that_it_reads(
    tmp_path, monkeypatch, rng, symmetry, field, is_dense
):
    matrix = random_sparse(rng, is_square=symmetry != "general")
    if field == "integer":
        matrix = scipy.sparse.coo_matrix(np.rint(5 * matrix.toarray()).astype(int))
    if symmetry != "general":
        matrix = scipy.sparse.coo_matrix(matrix + matrix.T)
    path = tmp_path / "k.mtx"
    written = matrix.toarray() if is_dense else matrix
    scipy.io.mmwrite(path, written, field=field, symmetry=symmetry, comment="one\ntwo")
    monkeypatch.undo()
    expected = scipy.io.mmread(path)
    if scipy.sparse.issparse(expected):
        expected = expected.toarray()
    assert np.array_equal(read_matrix(path), expected)


@pytest.mark.parametrize("form", ["csr", "csc", "coo"])
def test_sparse_matrices_of_each_form_are_read(tmp_path, rng, form):
    matrix = random_sparse(rng, is_square=False).asformat(form)
    for is_compressed in (False, True):
        scipy.sparse.save_npz(tmp_path / "k.npz", matrix, compressed=is_compressed)
        assert np.array_equal(read_matrix(tmp_path / "k.npz"), matrix.toarray())


HEAD = "%%MatrixMarket matrix coordinate real general\n"


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (HEAD + "2 2 1\n3 1 5.0\n", "index 3 of rows, counted from 1; allowed: .* from 1 to 2"),
        (HEAD + "2 2 1\n3 1 5.0\n", "the file states 2 × 2: mend the line of sizes, or the index"),
        (HEAD + "2 2 1\n1 0 5.0\n", "index 0 of columns, .* count from 0 need 1 added"),
        (
            HEAD.replace("general", "symmetric") + "2 2 3\n1 1 5.0\n2 1 1.0\n1 2 1.0\n",
            "write general in the first line, or leave one triangle out",
        ),
        (HEAD.replace("general", "symmetric") + "2 3 1\n1 1 5.0\n", "mend the line of sizes"),
        (HEAD + "2 2 1\n1 1 5,0\n", "write decimal points"),
        (HEAD + "2 2 1\n1 1 5D3\n", "1e3 in place of 1D3"),
        (HEAD + "2 2\n1 1 5.0\n", "as 18 18 42 for 18 rows, 18 columns and 42 entries"),
        (HEAD.replace("general", "symetric") + "1 1 1\n1 1 5.0\n", "mend or write the first line"),
        (HEAD + "2 2 1\n1 1.5 5.0\n", "index 1.5 of columns"),
        (HEAD + "2 2 1\n1 -1 5.0\n", "index -1 of columns"),
        (HEAD + "2 2 1\n1 1 5.0x\n", "with '1 1 5.0x'"),
        (HEAD + "2 2 1\n1 1 nan\n", "with '1 1 nan'"),
        (HEAD + "2 2 1\n1 1 1e\n", "could not convert string to float"),
        (HEAD + "2 2 2\n1 1 5.0\n", "of 1 entries, where its line of sizes states 2; .* mend the last number"),
        (HEAD + "2 2 -1\n1 1 5.0\n", "sizes .* whole numbers"),
        (HEAD + "900000000 900000000 1\n1 1 5.0\n", "900000000 × 900000000; allowed: up to 5000"),
        (HEAD + "2 2 99999999999999\n1 1 5.0\n", "of 1 entries, where its line of sizes states 99999999999999"),
        (HEAD.replace("real", "complex") + "1 1 1\n1 1 1 0\n", "coordinate complex"),
        (HEAD, "sizes"),
    ],
)  # fmt: skip
def test_texts_that_contradict_themselves_are_refused(tmp_path, text, words):
    path = tmp_path / "k.mtx"
    path.write_text(text)
    with pytest.raises(RefusedError, match=words):
        read_matrix(path)


@pytest.mark.parametrize(
    ("key", "values", "words"),
    [
        ("indices", [0, 3, 1, 2, 0], "index 4 of columns"),
        ("indices", [0, -1, 1, 2, 0], "index 0 of columns"),
        ("indices", [0, 1], "different lengths"),
        ("indptr", [0, 2, 1, 5], "pointers that do not rise"),
        ("indptr", [0, 2, 4, 900000000], "pointers that do not rise"),
        ("indptr", [0, 1, 2, 3, 5], "index 4 of rows"),
        ("shape", [900000000, 900000000], "up to 5000"),
        ("shape", [3, 3, 3], "of 3 sides"),
        ("format", b"bsr", r"of form bsr; .* matrix\.tocsr"),
    ],
)  # fmt: skip
def test_sparse_arrays_that_contradict_one_another_are_refused(tmp_path, key, values, words):
    arrays = {
        "format": b"csr",
        "shape": [3, 3],
        "data": np.ones(5),
        "indices": [0, 1, 1, 2, 0],
        "indptr": [0, 2, 4, 5],
    }
    np.savez(tmp_path / "k.npz", **arrays)
    assert read_matrix(tmp_path / "k.npz").sum() == 5
    np.savez(tmp_path / "k.npz", **(arrays | {key: values}))
    with pytest.raises(RefusedError, match=words):
        read_matrix(tmp_path / "k.npz")


@pytest.mark.parametrize("ending", ["npy", "npz"])
@pytest.mark.parametrize("shape", ["(9, 9)", "(3, 2)", "(30000, 30000)", "(-3, -3)", "(3,)*99"])
def test_a_head_that_promises_other_numbers_than_follow_is_refused(tmp_path, ending, shape):
    np.save(tmp_path / "k.npy", np.ones((3, 3)))
    content = (tmp_path / "k.npy").read_bytes()
    start, end = content.index(b"(3, 3)"), content.index(b"\n")
    head = content[:start] + shape.encode() + b", }"
    content = head.ljust(end) + content[end:]
    if ending == "npy":
        (tmp_path / "k.npy").write_bytes(content)
    else:
        with ZipFile(tmp_path / "k.npz", "w") as archive:
            archive.writestr("k.npy", content)
    with pytest.raises(RefusedError, match=r"of shape|bytes, where its head states|unreadable"):
        read_matrix(tmp_path / f"k.{ending}")


def test_objects_are_no_matrix_and_no_pickle_is_read(tmp_path):
    np.save(tmp_path / "k.npy", np.array([None, 1.0], object), allow_pickle=True)
    np.savez(tmp_path / "k.npz", k=np.array([None, 1.0], object))
    for name in ("k.npy", "k.npz"):
        with pytest.raises(RefusedError, match="object of shape"):
            read_matrix(tmp_path / name)


@pytest.mark.parametrize(
    ("array", "cure"),
    [
        (MATRIX[np.newaxis], r"save two dimensions, as array\[0\]"),
        (MATRIX + 1j, "save its real part"),
        (MATRIX.astype(object), "save numbers"),
        (np.where(MATRIX == 0, np.nan, MATRIX), "write finite numbers there"),
    ],
)
def test_arrays_that_are_no_matrix_tell_their_cure(tmp_path, array, cure):
    np.save(tmp_path / "k.npy", array, allow_pickle=True)
    with pytest.raises(RefusedError, match=cure):
        read_matrix(tmp_path / "k.npy")


def test_a_matrix_larger_than_the_unknowns_is_refused(tmp_path):
    for name, write in WRITE.items():
        write(tmp_path / name)
        assert read_matrix(tmp_path / name, max_rows=3).shape == (3, 3)
        with pytest.raises(RefusedError, match="3 × 3; allowed: up to 2 rows"):
            read_matrix(tmp_path / name, max_rows=2)


def test_an_archive_that_unpacks_to_more_than_memory_is_refused(tmp_path, monkeypatch):
    np.savez_compressed(tmp_path / "k.npz", k=np.zeros((200, 200)))
    assert read_matrix(tmp_path / "k.npz").shape == (200, 200)
    monkeypatch.setattr(memory, "free_memory", lambda: 1e5)
    with pytest.raises(RefusedError, match=r"takes 0\.00064 GB"):
        read_matrix(tmp_path / "k.npz")
