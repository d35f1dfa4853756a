"""CSV files of everything in a folder of results, for spreadsheets."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from alphacut.frame.outputs import output_unit
from alphacut.io.files import write_text
from alphacut.io.netcdf import read_dataset

if TYPE_CHECKING:
    import xarray

BY_OUTPUT = "SI, by output"


def write_tables(results: Path, folder: Path) -> list[Path]:
    """Write every NetCDF file of `results` as CSV files in `folder`, a row for each place.

    An envelope gives a file for each output, a row for each node, and all envelopes together one
    of peaks. Of other results variables over the same axes share a file. Every column is named with
    its unit, or a column `unit` has it. Numbers have all their digits.

    Args:
        results: Folder of a run.
        folder: Where the CSV files go; made if it does not exist.

    Returns:
        The files.
    """
    folder.mkdir(parents=True, exist_ok=True)
    made, peaks = [], [",".join(PEAKS)]
    for path in sorted(results.glob("*.nc")):
        dataset = read_dataset(path)
        if path.stem.startswith("envelope_") and "output" in dataset.dims:
            tables = dict(_by_output(dataset))
            tables["attained"] = _csv(dataset[["lower_at", "upper_at"]])
            peaks += _peaks(path.stem.removeprefix("envelope_"), dataset)
            for name, text in tables.items():
                made.append(folder / f"{path.stem}-{name}.csv")
                write_text(made[-1], text)
            continue
        for axes, part in _by_axes(dataset):
            name = "-".join([path.stem, *([] if axes == _widest(dataset) else ["by", *axes])])
            file = folder / f"{name}.csv"
            write_text(file, _csv(part))
            made.append(file)
    if len(peaks) > 1:
        made.append(folder / "peaks.csv")
        write_text(made[-1], "\n".join([*peaks, ""]))
    return made


PEAKS = (
    "study",
    "output",
    "unit",
    "alpha",
    "least peak at nodes (bound)",
    "least peak at nodes (tried)",
    "greatest peak at nodes",
    "error and what lies between nodes",
)
BANDS = ("lower", "upper", "error", "inner_lower", "inner_upper", "proved_lower", "proved_upper")


def _by_output(dataset: xarray.Dataset) -> Iterator[tuple[str, str]]:
    """For each output a wide table: a row for each node, the bounds of each level side by side."""
    for name in map(str, dataset["output"].values):
        one, unit = dataset.sel(output=name), output_unit(name)
        columns = {"time [s]": one["time"].values}
        for level in one["alpha"].values:
            for band in (band for band in BANDS if band in one):
                title = f"{band} at alpha {level:g} [{unit}]"
                columns[title] = one[band].sel(alpha=level).values
        if "between" in one:
            columns[f"between [{unit}]"] = one["between"].values
        rows = zip(*columns.values(), strict=True)
        lines = [",".join(repr(float(x)) for x in row) for row in rows]
        yield name, "\n".join([",".join(columns), *lines, ""])


def _peaks(study: str, dataset: xarray.Dataset) -> Iterator[str]:
    """Rows of the table of peaks, an output and a level each."""
    if "peak" not in dataset:
        return
    for name in map(str, dataset["output"].values):
        one = dataset.sel(output=name)
        for level in one["alpha"].values:
            at = one.sel(alpha=level)
            low, high = (float(at["peak"].sel(bound=side)) for side in ("lower", "upper"))
            more = [float(at[x]) if x in at else None for x in ("peak_tried", "peak_error")]
            numbers = (float(level), low, more[0], high, more[1])
            cells = ["" if x is None else repr(x) for x in numbers]
            yield ",".join([study, name, output_unit(name), *cells])


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
    if "observed" in part.coords:
        names.insert(1, "observed")
    mixed = [name for name in part.data_vars if part[name].attrs.get("units") == BY_OUTPUT]
    outputs = table.get("observed", table.get("output"))
    if mixed and outputs is not None:
        table["unit"] = [output_unit(str(name)) for name in outputs]
        names.append("unit")
    units = {name: part[name].attrs.get("units", "") if name in part else "" for name in names}
    kept = table[[name for name in names if name in table]]
    bare = ("", "1", *((BY_OUTPUT,) if "unit" in table else ()))
    titles = [f"{name} [{units[name]}]" if units[name] not in bare else name for name in kept]
    text: str = kept.set_axis(titles, axis=1).to_csv(index=False)
    return text
