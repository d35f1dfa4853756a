"""Safe tolerances of a case: the largest scaling of its supports that keeps the limit, proved.

Where the modulus comes from the cell, the supports of the particle-size law and of the inclusions
are scaled with the others, and the frame gets the range of E over them.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from alphacut.case.case import Case
from alphacut.case.limits import exceeded_limits
from alphacut.frame import StoreyFrame
from alphacut.frame.decisions.safe_scale import SafeScale, safe_scale
from alphacut.frame.structures.modes import ModalError
from alphacut.frame.structures.quantities import RATIO, Output, of_storey_frame
from alphacut.fuzzy import FuzzyNumber, Interval, Signed, Triangular, propagate
from alphacut.fuzzy.campaign.campaign import CampaignError
from alphacut.io.files import Document
from alphacut.io.problem import BadInput
from alphacut.io.progress import Tick
from alphacut.stages.material.campaign import Campaign, campaign
from alphacut.stages.vibration.envelope_task import task_of
from alphacut.stages.vibration.structure import Structure, structure
from alphacut.stages.vibration.studies import left_out
from alphacut.stages.vibration.update import input_unit
from alphacut.stochastic.theta.truncated_normal import Array

Range = Callable[[float], tuple[float, float]]
Ends = Callable[[float], Mapping[str, tuple[float, float]]]
MOST = 2.0
"""Largest scale that is asked for by default."""
SCALES = 13
"""Scales at which the range of the cell's modulus is computed; between them it is interpolated."""
HALVINGS, BEYOND = 60, 1 + 1e-9
"""Steps towards the scale at which the weight buckles a storey, looked for up to just beyond."""
MEANINGFUL = 0.9
"""Share of the scale at which a support reaches what its input must not be."""


def _all_scaled(numbers: Mapping[str, FuzzyNumber], scale: float) -> dict[str, tuple[float, float]]:
    """Intervals of inputs at a scale of their supports about the nominal values."""
    ends = {name: (x.modal, *x.support) for name, x in numbers.items()}
    return {
        name: (middle - scale * (middle - low), middle + scale * (high - middle))
        for name, (middle, low, high) in ends.items()
    }


@dataclass(frozen=True)
class Tolerances:
    """Safe tolerances of a case.

    Args:
        found: Scale, box and witness of the frame's parameters.
        limits: Largest magnitude of each limited output, in SI.
        frame: The frame's parameters by name, in SI; without E where the cell gives it.
        cell: The cell's inputs, likewise; empty where the modulus is given.
        fixed: Fuzzy inputs that are held fixed.
        most: Largest scale that was asked for.
        ended: Why this is less than the caller asked for; empty where it is not.
    """

    found: SafeScale
    limits: Mapping[str, float]
    frame: Mapping[str, FuzzyNumber]
    cell: Mapping[str, FuzzyNumber]
    fixed: Sequence[str] = ()
    most: float = 2.0
    ended: str = ""

    @property
    def undecided(self) -> bool:
        """Whether neither a proof nor a motion above the limit was found beyond the safe scale."""
        return self.found.witness is None and (self.found.safe or 0.0) < self.most

    @property
    def intervals(self) -> dict[str, tuple[float, float]]:
        """Safe interval of every input, the cell's first, in SI; of scale 0 where nothing is."""
        scale = self.found.safe or 0.0
        return _all_scaled({**self.cell, **self.frame}, scale)

    def document(self) -> Document:
        """The result as it is printed with ``--json``, in SI."""
        found = self.found
        witness = (
            None if found.witness is None else dict(zip(found.names, found.witness, strict=True))
        )
        limits: list[Document] = [
            {"output": name, "limit": limit, "unit": Output(name).unit}
            for name, limit in self.limits.items()
        ]
        return {
            **(limits[0] if len(limits) == 1 else {"limits": limits}),
            "safe_scale": found.safe,
            "most": self.most,
            **({"most_reason": self.ended} if self.ended else {}),
            "undecided": self.undecided,
            "unsafe_scale": None if np.isinf(found.unsafe) else found.unsafe,
            "gap": None if np.isinf(found.gap) else found.gap,
            "safe": {name: list(ends) for name, ends in self.intervals.items()},
            "units": {name: input_unit(name) for name in (*self.intervals, *found.names)},
            "fixed": list(self.fixed),
            "witness": witness,
            "witness_share": found.share,
            "nominal_share": found.nominal_share,
            "nature": found.nature,
            "reason": found.reason,
            "between_nodes": "the motion between nodes is not included",
            "boxes": found.boxes,
            "seconds": found.seconds,
        }


