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
from math import comb
from typing import NamedTuple

import numpy as np

from alphacut.base.arrays import Array
from alphacut.frame import numbers
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


class FittedModel(NamedTuple):
    """A modal model of a box, with T time nodes and m outputs."""

    model: ModalModel
    error: Array  # proved bound of its error at the nodes, (T, m)
    excess: float  # largest error over the tolerance of its output
    # how often each input that contributes would have to be halved for an error within the
    # tolerance at the largest degree, at least 1; estimated
    halvings: float


def fitted_model(
    flow: LinearFlow,
    boxes: Boxes,
    tolerance: Array,
    models: dict[int, tuple[ModalModel, Array]],
    *,
    fixed: Mapping[str, float] | None = None,
    max_excess: float = 1.0,
) -> FittedModel:
    """Return a modal model whose error is within a tolerance, or the most accurate one found.

    The degree of its polynomials rises until the error is small enough, or no degree is expected to
    make it small enough.

    Args:
        flow: The exact response.
        boxes: Nested boxes of the inputs, the widest first, whose inputs all have a width there.
        tolerance: Error that is wanted at the nodes, shape (m,).
        models: Models of the box by their degree, with their errors, for this tolerance or smaller
            ones; further ones are added.
        fixed: Values of other parameters by name, where they are not nominal.
        max_excess: Multiple of the tolerance that is of use.

    Raises:
        UnprovedError: The structure has no smooth oscillating modes over the box.
    """
    n_inputs = len(boxes.names)
    # Tuned: with more than 3100 monomials, the degrees 13, 10 and 8 for 4, 5 and 6 inputs, a model
    # takes more time than bisections of the box do. A polynomial of degree N in n inputs has
    # (n + N)! / (n! N!) monomials.
    max_degree = numbers.MAX_DEGREE
    while comb(n_inputs + max_degree, n_inputs) > 3100 and max_degree > 2:
        max_degree -= 1
    # Most structures need few degrees, and the cost of a degree grows as the number of monomials.
    degree = min(numbers.FIRST_DEGREE, max_degree)
    best: FittedModel | None = None
    last_excess = np.inf
    step = 0
    # The factor of the error for each further degree. Before it is known, 0.1 is taken: a larger
    # one would go up in larger steps (tuned).
    decay = 0.1
    while True:
        # Modes that contribute less than a small part of the tolerance are left out; their energy
        # counts as error.
        if degree not in models:
            left_out = numbers.LEFT_OUT_MODES * tolerance
            model = ModalModel.of_degree(flow, boxes, degree, left_out, fixed=fixed)
            models[degree] = model, proved_error(model)
        model, error = models[degree]
        excess = float((error / tolerance).max())
        if step:
            decay = (excess / last_excess) ** (1 / step)
        # Halving the inputs that contribute divides the error of the degree N by 2^(N + 1), its
        # first term that is left out.
        log2_excess = np.log2(max(excess, 1.0)) + (max_degree - degree) * np.log2(decay)
        halvings = max(1.0, np.ceil(log2_excess / (max_degree + 1)))
        if best is None or excess < best.excess:
            best = FittedModel(model, error, excess, halvings)
        if excess <= 1 or degree == max_degree or decay >= 1:
            return best
        last_degree = degree + np.log(excess / max_excess) / -np.log(decay)
        if step and not last_degree < max_degree + 1:
            return best
        # Four fifths of the degrees that the errors ask for are taken at once (tuned: more often
        # end at a degree that is higher than necessary).
        step = min(max(1, int(0.8 * np.log(excess) / -np.log(decay))), max_degree - degree)
        last_excess = excess
        degree += step


def damped_modes(
    flow: LinearFlow, boxes: Boxes, fixed: Mapping[str, float], tolerance: Array
) -> Modes:
    """Return models of a structure's response over a box whose inputs all have a width.

    Args:
        flow: The exact response.
        boxes: The box.
        fixed: Values of other parameters by name, where they are not nominal.
        tolerance: Error that the polynomials may have at the nodes, shape (m,).

    Raises:
        UnprovedError: The structure has no smooth oscillating modes over the box, or the error of
            the polynomials exceeds 20 times the tolerance; `along` is the input to bisect.
    """
    max_excess = 20.0  # tuned: wider bounds are bisected in less time
    found = fitted_model(flow, boxes, tolerance, {}, fixed=fixed, max_excess=max_excess)
    if not found.excess <= max_excess:
        what = f"the proved error of the modes is {found.excess:.2g} times what it may be"
        along = int(error_fractions(found.model).argmax())
        raise UnprovedError(what, "take narrower inputs", along)
    return as_oscillators(found.model, found.error)


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
