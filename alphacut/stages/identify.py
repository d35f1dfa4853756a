"""Stage identify: inputs of a frame after its natural modes were measured."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from alphacut.case.motion import Identify
from alphacut.case.structure import Structure
from alphacut.frame.identify import (
    Identified,
    MeasuredMode,
    Measurement,
    Prediction,
    RefutedError,
    measured_mode,
)
from alphacut.frame.identify import identify as identified
from alphacut.frame.identify.possibility import widest
from alphacut.frame.structures.quantities import of_storey_frame
from alphacut.fuzzy import FuzzyNumber
from alphacut.fuzzy.refused import RefusedError
from alphacut.io.files import Document
from alphacut.io.modes_csv import ModeRows, mode_rows
from alphacut.io.provenance import file_digest
from alphacut.stages.envelope import EnvelopeTask
from alphacut.stages.store import Stage, Work

if TYPE_CHECKING:
    import xarray


@dataclass(frozen=True, eq=False)
class Learned:
    """Inputs of a structure after measured modes.

    Args:
        posterior: The inputs' boxes; None where the measurement refutes the frame.
        refuted: Reason of that; empty where it does not.
        prior: The inputs before.
        held: Measured modes that were predicted, each with its prediction.
        structure: The structure with the inputs learned.
    """

    posterior: Identified | None
    refuted: str
    prior: Mapping[str, FuzzyNumber]
    held: tuple[tuple[ModeRows, Prediction], ...]
    structure: Structure

    def document(self) -> Document:
        """The result for ``--json``, in SI."""
        after = self.posterior
        if after is None:
            return {"refuted": self.refuted}
        return {
            "alpha": after.alpha,
            "inputs": {
                name: {"lower": after.lower[:, k], "upper": after.upper[:, k]}
                for k, name in enumerate(after.names)
            },
            "prior": {name: list(widest(number)) for name, number in self.prior.items()},
            "narrowed": dict(after.narrowed),
            "units": {name: of_storey_frame(name).unit for name in after.names},
            "agreement": after.height,
            "held_out": [_predicted(*pair) for pair in self.held],
            "claim": str(after.claim),
        }


def _predicted(row: ModeRows, prediction: Prediction) -> Document:
    low, high = float(prediction.lower[0]), float(prediction.upper[0])
    measured = float(row.frequencies.mean())
    inside = low <= measured <= high
    return {"mode": row.mode, "measured": measured, "predicted": [low, high], "inside": inside}


def learned(section: Identify, structure: Structure, alpha: tuple[float, ...]) -> Learned:
    """The inputs that [identify] learns.

    Args:
        section: Measured modes, and the inputs.
        structure: The frame with its priors.
        alpha: Levels, above 0.

    Raises:
        RefusedError: The file of modes is wrong, or an input cannot be learned.
    """
    frame = structure.frame
    if frame is None or not alpha[0] > 0:
        raise RefusedError("envelope.alpha", list(alpha), "levels above 0 of a storey frame")
    rows = mode_rows(section.measured)
    modes = [row.mode for row in rows]
    if not set(section.held_out) < set(modes):
        value = ", ".join(map(str, section.held_out))
        raise RefusedError("identify.held_out", value, f"some of modes {modes}, not all")
    used = tuple(_measured(section, row) for row in rows if row.mode not in section.held_out)
    prior = structure.inputs(section.learn, "identify.learn")
    try:
        after = identified(frame, prior, Measurement(used, False), alpha=alpha)
    except RefutedError as error:
        return Learned(None, str(error), prior, (), structure)
    predictions = {one.mode: one for one in after.predictions()}
    held = tuple(
        (row, predictions[row.mode])
        for row in rows
        if row.mode in section.held_out and row.mode in predictions
    )
    numbers = {**structure.numbers, **after.numbers}
    return Learned(after, "", prior, held, replace(structure, numbers=numbers))


def _measured(section: Identify, row: ModeRows) -> MeasuredMode:
    shapes = {floor: [*map(float, values)] for floor, values in row.amplitudes.items()}
    return measured_mode(
        row.mode,
        row.frequencies,
        shapes,
        frequency_deviation=section.frequency_deviation,
        shape_deviation=section.shape_deviation,
    )


def stage(section: Identify, structure: Structure, inputs: Learned, task: EnvelopeTask) -> Stage:
    """The stage of inputs and envelope before and after, over `knowledge`."""

    def compute(work: Work) -> xarray.Dataset:
        return dataset(structure, inputs, task, work)

    content = [section, file_digest(section.measured), structure.model, structure.numbers]
    return Stage("update", [*content, task.section], ("fuzzy", "frame"), compute)


def dataset(
    structure: Structure, inputs: Learned, task: EnvelopeTask, work: Work
) -> xarray.Dataset:
    """Inputs and envelope before and after, over `knowledge`; empty where refuted."""
    import xarray

    after = inputs.posterior
    if after is None:
        return xarray.Dataset(attrs={"refuted": inputs.refuted})
    alone = replace(work, folder=None)
    sides = [task.compute(one, alone)[["lower", "upper"]] for one in (structure, inputs.structure)]
    knowledge = xarray.DataArray(["prior", "posterior"], dims="knowledge", name="knowledge")
    bands = xarray.concat(sides, knowledge)
    before = np.array([widest(number) for number in inputs.prior.values()]).T
    ends = np.stack([after.lower, after.upper], axis=1)
    ends = np.stack([np.broadcast_to(before, ends.shape), ends])
    axes, words = ("knowledge", "alpha", "bound", "parameter"), {"units": "SI, by input"}
    return bands.assign(inputs=(axes, ends, words)).assign_coords(
        bound=["lower", "upper"], parameter=list(after.names)
    )


def narrower(bands: xarray.Dataset) -> dict[str, float]:
    """Mean width of each output's envelope after over that before, at the lowest level."""
    width = (bands["upper"] - bands["lower"]).isel(alpha=0).mean("time")
    share = width.sel(knowledge="posterior") / width.sel(knowledge="prior")
    names = map(str, share["output"].values)
    return dict(zip(names, map(float, np.asarray(share)), strict=True))
