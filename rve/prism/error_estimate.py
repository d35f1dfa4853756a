"""Error of a product-space result, measured against planar elements of order 4.

The product space has no θ-derivative, so its exact solution at each θ is a planar cell. A table of
such cells over the radius is a reference that shares neither elements nor mesh with the wedges; its
own declared error is added. Where planar cells have no mesh (particles in touch) bounds take their
place.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from alphacut.rve.bounds import hashin_shtrikman_bulk, reuss, voigt
from alphacut.rve.cell import STRAIN, Phase, square_moduli, with_ratio, with_ratio_errors
from alphacut.rve.ranks import ALONE, Ranks
from alphacut.rve.result import Homogenised, StressCurve
from alphacut.rve.slices.curve import ratio_error
from alphacut.rve.slices.theta_rule import extreme_radii, theta_rule
from alphacut.rve.table.build import PlanarSource
from alphacut.rve.table.cache import stored_table
from alphacut.rve.table.interpolant import TableRange
from alphacut.stochastic import RadiusMap
from alphacut.stochastic.theta.truncated_normal import Array

_FINE = 128  # nodes in θ that leave nothing out
_ACCURACIES = [float(f"{d}e-{k}") for k in (4, 5, 6, 7) for d in (10, 5, 2)] + [1e-7]
_FIRST = 0.18  # accuracy of the first reference over the expected error
_SHARE, _SHARE_OF_EACH = 0.2, 0.5  # of the largest and of each error, which a reference may leave

Moduli = Callable[[Array], Array]  # at radii (n,), shape (n, 3)


def judged(
    result: Homogenised,
    radius_map: RadiusMap,
    phases: tuple[Phase, Phase],
    *,
    layers: Array,
    expected: float = 1.0,
    cache: Path | None = None,
    ranks: Ranks = ALONE,
) -> Homogenised:
    """The result with its declared errors.

    Args:
        result: Of the product space.
        radius_map: Its map.
        phases: Its matrix and inclusion.
        layers: About the relative errors that the layers in θ leave in the mean moduli and the
            ratio, shape (4,); the rest is booked to the mesh.
        expected: About the largest error, for which the first reference is accurate enough.
        cache: Folder where tables are kept; None keeps them in the process.
        ranks: Those that share the making of tables.
    """
    source = partial(_reference, radius_map, phases, cache=cache, ranks=ranks)
    mean, nodes = _distances(result.curve, radius_map, source, expected) or _within_bounds(
        result.curve, radius_map, phases
    )
    layers = np.minimum(layers, mean)
    return replace(
        result,
        curve=replace(result.curve, error=nodes[:, [0, 2]]),
        errors={"space": (1 + mean) / (1 + layers) - 1, "theta": layers},
    )


def _distances(
    curve: StressCurve,
    radius_map: RadiusMap,
    source: Callable[[float], tuple[Moduli, Moduli]],
    expected: float,
) -> tuple[Array, Array] | None:
    """Errors of means and ratio, and at nodes, by ever better references; None without any."""
    wanted, found, failed = _FIRST * expected, None, False
    while True:
        step = next((k for k, least in enumerate(_ACCURACIES) if least <= wanted), -1)
        try:
            mean, nodes, noise = _distance(curve, radius_map, *source(_ACCURACIES[step]))
        except RuntimeError:  # no planar mesh, or none fine enough
            if found or step == 0:
                return found
            failed, wanted = True, 10 * _ACCURACIES[step]
            continue
        found = (1 + mean) * (1 + noise) - 1, nodes
        allowed = np.fmin(_SHARE * np.nanmax(mean[:3]), _SHARE_OF_EACH * mean[:3])
        left = float((noise[:3] / np.maximum(allowed, 1e-300)).max())
        if failed or left <= 1 or _ACCURACIES[step] == _ACCURACIES[-1]:
            return found
        wanted = _ACCURACIES[step] / max(left, 2.0)


def _distance(
    curve: StressCurve, radius_map: RadiusMap, exact: Moduli, left: Moduli
) -> tuple[Array, Array, Array]:
    """Distances from a reference, of means and at nodes, and what the former owe to its error."""
    fine = theta_rule(radius_map, points=_FINE)
    moduli = moduli_of(curve)
    slices, noise = exact(radius_map(fine.nodes)), left(radius_map(fine.nodes))
    other = with_ratio(fine.weights @ slices)
    noise = np.append(noise[:, :3].max(axis=0), ratio_error(fine.weights, slices, noise))
    # σ11 is printed, the whole stiffness exported: on a mesh x1 is not quite x2
    both = moduli, moduli if curve.stiffness is None else square_moduli(curve.stiffness)
    mean = np.max([_apart(with_ratio(curve.weights @ one), other) for one in both], axis=0)
    nodes = _apart(moduli, exact(radius_map(curve.theta)))
    return mean, (1 + nodes) * (1 + left(radius_map(curve.theta))[:, :3]) - 1, noise


def mean_moduli(curve: StressCurve) -> Array:
    """C11 + C12, C11 − C12, C33 and the ratio of the last two, by their means, shape (4,)."""
    return with_ratio(curve.weights @ moduli_of(curve))


def moduli_of(curve: StressCurve) -> Array:
    """C11 + C12, C11 − C12 and C33 at the nodes, shape (n, 3), in Pa.

    The second is nan where no third load was solved.
    """
    if curve.stiffness is None:
        known = curve.s11 / STRAIN, np.full(curve.s11.size, np.nan), curve.s12 / (2 * STRAIN)
        return np.stack(known, axis=-1)
    moduli = square_moduli(curve.stiffness)
    moduli[:, 0] = curve.s11 / STRAIN
    return moduli


def reference_range(radius_map: RadiusMap, phases: tuple[Phase, Phase]) -> TableRange:
    """What a reference covers."""
    low, high = (float(r) for r in extreme_radii(radius_map))
    return TableRange(phases[0], phases[1].poisson, (low, high), (phases[1].modulus,) * 2)


def _reference(
    radius_map: RadiusMap,
    phases: tuple[Phase, Phase],
    accuracy: float,
    *,
    cache: Path | None,
    ranks: Ranks,
) -> tuple[Moduli, Moduli]:
    """Moduli at radii by a table of planar cells, and their declared relative errors."""
    span, inclusion = reference_range(radius_map, phases), phases[1]
    make = partial(PlanarSource, ranks=ranks)
    table, _ = stored_table(span, cache, accuracy=accuracy, make=make, ranks=ranks)
    modulus = np.array([inclusion.modulus])

    def exact(radius: Array) -> Array:
        return np.asarray(table.moduli(radius, modulus)[:, 0])

    def left(radius: Array) -> Array:
        return np.asarray(table.space_error(radius) + table.interpolation)

    return exact, left


def _within_bounds(
    curve: StressCurve, radius_map: RadiusMap, phases: tuple[Phase, Phase]
) -> tuple[Array, Array]:
    """Errors of the mean moduli and ratio, and of those at nodes, that no exact value exceeds."""
    fraction = np.pi / 4 * radius_map(curve.theta) ** 2
    moduli = moduli_of(curve)
    bounds = [square_moduli(bound(fraction, *phases)) for bound in (reuss, voigt)]
    for bound, bulk in zip(bounds, hashin_shtrikman_bulk(fraction, *phases), strict=True):
        bound[:, 0] = 2 * bulk
    nodes = np.max([_apart(moduli, bound) for bound in bounds], axis=0)
    mean = np.max(
        [_apart(curve.weights @ moduli, curve.weights @ bound) for bound in bounds], axis=0
    )
    return with_ratio_errors(mean), nodes


def _apart(first: Array, second: Array) -> Array:
    """Relative distance by the larger of both ratios."""
    return np.maximum(first / second, second / first) - 1
