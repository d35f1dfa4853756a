"""Stored results: datasets and the summary of a run."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from alphacut.fuzzy.refused import RefusedError, require
from alphacut.io.files import Document, as_json
from alphacut.io.provenance import FORMAT, door

if TYPE_CHECKING:
    import xarray

PLAIN = re.compile(r"(?!.*\.\.)[\w+-][\w.+-]{0,100}")
"""Names of files in a folder of results, which lead to no other folder."""


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


def dataset_of(document: Document) -> xarray.Dataset:
    """A dataset that holds a document and nothing else."""
    import xarray

    return xarray.Dataset(attrs={"document": as_json(document)})


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
    """summary.json of a folder that a run has written; what it names lies in that folder.

    Raises:
        RefusedError: There is none, it is damaged, or its format is another one.
    """
    try:
        summary: Document = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
        studies = summary.get("envelopes", {})
        names = [*summary["fingerprints"], *studies]
        names += [output for one in studies.values() for output in one["min"]]
        names += [name.removeprefix("figures/") for name in summary["figures"]]
        what = "" if all(map(PLAIN.fullmatch, names)) else "damaged"
    except OSError:
        what = "without summary.json"
    except (ValueError, RecursionError, LookupError, TypeError, AttributeError) as error:
        what = f"damaged ({type(error).__name__})"
    if what:
        raise damaged(folder, what)
    require_known(summary, folder)
    return summary


def require_own(summary: Document, folder: Path) -> None:
    """Refuses the files of another run in a folder.

    Raises:
        RefusedError: A file there is not of the run that wrote the summary.
    """
    files = {folder / f"{name}.nc": key for name, key in summary["fingerprints"].items()}
    there = {file: key for file, key in files.items() if file.is_file()}
    other = ", ".join(file.name for file, key in there.items() if fingerprint_of(file) != key)
    require(not other, str(folder), f"with {other} of another run", "one run's files")


def damaged(folder: Path, what: str) -> RefusedError:
    """The error of results that cannot be used."""
    cure = f"make it anew by {door('run', 'CASE.toml')}"
    return RefusedError(str(folder), what, "whole results of a run", cure)
