"""Arrays from files of frame programs (Matrix Market, NumPy, CSV), and tables as texts."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from alphacut.fuzzy.arrays import Array
from alphacut.fuzzy.refused import RefusedError, printable, require

ENDINGS = (".mtx", ".npz", ".npy", ".csv")
ALLOWED = "a file .mtx, .npz, .npy or .csv with one array of finite real numbers"


def read_array(path: Path, name: str = "") -> Array:
    """Reads one array of floats, shape (n,) or (n, m), from a file; a sparse one becomes dense.

    `name` chooses one of several arrays in a .npz file.

    Raises:
        RefusedError: The file cannot be read, or holds something else.
    """
    if path.suffix.lower() not in ENDINGS:
        raise RefusedError(path.name, f"of type {path.suffix or 'none'}", ALLOWED)
    try:
        array = np.asarray(_read_by_ending(path, name))
    except RefusedError:
        raise
    except Exception as error:  # whatever the readers of SciPy and NumPy raise
        reason = printable(error, 80) or type(error).__name__
        raise RefusedError(path.name, reason, ALLOWED) from None
    is_finite = array.dtype.kind in "iuf" and bool(np.isfinite(array).all())
    fits = is_finite and array.ndim in (1, 2) and array.size > 0
    require(fits, path.name, "no such array", ALLOWED)
    return array.astype(float)


def _read_by_ending(path: Path, name: str) -> Array:
    """The array in a .mtx, .csv, .npy or .npz file; `name` chooses one of several in a .npz."""
    import scipy.io
    import scipy.sparse

    kind = path.suffix.lower()
    if kind == ".mtx":
        array = scipy.io.mmread(path)
        return np.asarray(array.toarray() if scipy.sparse.issparse(array) else array)
    if kind == ".csv":
        return np.loadtxt(path, delimiter=",", ndmin=2, encoding="utf-8-sig")
    if kind == ".npy":
        return np.asarray(np.load(path, allow_pickle=False))
    with np.load(path, allow_pickle=False) as file:
        names = file.files
        if {"format", "data", "shape"} <= set(names):
            return np.asarray(scipy.sparse.load_npz(path).toarray())
        chosen = [x for x in names if not name or x == name]
        if len(chosen) != 1:
            what = f"array {name or 'not named'}"
            raise RefusedError(path.name, what, f"{path.name}:NAME, one of {', '.join(names)}")
        return np.asarray(file[chosen[0]])


def text_table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Lines of a table of texts: the first column to the left, the others to the right."""
    lines = [[*head], *map(list, rows)]
    first, *further_widths = (max(len(line[k]) for line in lines) for k in range(len(head)))
    aligned = ([line[0].ljust(first), *map(str.rjust, line[1:], further_widths)] for line in lines)
    return "".join(f"{'  '.join(line).rstrip()}\n" for line in aligned)
