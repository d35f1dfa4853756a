"""Stored results: datasets and the summary of a run."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from alphacut.fuzzy.refused import RefusedError, require
from alphacut.io.files import Document, whole_file
from alphacut.io.provenance import FORMAT, door

if TYPE_CHECKING:
    import xarray

NEEDED = {
    "case": str,
    "title": str,
    "case_text": str,
    "command": str,
    "versions": dict,
    "seconds": float,
    "fingerprints": dict,
}
"""Entries of summary.json that every reader needs, with their types."""


def require_known(facts: Mapping[str, object], path: Path) -> None:
    """Refuses a format that this program does not know.

    Args:
        facts: Attributes of the file.
        path: The file.

    Raises:
        RefusedError: The format is another one.
    """
    version = facts.get("format_version", FORMAT)
    cure = f"make it anew by {door('run', 'CASE.toml', '--fresh')}"
    allowed = f"files of format {FORMAT}"
    require(version == FORMAT, str(path), f"of format {version}", allowed, cure)


def write_dataset(dataset: xarray.Dataset, path: Path | str, facts: Mapping[str, object]) -> None:
    """Writes a NetCDF file with `facts` among its attributes, whole or not at all."""
    with whole_file(path) as partial:
        dataset.assign_attrs(facts).to_netcdf(partial)


def read_dataset(path: Path | str, *, key: str = "file") -> xarray.Dataset:
    """A NetCDF file of this program, whole in memory.

    Raises:
        RefusedError: There is no such file, it is no NetCDF file, or its format is another one.
    """
    import xarray

    path = Path(path)
    try:
        data = xarray.load_dataset(path)
    except (OSError, ValueError):
        raise RefusedError(key, str(path), "a NetCDF file of this program") from None
    require_known(data.attrs, path)
    return data


def document_of(data: xarray.Dataset) -> Document:
    """Numbers that a dataset states as JSON."""
    document: Document = json.loads(data.attrs["document"])
    return document


def fingerprint_of(path: Path) -> str:
    """The fingerprint in a NetCDF file; empty if it cannot be read.

    Raises:
        RefusedError: Another version wrote the file; it is not overwritten unasked.
    """
    import xarray

    try:
        with xarray.open_dataset(path) as dataset:
            facts = dict(dataset.attrs)
    except (OSError, ValueError):
        return ""
    require_known(facts, path)
    return str(facts.get("fingerprint", ""))


def read_summary(folder: Path) -> Document:
    """summary.json of a folder that a run has written.

    Raises:
        RefusedError: There is none, it is damaged, or its format is another one.
    """
    path = folder / "summary.json"
    try:
        summary = json.loads(path.read_text(encoding="utf-8"))
        whole = all(isinstance(summary[name], kind) for name, kind in NEEDED.items())
    except OSError as error:
        raise damaged(folder, "without summary.json") from error
    except (ValueError, RecursionError, KeyError, TypeError) as error:
        raise damaged(path, f"damaged ({type(error).__name__})") from error
    if not whole:
        raise damaged(path, "damaged")
    require_known(summary, path)
    return dict(summary)


def own_files(summary: Document, folder: Path) -> list[Path]:
    """The NetCDF files of a summary that are in its folder.

    Raises:
        RefusedError: Some are not those of the run that wrote the summary.
    """
    keys: dict[str, str] = summary["fingerprints"]
    files = [folder / f"{name}.nc" for name in keys if re.fullmatch(r"[\w+-][\w.+-]*", name)]
    there = [file for file in files if file.is_file()]
    other = ", ".join(file.name for file in there if fingerprint_of(file) != keys[file.stem])
    require(not other, str(folder), f"with {other} of another run", "one run's files")
    return there


def damaged(path: Path, what: str) -> RefusedError:
    """The error of results that cannot be used."""
    cure = f"make it anew by {door('run', 'CASE.toml')}"
    return RefusedError(str(path), what, "whole results of a run", cure)
