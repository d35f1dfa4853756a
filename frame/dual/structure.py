"""Structures with classical modes as expansions over the unit box: M(u), K(u), outputs, damping.

Covered is M q̈ + D q̇ + K q = −M ι a(t) + Σ b f(t) with D = a M + b K + 2 M Φ diag(ζ_k ω_k) Φᵀ M,
whose undamped modes uncouple the motion; what else a structure has is refused with the word why.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import singledispatch

import numpy as np

from alphacut.frame.calculus.taylor_model import TaylorModel, concatenate, solve
from alphacut.frame.calculus.unproved import UnprovedError
from alphacut.frame.structures.linear import LinearSystem, histories
from alphacut.frame.structures.loads import Factor
from alphacut.frame.structures.matrix import MatrixStructure, Terms, value_of
from alphacut.frame.structures.storey import StoreyFrame
from alphacut.fuzzy.arrays import Array, Rows

Inputs = Mapping[str, TaylorModel]


@dataclass(frozen=True, eq=False)
class Classical:
    """A structure over a box of d inputs, n unknowns, m outputs.

    Args:
        mass: M, V = (n, n).
        stiffness: K, V = (n, n).
        rows: What outputs take of the displacements, shape (m, n).
        factor: What they are multiplied by, V = (m,).
        order: Which derivative of the motion they take it of, shape (m,); of order 2 with the
            ground's acceleration added.
        start: Initial displacements and velocities, V = (2, n).
        pattern: ι, how the unknowns move with the ground, shape (n,).
        forced: M⁻¹ b of each history of forces by its name, V = (n,).
        rayleigh: a and b, V = (2,).
        ratio: ζ_k of the modes by rising frequency, V = (modes,); unknowns without mass have none.
    """

    mass: TaylorModel
    stiffness: TaylorModel
    rows: Array
    factor: TaylorModel
    order: Rows
    start: TaylorModel
    pattern: Array
    rayleigh: TaylorModel
    ratio: TaylorModel
    forced: dict[str, TaylorModel]


@singledispatch
def classical(system: LinearSystem, p: Inputs) -> Classical:
    """The structure with all its parameters as expansions, each V = ().

    Raises:
        UnprovedError: Its modes are not known to be classical.
    """
    del p
    raise UnprovedError(
        f"a {type(system).__name__} is not covered", "take a StoreyFrame or a MatrixStructure"
    )


@classical.register
def _(system: StoreyFrame, p: Inputs) -> Classical:
    n = system.floors
    links = _springs(system, p)
    elastic = links - _softening(system, p) if system.gravity else links
    _refuse_dashpots(system, p)
    below = np.eye(n) - np.eye(n, k=-1)  # drifts from displacements
    rows, factor, order = [], [], []
    for name in system.outputs:
        kind, z = system.quantity(name)
        row = (below if kind in ("drift", "shear") else np.eye(n))[z]
        rows.append(row)
        factor.append(links[z] if kind == "shear" else p["rayleigh_mass"] * 0.0 + 1.0)
        order.append({"v": 1, "a": 2}.get(kind, 0))
    rayleigh = stacked([p["rayleigh_mass"], p["rayleigh_stiffness"]])
    start = stacked([_of_floors(system, p, f"{x}{{}}_0") for x in "qv"])
    ratios = [p[name] for name in system.ratios]
    mass = _of_floors(system, p, "m{}").contract(np.eye(n)[:, :, None] * np.eye(n)[:, None])
    stiffness = elastic.contract(below[:, :, None] * below[:, None])
    columns = [
        p[x] * np.eye(n)[y.at - 1] for x, y in zip(system.force_names, system.loads, strict=True)
    ]
    start, forced = _pushed(system, start, columns, mass, stiffness)
    return Classical(
        mass,
        stiffness,
        np.array(rows),
        stacked(factor),
        np.array(order),
        start,
        np.ones(n),
        rayleigh,
        _of_modes(ratios, n, rayleigh),
        forced,
    )


@classical.register
def _(system: MatrixStructure, p: Inputs) -> Classical:
    if system.damping:
        raise UnprovedError(
            "a damping matrix couples the modes", "give damping ratios in its place"
        )
    n = system.size
    nothing = next(iter(p.values())) * 0.0
    rows = [np.append(row, np.zeros(2 * n - len(row))) for row in system.observed.values()]
    of_speed = np.array([bool(row[n:].any()) for row in rows])
    if any(fast and row[:n].any() for fast, row in zip(of_speed, rows, strict=True)):
        raise UnprovedError("an output mixes displacements and velocities", "observe them apart")
    start = [np.zeros(n) if x is None else np.asarray(x, float) for x in (system.q0, system.v0)]
    ratios = [nothing + p[x] if isinstance(x, str) else nothing + x for x in system.ratios]
    factors = stacked([nothing, nothing])
    mass, stiffness = _total(system.mass, p, n), _total(system.stiffness, p, n)
    columns = [spread(nothing + _value(x.amplitude, p), np.asarray(x.at)) for x in system.loads]
    moved, forced = _pushed(
        system, spread(nothing + 1.0, np.array(start)), columns, mass, stiffness
    )
    return Classical(
        mass,
        stiffness,
        np.array([row[:n] + row[n:] for row in rows]),
        stacked([nothing + _value(system.row_factors.get(x, 1.0), p) for x in system.observed]),
        of_speed.astype(int),
        moved,
        np.ones(n) if system.pattern is None else np.asarray(system.pattern, float),
        factors,
        _of_modes(ratios, len(system.massive), factors),
        forced,
    )


def _pushed(
    system: StoreyFrame | MatrixStructure,
    start: TaylorModel,
    columns: Sequence[TaylorModel],
    mass: TaylorModel,
    stiffness: TaylorModel,
) -> tuple[TaylorModel, dict[str, TaylorModel]]:
    """The start with static forces and impulses, and M⁻¹ b of each history of forces by its name.

    Args:
        system: The structure.
        start: Initial displacements and velocities without forces, V = (2, n).
        columns: Each force at the amplitude 1 of its history, V = (n,).
        mass: M, V = (n, n).
        stiffness: K, V = (n, n).
    """
    if not columns:
        return start, {}
    heavy = getattr(system, "massive", np.arange(len(mass.value)))
    placed = np.eye(len(mass.value))[:, heavy]
    inner = mass[heavy[:, None], heavy]
    names = {x.identity: name for name, x in histories(system).items() if name != "load"}
    forced, static, impulse = dict[str, TaylorModel](), start[0] * 0.0, start[1] * 0.0
    for force, column in zip(system.loads, columns, strict=True):
        push = (placed @ _solved(inner, column[heavy]))[:, 0]
        if force.history is None:
            impulse = impulse + push
            continue
        name = names[force.history.identity]
        forced[name] = forced[name] + push if name in forced else push
        if force.history.is_static:
            static = static + column * float(force.history.values(np.zeros(1))[0])
    if static.size().any():
        static = _solved(stiffness, static)[:, 0]
    return start + stacked([static, impulse]), forced


def _solved(matrix: TaylorModel, right: TaylorModel) -> TaylorModel:
    """A⁻¹ b, V = (n, 1), of A₀⁻¹ A and A₀⁻¹ b: what varies in all of A alike is diagonal there."""
    first: Array = np.asarray(np.linalg.inv(matrix.value))
    return solve(first @ matrix, first @ right[:, None])


def _of_floors(system: StoreyFrame, p: Inputs, pattern: str) -> TaylorModel:
    """Values of all floors, V = (n,), named as `pattern`."""
    return stacked([p[pattern.format(z + 1)] for z in range(system.floors)])


def _springs(system: StoreyFrame, p: Inputs) -> TaylorModel:
    """k_z, V = (n,), as given or 12 c E I / l³."""
    if system.stiffness:
        return _of_floors(system, p, "k{}")
    stiffness_factor = _of_floors(system, p, "c{}") * _of_floors(system, p, "l{}") ** -3.0
    inertia = _of_floors(system, p, "I{}") if len(system.moments) > 1 else stacked([p["I"]])
    return stiffness_factor * inertia * stacked([p["E"] * 12.0])


def _softening(system: StoreyFrame, p: Inputs) -> TaylorModel:
    """P_z / l_z of the weight above, V = (n,)."""
    n = system.floors
    above = _of_floors(system, p, "m{}").contract(system.gravity * np.tri(n))
    return above * _of_floors(system, p, "l{}") ** -1.0


def _refuse_dashpots(system: StoreyFrame, p: Inputs) -> None:
    if any(p[name].size() > 0 for name in system.group("d")):
        raise UnprovedError(
            "dashpots couple the modes", "give a damping ratio or Rayleigh's factors"
        )
    if system.gravity and p["rayleigh_stiffness"].size() > 0:
        raise UnprovedError(
            "Rayleigh's damping by the springs without the weights couples the modes",
            "give a damping ratio, or leave gravity out",
        )


def without_ratios(system: LinearSystem) -> LinearSystem:
    """The structure without damping ratios, whose damping matrix takes all modes to compute."""
    if isinstance(system, MatrixStructure):
        return replace(system, ratios=())
    return replace(system, damping_ratio=None) if isinstance(system, StoreyFrame) else system


def _of_modes(ratios: list[TaylorModel], n: int, like: TaylorModel) -> TaylorModel:
    """ζ_k, V = (n,): one for all, one for each, or none."""
    ratios_of_modes = ratios or [like[0] * 0.0]
    return stacked(ratios_of_modes * n if len(ratios_of_modes) == 1 else ratios_of_modes)


def _value(factor: Factor | str | float, p: Inputs) -> TaylorModel | float:
    """Value of a factor over the box.

    Raises:
        UnprovedError: It is no arithmetic of the inputs.
    """
    try:
        return value_of(factor, p)
    except (TypeError, AttributeError) as failure:
        raise UnprovedError(
            f"a factor is not arithmetic ({failure})", "write it with + − * and powers"
        ) from None


def _total(terms: Terms, p: Inputs, n: int) -> TaylorModel:
    """Sum of arrays times factors, V = (n, n)."""
    out = spread(next(iter(p.values())) * 0.0, np.zeros((n, n)))
    for factor, array in terms:
        value = _value(factor, p)
        out = out + (spread(value, array) if isinstance(value, TaylorModel) else value * array)
    return out


def stacked(models: Sequence[TaylorModel]) -> TaylorModel:
    """Several as one, V with a new first axis."""
    return concatenate([x[None] for x in models], -1 - models[0].rest.ndim)


def spread(factor: TaylorModel, array: Array) -> TaylorModel:
    """One function times an array of numbers, V = the array's shape."""
    return factor[(None,) * np.ndim(array)] * array
