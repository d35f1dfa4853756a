"""M, D, K, start and rows as sums of constants times scalar factors: m_z, k_z, d_z and so on.

What a motion feels of each factor gives its derivatives by all parameters, at the cost of a few
scalars and not of all entries for every parameter.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import singledispatch
from math import prod

import numpy as np

from alphacut.frame.calculus.jet import Array, Jet
from alphacut.frame.structures.field_frame import FieldFrame
from alphacut.frame.structures.linear import LinearSystem
from alphacut.frame.structures.matrix import MatrixStructure
from alphacut.frame.structures.slopes import one_by_one
from alphacut.frame.structures.storey import StoreyFrame
from alphacut.frame.structures.storey_springs import Entry, chain, softening

RAYLEIGH = ("rayleigh_mass", "rayleigh_stiffness")


Monomial = tuple[float, Mapping[str, int]]
"""A coefficient and the powers of parameters that multiply it."""
Slope = tuple[int, int, Array]
"""Derivative (S,) of which factor by which parameter."""
Sensitivities = tuple[Array, Array, Array]


@dataclass(frozen=True, eq=False)
class Factors:
    """A structure whose arrays are sums over J factors, the first of them 1.

    Args:
        monomials: The first of the factors.
        others: The rest, jets of shape (S,) from all parameters; None where there are none.
        parts: What a unit of each puts into M, D and K, shape (J, 3, n, n).
        start: Into the initial state, shape (J, 2n).
        rows: Into the observation rows, shape (J, m, 2n).
        over: Factor by which a row is divided, shape (m,); 0 for none.
        rigid: How the unknowns move rigidly with the ground, shape (n,).
        modal: All parameters with their modal values.
    """

    monomials: Sequence[Monomial]
    others: Callable[[Mapping[str, Jet]], Sequence[Entry]] | None
    parts: Array
    start: Array
    rows: Array
    over: Array
    rigid: Array
    modal: Mapping[str, float]

    def at(
        self, system: LinearSystem, names: Sequence[str], points: Array, *, derivatives: bool
    ) -> tuple[Array, list[Slope]]:
        """Factors (S, J) at `points` (S, d) of `names`, and their derivatives that are not zero.

        Args:
            system: The structure whose they are.
            names: Its uncertain parameters.
            points: Their values.
            derivatives: Whether derivatives are wanted; else there are none.
        """
        given = {**self.modal, **dict(zip(names, points.T, strict=True))}
        value, slopes = np.empty((len(points), len(self.parts))), list[Slope]()
        place = {name: k for k, name in enumerate(names) if derivatives}
        for j, (coefficient, powers) in enumerate(self.monomials):
            terms = {name: given[name] ** power for name, power in powers.items()}
            value[:, j] = prod(terms.values(), start=coefficient)
            for name in (name for name in powers if name in place):
                others = prod((x for key, x in terms.items() if key != name), start=coefficient)
                own = powers[name] * given[name] ** (powers[name] - 1) * others
                slopes.append((j, place[name], np.zeros(len(points)) + own))
        if self.others is not None:
            p = one_by_one(system, names, points, derivatives=derivatives)
            for j, entry in enumerate(self.others(p), start=len(self.monomials)):
                jet = entry if isinstance(entry, Jet) else Jet.constant(entry, 0)
                value[:, j] = jet.value[: len(points)]
                first = jet.first.reshape(-1, len(points))
                slopes += [(j, k, own) for k, own in enumerate(first) if own.any()]
        return value, slopes

    def row(self, value: Array, output: Array) -> Array:
        """Rows (N, 2n) of outputs (N,) at factors (N, J)."""
        found = np.empty((len(output), self.rows.shape[-1]))
        for o in np.unique(output):
            found[output == o] = value[output == o] @ self.rows[:, o]
        found /= value[np.arange(len(output)), self.over[output]][:, None]
        return found

    def gradient(self, value: Array, by: Sensitivities, row: Array, output: Array) -> Array:
        """Derivatives (N, J) of outputs (N,) by the factors (N, J), of rows (N, 2n).

        Args:
            value: The factors.
            by: Derivatives by M, D and K, shape (N, 3, n, n), by the start, shape (N, 2n), and by
                the row, shape (N, 2n).
            row: The rows.
            output: Which output.
        """
        (parts, back, seen), every = by, np.arange(len(output))
        total = parts.reshape(len(parts), -1) @ self.parts.reshape(len(self.parts), -1).T
        total += back @ self.start.T
        divisor = value[every, self.over[output]]
        for o in np.unique(output):
            own = output == o
            total[own] += seen[own] @ self.rows[:, o].T / divisor[own][:, None]
        total[every, self.over[output]] -= (row * seen).sum(1) / divisor
        return np.asarray(total)


@singledispatch
def factors(system: LinearSystem, names: Sequence[str]) -> Factors | None:
    """A structure's factors; None where its arrays are no such sums, or are not known to be.

    Args:
        system: The structure.
        names: Its uncertain parameters.
    """
    del system, names
    return None


@factors.register
def _(system: MatrixStructure, names: Sequence[str]) -> Factors | None:
    del names
    if system.ratios:
        return None
    kinds, n = (system.mass, system.damping, system.stiffness), system.size
    listed = [(place, *term) for place, kind in enumerate(kinds) for term in kind]
    plain = [(place, f, array) for place, f, array in listed if not callable(f)]
    functions = [(place, f, array) for place, f, array in listed if callable(f)]
    monomials: list[Monomial] = [(1.0, {})]
    monomials += [(1.0, {f: 1}) if isinstance(f, str) else (f, {}) for _, f, _ in plain]
    parts = np.zeros((len(listed) + 1, 3, n, n))
    for j, (place, _, array) in enumerate([*plain, *functions]):
        parts[j + 1, place] = array
    start, rows = np.zeros((len(parts), 2 * n)), np.zeros((len(parts), len(system.outputs), 2 * n))
    start[0] = np.concatenate([np.zeros(n) if x is None else x for x in (system.q0, system.v0)])
    for o, row in enumerate(system.observed.values()):
        rows[0, o, : len(row)] = row
    rigid = np.ones(n) if system.pattern is None else np.asarray(system.pattern, float)
    others = (lambda p: [f(p) for _, f, _ in functions]) if functions else None
    over = np.zeros(len(system.outputs), int)
    return Factors(monomials, others, parts, start, rows, over, rigid, system.parameters)


@factors.register
def _(system: StoreyFrame, names: Sequence[str]) -> Factors | None:
    n, given = system.floors, system.parameters
    if system.ratios or isinstance(system, FieldFrame):  # whose places are sums of parameters
        return None
    damped = [bool(given[name]) or name in names for name in RAYLEIGH]
    links = [_link(system, z) for z in range(1, n + 1)]
    masses: list[Monomial] = [(1.0, {f"m{z}": 1}) for z in range(1, n + 1)]
    monomials: list[Monomial] = [(1.0, {}), *masses, *links]
    monomials += [(1.0, {f"d{z}": 1}) for z in range(1, n + 1)]
    monomials += [(1.0, {f"{x}{z}_0": 1}) for x in "qv" for z in range(1, n + 1)]
    for name, on, own in zip(RAYLEIGH, damped, (masses, links), strict=True):
        monomials += [(c, {**powers, name: 1}) for c, powers in own if on]
    gravity = bool(system.gravity)
    others = (lambda p: softening(system, p)) if gravity else None
    alone = np.eye(n)[:, :, None] * np.eye(n)[:, None]  # floor by floor
    linked = np.array([chain(list(unit)) for unit in np.eye(n)])
    between = linked if system.damper_placement == "storey" else alone
    blocks = [(0, alone), (2, linked), (1, between), *[(1, 0 * alone)] * 2]
    blocks += [(1, alone)] * damped[0] + [(1, linked)] * damped[1] + [(2, -linked)] * gravity
    parts = np.zeros((1 + n * len(blocks), 3, n, n))
    start = np.zeros((len(parts), 2 * n))
    start[1 + 3 * n : 1 + 5 * n] = np.eye(2 * n)
    for place, (kind, arrays) in enumerate(blocks):
        parts[1 + n * place : 1 + n * (place + 1), kind] = arrays
    rows, over = _rows(system, parts)
    return Factors(monomials, others, parts, start, rows, over, np.ones(n), given)


def _link(frame: StoreyFrame, z: int) -> Monomial:
    """Stiffness of storey z, from 1: as given, or 12 c E I / l³."""
    if frame.stiffness:
        return 1.0, {f"k{z}": 1}
    moment = f"I{z}" if len(frame.moments) > 1 else "I"
    return 12.0, {"E": 1, moment: 1, f"c{z}": 1, f"l{z}": -3}


def _rows(frame: StoreyFrame, parts: Array) -> tuple[Array, Array]:
    """Rows of a storey frame's outputs by its factors, and the mass that divides a floor's."""
    n, outputs = frame.floors, [frame._output(name) for name in frame.outputs]
    rows, over = np.zeros((len(parts), len(outputs), 2 * n)), np.zeros(len(outputs), int)
    for o, (kind, z) in enumerate(outputs):
        if kind in ("a", "ar"):
            over[o] = 1 + z
            rows[:, o] = -np.concatenate([parts[:, 2, z], parts[:, 1, z]], 1)
            continue
        own = rows[1 + n + z if kind == "shear" else 0, o]
        own[z + n * (kind == "v")] = 1.0
        if kind in ("drift", "shear") and z > 0:
            own[z - 1] = -1.0
    return rows, over
