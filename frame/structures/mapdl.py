"""Stiffness and mass matrices in files .full of Ansys MAPDL, read by ansys-mapdl-reader.

Its compiled code follows the lengths, pointers and indices in the file wherever they lead, so that
all of these are checked here before. The items of the heads are those of Ansys's fdfull.inc.
"""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np

from alphacut.base.arrays import Ints
from alphacut.base.errors import require
from alphacut.base.extras import extra_named
from alphacut.frame.structures.entry_lists import NamedMatrix, chosen_place
from alphacut.frame.structures.matrix_market import require_size

CURE = "let MAPDL write the file anew"
# Names of directions by their numbers in a file, from 1 on.
DIRECTIONS = ("UX", "UY", "UZ", "ROTX", "ROTY", "ROTZ")
# Flags of a record of integers; those of floats are 0, and others stand for compressed records.
INTEGERS = -(2**31)


def read_full(path: Path, content: bytes, *, member: str, max_rows: int) -> NamedMatrix:
    """Return the stiffness or the mass in a .full file, with unknowns as "12.UX".

    Unknowns that a boundary condition holds are left out. The unknowns have no names where some
    nodes have fewer directions than others, since the file does not say which.

    Args:
        path: The file.
        content: What it holds.
        member: "K" for the stiffness, "M" for the mass.
        max_rows: Largest number of unknowns, those that are held included.

    Raises:
        RefusedError: ansys-mapdl-reader is not installed; another member is asked for; the matrices
            are too large; or the file is damaged or compressed.
        Exception: Whatever ansys-mapdl-reader raises, as for lumped or unsymmetric matrices.
    """
    place = chosen_place(path.name, ("K", "M"), member)
    with extra_named(path.name):
        from ansys.mapdl.reader.full import FullFile
    directions = _require_sound(path.name, content, max_rows=max_rows)
    full = FullFile(path)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of the matrix that a file has not, and nobody asks for
        unknowns, *triangles = full.load_km(sort=False)
    require(triangles[place] is not None, path.name, f"without {member}", "a run that makes it")
    array = triangles[place].toarray()
    array += np.triu(array, 1).T
    # Rows of unknowns that are held have zeros alone.
    held = {tuple(unknown) for unknown in full.const.tolist()}
    free = [k for k, unknown in enumerate(unknowns.tolist()) if tuple(unknown) not in held]
    names: tuple[str, ...] = ()
    if (full.ndof == len(directions)).all():
        labels = [(*DIRECTIONS, *map(str, range(7, 100)))[k - 1] for k in directions]
        names = tuple(f"{node}.{labels[k]}" for node, k in unknowns[free].tolist())
    return NamedMatrix(array[np.ix_(free, free)], names)


def _require_sound(name: str, content: bytes, *, max_rows: int) -> Ints:
    """Check all lengths, pointers and indices of a .full file that reading its matrices follows.

    Args:
        name: Name of the file, for messages.
        content: The file, of words of four bytes in little-endian order.
        max_rows: Largest number of unknowns.

    Returns:
        The numbers of the directions that unknowns have, from 1 on, in the order of each node.

    Raises:
        RefusedError: A record is cut off, compressed, or contradicts another; an index is out of
            range; two entries have one place; or there are too many unknowns.
    """
    words = np.frombuffer(content[: len(content) // 4 * 4], "<i4")

    def record(place: int, flags: int = INTEGERS) -> tuple[Ints, int]:
        """Return the words of the record at a place, and the place behind it."""
        # A record is its length in words, its flags, its words, and its length again.
        end = place + 3
        if 0 <= place < len(words):
            end += abs(int(words[place]))
        is_whole = place >= 0 and end <= len(words) and words[end - 1] == end - place - 3
        is_whole = is_whole and words[place] == words[end - 1] and words[place + 1] == flags
        cure = "write it anew, without compression (/FCOMP)"
        require(is_whole, name, f"damaged or cut off at word {place}", "whole records", cure)
        return words[place + 2 : end - 1], end

    _, place = record(0)
    head, place = record(place)
    head = np.append(head, np.zeros(40, np.int32))  # a short head states zeros
    n = int(head[1])
    require_size(name, (n, n), max_rows)
    directions, place = record(place)
    nodes, _ = record(place)
    counts, place = record(int(head[35]))
    held, _ = record(place)
    is_sound = len(counts) <= len(nodes) and len(held) == n == counts.sum(dtype=np.int64)
    is_sound = is_sound and bool(((counts >= 0) & (counts <= len(directions))).all())
    # Sizes and pointers beyond 2^31, and directions that no program has.
    is_sound = is_sound and not head[[9, 19, 21, 27, 36]].any() and directions.min() > 0
    require(is_sound, name, "of nodes that do not fit its unknowns", "whole records", CURE)

    # Each column of one triangle is a record of its rows, from 1 on, and one of its entries. The
    # triangle is that of MAPDL's own order of equations, so that rows lie on both sides of it. The
    # items of the head are the place and the number of entries of the stiffness, and of the mass.
    for pointer, n_entries in ((18, 8), (26, 33)):
        place = int(head[pointer])
        pairs: list[Ints] = []
        for column in range(1, n + 1) if head[n_entries] else ():
            rows, place = record(place)
            values, place = record(place, 0)
            is_sound = 2 * len(rows) == len(values) and bool(((rows >= 1) & (rows <= n)).all())
            require(is_sound, name, f"damaged in column {column}", "a row of each entry", CURE)
            pairs.append(np.minimum(rows, column) * n + np.maximum(rows, column))
        found = np.concatenate([*pairs, np.empty(0, int)])
        is_sound = len(np.unique(found)) == len(found) == head[n_entries]
        require(is_sound, name, f"of {len(found)} entries", f"{head[n_entries]}", CURE)
    return directions
