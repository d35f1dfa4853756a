"""The report of a run as one HTML page that needs nothing else: no network, no other file."""

from __future__ import annotations

import base64
import json
import re
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from markupsafe import Markup, escape

from alphacut.frame.structures.quantities import Output
from alphacut.io.files import Document
from alphacut.io.netcdf import damaged, own_files, read_dataset, read_summary
from alphacut.report.glossary import explained
from alphacut.report.sections import sections
from alphacut.report.tables import environment
from alphacut.stochastic.theta.truncated_normal import Array

if TYPE_CHECKING:
    import xarray

HERE = Path(__file__).parent


def report(folder: Path) -> str:
    """The page for the results in a folder.

    Raises:
        BadInput: The folder holds no results of a run, those of two, or of a newer program.
    """
    summary = read_summary(folder)
    try:
        own_files(summary, folder)
        return page(summary, folder)
    except (KeyError, TypeError, AttributeError, IndexError) as error:
        raise damaged(folder / "summary.json", error) from error


def page(summary: Document, folder: Path) -> str:
    """The page for a summary."""
    text = {name: (HERE / f"report.{name}").read_text(encoding="utf-8") for name in ("css", "js")}
    data = [  # of the interactive plot
        plot(name, study, read_dataset(folder / f"envelope_{name}.nc", key=str(folder)))
        for name, study in summary.get("envelopes", {}).items()
    ]
    about = escape(" ".join(summary.get("about", "").split()))
    return (
        environment()
        .get_template("report.html")
        .render(
            title=summary["title"],
            name=summary["case"],
            about=Markup(re.sub(r"`([^`]+)`", r"<code>\1</code>", about)),
            banner="",
            css=Markup(text["css"]),
            js=Markup(text["js"]),
            sections=explained(Markup("\n").join(sections(summary, folder))),
            # JSON that may stand inside a script element
            envelopes=Markup(json.dumps(data, ensure_ascii=False).replace("<", "\\u003c")),
        )
    )


def plot(name: str, study: Document, dataset: xarray.Dataset) -> Document:
    """One study: lower and upper bounds by level and output as 32-bit floats, in base64."""
    time = dataset["time"].values
    bounds = dataset[["lower", "upper"]].transpose("alpha", "output", "time")
    return {
        "name": name,
        "title": f"{name}: fuzzy {', '.join(study['fuzzy'])}",
        "fuzzy": len(dataset["parameter"]),
        "alpha": dataset["alpha"].values.tolist(),
        "outputs": [str(output) for output in dataset["output"].values],
        "units": [Output(str(output)).unit for output in dataset["output"].values],
        "step": float(time[1] - time[0]),
        **{
            str(side): [[packed(row) for row in level] for level in ends.values]
            for side, ends in bounds.items()
        },
    }


def packed(row: Array) -> str:
    """Numbers as little-endian 32-bit floats in base64."""
    return base64.b64encode(np.ascontiguousarray(row, "<f4").tobytes()).decode()
