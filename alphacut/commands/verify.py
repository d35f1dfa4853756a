"""Command ``verify``: proved envelopes of a run against exact responses."""

from __future__ import annotations

import argparse
import json
import re
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO

import numpy as np

from alphacut.base.errors import require
from alphacut.commands.options import write_answer
from alphacut.frame.result import Ends, Envelope
from alphacut.frame.verification.self_test import Trial, stored_motions
from alphacut.fuzzy import Interval
from alphacut.fuzzy.result import Nature
from alphacut.io.results import ResultsFolder
from alphacut.report.results import agreement

if TYPE_CHECKING:
    import xarray


def verify(options: argparse.Namespace, out: TextIO) -> int:
    """Test all guaranteed envelopes in a folder of results by exact responses.

    A run stores with each guaranteed envelope the inputs of some structures and their exact
    responses. They are compared with the stored bounds, without the proof.

    Args:
        options: Of the command line: `folder`, `json` and `quiet`.
        out: Takes a line for each envelope, or the JSON document with ``--json -``.

    Returns:
        Exit status 0.

    Raises:
        RefusedError: The folder holds no envelope, or its files are damaged.
        ContradictionError: A response lies outside an envelope that is guaranteed.
    """
    folder = ResultsFolder.read(Path(options.folder))
    names = [x.removesuffix(".nc") for x in folder.files if re.fullmatch(r"envelope_.*\.nc", x)]
    value = str(folder.path)
    if any(name.startswith("record_") for name in folder.files):
        value += ", of a suite, whose peaks the run tested as it proved them"
    require(bool(names), "FOLDER", value, "results of a run with an envelope")
    document: dict[str, object] = {}
    text = ""
    for name in names:
        data = folder.dataset(f"{name}.nc")
        peaks = json.loads(folder.content(f"{name}.json"))["result"]["peak"].values()
        nature = str(data.attrs["nature"])
        n_motions = 0
        # Responses are stored where the bounds of the envelope, or wider ones beside them, are
        # guaranteed.
        if "motion_inputs" in data:
            points, motions = stored_motions(data)
            lower, upper = np.moveaxis(data["cut"].values, -1, 0)  # of shape (levels, inputs)
            highest = None  # results of former versions do not have it
            if "motion_highest" in data:
                highest = data["motion_highest"].values
            Trial(envelope_of(data), lower, upper).require_agreement(points, motions, highest)
            n_motions = len(points)
            verdict = f"{n_motions} exact motions {agreement(nature == Nature.GUARANTEED)}"
        elif any(peak["nature"] == Nature.GUARANTEED for peak in peaks):
            verdict = "its guaranteed peaks were tested by the run, nothing else in it is proved"
        elif nature == Nature.GUARANTEED:
            verdict = "it has no exact motions"
        else:
            verdict = "nothing in it is proved"
        document[name] = {"nature": nature, "motions_tested": n_motions}
        text += f"{name}: {verdict} ({nature})\n"
    write_answer(options, document, out, text)
    return 0


def envelope_of(data: xarray.Dataset) -> Envelope:
    """Return the envelope that a dataset of a run holds.

    Args:
        data: Dataset of an envelope file, in SI units, with the axes alpha, time, output and
            parameter. "cut" has the ends of the inputs, shape (alpha, parameter, 2); "label" the
            name of each output with its unit in brackets. Attributes are "nature" and "method".
            Three things may be missing: guaranteed bounds "proved_lower" and "proved_upper" beside
            other bounds, attained bounds "inner_lower" and "inner_upper", and errors.

    Returns:
        The envelope. Its fuzzy inputs are only known as intervals: their cuts on the lowest level.

    Raises:
        KeyError: The dataset is no envelope.
    """
    values = {name: variable.values for name, variable in data.data_vars.items()}
    names = ("lower", "upper", "lower_at", "upper_at", "error", "between", "attained_error")
    arguments: dict[str, Any] = {name: values[name] for name in names if name in values}
    for side, name in (("inner", "inner"), ("outer", "proved")):
        if f"{name}_lower" in values:
            arguments[side] = Ends(values[f"{name}_lower"], values[f"{name}_upper"])
    # The lowest α-cut contains all others: as an interval it has the bounds of this level.
    supports = zip(data["parameter"].values, values["cut"][0], strict=True)
    return Envelope(
        alpha=data["alpha"].values,
        time=data["time"].values,
        outputs=tuple(map(str, data["output"].values)),
        inputs={str(name): Interval(*map(float, support)) for name, support in supports},
        nature=Nature(data.attrs["nature"]),
        method=str(data.attrs["method"]),
        units=tuple(str(x).partition("[")[2].rstrip("]") for x in values["label"]),
        **arguments,
    )
