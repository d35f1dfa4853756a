"""Command ``verify``: stored envelopes against exact motions, without their proofs."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, TextIO

import numpy as np

from alphacut.commands.options import Command, add_quiet, write_answer
from alphacut.frame.envelope import Ends, Envelope
from alphacut.frame.verification.exact_motion import LinearMotion
from alphacut.frame.verification.self_test import ContradictionError, Trial
from alphacut.frame.verification.stored import stored_motions
from alphacut.fuzzy.arrays import Array
from alphacut.fuzzy.refused import require
from alphacut.fuzzy.result import Nature
from alphacut.fuzzy.sets.numbers import Interval
from alphacut.io.columns import columns_text
from alphacut.io.files import Document, locked
from alphacut.io.manifest import ResultsFolder
from alphacut.io.netcdf import dataset_of
from alphacut.stages.store import put_text

if TYPE_CHECKING:
    import xarray


def add_options(parser: argparse.ArgumentParser) -> None:
    """Adds the folder."""
    parser.add_argument("folder", metavar="FOLDER", help="results of a run, as results/building")
    add_quiet(parser)


def verify(options: argparse.Namespace, out: TextIO) -> int:
    """Tests all stored envelopes that have proved bounds, and writes motions of their inputs."""
    path = Path(options.folder)
    folder = ResultsFolder.opened(path)
    document: Document = {}
    names = [name for name in folder.parts if name.startswith("envelope_")]
    require(bool(names), "FOLDER", value=str(path), allowed="results of a run with an envelope")
    with locked("FOLDER", path):
        for name in names:
            data = dataset_of(folder.content(f"{name}.nc"))
            if "motion_inputs" not in data:
                document[name] = {"nature": str(data.attrs["nature"]), "motions_tested": 0}
                continue
            document[name] = verify_envelope(data, name, folder)
    lines = (
        f"{name}: {verdict['motions_tested']} exact motions agree with it ({verdict['nature']})\n"
        if verdict["motions_tested"]
        else f"{name}: nothing in it is proved ({verdict['nature']})\n"
        for name, verdict in document.items()
    )
    write_answer(options, document, out, "".join(lines))
    return 0


def verify_envelope(data: xarray.Dataset, name: str, folder: ResultsFolder) -> Document:
    """What a stored envelope was tested with; motions of the inputs it names go to a CSV file.

    Raises:
        ContradictionError: A motion contradicts it; contradiction.csv holds it.
    """
    points, motions = stored_motions(data)
    trial = Trial(envelope_of(data), np.moveaxis(data["cut"].values, -1, 0))
    try:
        trial.require_agreement(points, motions)
    except ContradictionError as error:
        put_text(folder, "contradiction.csv", columns_text(error.table))
        raise
    # + 0.0 leaves no zero negative
    places = {point.tobytes(): k for k, point in enumerate(points + 0.0)}
    wanted = (point.tobytes() for point in trial.named() + 0.0)
    named = [places[point] for point in wanted if point in places]
    files: dict[str, dict[str, Array]] = {
        f"{name}_motions.csv": motions_table(trial, [motions[k] for k in named]),
        f"{name}_inputs.csv": {
            "motion": np.arange(1, len(named) + 1).astype(float),
            **{f"{x} [SI]": points[named, k] for k, x in enumerate(trial.envelope.inputs)},
        },
    }
    for file, table in files.items():
        put_text(folder, file, columns_text(table))
    tested = {"motions_tested": len(points), "files": list(files)}
    return {"nature": str(data.attrs["nature"]), **tested}


def motions_table(trial: Trial, motions: Sequence[LinearMotion]) -> dict[str, Array]:
    """Time and outputs of motions at the nodes, by titles of columns."""
    envelope, table = trial.envelope, {"time [s]": trial.envelope.time}
    for k, motion in enumerate(motions, 1):
        values = motion.outputs(envelope.time)[0]
        table |= {f"motion {k}: {x}": values[:, o] for o, x in enumerate(envelope.named)}
    return table


def envelope_of(data: xarray.Dataset) -> Envelope:
    """The envelope in a dataset, as far as it is tested; its inputs are those of its support."""
    values = {name: variable.values for name, variable in data.data_vars.items()}
    cut = values["cut"][0].tolist()
    pairs = {
        kind: Ends(values[f"{key}_lower"], values[f"{key}_upper"])
        for kind, key in (("inner", "inner"), ("outer", "proved"))
        if f"{key}_lower" in values
    }
    labels = [str(label) for label in values["label"]]
    return Envelope(
        alpha=data["alpha"].values,
        time=data["time"].values,
        outputs=tuple(map(str, data["output"].values)),
        inputs={str(x): Interval(*cut[k]) for k, x in enumerate(data["parameter"].values)},
        nature=Nature(data.attrs["nature"]),
        method=str(data.attrs["method"]),
        units=tuple(x.partition("[")[2].rstrip("]") for x in labels),
        between=values.get("between"),
        attained_error=values.get("attained_error"),
        lower=values["lower"],
        upper=values["upper"],
        lower_at=values["lower_at"],
        upper_at=values["upper_at"],
        error=values["error"],
        inner=pairs.get("inner"),
        outer=pairs.get("outer"),
    )


COMMANDS = {
    "verify": Command(
        "test the proved envelopes of a run by exact motions, without the proof",
        add_options,
        verify,
    )
}
