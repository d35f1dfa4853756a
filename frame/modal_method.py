"""Envelopes by modal intervening variables: the default for linear structures."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np

from frame.box import UnitFlow
from frame.envelope import Envelope, signed_envelope
from frame.flow import LinearFlow
from frame.jet import Array
from frame.modal import ModalModel, fit_modes
from frame.modal_search import ModalSearch


def modal(
    flow: UnitFlow, progress: Callable[[float], None] | None = None, *, tolerance: float = 1e-6, budget: int = 280, seed: int = 0
) -> Envelope:
    """Envelope of a linear structure from a polynomial modal model over the widest box.

    Args:
        flow: Trajectories of a `LinearFlow`.
        progress: Called with the fraction done.
        tolerance: Wanted error of the modal model, in units of the outputs.
        budget: Most eigen-analyses.
        seed: Of the samples that find the basins.

    Raises:
        ModalError: The structure has no smooth oscillating modes over the box.
        ValueError: The flow is not that of a linear structure.
    """
    if not isinstance(flow.flow, LinearFlow):
        raise ValueError("method: 'modal' needs a linear structure; take graph-follower")
    begun = time.perf_counter()
    model = fit_modes(flow.flow, flow.boxes, tolerance=tolerance, budget=budget)
    bounds, at = search_levels(model, ModalSearch(seed=seed), progress)
    return signed_envelope(
        flow,
        bounds,
        at,
        method="modal",
        nature="estimated",
        trajectories=model.analyses,
        seconds=time.perf_counter() - begun,
        error=np.broadcast_to(2 * model.error, bounds.shape[:-1]).copy(),
        facts={"model_error": float(model.error.max()), "degree": int(model.eigenvalue.index.sum(1).max())},
    )


def search_levels(model: ModalModel, search: ModalSearch, progress: Callable[[float], None] | None) -> tuple[Array, Array]:
    """Bounds (A, T, m, 2) and unit coordinates (A, T, m, 2, d) on all levels, from the narrowest box to the widest, nested."""
    cuts = model.boxes
    shape = (len(cuts.alpha), len(model.time), len(model.outputs), 2)
    bounds, at = np.empty(shape), np.empty((*shape, len(cuts.names)))
    for done, level in enumerate(reversed(range(shape[0]))):
        if progress:
            progress(done / shape[0])
        bounds[level], at[level] = search.run(model, *cuts.unit(level), np.zeros((0, len(cuts.names))))
        if done:
            kept = bounds[level + 1] > bounds[level]
            bounds[level][kept], at[level][kept] = bounds[level + 1][kept], at[level + 1][kept]
    return bounds, at
