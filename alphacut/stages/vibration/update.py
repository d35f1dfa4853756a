"""Inputs of a case after natural modes of its frame were measured, and its envelope with them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from alphacut.case.case import Case
from alphacut.frame import StoreyFrame
from alphacut.frame.structures.quantities import of_storey_frame
from alphacut.fuzzy import FuzzyNumber
from alphacut.io.files import Document
from alphacut.io.problem import BadInput
from alphacut.io.progress import Tick
from alphacut.io.units import engineering
from alphacut.stages.vibration import envelope
from alphacut.stages.vibration.envelope_task import task_of
from alphacut.stages.vibration.modes_csv import ModeRows, mode_rows
from alphacut.stages.vibration.structure import Structure

if TYPE_CHECKING:
    import xarray

    from alphacut.frame.identify import Identified, MeasuredMode


@dataclass(frozen=True)
class HeldOut:
    """A measured mode that was predicted.

    Args:
        mode: Its number.
        measured: Mean of its measured frequencies, in Hz.
        predicted: Proved range of the frequency at the lowest level, in Hz.
    """

    mode: int
    measured: float
    predicted: tuple[float, float]

    @property
    def inside(self) -> bool:
        """Whether the measured frequency lies in the range predicted."""
        return self.predicted[0] <= self.measured <= self.predicted[1]


@dataclass(frozen=True, eq=False)
class Learned:
    """What measured modes leave of a case's inputs.

    Args:
        posterior: The inputs' boxes; None where the measurement refutes the frame.
        refuted: Why it does; empty where it does not.
        prior: The inputs before.
        held_out: Modes that were predicted.
        structure: The structure with the inputs learned.
    """

    posterior: Identified | None
    refuted: str
    prior: Mapping[str, FuzzyNumber]
    held_out: tuple[HeldOut, ...]
    structure: Structure

    def document(self) -> Document:
        """The result as it is printed with ``--json``, in SI."""
        found = self.posterior
        if found is None:
            return {"refuted": self.refuted}
        return {
            "alpha": found.alpha,
            "inputs": {
                name: {"lower": found.lower[:, k], "upper": found.upper[:, k]}
                for k, name in enumerate(found.names)
            },
            "prior": {name: list(prior_support(x)) for name, x in self.prior.items()},
            "narrowed": found.narrowed,
            **self._identified,
            "held_out": [
                {name: getattr(x, name) for name in ("mode", "measured", "predicted", "inside")}
                for x in self.held_out
            ],
            "claim": str(found.claim),
        }

    @property
    def _identified(self) -> Document:
        """How well prior and measurement agree, and combinations that are not learned."""
        found = self.posterior
        lost = [x.words for x in found.directions if not x.learned] if found else []
        return {"agreement": found and found.height, "not_learned": lost}


def prior_support(number: FuzzyNumber) -> tuple[float, float]:
    """The widest cut that a prior decides, in SI."""
    from alphacut.frame.identify.possibility import widest

    return widest(number)


def input_unit(name: str) -> str:
    """SI unit of an input of the cell or of a storey frame."""
    of_cell = {"matrix_modulus": "Pa", "inclusion_modulus": "Pa"}
    return of_cell.get(name) or of_storey_frame(name).unit


def sentences(found: Document) -> list[str]:
    """A line for each input and each mode that was predicted, from `Learned.document`, in SI."""
    if "refuted" in found:
        return [str(found["refuted"])]
    lines = []
    for name, ends in found["inputs"].items():
        both, share = (ends["lower"][0], ends["upper"][0]), found["narrowed"][name]
        told = " … ".join(engineering(end, input_unit(name)) for end in both)
        lines.append(f"{name}: {told}, {100 * share:.3g} % of its width before")
    for held in found["held_out"]:
        low, high = held["predicted"]
        where = "inside" if held["inside"] else "outside"
        lines.append(
            f"mode {held['mode']}: {low:.4g} … {high:.4g} Hz predicted,"
            f" {held['measured']:.4g} Hz measured: {where}"
        )
    return lines


def learned(case: Case, wanted: Structure) -> Learned:
    """The inputs of [update] learn after its measured modes.

    Args:
        case: With the sections update and frame.
        wanted: The structure with its priors.

    Raises:
        BadInput: The file of modes is wrong, or an input cannot be learned.
    """
    from alphacut.frame.identify import Measurement, RefutedError, identify

    if wanted.frame is None:
        raise BadInput.of("update", "natural modes are learned from for a storey frame")
    given = case.update
    rows, held = measured_modes(case), {round(number) for number in given.held_out}
    used = [row for row in rows if row.mode not in held]
    prior = inputs(case, wanted)
    try:
        measurement = Measurement(tuple(_measured(case, row) for row in used), given.independent)
        found = identify(wanted.frame, prior, measurement, alpha=given.alpha)
    except RefutedError as error:
        return Learned(None, str(error), prior, (), wanted)
    except ValueError as error:
        raise BadInput.of("update", str(error), file=str(case.path)) from None
    predictions = {one.mode: one for one in found.predictions()}
    predicted = tuple(
        HeldOut(row.mode, float(row.frequencies.mean()), (float(one.lower[0]), float(one.upper[0])))
        for row in rows
        if row.mode in held and (one := predictions.get(row.mode)) is not None
    )
    after = replace(wanted, numbers={**wanted.numbers, **found.numbers})
    return Learned(found, "", prior, predicted, after)


def measured_modes(case: Case) -> tuple[ModeRows, ...]:
    """The rows of the measured modes.

    Raises:
        BadInput: The file is wrong, or a mode that is held out is not in it, or the only one.
    """
    rows = mode_rows(case.beside(str(case.update.measured)))
    held, modes = case.update.held_out, [float(row.mode) for row in rows]
    missing = [number for number in held if number not in modes]
    if missing or set(modes) <= set(held):
        what = (
            "no such mode was measured"
            if missing
            else "no mode is left to learn from, all are held out"
        )
        allowed = f"some of {', '.join(f'{mode:g}' for mode in modes)}, not all"
        raise case.refuse("update.held_out", what, allowed)
    return rows


def require_readable(case: Case, frame: StoreyFrame | None) -> None:
    """Refuse a case whose measurement cannot be read, before anything is computed.

    Raises:
        BadInput: As of `measured_modes` and `recorded_motion`.
    """
    if case.sections.update is None or frame is None:
        return
    measured_modes(case)


def inputs(case: Case, wanted: Structure) -> dict[str, FuzzyNumber]:
    """The fuzzy inputs that [update] learn names.

    Raises:
        BadInput: One is unknown, or crisp.
    """
    try:
        return wanted.inputs(case.update.learn)
    except BadInput as error:
        (problem,) = error.problems
        raise BadInput(replace(problem, key="update.learn", file=str(case.path))) from None


def _measured(case: Case, row: ModeRows) -> MeasuredMode:
    from alphacut.frame.identify import measured_mode

    shapes = {floor: [*map(float, values)] for floor, values in row.amplitudes.items()}
    return measured_mode(
        row.mode,
        row.frequencies,
        shapes,
        frequency_deviation=case.update.frequency_deviation,
        shape_deviation=case.update.shape_deviation,
    )


def envelopes(
    case: Case, wanted: Structure, found: Learned, progress: Tick | None = None
) -> xarray.Dataset:
    """The envelope with the priors and with what was learned, over `knowledge`.

    Args:
        case: With the section envelope.
        wanted: The structure with its priors.
        found: What was learned.
        progress: Told the share done.

    Raises:
        BadInput: An input that was learned is not among the envelope's.
    """
    import xarray

    task = replace(task_of(case), alpha=case.update.alpha)
    missing = sorted(set(found.prior) - set(wanted.inputs(task.fuzzy)))
    if missing:
        raise BadInput.of(
            "envelope.fuzzy",
            f"{', '.join(missing)} of [update] learn are missing",
            ", ".join(task.fuzzy),
            "all inputs that are learned, among others",
            file=str(case.path),
        )
    sides = []
    for share, structure in enumerate((wanted, found.structure)):

        def tick(done: float, before: int = share) -> None:
            if progress is not None:
                progress((before + done) / 2)

        sides.append(envelope.compute(structure, task, progress=tick).to_dataset())
    shared = ["lower", "upper"]
    return xarray.concat(
        [side[shared] for side in sides],
        xarray.DataArray(["prior", "posterior"], dims="knowledge", name="knowledge"),
    )


def dataset(
    case: Case, wanted: Structure, found: Learned, progress: Tick | None = None
) -> xarray.Dataset:
    """Inputs and envelope before and after, over `knowledge`; without any where refuted."""
    import xarray

    if found.posterior is None:
        return xarray.Dataset(attrs={"refuted": found.refuted})
    bands, after = envelopes(case, wanted, found, progress), found.posterior
    before = np.array([prior_support(number) for number in found.prior.values()]).T
    ends = np.stack([after.lower, after.upper], axis=1)
    ends = np.stack([np.broadcast_to(before, ends.shape), ends])
    return bands.assign(
        inputs=(("knowledge", "alpha", "bound", "parameter"), ends, {"units": "SI, by input"})
    ).assign_coords(bound=["lower", "upper"], parameter=list(after.names))


def narrower(bands: xarray.Dataset) -> dict[str, float]:
    """Mean width of each output's envelope after the update over that before, lowest level."""
    width = (bands["upper"] - bands["lower"]).isel(alpha=0).mean("time")
    share = width.sel(knowledge="posterior") / width.sel(knowledge="prior")
    return {
        str(name): float(x)
        for name, x in zip(share["output"].values, np.asarray(share), strict=True)
    }
