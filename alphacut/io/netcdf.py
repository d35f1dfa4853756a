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
    """The dataset of a NetCDF file, from its content, whose digest was compared."""
    import netCDF4
    import xarray

    backends: Any = xarray.backends  # whose classes have no types
    file = netCDF4.Dataset("results", memory=content)  # which loading closes
    return xarray.load_dataset(backends.NetCDF4DataStore(file))


def read_dataset(path: Path, key: str) -> xarray.Dataset:
    """A NetCDF file that the manifest beside it lists.

    Args:
        path: The file.
        key: Option that names it, for messages.

    Raises:
        RefusedError: There is no such file or manifest, or the file was changed.
    """
    folder, is_dataset = ResultsFolder.opened(path.parent), path.suffix == ".nc"
    listed = is_dataset and any(path.name in part.files for part in folder.parts.values())
    cure = "its folder holds it with manifest.json, which tells whether it is as it was written"
    require(
        listed,
        key,
        value=str(path),
        allowed="a NetCDF file in the results of this program",
        cure=cure,
    )
    return dataset_of(folder.content(path.name))


def read_summary(folder: ResultsFolder) -> Document:
    """summary.json of a folder that a run has written; what it names lies in that folder.

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
        is_whole = all(map(is_plain, names))
    except RefusedError as error:
        raise damaged(folder, f"damaged (summary.json {error.value})") from None
    except (ValueError, RecursionError, LookupError, TypeError, AttributeError) as error:
        raise damaged(folder, f"damaged ({type(error).__name__})") from None
    if not is_whole:
        raise damaged(folder, "damaged")
    return summary


def require_same_run(summary: Document, folder: ResultsFolder) -> None:
    """Refuses the files of another run in a folder."""
    listed = {name: part.fingerprint for name, part in folder.parts.items()}
    changed = [name for name, key in summary["fingerprints"].items() if listed.get(name) != key]
    require(
        not changed,
        str(folder.path),
        value=f"with {', '.join(changed)} of another run",
        allowed="one run's files",
    )


def damaged(folder: ResultsFolder, what: str) -> RefusedError:
    """The error of results that cannot be used."""
    return RefusedError(str(folder.path), what, COMPLETE, RUN_AGAIN)
