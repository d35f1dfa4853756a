"""Files that Nastran and MAPDL wrote, which the packages that read them bring; and CalculiX's own."""

import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import scipy.io
import scipy.linalg

from alphacut.frame import read_matrix, read_unknowns
from alphacut.fuzzy import RefusedError

DMIG = """$ a matrix of three unknowns
GRID,11,,1.0,0.0,0.0
DMIG    KAAX           0       6       2       0
DMIG*   KAAX                          11               1
*                     11               1 4.000000000D+00
DMIG*   KAAX                          11               5
*                     11               1-1.500000000D+00
*                     11               5 3.000000000D+00
DMIG    KAAX           7       0              11       1   2.5-1
+              7       0     2.0
DMIG,MAAX,0,1,1,0
DMIG,MAAX,7,0,,7,0,5.0
ENDDATA
"""
STIFFNESS = [[2, 0.25, 0], [0.25, 4, -1.5], [0, -1.5, 3]]


def nastran_files():
    """The folder of files that pyYeti's tests read."""
    pyyeti = pytest.importorskip("pyyeti")
    return Path(pyyeti.__file__).parent / "tests"


@pytest.fixture
def punch(tmp_path):
    """A file of two matrices in cards of all three layouts."""
    pytest.importorskip("pyyeti")
    path = tmp_path / "job.pch"
    path.write_text(DMIG)
    return path


def test_dmig_cards_name_unknowns_by_grid_and_component(punch):
    names = read_unknowns(punch, name="kaax")
    assert names == ("7.0", "11.1", "11.5")
    assert np.array_equal(read_matrix(punch, name="KAAX"), STIFFNESS)
    mass = read_matrix(punch, name="MAAX", unknowns=names)
    assert np.array_equal(mass, np.diag([5.0, 0, 0]))
    with pytest.raises(RefusedError, match=r"with 2 matrices; allowed: .*, one of KAAX, MAAX"):
        read_matrix(punch)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("DMIG*   KAAX                          11               5", "DMIX*   KAAX    ", "damaged"),
        ("*                     11               5", "j                     11     5", "damaged"),
        ("\nENDDATA\n", "", "cut off|damaged|entries"),
        ("3.000000000D+00", "3.000000000X+00", "could not convert"),
        ("3.000000000D+00", "3_0.00000000D+0", "damaged"),
        ("0       6", "0       2", "of form 2"),
        ("6       2", "6       3", "type 3"),
        ("+              7       0     2.0", "+             11       1     2.0", "2 entries|without"),
        ("                     11               5 3.", "                   11.5               5 3.",
         "whole numbers"),
    ],
)  # fmt: skip
def test_damaged_cards_are_refused_and_not_left_out(punch, old, new, message):
    assert old in DMIG
    punch.write_text(DMIG.replace(old, new))
    with pytest.raises(RefusedError, match=message):
        read_matrix(punch, name="KAAX")


def test_a_missing_library_is_one_line_with_the_command_of_pip(tmp_path, monkeypatch):
    of_mapdl = ("ansys", "ansys.mapdl", "ansys.mapdl.reader")  # which earlier tests may import
    for module in ("pyyeti.nastran.bulk", "pyyeti.nastran.op4", *of_mapdl):
        monkeypatch.setitem(sys.modules, module, None)
    extras = {"job.pch": "nastran", "job.op4": "nastran", "job.full:K": "mapdl"}
    for name, extra in extras.items():
        file, _, member = name.partition(":")
        (tmp_path / file).write_text(DMIG)
        with pytest.raises(RefusedError, match=rf"pip install 'alphacut\[{extra}\]'$"):
            read_matrix(tmp_path / file, name=member)


def test_cards_of_nastran_are_read_to_equal_digits():
    path = nastran_files() / "nastran_dmig_data" / "matrix_factory.pch"
    text = path.read_text()
    cards = re.findall(r"DMIG\*   RANDM +(\d+) +(\d)\n((?:\*.*\n)+)", text)
    entries = {
        (f"{row[8:24].strip()}.{row[24:40].strip()}", f"{node}.{component}"): float(
            row[40:56].replace("D", "E")
        )
        for node, component, rows in cards
        for row in rows.splitlines()
    }
    names = read_unknowns(path, name="RANDM")
    matrix = read_matrix(path, name="RANDM")
    assert {pair: matrix[names.index(pair[0]), names.index(pair[1])] for pair in entries} == entries
    assert np.count_nonzero(matrix) == len(entries) == 441


@pytest.mark.parametrize("layout", ["dense", "bigmat", "nonbigmat"])
@pytest.mark.parametrize("kind", ["ascii", "ascii_d", "ascii_i64", "le", "be", "le_i64", "be_i64"])
def test_output4_of_nastran_is_read_to_equal_digits(layout, kind):
    folder = nastran_files() / "nastran_op4_data"
    expected = scipy.io.loadmat(folder / "r_c_rc.mat")["rmat"]
    path = folder / f"double_{layout}_{kind}.op4"
    if "ascii" in kind:  # whose first line ends by the number of digits behind the point, as 5E16.9
        digits = path.read_text().partition("\n")[0].rpartition(".")[2].partition("|")[0]
        expected = np.vectorize(lambda x: float(f"{x:.{digits.strip()}e}"))(expected)
    assert np.array_equal(read_matrix(path, name="RMAT"), expected)
    with pytest.raises(RefusedError, match="with a complex cmat"):
        read_matrix(path, name="cmat")


