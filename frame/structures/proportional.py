"""Structures whose modes the damping does not couple, so that motions are functions of M⁻¹K."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import singledispatch

import numpy as np

from alphacut.frame.calculus.jet import Array
from alphacut.frame.structures.linear import LinearSystem
from alphacut.frame.structures.matrix import MatrixStructure
from alphacut.frame.structures.storey import StoreyFrame

RAYLEIGH = ("rayleigh_mass", "rayleigh_stiffness")


@dataclass(frozen=True, eq=False)
class Proportional:
    """A structure with D = M (a + b S + 2 ζ √S), S = M⁻¹K.

    Args:
        bare: The same without damping; accelerations among its outputs are displacements there.
        order: Which derivative of the motion each output is of, 0, 1 or 2, shape (m,).
        rows: What outputs take of it, shape (m, n); None where that depends on parameters.
        ratio: ζ, a number or the name of a parameter.
        rayleigh: a in 1/s and b in s, numbers or names of parameters.
        affine: Whether M, K and the start are sums of one uncertain parameter each times
            constants.
    """

    bare: LinearSystem
    order: Array
    rows: Array | None
    ratio: str | float
    rayleigh: tuple[str | float, str | float]
    affine: bool = False

    def values(self, names: Sequence[str], points: Array) -> tuple[Array, Array, Array]:
        """ζ, a and b at points (S, d) of the parameters `names`, each (S, 1)."""

        def one(given: str | float) -> Array:
            if isinstance(given, str):
                return points[:, [list(names).index(given)]]
            return np.full((len(points), 1), float(given))

        a, b = self.rayleigh
        return one(self.ratio), one(a), one(b)


@singledispatch
def proportional(system: LinearSystem, names: Sequence[str]) -> Proportional | None:
    """How a structure's damping follows M and K; None where that is not known.

    Args:
        system: The structure.
        names: Its uncertain parameters.
    """
    del system, names
    return None


@proportional.register
def _(system: StoreyFrame, names: Sequence[str]) -> Proportional | None:
    given = system.parameters
    dampers = {name: given[name] for name in system.group("d")}
    rayleigh = tuple(name if name in names else given[name] for name in RAYLEIGH)
    kinds = [system._output(name)[0] for name in system.outputs]
    if any(dampers.values()) or set(dampers) & set(names) or len(system.ratios) > 1:
        return None
    if "ar" in kinds or (system.gravity and rayleigh[1]):  # which takes the springs alone
        return None
    still = tuple(f"q{name[1:]}" if name[0] in "av" else name for name in system.outputs)
    bare = replace(system, damping_ratio=(), rayleigh=(0.0, 0.0), outputs=still)
    order = np.array([{"v": 1, "a": 2}.get(kind, 0) for kind in kinds])
    rows = None if "shear" in kinds else _rows(bare)
    ratio: str | float = 0.0
    if system.ratios:
        ratio = "zeta" if "zeta" in names else given["zeta"]
    affine = bool(system.stiffness) and not system.gravity and rows is not None
    return Proportional(bare, order, rows, ratio, (rayleigh[0], rayleigh[1]), affine)


def _rows(bare: StoreyFrame) -> Array:
    """What outputs take of the displacements, shape (m, n)."""
    from alphacut.frame.structures.linear import evaluate

    found: Array = evaluate(bare, (), np.zeros((1, 0)), derivatives=False)[1].value[0]
    return found[:, : bare.floors]


@proportional.register
def _(system: MatrixStructure, names: Sequence[str]) -> Proportional | None:
    observed = [np.asarray(row, float) for row in system.observed.values()]
    whole = [np.append(row, np.zeros(2 * system.size - len(row))) for row in observed]
    halves = [np.split(row, 2) for row in whole]
    pure = all(not (q.any() and v.any()) for q, v in halves)
    if system.damping or len(system.ratios) > 1 or not pure:
        return None
    order = np.array([int(v.any()) for _, v in halves])
    ratio = system.ratios[0] if system.ratios else 0.0
    if isinstance(ratio, str) and ratio not in names:
        ratio = float(system.parameters[ratio])
    bare = replace(system, ratios=())
    rows = np.array([q + v for q, v in halves])
    named = [factor for kind in (system.mass, system.stiffness) for factor, _ in kind]
    affine = not any(callable(factor) for factor in named)
    return Proportional(bare, order, rows, ratio, (0.0, 0.0), affine)
