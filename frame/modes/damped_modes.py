"""Modes of a structure whose dashpots couple them, as oscillators.

A damped mode λ = −g + iω with the coefficient C = a + ib adds 2 Re C ρ(t; λ) to an output, with
the Duhamel integral ρ of a load, or exp(λ t). In the responses of `Source`, Re ρ + (g/ω) Im ρ of a
displacement and Im ρ/ω, it is

    2 Re C ρ = 2 a (Re ρ + (g/ω) Im ρ) − 2 (a g + b ω) Im ρ/ω.

So each mode is an oscillator with two sources for each load. Outputs are taken off displacements
and velocities, accelerations by the equations of motion, with what forces add to these at once as a
term of its own. What the polynomials of the modes miss is bounded by theorem 1
(`model_error.proved_error`), and takes the place of the coupling of classical modes.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from math import comb

import numpy as np

from alphacut.base.arrays import Array
from alphacut.frame.boxes import Boxes
from alphacut.frame.calculus.taylor_model import ORDER, TaylorModel, concatenate
from alphacut.frame.calculus.unproved import UnprovedError
from alphacut.frame.dynamics.flow import LinearFlow
from alphacut.frame.modes.intervening import Oscillator, range_of
from alphacut.frame.modes.modal_model import ModalModel
from alphacut.frame.modes.model_error import error_between_nodes, error_fractions, proved_error
from alphacut.frame.modes.modes import Modes
from alphacut.frame.modes.truncated_modes import TruncatedModes, feedthroughs
from alphacut.frame.records.history import History
from alphacut.frame.response.load_tables import Direct
from alphacut.frame.response.oscillators import Source
from alphacut.frame.structures.loads import distinct_histories


def damped_modes(
    flow: LinearFlow, boxes: Boxes, fixed: Mapping[str, float], tolerance: Array
) -> Modes:
    """Return models of a structure's response over a box whose inputs all have a width.

    The degree of the polynomials rises until their error is within the tolerance, or the number of
    their terms is not worth its time.

    Args:
        flow: The exact response.
        boxes: The box.
        fixed: Values of other parameters by name, where they are not nominal.
        tolerance: Error that the polynomials may have at the nodes, shape (m,).

    Raises:
        UnprovedError: The structure has no smooth oscillating modes over the box, or the error of
            the polynomials exceeds 20 times the tolerance; `along` is the input to bisect.
    """
    degree = 2
    best, best_error = _model_of_degree(flow, boxes, fixed, degree, tolerance)
    excess = float((best_error.max(axis=0) / tolerance).max())
    # Tuned: polynomials of more terms take more time than bisections do.
    while excess > 1 and comb(len(boxes.names) + degree + 1, degree + 1) <= 3100 and degree < 14:
        degree += 1
        model, error = _model_of_degree(flow, boxes, fixed, degree, tolerance)
        new_excess = float((error.max(axis=0) / tolerance).max())
        if new_excess < excess:
            best, best_error = model, error
        if new_excess > 0.5 * excess:
            break  # further degrees do not converge
        excess = new_excess
    excess = float((best_error.max(axis=0) / tolerance).max())
    if not excess <= 20:
        what = f"the proved error of the modes is {excess:.2g} times what it may be"
        raise UnprovedError(what, "take narrower inputs", int(error_fractions(best).argmax()))
    return as_oscillators(best, best_error)


def _model_of_degree(
    flow: LinearFlow, boxes: Boxes, fixed: Mapping[str, float], degree: int, tolerance: Array
) -> tuple[ModalModel, Array]:
    """Return the modal model of a degree with its error, without what forces add at once."""
    model = ModalModel.of_degree(flow, boxes, degree, 0.1 * tolerance, fixed=fixed)
    loads = tuple(load for load in model.loads if not isinstance(load, Direct))
    model = replace(model, loads=loads)
    return model, proved_error(model)


def as_oscillators(model: ModalModel, error: Array) -> Modes:
    """Return a modal model with its error, shape (T, m), as oscillators and what they leave open.

    What forces add at once stands beside the oscillators.

    Raises:
        UnprovedError: A mode may not oscillate somewhere in the box.
    """
    parts: list[tuple[History | None, TaylorModel]] = [
        (load.history, load.share) for load in model.loads if not isinstance(load, Direct)
    ]
    if model.has_free_response:
        parts = [(None, model.coefficient), *parts]
    sources = list[Source]()
    for k, (history, _) in enumerate(parts):
        sources.append(Source(f"displacement{k}", history, is_displacement=True))
        sources.append(Source(f"velocity{k}", history))

    oscillators = []
    for k in range(model.count):
        omega = model.eigenvalue.imag[k]
        decay = -model.eigenvalue.real[k]
        omega_range = range_of(omega)
        if not omega_range[0] > 0:
            raise UnprovedError("a mode may not oscillate", "take less damping, or narrower inputs")
        participation = list[TaylorModel]()
        for _, coefficient in parts:
            a = coefficient.real[k]
            b = coefficient.imag[k]
            participation.append(a * 2.0)
            participation.append((a * decay + b * omega) * -2.0)
        quotient = decay * omega**-1.0
        low, high = range_of(quotient)
        oscillator = Oscillator(
            omega=omega.truncated(ORDER),
            decay=decay.truncated(ORDER),
            quotient=quotient.truncated(ORDER),
            participation=concatenate([x[None] for x in participation], -2).truncated(ORDER),
            omega_range=omega_range,
            # The tables take the upper end as the largest magnitude.
            quotient_range=(low, max(high, -low)),
        )
        oscillators.append(oscillator)
    truncated = list[TruncatedModes]()
    if model.structure.feeds is not None:
        forces = distinct_histories(model.flow.system.loads)
        factors = model.structure.feeds.truncated(ORDER).T
        truncated.append(feedthroughs(factors, forces, model.flow.time))
    return Modes(
        time=model.flow.time,
        sources=sources,
        orders=np.zeros(error.shape[1], int),
        oscillators=oscillators,
        truncated=truncated,
        open=error,
        open_between=error_between_nodes(model, error),
    )
