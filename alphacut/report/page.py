"""The report of a run as one HTML page that needs nothing else: no network, no other file."""

from __future__ import annotations

import base64
from pathlib import Path

import numpy as np

from alphacut.frame.structures.quantities import Output
from alphacut.fuzzy.arrays import Array
from alphacut.fuzzy.result import Nature
from alphacut.io.files import Document
from alphacut.io.netcdf import damaged, own_files, read_dataset, read_summary
from alphacut.report.results import nature_of, plain_name
from alphacut.report.sections import Page


def report(folder: Path) -> str:
    """The page for the results in a folder.

    Raises:
        RefusedError: The folder holds no results of a run, those of two, or of a newer program.
    """
    summary = read_summary(folder)
    try:
        own_files(summary, folder)
        return page(summary, folder)
    except (KeyError, TypeError, AttributeError, IndexError, ValueError) as error:
        raise damaged(folder / "summary.json", f"damaged ({type(error).__name__})") from error


def page(summary: Document, folder: Path) -> str:
    """The page for a summary; all texts of it are escaped."""
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    loader = FileSystemLoader(Path(__file__).parent)
    templates = Environment(autoescape=True, loader=loader, undefined=StrictUndefined)
    studies = summary.get("envelopes", {}).items()
    return templates.get_template("report.html").render(
        title=summary["title"],
        name=summary["case"],
        about=" ".join(summary.get("about", "").split()),
        sections=Page(summary, folder).sections(),
        envelopes=[plot(name, study, folder) for name, study in studies if plain_name(name)],
    )


def plot(name: str, study: Document, folder: Path) -> Document:
    """One study of the interactive plot: bounds and error by level and output, in base64."""
    dataset = read_dataset(folder / f"envelope_{name}.nc", key=str(folder))
    time = dataset["time"].values
    outputs = [str(output) for output in dataset["output"].values]
    bands = {side: dataset[side] for side in ("lower", "upper")}
    nature = nature_of(study["nature"])
    proved = nature is Nature.GUARANTEED  # its error is inside
    bands["error"] = dataset["lower"] * 0.0 if proved else dataset["error"]
    return {
        "name": name,
        "title": f"{name}: fuzzy {', '.join(study['fuzzy'])}",
        "fuzzy": len(study["fuzzy"]),
        "nature": str(nature),
        "alpha": dataset["alpha"].values.tolist(),
        "outputs": outputs,
        "units": [Output(output).unit for output in outputs],
        "step": float(time[1] - time[0]),
        **{
            side: [
                [packed(row) for row in level]
                for level in band.transpose("alpha", "output", "time").values
            ]
            for side, band in bands.items()
        },
    }


def packed(row: Array) -> str:
    """Numbers as little-endian 32-bit floats in base64."""
    return base64.b64encode(np.ascontiguousarray(row, "<f4").tobytes()).decode()
