"""Stiffness and mass matrices in files .full of Ansys MAPDL, by ansys-mapdl-reader.

Its compiled code follows the lengths, pointers and indices in a file wherever they lead, so that it
reads in a process of its own. The items of the heads are those of Ansys's fdfull.inc.
"""

from __future__ import annotations

import warnings
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from alphacut.base.apart import read_apart
from alphacut.base.array_files import Numbers
from alphacut.base.arrays import Ints
from alphacut.base.errors import require
from alphacut.base.extras import extra_named
from alphacut.frame.structures.entry_lists import NamedMatrix, chosen_place
from alphacut.frame.structures.matrix_market import require_size

DIRECTIONS = ("UX", "UY", "UZ", "ROTX", "ROTY", "ROTZ")
"""Names of directions by their numbers in a file, from 1 on."""


def read_full(path: Path, *, member: str, max_rows: int) -> NamedMatrix:
    """Return the stiffness or the mass in a .full file, with unknowns as "12.UX".

    Unknowns that a boundary condition holds are left out. The unknowns have no names where some
    nodes have fewer directions than others, since the file does not say which.

    Args:
        path: The file.
        member: "K" for the stiffness, "M" for the mass.
        max_rows: Largest number of unknowns, those that are held included.

    Raises:
        RefusedError: ansys-mapdl-reader is not installed; another member is asked for; the matrices
            are too large; or ansys-mapdl-reader cannot read the file, as of lumped or unsymmetric
            matrices, or ends in it.
    """
    chosen_place(path.name, ("K", "M"), member)
    with extra_named(path.name):
        if find_spec("ansys.mapdl.reader") is None:
            raise ModuleNotFoundError(name="ansys")
    read = read_apart(
        "alphacut.frame.structures.mapdl:arrays_of_full",
        path,
        library="ansys-mapdl-reader",
        options={"member": member.upper(), "max_rows": max_rows},
    )
    array = np.asarray(read["matrix"], float)
    array += np.triu(array, 1).T
    names: tuple[str, ...] = ()
    if read["is_named"]:
        labels = (*DIRECTIONS, *map(str, range(7, 100)))
        unknowns = np.asarray(read["unknowns"], int)
        names = tuple(f"{node}.{labels[number - 1]}" for node, number in unknowns)
    return NamedMatrix(array, names)


def arrays_of_full(path: Path, *, member: str, max_rows: int) -> dict[str, Numbers]:
    """Return what ansys-mapdl-reader reads from a file: the reader that runs apart.

    Args:
        path: The file.
        member: "K" or "M".
        max_rows: Largest number of unknowns.

    Returns:
        matrix, one triangle of it without rows of unknowns that are held, shape (n, n); unknowns,
        node and direction of each row, shape (n, 2); is_named, whether all nodes have the same
        directions, so that these are known.

    Raises:
        RefusedError: The matrix is too large, is not there, has an index outside of it, or
            disagrees with the counts in the head.
        Exception: Whatever ansys-mapdl-reader raises.
    """
    from ansys.mapdl.reader.full import FullFile

    full = FullFile(path)
    require_size(path.name, (full.neqn, full.neqn), max_rows)
    _require_counts(path, full.read_record(103), member)
    # Behind the head, which begins at word 103, stand the directions that unknowns have.
    _, n_words = full.read_record(103, return_bufsize=True)
    directions = full.read_record(103 + n_words)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of the matrix that a file has not, and nobody asks for
        places, *triangles = full.load_km(sort=False)
    triangle = triangles["KM".index(member)]
    require(triangle is not None, path.name, f"without {member}", "a run that makes it")
    triangle.check_format(full_check=True)
    # Rows of unknowns that are held have zeros alone.
    held = {tuple(place) for place in full.const.tolist()}
    free = [k for k, place in enumerate(places.tolist()) if tuple(place) not in held]
    unknowns = places[free]
    is_named = bool((full.ndof == len(directions)).all())
    if is_named:
        unknowns[:, 1] = directions[unknowns[:, 1]]
    matrix = triangle.toarray()[np.ix_(free, free)]
    return {"matrix": matrix, "unknowns": unknowns, "is_named": np.array(is_named)}


def _require_counts(path: Path, head: Ints, member: str) -> None:
    """Raise RefusedError unless the counts in the head of a file are those of its records.

    Each unknown has a record of the rows of its entries, with a record of as many numbers of eight
    bytes behind it. A record is its length in words of four bytes, a flag, and the words; the
    length stands behind it again.

    Args:
        path: The file.
        head: Items of fdfull.inc, from the first one.
        member: "K" or "M", whose records are counted.
    """
    words = np.fromfile(path, "<i4")

    def length_at(position: int) -> int:
        """Return the number of words in the record there; −1 where there is no whole one."""
        length = int(words[position]) if 0 <= position < len(words) else -1
        end = position + 2 + length
        is_whole = length >= 0 and end < len(words) and words[end] == length
        return length if is_whole else -1

    n_unknowns, n_nodes, first_of_nodes = int(head[1]), int(head[32]), int(head[35])
    first, term_count = (head[18], head[8]) if member == "K" else (head[26], head[33])
    # How many directions each node has.
    directions = words[first_of_nodes + 2 :][: max(length_at(first_of_nodes), 0)]
    agree = len(directions) == n_nodes and int(directions.sum()) == n_unknowns
    n_terms = 0
    position = int(first)
    for _ in range(n_unknowns if agree and term_count else 0):
        length = length_at(position)
        position += length + 3
        agree = agree and length >= 0 and length_at(position) == 2 * length
        position += 2 * length + 3
        n_terms += length
    cure = "let MAPDL write the file anew"
    allowed = "counts of its records"
    require(agree and n_terms == term_count, path.name, "of counts that disagree", allowed, cure)
