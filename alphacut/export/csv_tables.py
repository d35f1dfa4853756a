"""CSV files of all results of a run, for spreadsheets."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

from alphacut.frame.structures.quantities import Output
from alphacut.io.files import as_json, say, write_text
from alphacut.io.netcdf import read_dataset
from alphacut.io.provenance import digest
from alphacut.stages.modulus import listed

if TYPE_CHECKING:
    import xarray

BY_OUTPUT = "SI, by output"
KEPT = ".kept.json"  # digests of the tables that a report wrote into a folder, by name
MOST = 500_000  # rows of a table; spreadsheets end at twice that


def write_tables(results: Iterable[Path], folder: Path) -> list[Path]:
    """Write NetCDF files as CSV files in `folder`, a row for each place.

    An envelope gives a file for each output, a row for each node, and all envelopes together one
    of peaks. Of other results variables over the same axes share a file. Every column is named with
    its unit, or a column `unit` has it, and one says what the numbers are worth (`nature`). Numbers
    have all their digits. A table of more than `MOST` rows is left out, which is said. Tables that
    an earlier report left there are removed, unless somebody changed them, which is said.

    Args:
        results: The NetCDF files.
        folder: Where the CSV files go; made if it does not exist.

    Returns:
        The files.
    """
    folder.mkdir(parents=True, exist_ok=True)
    tables, peaks = dict[str, str](), [PEAKS]
    for path in results:
        dataset = with_worth(read_dataset(path))
        if path.stem.startswith("envelope_") and "output" in dataset.dims:
            tables |= {f"{path.stem}-{name}": text for name, text in _by_output(dataset)}
            tables[f"{path.stem}-attained"] = _csv(dataset[["lower_at", "upper_at"]])
            peaks += _peaks(path.stem.removeprefix("envelope_"), dataset)
            continue
        widest = next((v.dims for v in dataset.data_vars.values() if v.dims), ())
        for axes, part in _by_axes(dataset):
            own = [] if axes == widest else ["by", *axes]  # the first bears the name alone
            name, rows = "-".join([path.stem, *own]), math.prod(part.sizes.values())
            if rows > MOST:
                say(f"{name}.csv is left out: it had {rows:,} rows; {path} holds them as NetCDF")
                continue
            tables[name] = _csv(part)
    if len(peaks) > 1:
        tables["peaks"] = "\n".join([*peaks, ""])
    sweep(folder, {f"{name}.csv": digest(text) for name, text in tables.items()})
    for name, text in tables.items():
        write_text(folder / f"{name}.csv", text)
    return [folder / f"{name}.csv" for name in tables]


def sweep(folder: Path, digests: Mapping[str, str]) -> None:
    """Remove tables that an earlier report wrote and this one does not; note what this one does."""
    told: dict[str, str] = {}
    with suppress(OSError, ValueError, TypeError):
        told = dict(json.loads((folder / KEPT).read_text(encoding="utf-8")))
    old = [folder / Path(name).name for name in told if name not in digests]
    for file in filter(Path.is_file, old):
        if digest(file.read_bytes().decode(errors="replace")) == told[file.name]:
            file.unlink()
        else:
            say(f"{file} is of an earlier report and stays, since it was changed")
    write_text(folder / KEPT, as_json(digests))


PEAKS = (
    "study,output,unit,alpha,least peak at nodes (bound),least peak at nodes (tried),greatest peak"
    " at nodes,error and what lies between nodes,nature"
)
BANDS = ("lower", "upper", "error", "inner_lower", "inner_upper", "proved_lower", "proved_upper")


def with_worth(dataset: xarray.Dataset) -> xarray.Dataset:
    """The dataset with coordinates, columns later, that say what its numbers are worth."""
    facts, count = dataset.attrs, dataset.sizes.get("alpha", 0)
    told: dict[str, tuple[str, list[object]]] = {}
    if "nature" in facts and count:
        own = json.loads(facts["document"])["cuts"] if "document" in facts else {}
        told["nature"] = "alpha", own.get("nature", [facts["nature"]] * count)
    if "error_name" in dataset.dims:
        error = sum(listed(dataset, "error").values())
        told["declared relative error of E"] = "alpha", [error] * count
    return dataset.assign_coords(told)


def _by_output(dataset: xarray.Dataset) -> Iterator[tuple[str, str]]:
    """For each output a wide table: a row for each node, the bounds of each level side by side."""
    for name in map(str, dataset["output"].values):
        one, unit = dataset.sel(output=name), Output(name).unit
        columns = {"time [s]": one["time"].values}
        for level in one["alpha"].values:
            for band in (band for band in BANDS if band in one):
                inside = "within the bounds" if "inner_lower" in one else "to be added"
                what = band if band != "error" else f"error {inside}"
                title = f"{what} at alpha {level:g} [{unit}]"
                columns[title] = one[band].sel(alpha=level).values
        if "between" in one:
            columns[f"between [{unit}]"] = one["between"].values
        rows = zip(*columns.values(), strict=True)
        nature = f"{dataset.attrs.get('nature', '')}"
        lines = [",".join([*(repr(float(x)) for x in row), nature]) for row in rows]
        yield name, "\n".join([",".join([*columns, "nature"]), *lines, ""])


def _peaks(study: str, dataset: xarray.Dataset) -> Iterator[str]:
    """Rows of the table of peaks, an output and a level each."""
    if "peak" not in dataset:
        return
    for name in map(str, dataset["output"].values):
        one = dataset.sel(output=name)
        for level in one["alpha"].values:
            at = one.sel(alpha=level)
            low, high = (repr(float(at["peak"].sel(bound=x))) for x in ("lower", "upper"))
            more = [repr(float(at[x])) if x in at else "" for x in ("peak_tried", "peak_error")]
            cells = (repr(float(level)), low, more[0], high, more[1])
            nature = str(dataset.attrs.get("nature", ""))
            yield ",".join([study, name, Output(name).unit, *cells, nature])


def _by_axes(dataset: xarray.Dataset) -> Iterator[tuple[tuple[str, ...], xarray.Dataset]]:
    """Variables that share their axes, numbers without any left out."""
    groups: dict[tuple[str, ...], list[str]] = {}
    for name, variable in dataset.data_vars.items():
        if variable.dims:
            groups.setdefault(tuple(map(str, variable.dims)), []).append(str(name))
    yield from ((axes, dataset[names]) for axes, names in groups.items())


def _csv(part: xarray.Dataset) -> str:
    """Table in long form: axes first, then the variables."""
    table = part.to_dataframe().reset_index()
    names = [*map(str, part.sizes), *map(str, part.data_vars)]
    if "observed" in part.coords:
        names.insert(1, "observed")
    mixed = [name for name in part.data_vars if part[name].attrs.get("units") == BY_OUTPUT]
    outputs = table.get("observed", table.get("output"))
    if mixed and outputs is not None:
        table["unit"] = [Output(str(name)).unit for name in outputs]
        names.append("unit")
    names += [str(name) for name in part.coords if name not in names]
    bare = ("", "1", *((BY_OUTPUT,) if "unit" in table else ()))
    units = {x: part[x].attrs.get("units", "") for x in names if x in part}
    titles = {x: f"{x} [{unit}]" for x, unit in units.items() if unit not in bare}
    kept = table[[name for name in names if name in table]].rename(columns=titles)
    return str(kept.to_csv(index=False))
