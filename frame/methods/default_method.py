"""Default method: the modal model where it keeps the error, else the Graph Follower."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from alphacut.frame.boxes import UnitFlow
from alphacut.frame.envelope import Envelope
from alphacut.frame.methods.auto import cheapest
from alphacut.frame.methods.modal import modal
from alphacut.frame.outputs import output_unit

TOLERANCE = 1e-4
"""Wanted error unless one is given, in m."""
SHARE = 1e-3
"""Wanted error where no output is a displacement, as a share of each output's peak at the modal
parameters.
"""
FITTED = 1e-6
"""Error wanted of the modal model, which costs little: in m, or a share of the peaks."""
OF_MODAL = frozenset({"certify", "seed", "boxes", "workers"})
"""Options that the method modal alone has."""


def default(
    flow: UnitFlow, progress: Callable[[float], None] | None = None, **options: Any
) -> Envelope:
    """Envelope of a linear structure by `auto`, or by `modal` with its own options.

    Args:
        flow: Trajectories of a `LinearFlow`.
        progress: Called with the fraction done.
        options: Options of `auto`, or of `modal`.

    Raises:
        ToleranceError: No method reaches the wanted error.
        ModalError: An option of `modal` is given, and the structure has no smooth oscillating modes
            over the box.
    """
    if OF_MODAL & options.keys():
        return modal(flow, progress, **options)
    tolerance = options.pop("tolerance", None)
    if tolerance is None:
        lengths = any(output_unit(name) == "m" for name in flow.outputs)
        flow, tolerance = (
            (flow, TOLERANCE) if lengths or flow.relative else (replace(flow, relative=True), SHARE)
        )
    return cheapest(
        flow, progress, tolerance=tolerance, fitted=min(FITTED, tolerance / 8), **options
    )
