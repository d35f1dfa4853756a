"""Stiffness of each storey, from its columns or as it is given, less what the weight above takes.

A weight P on a storey of height h that is displaced by Δ presses with P Δ / h against what holds
it: the linear geometric stiffness −P/h (P-Delta). The columns' own bending between their ends is
left out: a clamped column buckles there at 12 E I / l² and in truth at π² E I / l².
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from alphacut.frame.calculus.jet import Jet
from alphacut.frame.structures.storey_checks import StoreyValues
from alphacut.fuzzy.refused import RefusedError

Entry = Jet | float
Ends = Mapping[str, tuple[float, float]]


def chain(links: Sequence[Entry]) -> list[list[Entry]]:
    """Matrix of a chain fixed at its lower end from the coefficients of its links."""
    n = len(links)
    rows: list[list[Entry]] = [[0.0] * n for _ in range(n)]
    for i in range(n):
        rows[i][i] = links[i] + links[i + 1] if i + 1 < n else links[i]
        if i + 1 < n:
            rows[i][i + 1] = rows[i + 1][i] = -1.0 * links[i + 1]
    return rows


def springs(frame: StoreyValues, p: Mapping[str, Jet]) -> list[Jet]:
    """k_z of every storey, in N/m: as given, or 12 c E I / l³ of its columns."""
    storeys = range(1, len(frame.masses) + 1)
    if frame.stiffness:
        return [p[f"k{z}"] for z in storeys]
    if len(frame.moments) > 1:
        rigidities = [12 * p["E"] * p[f"I{z}"] for z in storeys]
    else:  # 24 E I / l³ of two columns in section 6.1
        rigidity = 12 * p["E"] * p["I"]
        rigidities = [rigidity] * len(frame.masses)
    return [
        of_one * p[f"c{z}"] * p[f"l{z}"] ** -3
        for z, of_one in zip(storeys, rigidities, strict=True)
    ]


def softening(frame: StoreyValues, p: Mapping[str, Jet]) -> list[Jet]:
    """P_z / l_z of every storey, in N/m, with the weight P_z of all floors above it."""
    found: list[Jet] = []
    weight: Jet | None = None
    for z in range(len(frame.masses), 0, -1):
        own = frame.gravity * p[f"m{z}"]
        weight = own if weight is None else weight + own
        found.append(weight * p[f"l{z}"] ** -1)
    return found[::-1]


def require_standing(stiff: Sequence[Jet], soft: Sequence[Jet]) -> None:
    """Refuse parameter sets at which the weight buckles a storey.

    A chain's stiffness is positive definite where that of each storey is positive.

    Raises:
        RefusedError: Somewhere k_z is not above P_z / l_z.
    """
    for z, (k, taken) in enumerate(zip(stiff, soft, strict=True), start=1):
        bad = np.flatnonzero(~(k.value > taken.value))
        if len(bad):
            raise RefusedError(
                f"stiffness of storey {z} under P-Delta",
                f"{k.value[bad[0]]:.5g} N/m",
                f"more than weight over height, {taken.value[bad[0]]:.5g} N/m",
                "else it buckles: take stiffer storeys, lighter floors or narrower supports",
            )
