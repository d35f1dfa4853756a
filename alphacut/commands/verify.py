"""Command ``verify``: stored envelopes against exact motions, without their proofs."""

from __future__ import annotations

import argparse
import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, TextIO

import numpy as np

from alphacut.commands.options import Command, add_quiet, write_answer
from alphacut.frame.envelope import Ends, Envelope
from alphacut.frame.verification.exact_motion import LinearMotion
from alphacut.frame.verification.self_test import Trial, inputs_at_peaks, stored_motions
from alphacut.fuzzy.arrays import Array
from alphacut.fuzzy.refused import require
from alphacut.fuzzy.result import Nature
from alphacut.fuzzy.sets.numbers import Interval
from alphacut.io.arrays import columns_text
from alphacut.io.files import Document, locked
from alphacut.io.results import ResultsFolder

if TYPE_CHECKING:
    import xarray


def add_options(parser: argparse.ArgumentParser) -> None:
    """Adds the folder."""
    parser.add_argument("folder", metavar="FOLDER", help="results of a run, as results/building")
    add_quiet(parser)


def verify(options: argparse.Namespace, out: TextIO) -> int:
    """Tests all proved envelopes in a folder by exact motions; returns exit status 0."""
    path = Path(options.folder)
    folder = ResultsFolder.read(path)
    document: Document = {}
    names = [x.removesuffix(".nc") for x in folder.files if re.fullmatch(r"envelope_.*\.nc", x)]
    require(bool(names), "FOLDER", value=str(path), allowed="results of a run with an envelope")
    with locked("FOLDER", path):
        for name in names:
            data = folder.dataset(f"{name}.nc")
            if "motion_inputs" not in data:  # which proved envelopes alone store
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
    """Tests a stored envelope, and writes inputs and motions at its peaks to two CSV files.

    Returns its nature, the number of motions tested, and the names of the files; a motion outside
    raises ContradictionError.
    """
    points, motions = stored_motions(data)
    envelope = envelope_of(data)
    Trial(envelope, *np.moveaxis(data["cut"].values, -1, 0)).require_agreement(points, motions)
    # points are compared as bytes, in which + 0.0 leaves no negative zero
    indices = {point.tobytes(): k for k, point in enumerate(points + 0.0)}
    at_peaks = (point.tobytes() for point in inputs_at_peaks(envelope, 0) + 0.0)
    shown = [indices[point] for point in at_peaks if point in indices]
    inputs: dict[str, Array] = {"motion": np.arange(1, len(shown) + 1).astype(float)}
    inputs |= {f"{x} [SI]": points[shown, k] for k, x in enumerate(envelope.inputs)}
    motions_shown = motions_table(envelope, [motions[k] for k in shown])
    files = {f"{name}_motions.csv": motions_shown, f"{name}_inputs.csv": inputs}
    for file, columns in files.items():
        folder.put_text(file, columns_text(columns))
    tested = {"motions_tested": len(points), "files": list(files)}
    return {"nature": str(data.attrs["nature"]), **tested}


def motions_table(envelope: Envelope, motions: Sequence[LinearMotion]) -> dict[str, Array]:
    """Time and outputs of motions at the nodes, by titles of columns."""
    table = {"time [s]": envelope.time}
    for k, motion in enumerate(motions, 1):
        values = motion.outputs(envelope.time)[0]
        table |= {f"motion {k}: {x}": values[:, o] for o, x in enumerate(envelope.named)}
    return table


def envelope_of(data: xarray.Dataset) -> Envelope:
    """The envelope that a dataset holds, with the supports of its fuzzy inputs as intervals."""
    values = {name: variable.values for name, variable in data.data_vars.items()}
    supports = values["cut"][0].tolist()

    def stored_ends(name: str) -> Ends | None:
        has_ends = f"{name}_lower" in values
        return Ends(values[f"{name}_lower"], values[f"{name}_upper"]) if has_ends else None

    labels = [str(label) for label in values["label"]]
    return Envelope(
        alpha=data["alpha"].values,
        time=data["time"].values,
        outputs=tuple(map(str, data["output"].values)),
        inputs={str(x): Interval(*supports[k]) for k, x in enumerate(data["parameter"].values)},
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
        inner=stored_ends("inner"),
        outer=stored_ends("proved"),
    )


COMMANDS = {
    "verify": Command(
        "test the proved envelopes of a run by exact motions, without the proof",
        add_options,
        verify,
    )
}
