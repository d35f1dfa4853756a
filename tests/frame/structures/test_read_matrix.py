"""Matrices from files of every kind that is read, and files that are refused."""

from zipfile import ZipFile

import numpy as np
import pytest
import scipy.io
import scipy.sparse

from alphacut.base import memory
from alphacut.frame import read_matrix
from alphacut.fuzzy import RefusedError
from tests.refused import refuses

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
        with refuses("both.npz"):
            read_matrix(tmp_path / "both.npz", name=name)


@pytest.mark.parametrize(
    ("name", "content", "key"),
    [
        ("k.txt", "1 2\n", "k.txt"),
        ("k.csv", "1,nan\n", "k.csv"),
        ("k.mtx", "no matrix\n", "k.mtx"),
        ("k.npy", "no array", "k.npy"),
    ],
)
def test_what_is_no_matrix_is_refused(tmp_path, name, content, key):
    (tmp_path / name).write_text(content)
    with refuses(key):
        read_matrix(tmp_path / name)
    missing = f"missing{tmp_path.joinpath(name).suffix}"
    with refuses(missing):
        read_matrix(tmp_path / missing)


def refuse_calls(*_, **__):
    raise AssertionError("a library was handed a file that is not checked")


@pytest.fixture(autouse=True)
def _no_library_reads(monkeypatch):
    monkeypatch.setattr(scipy.io, "mmread", refuse_calls)
    monkeypatch.setattr(scipy.sparse, "load_npz", refuse_calls)


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
    ("text", "key"),
    [
        (HEAD + "2 2 1\n3 1 5.0\n", "k.mtx"),
        (
            HEAD.replace("general", "symmetric") + "2 2 3\n1 1 5.0\n2 1 1.0\n1 2 1.0\n",
            "k.mtx",
        ),
        (HEAD.replace("general", "symmetric") + "2 3 1\n1 1 5.0\n", "k.mtx"),
        (HEAD + "2 2 1\n1 1 5,0\n", "k.mtx"),
        (HEAD + "2 2\n1 1 5.0\n", "k.mtx"),
        (HEAD.replace("general", "symetric") + "1 1 1\n1 1 5.0\n", "k.mtx"),
        (HEAD + "2 2 1\n1 1.5 5.0\n", "k.mtx"),
        (HEAD + "2 2 1\n1 1 5.0x\n", "k.mtx"),
        (HEAD + "2 2 1\n1 1 1e\n", "k.mtx"),
        (HEAD + "2 2 2\n1 1 5.0\n", "k.mtx"),
        (HEAD + "2 2 -1\n1 1 5.0\n", "k.mtx"),
        (HEAD + "900000000 900000000 1\n1 1 5.0\n", "k.mtx"),
        (HEAD.replace("real", "complex") + "1 1 1\n1 1 1 0\n", "k.mtx"),
        (HEAD, "k.mtx"),
    ],
)  # fmt: skip
def test_texts_that_contradict_themselves_are_refused(tmp_path, text, key):
    path = tmp_path / "k.mtx"
    path.write_text(text)
    with refuses(key):
        read_matrix(path)


