"""Ranges of what the cell's models take, each refused by its key."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from alphacut.fuzzy.arrays import Array
from alphacut.fuzzy.refused import RefusedError
from alphacut.rve.cell.cell import AnyPhase, Interphase, Phase, VoigtPhase
from alphacut.rve.cell.outline import Outline, is_round
from alphacut.stochastic import RadiusMap, require_map

HALVES = "in halves of the cell's side"
JUMP = 0.01
"""Of radii over 1/2048 of the support of θ; twenty times as steep as maps of particles are."""
STIFFEST = 0.45
"""Poisson's ratio above which quadratic elements lock."""


def require_mesh_size(size: float) -> None:
    """Refuse an edge length outside (0, 1], in halves of the cell's side."""
    if not 0 < size <= 1:
        raise RefusedError("the mesh size", f"{size:g}", f"values in (0, 1], {HALVES}")


def require_points(points: int | None) -> None:
    """Refuse a quadrature rule in θ of fewer than two points; None means the model's choice."""
    if points is not None and points < 2:
        raise RefusedError("number of points of the rule in θ", points, "2 or more")


def require_continuous(radius_map: RadiusMap) -> Array:
    """Radii at 2049 even steps over θ; refuses a map with a jump, whose error no rule can tell."""
    require_map(radius_map)
    law = radius_map.distribution
    theta = np.linspace(law.lower, law.upper, 2049)
    radii = radius_map(theta)
    jump = int(np.argmax(abs(np.diff(radii))))
    if abs(radii[jump + 1] - radii[jump]) > JUMP:
        value = f"{radii[jump]:.4g} and {radii[jump + 1]:.4g} side by side"
        raise RefusedError(f"r at θ = {theta[jump]:.4g}", value, "maps without a jump")
    return np.asarray(radii)


def require_compressible(*phases: AnyPhase) -> None:
    """Refuse phases that are so incompressible that quadratic elements lock."""
    ratio = max((phase.poisson for phase in phases if isinstance(phase, Phase)), default=0.0)
    if ratio > STIFFEST:
        cure = "finite elements lock above: take the series"
        raise RefusedError("Poisson's ratio", f"{ratio:g}", f"values up to {STIFFEST:g}", cure)


def require_interphase(interphase: Interphase | None, outline: Outline) -> None:
    """Refuse an interphase in which elements lock, or around a particle that is not round."""
    if interphase is None:
        return
    require_compressible(interphase.phase)
    if not is_round(outline):
        raise RefusedError("interphase", "around an outline", "one around round particles")


def require_parts(
    radius_map: object, matrix: object, inclusions: object, *, isotropic: bool = True
) -> None:
    """Refuse arguments of `solve` that are no radius map, no phase and no sequence of phases."""
    kinds = (Phase,) if isotropic else (Phase, VoigtPhase)
    phases = (matrix, *inclusions) if isinstance(inclusions, Sequence) else ()
    has_phases = len(phases) > 1 and all(isinstance(phase, kinds) for phase in phases)
    is_map = callable(radius_map) and hasattr(radius_map, "distribution")
    if not (is_map and has_phases):
        parts = ", ".join(type(part).__name__ for part in (radius_map, matrix, inclusions))
        empty = " (empty)" if inclusions in ([], ()) else ""
        raise RefusedError(
            "parts of the cell",
            f"{parts}{empty}",
            "the radius map, the matrix's phase and a list of the inclusions' phases",
            "any stiffness is for slices and prism; write solve(radius, Phase(3e9), [Phase(70e9)])",
        )
