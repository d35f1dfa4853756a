"""How many modes are worth enclosing, and how well: an estimate at the middle of the box."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from alphacut.frame.calculus.taylor_model import TaylorModel
from alphacut.frame.modes.blocks import CentredMatrices
from alphacut.frame.modes.rest import Excitation
from alphacut.frame.modes.structure import Classical
from alphacut.frame.response.duhamel import responses_at_nodes
from alphacut.frame.response.oscillators import POWERS, feedthrough
from alphacut.frame.structures.loads import History
from alphacut.fuzzy.arrays import Array

MAX_NODES = 500
"""Nodes at which responses are compared."""


def modes_wanted(
    structure: Classical,
    centre: CentredMatrices,
    excited: TaylorModel,
    excitation: Excitation,
    allowed: Array,
) -> tuple[int, Array]:
    """Least number of lowest modes to keep, so that truncating the others errs by what is allowed.

    It is an estimate by the bounds of `TruncatedModes`, with sums and responses in the middle of
    the box.

    Args:
        structure: The structure.
        centre: Its modes in the middle of the box.
        excited: Sources in the coordinates of `centre`, shape (sources, n).
        excitation: The loads, the nodes and the names of the sources.
        allowed: Truncation error of each output that is allowed, shape (m,).

    Returns:
        The number, and the relative error of each mode's λ that changes an output by its allowed
        error, shape (n,).
    """
    loads, time, sources = excitation
    time = time[:: -(-len(time) // MAX_NODES)]
    squared, n = centre.squared, centre.modes
    read = (structure.rows @ centre.basis)[:, :n] * structure.factor.value[:, None]
    participation = excited.value[:, :n]
    reads_massless = np.any((structure.rows @ centre.basis)[:, n:], axis=1)
    a, b = structure.rayleigh.value
    decay = (a + b * squared) / 2 + structure.ratio.value[:n] * np.sqrt(squared)
    omega = np.sqrt(np.maximum(squared - decay**2, 1e-6 * squared))
    error, sensitivity = np.zeros((n, len(allowed))), np.zeros((n, len(allowed)))
    sigma = -decay + 1j * omega
    motions = {source: _motion(source, sigma, loads, time) for source in sources}
    for o, order in enumerate(structure.order):
        for s, source in enumerate(sources):
            waves = _waves(source, sigma, motions[source][0], int(order))
            waves = waves + feedthrough(source, loads, int(order), time)
            slope = np.abs(motions[source][1]).max(1) * omega ** (order + (source == "start")) / 2
            # λ |de/dλ|, as |dσ/dλ| ≈ 1/(2 ω)
            sensitivity[:, o] += np.abs(read[o] * participation[s]) * slope
            errors = [
                _truncation_error(read[o], participation[s], waves, squared, x) for x in POWERS
            ]
            # the first power needs Σ read², which is unknown where massless unknowns are read
            first = int(reads_massless[o])
            error[:, o] += np.min(errors[first:], axis=0)
    sufficient = np.flatnonzero((error <= allowed).all(1))
    wanted = max(int(sufficient[0]), 1) if len(sufficient) else n
    return wanted, np.min(allowed / np.maximum(sensitivity, 1e-300), axis=1)


def _truncation_error(
    read: Array, participation: Array, waves: Array, squared: Array, power: float
) -> Array:
    """Error of an output without the modes from k on, for each k, shape (n,).

    By Cauchy and Schwarz it is the root of Σ a² Σ β² over these modes times half the range of
    λ^power e; from power ½ on the terms a² are divided by λ, at 1 those of β² too.

    Args:
        read: Output's coefficients a, shape (n,).
        participation: The source's participations β, shape (n,).
        waves: Responses e, shape (n, T).
        squared: λ, shape (n,).
        power: One of `POWERS`.
    """
    outputs = _tail_sums(read**2 / squared ** float(power > 0))
    sources = _tail_sums(participation**2 / squared ** float(power == 1))
    scaled = waves * squared[:, None] ** power
    high, low = (np.maximum.accumulate(sign * scaled[::-1])[::-1] for sign in (1, -1))
    half = np.maximum(high, low) if power == POWERS[1] else _with_mode_below(high + low) / 2
    return np.asarray(np.sqrt(outputs * sources) * half.max(1))


def _motion(source: str, sigma: Array, loads: Mapping[str, History], time: Array) -> Array:
    """ρ(σ; t) of a load, or exp(σ t), and its derivative by σ at nodes, shape (2, modes, T)."""
    if source in loads:
        return np.asarray(responses_at_nodes(sigma, loads[source], time, 1)[0].swapaxes(1, 2))
    free = np.exp(sigma[:, None] * time)
    return np.stack([free, time * free])


def _waves(source: str, sigma: Array, motion: Array, order: int) -> Array:
    """Responses to a unit share of a source, as those of `waves`, shape (modes, T)."""
    G = sigma[:, None] ** order * motion
    if source == "start":
        return np.asarray(G.real - (sigma.real / sigma.imag)[:, None] * G.imag)
    side = -1.0 if source == "load" else 1.0
    return np.asarray(side * G.imag / sigma.imag[:, None])


def _with_mode_below(x: Array) -> Array:
    """Each row as the one before: ranges reach down to the mode below, as frequencies vary."""
    return np.concatenate([x[:1], x[:-1]])


def _tail_sums(x: Array) -> Array:
    """For each entry, the sum of it and of all that follow."""
    return np.asarray(np.cumsum(x[::-1])[::-1])