def tolerances(
    case: Case,
    handed: FuzzyNumber | None,
    *,
    most: float | None = None,
    workers: int = 1,
    progress: Tick | None = None,
) -> Tolerances:
    """Largest scaling of the supports of [envelope] fuzzy for which the limit provably holds.

    Args:
        case: With the sections exceedance and envelope and a storey frame.
        handed: Modulus in Pa that stands in for the cell, if any.
        most: Largest scale that is asked for; None for `MOST`, or less where an input's meaning
            ends near it.
        workers: Processes of the proof.
        progress: Told the share done.

    Raises:
        ModalError: A mode does not oscillate within the largest scale.
        BadInput: The structure is no storey frame, or has no such output.
    """
    limits, over = exceeded_limits(case), case.envelope
    near, most = (MEANINGFUL, MOST) if most is None else (1.0, most)
    given = handed is not None or case.frame.modulus is not None or case.frame.stiffness is not None
    cell = None if given else campaign(case)
    modulus_range, most, ended = (None, most, "") if cell is None else _cell_range(cell, most)
    modulus = handed if cell is None or modulus_range is None else _triangle(modulus_range)
    wanted = structure(case, modulus)
    if wanted.frame is None:
        raise BadInput.of("frame", "missing: safe tolerances are those of a storey frame")
    inputs = wanted.inputs(over.fuzzy)
    own = {name: x for name, x in inputs.items() if modulus_range is None or name != "E"}
    computed = most

    def ends(scale: float) -> dict[str, tuple[float, float]]:
        found = _all_scaled(own, scale)
        if modulus_range is not None and "E" in inputs:
            found["E"] = modulus_range(min(scale, computed))
        return {name: found[name] for name in inputs}

    def reach(scale: float) -> tuple[Array, Array]:
        both = np.array([*ends(scale).values()], float)
        return both[:, 0], both[:, 1]

    most, ended = _with_meaning(wanted.frame, own, ends, most, ended, near)
    nominal = {name: number.modal for name, number in inputs.items()}
    proof = partial(safe_scale, _limited(wanted, tuple(limits), case), nominal, reach, limits)
    proof = partial(proof, duration=over.duration, step=over.step, most=most)
    try:
        found = proof(workers=workers, progress=progress or False)
    except ModalError as error:
        what = str(error).partition(";")[0]
        raise ModalError(f"{what}; less damping, narrower supports or a smaller --most") from None
    if cell is not None and found.safe and "E" in inputs:
        found = _within_cell(found, cell, list(inputs).index("E"))
    fixed = left_out(wanted, [task_of(case)])
    return Tolerances(found, limits, own, cell.inputs if cell else {}, fixed, most, ended)


def _with_meaning(
    frame: StoreyFrame,
    own: Mapping[str, FuzzyNumber],
    ends: Ends,
    most: float,
    ended: str,
    near: float,
) -> tuple[float, str]:
    """The largest scale, lowered to 1 or where every input has a meaning, and which has none.

    A meaning, or a frame that stands, that ends at a scale lowers what is above `near` times that.
    """
    found = [(BEYOND * most / near, "")]
    for name, number in own.items():
        (low, high), modal, rule = number.support, number.modal, of_storey_frame(name).range
        why = f"{name}, which must be {rule}, has no meaning"
        found += [(modal / (modal - low), why)] if rule and low < modal else []
        found += [((1 - modal) / (high - modal), why)] if rule == RATIO and high > modal else []
    end, why = _standing(frame, ends, *min(found))
    if why and near * end <= most > 1:
        return max(MEANINGFUL * end, 1.0), f"{why} from {end:.4g} on"
    return most, ended


