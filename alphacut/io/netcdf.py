"""Stored results: datasets in NetCDF, and the summary of a run."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

from alphacut.fuzzy.refused import RefusedError, require
from alphacut.io.files import Document
from alphacut.io.manifest import COMPLETE, RUN_AGAIN, ResultsFolder, is_plain

if TYPE_CHECKING:
    import xarray


def dataset_of(content: bytes) -> xarray.Dataset:
    """The dataset that the content of a NetCDF file holds; its digest must have been compared."""
    import netCDF4
    import xarray

    backends: Any = xarray.backends  # whose classes have no types
    file = netCDF4.Dataset("results", memory=content)  # which loading closes
    return xarray.load_dataset(backends.NetCDF4DataStore(file))


def read_dataset(path: Path, key: str) -> xarray.Dataset:
    """Reads a NetCDF file that the manifest beside it lists.

    Args:
        path: The file.
        key: Option that names it, for messages.

    Raises:
        RefusedError: There is no such file or manifest, or the file was changed.
    """
    folder, is_dataset = ResultsFolder.read(path.parent), path.suffix == ".nc"
    is_listed = is_dataset and any(path.name in part.files for part in folder.stage_files.values())
    allowed = "a NetCDF file in the results of this program"
    cure = "its folder holds it with manifest.json, which tells whether it is as it was written"
    require(is_listed, key, value=str(path), allowed=allowed, cure=cure)
    return dataset_of(folder.content(path.name))


def read_summary(folder: ResultsFolder) -> Document:
    """Reads summary.json of a folder of results; the files that it names have plain names.

    Raises:
        RefusedError: There is none, it is damaged, or its format is another one.
    """
    if not (folder.path / "summary.json").exists():
        raise damaged(folder, "without summary.json")
    try:
        summary: Document = json.loads(folder.content("summary.json"))
        studies = summary.get("envelopes", {})
        names = [*summary["fingerprints"], *studies, *summary["figures"]]
        names += [output for study in studies.values() for output in study["min"]]
        is_safe = all(map(is_plain, names))  # no name leads out of the folder
    except RefusedError as error:
        raise damaged(folder, f"damaged (summary.json {error.value})") from None
    except (ValueError, RecursionError, LookupError, TypeError, AttributeError) as error:
        raise damaged(folder, f"damaged ({type(error).__name__})") from None
    if not is_safe:
        raise damaged(folder, "damaged")
    return summary


def require_same_run(summary: Document, folder: ResultsFolder) -> None:
    """Refuses a folder with files of another run than that of its summary."""
    listed = {name: part.fingerprint for name, part in folder.stage_files.items()}
    changed = [name for name, key in summary["fingerprints"].items() if listed.get(name) != key]
    value = f"with {', '.join(changed)} of another run"
    require(not changed, str(folder.path), value=value, allowed="one run's files")


def damaged(folder: ResultsFolder, what: str) -> RefusedError:
    """The error of results that cannot be used."""
    return RefusedError(str(folder.path), what, COMPLETE, RUN_AGAIN)
