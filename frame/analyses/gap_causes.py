"""Why a bound of a peak is wide or not guaranteed, and what would narrow it, in words.

What is said is computed: what responses may add between the time nodes is part of the bound itself,
and the inputs and modes that matter most are those of the response at the centre of the box.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from alphacut.base.arrays import Array
from alphacut.frame.boxes import boxes
from alphacut.frame.dynamics.nonlinear import make_flow
from alphacut.frame.result import Envelope
from alphacut.frame.structures.linear import LinearSystem, evaluate, undamped_modes
from alphacut.frame.structures.model import StructureModel
from alphacut.frame.structures.storey import yields

UNPROVED = "unproved: "
"""What stands in the first note of an envelope before the reason why it is not guaranteed."""
WORDS_OF_WIDTH = ("wide", "may ", "not finite", "sub-boxes", "at all inputs", "are not shown")
"""Words of reasons that narrower inputs would help against."""
NAMED_FRACTION = 0.2
"""Fraction of the largest mode that another one must move an output by to be named beside it."""


class Influence(NamedTuple):
    """Inputs by name, the one that moves an output most first, with their largest changes of it.

    A change is that over half of the range of the input, extrapolated from 1 % of it at the centre
    of the box, as a fraction of the peak at the centre.
    """

    names: tuple[str, ...]
    changes: Array


def influence_of_inputs(model: StructureModel, band: Envelope, output: str) -> Influence:
    """Return by how much each input of an envelope on its lowest level moves an output.

    Raises:
        RefusedError: A response at the centre of the box does not exist.
    """
    cuts = boxes(band.inputs, [float(band.alpha[0])])
    radius = (cuts.upper[0] - cuts.lower[0]) / 2
    centre = (cuts.upper[0] + cuts.lower[0]) / 2
    small = np.diag(0.01 * radius)
    step = float(band.time[1] - band.time[0])
    flow = make_flow(model.with_outputs([output]), cuts.names, float(band.time[-1]), step)
    values = flow.values(centre + np.vstack([small, -small, np.zeros_like(small[:1])]))[..., 0]
    n_inputs = len(centre)
    changes = np.abs(values[:n_inputs] - values[n_inputs : 2 * n_inputs]).max(axis=1) / 0.02
    changes = changes / max(float(np.abs(values[-1]).max()), 1e-300)
    order = np.argsort(-changes)
    return Influence(tuple(cuts.names[k] for k in order), changes[order])


def main_modes(model: LinearSystem, output: str) -> str:
    """Return the modes that move an output most, at the nominal inputs, as "mode 1 (0.41 s)".

    A mode counts by the size of its shape at the output, times the size of the loads, of the motion
    of the ground and of the initial state in its shape.
    """
    observed = model.with_outputs([output])
    matrices, rows = evaluate(observed, (), np.zeros((1, 0)), derivatives=False)
    squared, shapes = undamped_modes(matrices.mass.value[0], matrices.stiffness.value[0])
    omega = np.sqrt(np.maximum(squared, 1e-300))
    n = len(omega)
    row = rows.value[0, 0]
    # The row is on displacements and velocities; a force moves mode k by 1/ω², and its velocity by
    # 1/ω.
    at_output = np.abs(row[:n] @ shapes) / omega**2 + np.abs(row[n:] @ shapes) / omega
    mass = matrices.mass.value[0]
    start = matrices.start.value[0, :, 0]
    excitation = omega**2 * np.abs(shapes.T @ mass @ start[:n])
    excitation += omega * np.abs(shapes.T @ mass @ start[n:])
    if observed.ground is not None:
        size = float(np.abs(observed.ground.samples).max())
        excitation += size * np.abs(shapes.T @ mass @ matrices.rigid[:, 0])
    if matrices.forces is not None:
        excitation += np.abs(shapes.T @ matrices.forces.value[0]).sum(axis=1)
    size_of_mode = at_output * excitation
    order = np.argsort(-size_of_mode)[:3]
    named = sorted(k for k in order if size_of_mode[k] >= NAMED_FRACTION * size_of_mode.max())
    numbers = " and ".join(str(k + 1) for k in named)
    periods = ", ".join(f"{2 * np.pi / omega[k]:.3g} s" for k in named)
    return f"mode{'s' if len(named) > 1 else ''} {numbers} ({periods})"


def missing_guarantee(model: StructureModel, band: Envelope, output: str) -> str:
    """Return why an output of an envelope is not guaranteed, and which input to narrow.

    It is empty if no proof was tried.
    """
    first_note = next(iter(band.notes), "")
    _, found, reason = first_note.partition(UNPROVED)
    if not found:
        return ""
    reason = reason.partition("; take quasi-monte-carlo")[0]  # which has been taken
    # Reasons that say what helps are whole, and narrower inputs help against others of width alone.
    says_what_helps = any(word in reason for word in ("narrow ", "take "))
    is_of_width = any(word in reason for word in WORDS_OF_WIDTH)
    if says_what_helps or not is_of_width:
        return reason
    return f"{reason}; narrow {_most_important(model, band, output)} first"


def open_part(band: Envelope) -> str:
    """Return which part of the box a proof to limits has left open; empty if there is none."""
    return next(
        (x for x in band.notes if x.partition(" % ")[2].startswith("of the box is closed")), ""
    )


def wide_gap(
    model: StructureModel, band: Envelope, output: str, *, gap: float, between: float
) -> str:
    """Return why a guaranteed bound of an output is far from an attained value, and what helps.

    Args:
        model: The structure.
        band: The guaranteed envelope.
        output: The output.
        gap: Distance of the bound from the attained value, as a fraction of the bound.
        between: What the bound contains for the response between time nodes, as a fraction of it.
    """
    step = float(band.time[1] - band.time[0])
    causes: list[str] = []
    cures: list[str] = []
    if between > 0.3 * gap:
        causes.append(f"{between:.0%} of it is what may come between time nodes {step:g} s apart")
        cures.append("take a smaller step")
    if between < 0.7 * gap:
        modes = "its modes"
        if isinstance(model, LinearSystem) and not yields(model):
            modes = main_modes(model, output)
        add = "adds" if modes.startswith("mode ") else "add"
        causes.append(f"over the ranges of the inputs it is open how much {modes} {add}")
        cures.append(f"narrow {_most_important(model, band, output)} first, which moves it most")
    return f"{', and '.join(causes)}; {', or '.join(cures)}"


def _most_important(model: StructureModel, band: Envelope, output: str) -> str:
    """Return the name of the input that moves an output most."""
    return influence_of_inputs(model, band, output).names[0]