def test_output4_that_is_cut_off_or_too_large_is_refused(tmp_path):
    folder = nastran_files() / "nastran_op4_data"
    for name in ("double_dense_ascii.op4", "double_dense_le.op4"):
        content = (folder / name).read_bytes()
        for fraction in (0.2, 0.5, 0.99):
            (tmp_path / name).write_bytes(content[: int(fraction * len(content))])
            with pytest.raises(RefusedError, match=name):
                read_matrix(tmp_path / name, name="rmat")
    with pytest.raises(RefusedError, match=r"is 19 × 10000001; allowed: up to 5000"):
        read_matrix(folder / "nas_large_dim_bigmat_binary.op4", name="matd")


def test_a_full_file_of_mapdl_is_read_to_equal_digits():
    reader = pytest.importorskip("ansys.mapdl.reader")
    path = Path(reader.__file__).parent / "examples" / "file.full"
    places, stiffness, _ = reader.read_binary(str(path)).load_km(as_sparse=False, sort=True)
    upper = dict(zip(map(tuple, places.tolist()), range(len(places)), strict=True))
    names = read_unknowns(path, name="K")
    matrix = read_matrix(path, name="K")
    assert len(names) == 900
    assert names[:2] == ("63.UX", "63.UY")
    nodes = (name.split(".") for name in names)
    order = [upper[int(node), ("UX", "UY", "UZ").index(label)] for node, label in nodes]
    expected = np.triu(stiffness) + np.triu(stiffness, 1).T
    assert np.array_equal(matrix, expected[np.ix_(order, order)])
    mass = read_matrix(path, name="M", unknowns=names)
    lowest = scipy.linalg.eigh(matrix, mass, subset_by_index=(0, 1), eigvals_only=True)
    assert lowest[1] == pytest.approx(lowest[0])  # the square beam bends alike in two directions
    with pytest.raises(RefusedError, match="one of K, M"):
        read_matrix(path)


# Words of the head: counts of unknowns, entries and nodes, and pointers; 538 is of the first column.
DAMAGED_COUNTS = [
    (106, 962), (113, 39022), (113, 39023 - 963), (113, 2**31 - 1), (123, 0),
    (137, 320), (138, 17792), (140, 0), (536, 2),
]  # fmt: skip


@pytest.mark.parametrize(
    ("place", "value", "words"),
    [
        (106, 10**6, "1000000 × 1000000; allowed: up to 5000"),
        *((place, value, "counts that disagree") for place, value in DAMAGED_COUNTS),
        (123, -1, "format requires"),
        (138, 0, "without M"),
    ],
)
def test_a_damaged_full_file_ends_no_process_but_its_own(tmp_path, place, value, words):
    """Counts and pointers in the head that lead out of the file."""
    reader = pytest.importorskip("ansys.mapdl.reader")
    file = np.fromfile(Path(reader.__file__).parent / "examples" / "file.full", "<i4")
    file[place] = value
    file.tofile(tmp_path / "file.full")
    with pytest.raises(RefusedError, match=words) as caught:
        read_matrix(tmp_path / "file.full", name="M" if place == 138 else "K")
    assert len(str(caught.value).splitlines()) == 1


BEAM = """*NODE, NSET=ALL
1, 0, 0, 0
2, 1, 0, 0
3, 1, 1, 0
4, 0, 1, 0
5, 0, 0, 2
6, 1, 0, 2
7, 1, 1, 2
8, 0, 1, 2
*ELEMENT, TYPE=C3D8, ELSET=BOX
1, 1, 2, 3, 4, 5, 6, 7, 8
*MATERIAL, NAME=STEEL
*ELASTIC
2.1e11, 0.3
*DENSITY
7800
*SOLID SECTION, ELSET=BOX, MATERIAL=STEEL
*BOUNDARY
1, 1, 3
2, 1, 3
3, 1, 3
4, 1, 3
*STEP
*FREQUENCY, SOLVER=MATRIXSTORAGE
2
*END STEP
"""


def test_matrices_that_calculix_writes_give_its_frequencies(tmp_path):
    program = shutil.which("ccx")
    if program is None:
        pytest.skip("calculix-ccx is not installed")
    for folder, solver in (("matrices", "SOLVER=MATRIXSTORAGE"), ("modes", "SOLVER=SPOOLES")):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "box.inp").write_text(BEAM.replace("SOLVER=MATRIXSTORAGE", solver))
        subprocess.run([program, "box"], cwd=tmp_path / folder, capture_output=True, check=False)
    names = read_unknowns(tmp_path / "matrices" / "box.sti")
    assert len(names) == 12
    stiffness = read_matrix(tmp_path / "matrices" / "box.sti", unknowns=names)
    mass = read_matrix(tmp_path / "matrices" / "box.mas", unknowns=names)
    lowest = scipy.linalg.eigh(stiffness, mass, subset_by_index=(0, 1), eigvals_only=True)
    table = (tmp_path / "modes" / "box.dat").read_text()
    rows = re.findall(r"^ +\d+ +(0\.\d+E[+-]\d+)", table, re.MULTILINE)
    assert lowest == pytest.approx([float(x) for x in rows[:2]], rel=1e-6)
