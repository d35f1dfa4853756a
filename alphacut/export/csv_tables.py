"""CSV files of everything in a folder of results, for spreadsheets."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from alphacut.io.files import write_text
from alphacut.io.netcdf import read_dataset

if TYPE_CHECKING:
    import xarray


def write_tables(results: Path, folder: Path) -> list[Path]:
    """Write every NetCDF file of `results` as CSV files in `folder`, a row for each place.

    Variables over the same axes share a file; every column is named with its unit. Numbers have all
    their digits.

    Args:
        results: Folder of a run.
        folder: Where the CSV files go; made if it does not exist.

    Returns:
        The files.
    """
    folder.mkdir(parents=True, exist_ok=True)
    made = []
    for path in sorted(results.glob("*.nc")):
        dataset = read_dataset(path)
        for axes, part in _by_axes(dataset):
            name = "-".join([path.stem, *([] if axes == _widest(dataset) else ["by", *axes])])
            file = folder / f"{name}.csv"
            write_text(file, _csv(part))
            made.append(file)
    return made


def _by_axes(dataset: xarray.Dataset) -> Iterator[tuple[tuple[str, ...], xarray.Dataset]]:
    """Variables that share their axes, numbers without any left out."""
    groups: dict[tuple[str, ...], list[str]] = {}
    for name, variable in dataset.data_vars.items():
        if variable.dims:
            groups.setdefault(tuple(map(str, variable.dims)), []).append(str(name))
    for axes, names in groups.items():
        yield axes, dataset[names]


def _widest(dataset: xarray.Dataset) -> tuple[str, ...]:
    """Axes of the first variable that has any, whose file bears the dataset's name alone."""
    return next((tuple(map(str, v.dims)) for v in dataset.data_vars.values() if v.dims), ())


def _csv(part: xarray.Dataset) -> str:
    """Table in long form: axes first, then the variables."""
    table = part.to_dataframe().reset_index()
    names = [*map(str, part.sizes), *map(str, part.data_vars)]
    units = {name: part[name].attrs.get("units", "") if name in part else "" for name in names}
    kept = table[[name for name in names if name in table]]
    titles = [f"{name} [{units[name]}]" if units[name] not in ("", "1") else name for name in kept]
    text: str = kept.set_axis(titles, axis=1).to_csv(index=False)
    return text
