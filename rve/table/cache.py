"""Tables on disk, one NumPy archive each, named by the hash of its origin."""

from __future__ import annotations

import hashlib
import json
import os
import tempfile
from collections.abc import Callable
from dataclasses import asdict
from functools import cache
from pathlib import Path
from zipfile import BadZipFile

import numpy as np

from alphacut.rve.ranks import ALONE, Ranks
from alphacut.rve.solver.integrals import MADE_BY, version_of
from alphacut.rve.table.build import PlanarSource, Source, build_table
from alphacut.rve.table.interpolant import Table, TableRange

# The code a table comes from.
_PROGRAMS = ["bounds.py", "cell.py", "square.py", "solver/*.c", "spheres/**/*.py"]
_PROGRAMS += [f"{room}/*.py" for room in ("mesh", "planar", "series", "slices", "solver", "table")]
_PACKAGES = "numpy", "scipy", "cvxopt", "petsc4py", "gmsh", *MADE_BY


def table_key(span: TableRange, *, accuracy: float, source: str) -> str:
    """Hash of range, accuracy, source, code and package versions."""
    asked = {"span": asdict(span), "accuracy": accuracy, "source": source, "made by": _provenance()}
    return hashlib.sha256(json.dumps(asked, sort_keys=True).encode()).hexdigest()[:24]


@cache
def _provenance() -> str:
    here = Path(__file__).parents[1]
    code = hashlib.sha256()
    for pattern in _PROGRAMS:
        for path in sorted(here.glob(pattern)):
            code.update(path.read_bytes())
    return f"{code.hexdigest()} {[f'{name} {version_of(name)}' for name in _PACKAGES]}"


def stored_table(
    span: TableRange,
    folder: Path | None,
    *,
    accuracy: float,
    make: Callable[[TableRange, float], Source] = PlanarSource,
    progress: Callable[[float], None] | None = None,
    ranks: Ranks = ALONE,
) -> tuple[Table, bool]:
    """The table from `folder`, or made and put there; and the truth of "it was there".

    `ranks` share the making; the first of them reads and writes.

    Raises:
        TableError: The accuracy is not reached.
    """
    key = table_key(span, accuracy=accuracy, source=getattr(make, "func", make).__name__)
    file = folder / f"table-{key}.npz" if folder else None
    found = ranks.first(lambda: _in_process.get(key) or (_read(file, span) if file else None))
    fresh = found or build_table(span, accuracy=accuracy, make=make, progress=progress, ranks=ranks)
    if file and not found:
        ranks.first(lambda: _write(fresh, file))
    _in_process[key] = fresh
    return fresh, found is not None


_in_process: dict[str, Table] = {}  # by key, so what is found is what would be made


def _write(table: Table, path: Path) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    about = {
        "mesh_size": table.mesh_size,
        "unknowns": table.unknowns,
        "systems": table.systems,
        "seconds": table.seconds,
    }
    handle, partial = tempfile.mkstemp(dir=path.parent, prefix=path.stem, suffix=".partial")
    try:
        with os.fdopen(handle, "wb") as file:
            np.savez(
                file,
                coefficients=table.coefficients,
                space=table.space,
                about=np.array(json.dumps(about)),
            )
        Path(partial).replace(path)
    except BaseException:
        Path(partial).unlink(missing_ok=True)
        raise


def _read(path: Path, span: TableRange) -> Table | None:
    """The table at `path`; None if there is none or it cannot be read."""
    try:
        with np.load(path, allow_pickle=False) as archive:
            return Table(
                span, archive["coefficients"], archive["space"], **json.loads(str(archive["about"]))
            )
    except (OSError, ValueError, KeyError, TypeError, EOFError, BadZipFile):
        return None
