"""Matrices of a frame program, from files of Matrix Market, NumPy, SciPy or CSV."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from alphacut.base.arrays import Array
from alphacut.base.errors import RefusedError, printable, require

ENDINGS = (".mtx", ".npz", ".npy", ".csv")
ALLOWED = "a file .mtx, .npz, .npy or .csv with one array of finite real numbers"


def read_matrix(path: str | Path, *, name: str = "") -> Array:
    """Read a matrix, as of masses or stiffnesses, from a file; a sparse one becomes dense.

    Args:
        path: File of Matrix Market (.mtx), of `scipy.sparse.save_npz` or `numpy.savez` (.npz), of
            `numpy.save` (.npy), or of numbers between commas (.csv).
        name: Name of the array in a .npz file of several.

    Returns:
        The matrix, shape (n, m); or a vector, shape (n,), where the file has one.

    Raises:
        RefusedError: The file cannot be read, or holds something else.

    Example:
        >>> read_matrix("cases/plane-frame/stiffness1.mtx").shape
        (18, 18)
    """
    file = Path(path)
    if file.suffix.lower() not in ENDINGS:
        raise RefusedError(file.name, f"of type {file.suffix or 'none'}", ALLOWED)
    try:
        array = np.asarray(_read_by_ending(file, name))
    except RefusedError:
        raise
    except Exception as error:  # whatever the readers of SciPy and NumPy raise
        reason = printable(error, 80) or type(error).__name__
        raise RefusedError(file.name, reason, ALLOWED) from None
    is_finite = array.dtype.kind in "iuf" and bool(np.isfinite(array).all())
    fits = is_finite and array.ndim in (1, 2) and array.size > 0
    require(fits, file.name, value="no such array", allowed=ALLOWED)
    return array.astype(float)


def _read_by_ending(path: Path, name: str) -> Array:
    """Return the array in a file; `name` chooses one of several in a .npz file."""
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