@pytest.mark.parametrize(
    ("key", "values", "words"),
    [
        ("indices", [0, 3, 1, 2, 0], "k.npz"),
        ("indices", [0, 1], "k.npz"),
        ("indptr", [0, 2, 1, 5], "k.npz"),
        ("indptr", [0, 1, 2, 3, 5], "k.npz"),
        ("shape", [900000000, 900000000], "k.npz"),
        ("shape", [3, 3, 3], "k.npz"),
        ("format", b"bsr", "k.npz"),
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
    with refuses(words):
        read_matrix(tmp_path / "k.npz")


@pytest.mark.parametrize("ending", ["npy", "npz"])
@pytest.mark.parametrize("shape", ["(9, 9)", "(3, 2)", "(30000, 30000)", "(-3, -3)"])
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
    with pytest.raises(RefusedError, match=r"k.np[yz]"):
        read_matrix(tmp_path / f"k.{ending}")


@pytest.mark.parametrize(
    ("array", "key"),
    [
        (MATRIX[np.newaxis], "k.npy"),
        (MATRIX + 1j, "k.npy"),
        (MATRIX.astype(object), "k.npy"),  # a pickle, which is never loaded
        (np.where(MATRIX == 0, np.nan, MATRIX), "k.npy"),
    ],
)
def test_arrays_that_are_no_matrix_tell_their_cure(tmp_path, array, key):
    np.save(tmp_path / "k.npy", array, allow_pickle=True)
    with refuses(key):
        read_matrix(tmp_path / "k.npy")


def test_a_matrix_larger_than_the_unknowns_is_refused(tmp_path):
    for name, write in WRITE.items():
        write(tmp_path / name)
        assert read_matrix(tmp_path / name, max_rows=3).shape == (3, 3)
        with refuses(name):
            read_matrix(tmp_path / name, max_rows=2)


def test_an_archive_that_unpacks_to_more_than_memory_is_refused(tmp_path, monkeypatch):
    np.savez_compressed(tmp_path / "k.npz", k=np.zeros((300, 300)))
    assert read_matrix(tmp_path / "k.npz").shape == (300, 300)
    monkeypatch.setattr(memory, "free_memory", lambda: 1e5)
    with refuses("k.npz:k"):
        read_matrix(tmp_path / "k.npz")


@pytest.mark.parametrize(
    ("comment", "factor"),
    [
        ("kN/m", 1000.0),
        ("Stiffness matrix in MN/m", 1000000.0),
        ("units kN and mm", None),
        ("N/mm", None),
        ("unit=N/m", 1.0),
        ("in kN per m", 1000.0),
        ("force unit: kN, length unit: m", 1000.0),
        ("kilonewtons per metre", 1000.0),
        ("MPa", None),
        ("values in 1e6 N/m", None),
        ("x 10^3 N/m", None),
        ("tonnes", 1000.0),
        ("mass in tonnes", 1000.0),
        ("[lb]", None),
        ("mass matrix [t]", 1e3),
        ("mass matrix (kg)", 1.0),
        ("kN/m, masses (kg)", None),
        ("stiffness in kN m^-1", 1e3),
        ("forces kN", 1e3),
        ("rotational stiffness kN·m/rad", 1e3),
        ("N·mm/rad", None),
        ("E = 210 GPa, stiffness N/m", 1.0),
        ("values divided by 1000, N/m", None),
        ("scale factor 1000", None),
        ("in 10⁶ N/m", None),
        ("mass matrix in g", None),
        ("kips, inches", None),
        ("displacements in mm, forces in N", None),
        ("daN/m", None),
        ("flexibility, m/kN", None),
        ("mass in 1000 kg", None),
        ("mass in Mg", 1e3),
        ("weights in kN", None),
        ("mega newton per meter", 1e6),
        ("mass, metric tonne", 1e3),
        ("US customary units", None),
        ("cgs", None),
        ("inverse of the stiffness", None),
        ("half of the matrix", None),
        ("in thousands of N/m", None),
        ("stiffness per cm, kN", None),
        ("compliance", None),
        ("damping ratio in %", None),
        ("masses, metric tons", 1e3),
        ("mass = weight / g", 1.0),
        ("masses of 3 storeys of 12 t each, span 4 m, kN", 1e3),
        ("columns of 2000 kN/m", None),
        ("square root of K", None),
        ("K/1000", None),
        ("K / EI", None),
        ("rigidez en Tn/m", None),
        ("тс/м", None),
        ("K^-1", None),
        ("reduced by factor 10", None),
        ("decanewton", None),
        ("units kN-m-t; 2 % of damping", 1e3),
        ("mass = weight/9.81, t", None),
        ("loads in t/m", None),
        ("E=30 GPa, h=3 m, density 7850 kg/m3, kN", 1e3),
        ("multiply by 1e3 for N/m", None),
        ("stiffness, to be multiplied with 1e6 kN/m", None),
        ("multiply each of the numbers by 9.81", None),
        ("N/m, x 10^5", None),
        ("displacements in m, rotations in rad, forces in kN, moments in kN*m", 1e3),
    ],
)
@pytest.mark.parametrize("name", ["k.csv", "k.mtx", "job.mtx"])
def test_units_in_comments_are_turned_to_si_or_refused(tmp_path, name, comment, factor):
    path = tmp_path / name
    abaqus = "1,1, 1,1, 2\n1,1, 1,2, -1\n1,2, 1,2, 2\n"
    market = f"{HEAD}% {comment}\n2 2 4\n1 1 2\n2 1 -1\n1 2 -1\n2 2 2\n"
    texts = {"k.csv": f"2,-1\n-1,2\n# {comment}\n", "k.mtx": market}
    path.write_text(texts.get(name, f"** {comment}\n{abaqus}"))
    matrix = [[2.0, -1.0], [-1.0, 2.0]]
    if factor is None:
        with pytest.raises(RefusedError):
            read_matrix(path)
        with pytest.warns(UserWarning, match=f"of {name} what it states of its unit"):
            assert read_matrix(path, override=["unit"]).tolist() == matrix
    else:
        assert read_matrix(path) == pytest.approx(factor * np.array(matrix))


def test_units_tell_the_quantity_and_names_of_files_state_none(tmp_path):
    matrix = np.array([[2.0, -1.0], [-1.0, 2.0]])
    np.save(tmp_path / "K_kN_per_m.npy", matrix)
    (tmp_path / "frame MN.csv").write_text(
        "# springs kN/m; rotations kN m/rad; shear kN\n2,-1\n-1,2\n"
    )
    np.savez(tmp_path / "m.npz", M_tonne=matrix)
    np.savez(tmp_path / "n.npz", k=matrix, unit="MN/m")
    (tmp_path / "k.csv").write_text("# damping, kN s/m\n2,-1\n-1,2\n")
    (tmp_path / "s.csv").write_text("# units: kN, m, t\n2,-1\n-1,2\n")
    (tmp_path / "l.csv").write_text("# units kN-m-t\n2,-1\n-1,2\n")
    (tmp_path / "w.csv").write_text("# W [kN]\n2,-1\n-1,2\n")
    (tmp_path / "c.csv").write_text("# lumped mass matrix\n2,-1\n-1,2\n")
    (tmp_path / "r.csv").write_text("# rigidezza, kN su m\n2,-1\n-1,2\n")
    (tmp_path / "f.csv").write_text("# kN s2/m\n2,-1\n-1,2\n")
    np.savez(tmp_path / "p.npz", k=matrix, meta='{"units": "kN/m"}')
    cases = {
        "K_kN_per_m.npy": (1, {"mass", "stiffness", "damping"}),
        "frame MN.csv": (1e3, {"stiffness"}),
        "m.npz": (1e3, {"mass"}),
        "n.npz": (1e6, {"stiffness"}),
        "k.csv": (1e3, {"damping"}),
        "s.csv": (1e3, {"mass", "stiffness", "damping"}),
        "l.csv": (1e3, {"mass", "stiffness", "damping"}),
        "w.csv": (1e3, set()),
        "c.csv": (1, {"mass"}),
        "r.csv": (1e3, {"stiffness"}),
        "f.csv": (1e3, {"mass"}),
        "p.npz": (1e3, {"stiffness"}),
    }
    for name, (factor, quantities) in cases.items():
        member = "k" if name in ("n.npz", "p.npz") else ""
        for quantity in ("mass", "stiffness", "damping"):
            if quantity in quantities:
                array = read_matrix(tmp_path / name, name=member, quantity=quantity)
                assert array == pytest.approx(factor * matrix)
            else:
                with refuses(name):
                    read_matrix(tmp_path / name, name=member, quantity=quantity)


@pytest.mark.parametrize(
    ("quantity", "comments"),
    [
        ("stiffness", "entries in 1/s^2|s^-2|[rad^2/s^2]|N/(m kg)|rad/s|m/s|kN|unit: m|N/foo|[EU]"),
        ("stiffness", "in Mio. N/m|Tausend N/m|milliers de N/m|×10^6|N/m, Faktor 1000|1/2 K"),
        ("stiffness", "multiply by E|only K/2 stored|times EI|lumped masses; units kN, m"),
        ("mass", "unit s^2|kN|pesi in kN|poids des planchers|Gewichte|mass matrix, kN"),
        ("damping", "2 zeta omega in 1/s|(1/s)"),
    ],
)
def test_units_of_other_quantities_and_factors_are_refused(tmp_path, quantity, comments):
    for comment in comments.split("|"):
        (tmp_path / "k.csv").write_text(f"# {comment}\n2,-1\n-1,2\n", encoding="utf-8")
        with pytest.raises(RefusedError):
            read_matrix(tmp_path / "k.csv", quantity=quantity)


def test_a_unit_in_a_script_that_is_not_known_is_refused(tmp_path):
    (tmp_path / "k.csv").write_text("# 킬로뉴턴\n2,-1\n-1,2\n", encoding="utf-8")
    with refuses("k.csv, line 1"):
        read_matrix(tmp_path / "k.csv")
