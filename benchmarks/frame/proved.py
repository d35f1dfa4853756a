"""Proved values of structures that are known exactly, for benchmarks: motions and eigenvalues."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from alphacut.frame import Envelope, Proof, envelope
from alphacut.frame.bounds.box import over_box
from alphacut.frame.boxes import boxes
from alphacut.frame.modes.clusters import centred_matrices, enclose_subspaces
from alphacut.frame.structures.linear import LinearSystem
from alphacut.fuzzy import FuzzyNumber

Range = tuple[float, float]


def motion(
    structure: LinearSystem, duration: float, step: float, gap: float | None = None
) -> Envelope:
    """Return the motion of a structure with its nominal parameters, guaranteed at time nodes.

    Args:
        structure: A linear structure that the proofs of `envelope` cover.
        duration: In s, a multiple of `step`.
        step: Distance of the time nodes, in s.
        gap: Width of bounds that is allowed, as a fraction of the peak of each output.

    Raises:
        ValueError: The motion is not guaranteed.
    """
    name, value = next(iter(structure.parameters.items()))
    method = None if gap is None else Proof(gap=gap, tolerance=gap)
    found = envelope(structure, {name: value}, method, duration=duration, step=step, alpha=(0.0,))
    if not np.isfinite(found.proved.upper).all():
        raise ValueError(f"no proof: {'; '.join(found.notes)}")
    return found


def outputs_at(structure: LinearSystem, time: float, gap: float | None = None) -> dict[str, Range]:
    """Return proved bounds of each output at one time in s, by its name.

    Structure and `gap` are those of `motion`.
    """
    ends = motion(structure, time, time / 10, gap).proved
    last = zip(ends.lower[0, -1].tolist(), ends.upper[0, -1].tolist(), strict=True)
    return dict(zip(structure.outputs, last, strict=True))


def eigenvalues(
    structure: LinearSystem, count: int, inputs: Mapping[str, FuzzyNumber | float] | None = None
) -> list[Range]:
    """Return proved bounds of the lowest eigenvalues ω², in 1/s².

    Args:
        structure: A linear structure whose undamped modes uncouple it.
        count: How many of the lowest eigenvalues.
        inputs: Uncertain parameters, whose supports are the box of all that is bounded; the nominal
            structure alone unless given.

    Raises:
        ValueError: One of the modes meets another one in the box.
    """
    cuts = boxes(inputs or dict([next(iter(structure.parameters.items()))]), (0.0,))
    model = over_box(structure, cuts.names, cuts.lower[0], cuts.upper[0])
    centre, used = centred_matrices(model.mass, model.stiffness)
    found = dict[int, Range]()
    for block in enclose_subspaces(centre, used, count).blocks:
        if len(block.modes) == 1:
            lower, upper = block.eigenvalue_block.bounds()
            found[int(block.modes[0])] = (float(lower[0, 0]), float(upper[0, 0]))
    if missing := set(range(count)) - set(found):
        raise ValueError(f"modes {sorted(missing)} meet others")
    return [found[k] for k in range(count)]


def mapped(function: np.ufunc, ends: Range, factor: float = 1.0) -> Range:
    """Return a monotone function of bounds, times a factor, widened by 1e-14 of their size."""
    values = sorted(factor * float(function(x)) for x in ends)
    return values[0] - 1e-14 * abs(values[0]), values[1] + 1e-14 * abs(values[1])