def _standing(frame: StoreyFrame, ends: Ends, end: float, why: str) -> tuple[float, str]:
    """The scale from which on the weight buckles a storey, and which; `end` and `why` if none."""
    low = 0.0
    for _ in range(HALVINGS if frame.gravity else 0):
        middle = (low + end) / 2
        try:
            frame.require_standing(ends(middle))
            low = middle
        except ValueError as error:
            end, why = middle, str(error).partition(" it: ")[0] + " it"
    return end, why


def _limited(wanted: Structure, outputs: tuple[str, ...], case: Case) -> StoreyFrame:
    """The frame with the limited outputs alone."""
    assert wanted.frame is not None
    relative = [name for name in outputs if name.startswith("ar")]
    if relative and wanted.frame.ground is not None:
        what = f"{relative[0]} is relative to the ground, and tolerances are for absolute values"
        raise case.refuse("exceedance.output", what, f"a{relative[0][2:]}")
    try:
        return replace(wanted.frame, outputs=outputs)
    except ValueError as error:
        raise case.refuse("exceedance.output", str(error)) from None


def _moduli(cell: Campaign, scale: float) -> tuple[float, float]:
    """Range of E over the cell's supports at a scale, by the corners that the proved signs give."""
    inputs = {name: Interval(*ends) for name, ends in _all_scaled(cell.inputs, scale).items()}
    plan, shared, known = Signed(outputs=("E",)), cell.shared, cell.known
    found = propagate(
        cell.task, inputs, plan, alpha=[1.0], shared=shared, known=known, progress=False
    )
    lower, upper = found.bounds("E")
    return float(lower[0]), float(upper[0])


def _cell_range(cell: Campaign, most: float) -> tuple[Range, float, str]:
    """Range of E by scale, monotone between computed ones; the last of them, and why it is."""
    from scipy.interpolate import PchipInterpolator

    scales = np.union1d(np.linspace(0, most, SCALES), min(most, 1.0))
    ends, ended = list[tuple[float, float]](), ""
    for scale in map(float, scales):
        try:
            ends.append(_moduli(cell, scale))
        except CampaignError as error:
            kind, _, why = error.failures[0][1].partition(": ")
            if scale <= 1 or kind != "ValueError":  # the case's own supports, or another fault
                raise
            ended = f"at {scale:.4g} the cell has no modulus: {why}"
            break
    scales, both = scales[: len(ends)], np.array(ends)
    low, high = (PchipInterpolator(scales, both[:, side]) for side in (0, 1))
    return lambda scale: (float(low(scale)), float(high(scale))), float(scales[-1]), ended


def _triangle(modulus: Range) -> FuzzyNumber:
    """The modulus at scale 0 and 1 as a triangle, for the structure."""
    (low, high), (modal, _) = modulus(1.0), modulus(0.0)
    return Triangular(low, modal, high)


def _within_cell(found: SafeScale, cell: Campaign, column: int) -> SafeScale:
    """The safe scale, lowered until the range of E computed at it lies in the box proved safe."""
    assert found.safe is not None
    safe, low, high = found.safe, found.lower[column], found.upper[column]
    for lowered in (1.0, 1 - 1e-5, 1 - 1e-4, 1 - 1e-3, 1 - 1e-2):
        ends = _moduli(cell, lowered * safe)
        if low <= ends[0] and ends[1] <= high:
            return replace(found, safe=lowered * safe)
    raise RuntimeError("tolerances: the range of E over the safe box is not smooth in its scale")
