"""Matrix files that are cut off: what is left of them is not read as another matrix."""

import numpy as np
import pytest
import scipy.io

from alphacut.frame import read_matrix
from alphacut.fuzzy import RefusedError
from tests.frame.structures.test_entry_lists import NAMES, abaqus_text, calculix
from tests.frame.structures.test_program_files import DMIG


def spring_chain(rng, size):
    """A positive definite matrix with entries beside the diagonal, of values of many digits."""
    matrix = np.diag(rng.uniform(3e6, 9e6, size))
    beside = -rng.uniform(1e5, 1e6, size - 1)
    return matrix + np.diag(beside, 1) + np.diag(beside, -1)


def written(folder, kind, matrix):
    """A file of the matrix as a program writes it."""
    names = [f"{node}.{direction}" for node in range(1, len(matrix)) for direction in (1, 2)]
    path = folder / f"job.{kind}"
    if kind in ("sti", "mas"):
        return calculix(folder, matrix, names[: len(matrix)], ending=kind)
    if kind == "pch":
        pytest.importorskip("pyyeti")
        path.write_text(DMIG.replace("DMIG,MAAX,0,1,1,0\nDMIG,MAAX,7,0,,7,0,5.0\n", ""))
    elif kind == "mtx":
        path.write_text(abaqus_text(matrix, names[: len(matrix)]))
    else:
        path = folder / "market.mtx"
        scipy.io.mmwrite(path, scipy.sparse.coo_array(matrix))
    return path


@pytest.mark.parametrize("kind", ["mtx", "sti", "mas", "pch", "market"])
def test_a_file_that_is_cut_off_is_refused_or_names_fewer_unknowns(tmp_path, rng, kind):
    path = written(tmp_path, kind, spring_chain(rng, 5))
    content = path.read_bytes()
    whole = read_matrix(path)
    n_read = 0
    for place in range(len(content)):
        path.write_bytes(content[:place])
        try:
            matrix = read_matrix(path)
        except RefusedError:
            continue
        # What is cut off between lines may be a whole matrix of fewer unknowns, and never of other
        # numbers. A case compares the unknowns of its files.
        n_read += 1
        assert content[place - 1 : place] == b"\n"
        if kind == "pch":  # whose names are sorted otherwise
            assert np.isin(matrix, whole).all()
        else:
            assert np.array_equal(matrix, whole[: len(matrix), : len(matrix)])
            assert len(matrix) < len(whole)
    assert n_read < len(whole) + 2


@pytest.mark.parametrize("kind", ["mtx", "sti", "mas", "pch", "market"])
def test_a_file_without_its_last_line_feed_is_one_line_with_a_cure(tmp_path, rng, kind):
    path = written(tmp_path, kind, spring_chain(rng, 4))
    path.write_bytes(path.read_bytes().rstrip(b"\n"))
    message = r"is cut off at '.*'; allowed: a last line that ends .*; load it anew .* line feed$"
    with pytest.raises(RefusedError, match=message):
        read_matrix(path)


def test_names_of_unknowns_without_the_last_line_feed_are_refused(tmp_path):
    path = calculix(tmp_path)
    beside = path.with_suffix(".dof")
    beside.write_text(beside.read_text()[:-1])
    with pytest.raises(RefusedError, match=r"beam.dof is cut off at '10.1'"):
        read_matrix(path)
    beside.write_text("".join(f"{name}\n" for name in NAMES))
    assert read_matrix(path).shape == (3, 3)
