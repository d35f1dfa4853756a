"""Stored results: the version of their format, and refusal of newer ones."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from pathlib import Path
from shlex import quote
from typing import TYPE_CHECKING, Any

from alphacut.io.files import Document, whole_file
from alphacut.io.output_paths import hint
from alphacut.io.problem import BadInput
from alphacut.io.provenance import FORMAT, door, own_version

NEEDED = (
    "case",
    "title",
    "case_text",
    "command",
    "versions",
    "seconds",
    "fingerprints",
)  # of summary.json
if TYPE_CHECKING:
    import xarray


def require_known(told: Mapping[str, object], path: Path, *, key: str) -> None:
    """Refuse a format that this program does not know; older ones are read.

    Args:
        told: What the file says of itself, among it its version and the program that wrote it.
        path: The file.
        key: Key or option that names it, for the message.

    Raises:
        BadInput: The format is newer than this program, or no version at all.
    """
    version = told.get("format_version")
    if version is None:
        return
    whole = int(str(version)) if str(version).isdecimal() else 0
    if whole < 1:
        what = f"{path} tells no version of its format: {version}"
        raise BadInput.of(key, what, allowed="format_version 1 or more")
    if whole > FORMAT:
        maker = told.get("created_by")
        made = f", written by {maker}" if maker else ""
        what = f"{path} has format {whole}{made}; this program reads formats up to {FORMAT}"
        cure = (
            f"install that version, or make the file anew with this one, {own_version()}, by"
            f" {door('run', 'CASE.toml', '--fresh')}"
        )
        raise BadInput.of(key, what, allowed=cure)


def write_dataset(dataset: xarray.Dataset, path: Path | str, facts: Mapping[str, object]) -> None:
    """Write a NetCDF file with `facts` among its attributes, whole or not at all."""
    with whole_file(path) as partial:
        dataset.assign_attrs(facts).to_netcdf(partial)


def read_dataset(path: Path | str, *, key: str = "file") -> xarray.Dataset:
    """A NetCDF file of this program, whole in memory.

    Raises:
        BadInput: There is no such file, it is no NetCDF file, or its format is newer.
    """
    import xarray

    path = Path(path)
    if not path.is_file():
        raise BadInput.of(key, "there is no such file", str(path), hint(path))
    try:
        found = xarray.load_dataset(path)
    except (OSError, ValueError) as error:
        what = "this is no NetCDF file, or a damaged one"
        allowed = "a file of this program, such as modulus.nc of a run"
        raise BadInput.of(key, what, str(path), allowed) from error
    require_known(found.attrs, path, key=key)
    return upgraded(found)


def upgraded(found: xarray.Dataset) -> xarray.Dataset:
    """Dataset of format 1 as one of format 2, with proved bounds as the bounds."""
    if "outer_lower" not in found:
        return found
    turned = found.rename({"lower": "inner_lower", "upper": "inner_upper"})
    return turned.rename({"outer_lower": "lower", "outer_upper": "upper"})


def damaged(path: Path, why: Exception | str, cure: str = "") -> BadInput:
    """The error for a summary, or another JSON file beside it, that cannot be used."""
    told = why if isinstance(why, str | ValueError) else f"{type(why).__name__} at {why}"
    cure = cure or f"make it anew: {door('run')} CASE.toml keeps what is computed"
    return BadInput.of(str(path), f"this file is damaged: {told}", allowed=cure)


def finished(folder: Path) -> list[Path]:
    """Files of a run, whole or begun, that the same run goes on from."""
    kinds = "*.nc", "*.npz", "*.db", "*.partial/*.npz"
    found = (file for kind in kinds for file in sorted(folder.glob(kind)))
    return [file for file in found if file.stat().st_size]


def read_summary(folder: Path) -> Document:
    """summary.json of a folder that a run has written.

    Raises:
        BadInput: There is none, it is no JSON, or its format is newer.
    """
    path = folder / "summary.json"
    if not path.is_file():
        kept = ", ".join(file.name for file in finished(folder))
        what = "there are no results here: summary.json is missing"
        allowed = f"a folder that {door('run')} has written"
        if kept:
            what = f"the run here has not ended: summary.json is missing, and there are {kept}"
            allowed = f"the end of that run, by {door('run')} CASE.toml --out {quote(str(folder))}"
        raise BadInput.of(str(folder), what, allowed=allowed)
    try:
        found: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    except ValueError as error:
        raise damaged(path, error) from None
    if not isinstance(found, dict):
        raise damaged(path, "it holds no object")
    told = found.get("versions")
    version = told.get("alphacut") if isinstance(told, dict) else None
    maker = f"alphacut {version}" if version else ""
    require_known({"created_by": maker, **found}, path, key=str(folder))
    if missing := [name for name in NEEDED if name not in found]:
        raise damaged(path, f"it holds no {missing[0]}")
    return found


def own_files(summary: Document, folder: Path) -> list[Path]:
    """The NetCDF files of a summary that are in its folder.

    Raises:
        BadInput: Some are not those of the run that wrote the summary.
    """
    keys: dict[str, str] = summary["fingerprints"]
    files = [folder / f"{name}.nc" for name in keys if re.fullmatch(r"[\w.+-]+", name)]
    there = [file for file in files if file.is_file()]
    other = [file.name for file in there if fingerprint_of(file) != keys[file.stem]]
    if other:
        what = f"not of the run that wrote summary.json: {', '.join(other)}"
        raise BadInput.of(str(folder), what, allowed="results of one run")
    return there


def fingerprint_of(path: Path, key: str = "--out") -> str:
    """The fingerprint in a NetCDF file; empty if it cannot be read.

    Raises:
        BadInput: A newer program wrote the file; its results are not overwritten unasked.
    """
    import xarray

    try:
        with xarray.open_dataset(path) as dataset:
            facts = dict(dataset.attrs)
    except (OSError, ValueError):
        return ""
    require_known(facts, path, key=key)
    return str(facts.get("fingerprint", ""))
