"""The slices model: two-dimensional cell problems at the nodes of a rule in θ.

The product-space form has no θ-derivative, so its exact solution at each θ is the plane problem
with radius r(θ).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from time import perf_counter
from typing import ClassVar

import numpy as np
from numpy.polynomial.chebyshev import chebvander

from alphacut.fuzzy.arrays import Array, Rows
from alphacut.fuzzy.refused import RefusedError
from alphacut.rve.cell.cell import STRAIN, AnyPhase, Cell, Interphase, thickness_of
from alphacut.rve.cell.outline import Outline, circle
from alphacut.rve.cell.settings import (
    require_compressible,
    require_continuous,
    require_interphase,
    require_mesh_size,
    require_parts,
    require_points,
)
from alphacut.rve.result.bounds import mori_tanaka
from alphacut.rve.result.checks import with_checks
from alphacut.rve.result.moduli import square_moduli
from alphacut.rve.result.result import HomogenisedStiffness, PhaseEnergies, StressCurve
from alphacut.rve.slices.plane_cell import solve_slice
from alphacut.stochastic import RadiusMap, ThetaRule, gauss_rule

_ORDERS = 2, 3, 4
_DIGITS = 12  # radii equal to so many decimals are one slice
_FINE = 128  # points of a rule in θ whose error is below rounding
_SAFETY = 1.6  # of the error in θ
_NOISE = 1e-13  # of a declared error: what rounding leaves


@dataclass(frozen=True)
class SlicesModel:
    """Plane finite elements with curved sides at the nodes of a Gauss rule in θ.

    Args:
        order: Polynomial degree of the elements, 2 to 4.
        mesh_size: Edge length far from the interface, in halves of the cell's side, in (0, 1].
        points: Nodes in θ, at least 2.
        outline: Distance of the particle's edge from its centre over r(θ), a function of the angle.
    """

    order: int = 4
    mesh_size: float = 0.2
    points: int = 10
    outline: Outline = circle
    name: ClassVar[str] = "slices"

    def __post_init__(self) -> None:
        if self.order not in _ORDERS:
            raise RefusedError("order of the elements", self.order, "2, 3, 4")
        require_mesh_size(self.mesh_size)
        require_points(self.points)

    def solve(
        self,
        radius_map: RadiusMap,
        matrix: AnyPhase,
        inclusions: Sequence[AnyPhase],
        interphase: Interphase | None = None,
    ) -> list[HomogenisedStiffness]:
        """Homogenised stiffness for each of `inclusions`, in their order, with energies of phases.

        Raises:
            ConvergenceError: A linear system was not solved.
            RefusedError: A Poisson's ratio is above 0.45, or a radius does not fit.
        """
        require_parts(radius_map, matrix, inclusions, isotropic=False)
        require_compressible(matrix, *inclusions)
        require_interphase(interphase, self.outline)
        fine_radii = require_continuous(radius_map)
        start = perf_counter()
        rule = gauss_rule(radius_map.distribution, points=self.points)
        extremes = [fine_radii.min(), fine_radii.max()]  # for the error in θ
        all_radii = np.concatenate([radius_map(rule.nodes), extremes])
        radii, indices = np.unique(np.round(all_radii, _DIGITS), return_inverse=True)
        nodes = indices[: rule.nodes.size]  # index among the radii of each node in θ
        slices = [
            solve_slice(
                radius,
                matrix,
                inclusions,
                mesh_size=self.mesh_size,
                outline=self.outline,
                order=self.order,
                interphase=interphase,
            )
            for radius in radii
        ]
        pairs = [plane.energies_with_errors(self.order) for plane in slices]
        energies, energy_errors = (np.array(x) for x in zip(*pairs, strict=True))
        seconds = {"total": perf_counter() - start}
        results = []
        for m, inclusion in enumerate(inclusions):
            cell = Cell(matrix, inclusion, radius_map, self.outline, interphase)
            stiffness = np.array([plane.by_order[self.order][m] for plane in slices])
            errors = np.array([plane.error(self.order, square=cell.square)[m] for plane in slices])
            curve = StressCurve.from_stiffness(rule, stiffness[nodes])
            moduli = square_moduli(stiffness)
            result = HomogenisedStiffness(
                curve=curve,
                method=self.name,
                solver="cholesky",
                unknowns=max(plane.unknowns[self.order] for plane in slices),
                seconds=seconds,
                errors={
                    "space": _space_errors(curve, errors[nodes], square=cell.square),
                    "theta": theta_error(cell, rule, radii=radii, moduli=moduli),
                },
                cell=cell,
                energies=_mean_energies(
                    cell, rule, radii, nodes, energies[:, m], energy_errors[:, m]
                ),
            )
            results.append(with_checks(result))
        return results


def _space_errors(curve: StressCurve, error: Array, *, square: bool) -> Array:
    """Relative errors of mean moduli over θ, (3,), from those at the nodes, (n, 3)."""
    moduli = square_moduli(np.asarray(curve.stiffness))
    mean = curve.weights @ moduli
    errors = np.asarray(curve.weights @ (moduli * error) / mean)
    if square:  # C11 and C22 differ by the mesh alone; s11 has C11, the moduli their mean
        errors[0] += abs(STRAIN * mean[0] / curve.mean[0] - 1)
    return errors


def _mean_energies(
    cell: Cell, rule: ThetaRule, radii: Array, nodes: Rows, values: Array, errors: Array
) -> PhaseEnergies:
    """Mean energies of the phases over θ from those at the radii, (n, phases, 2, 3), in Pa."""

    def absolute_theta_error(moduli: Array) -> Array:
        return theta_error(cell, rule, radii=radii, moduli=moduli) * rule.mean(moduli[nodes])

    # energies X ∂c/∂X may change sign, but c + X ∂c/∂X are moduli with stiffer phases
    moduli = values.sum(axis=(1, 2))
    stiffer_errors = [
        [absolute_theta_error(moduli + values[:, phase, kind]) for kind in range(2)]
        for phase in range(len(cell.phases))
    ]
    error_in_theta = np.array(stiffer_errors) + absolute_theta_error(moduli)
    return PhaseEnergies(rule.mean(values[nodes]), rule.mean(errors[nodes]) + error_in_theta)


def theta_error(cell: Cell, rule: ThetaRule, *, radii: Array, moduli: Array) -> Array:
    """Declared relative errors of the mean C11 + C12, C11 − C12 and C33 by `rule`, shape (3,).

    The logarithm of a modulus over that of Mori and Tanaka is smooth in √(1 − r²), also where soft
    particles or an incompressible matrix make the modulus itself steep. Its weighted least-squares
    polynomials of several degrees are averaged by a rule of `_FINE` points; the error is the
    largest distance of these means from that by `rule`, with a safety factor.

    Args:
        cell: The cell; with an interphase r is the outer radius.
        rule: Its n nodes.
        radii: Radii solved, shape (m,): those of the nodes and the two extreme ones.
        moduli: C11 + C12, C11 − C12 and C33 at `radii`, shape (m, 3).
    """
    nodes = np.searchsorted(radii, np.round(cell.radius(rule.nodes), _DIGITS))
    weights = np.maximum(np.bincount(nodes, rule.weights, minlength=radii.size), 1e-6)
    root = np.sqrt(weights)[:, None]
    fine = gauss_rule(cell.radius.distribution, points=_FINE)
    fine_radii = cell.radius(fine.nodes)

    def mori_tanaka_moduli(r: Array) -> Array:
        bulk, shear = mori_tanaka(np.pi / 4 * r**2, [cell.matrix, cell.inclusion])
        return np.stack([2 * bulk, 2 * shear, shear], axis=-1)

    scale = mori_tanaka_moduli(fine_radii)
    logarithm = np.log(moduli / mori_tanaka_moduli(radii))
    low, high, span = logarithm.min(axis=0), logarithm.max(axis=0), np.ptp(logarithm, axis=0)
    thickness = thickness_of(cell.interphase)
    x, fine_x = (np.sqrt(1 - (r + thickness) ** 2) for r in (radii, fine_radii))
    middle, half_width = (x.min() + x.max()) / 2, max(np.ptp(x), 1e-12) / 2
    mean, distances = rule.weights @ moduli[nodes], []
    # up to the interpolating polynomial, from a degree with some freedom to spare on
    for degree in range(min(max(0, radii.size - 4), 9), min(radii.size, 15)):
        basis = chebvander((x - middle) / half_width, degree)
        coefficients = np.linalg.lstsq(basis * root, logarithm * root, rcond=1e-14)[0]
        fit = chebvander((fine_x - middle) / half_width, degree) @ coefficients
        fine_moduli = scale * np.exp(np.clip(fit, low - span, high + span))
        distances.append(fine.weights @ fine_moduli / mean - 1)
    return np.asarray(_SAFETY * np.abs(distances).max(axis=0) + _NOISE)
