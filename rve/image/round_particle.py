"""The image model: the round particle as the pixels that it fills, proved bounds at each θ.

Inner and outer pixels bracket the disc, so the middle of their bounds has an error that is proved
in the cell; the rule in θ adds an estimate.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from time import perf_counter

import numpy as np

from alphacut.rve.cell import Cell, Phase, square_moduli, with_ratio_errors
from alphacut.rve.image.fields.conjugate_gradient import ConjugateGradient
from alphacut.rve.image.moduli import ModuliInterval, PlaneModuli
from alphacut.rve.image.outlines.equation import Equation
from alphacut.rve.image.outlines.outline import Grid, phase_ranges
from alphacut.rve.image.phase_images import moduli_images
from alphacut.rve.image.solve import CrispBounds, solve_between
from alphacut.rve.result import Homogenised
from alphacut.rve.settings import require_points
from alphacut.rve.slices.curve import certified, curve_of, mean_errors, with_errors
from alphacut.rve.slices.theta_rule import DIGITS, extreme_radii, theta_error, theta_rule
from alphacut.stochastic import RadiusMap


@dataclass(frozen=True)
class RasterModel:
    """Proved bounds of inner and outer pixels at the nodes of a Gauss rule in θ.

    Args:
        pixels: Pixels along the cell's side, even, at least 8.
        points: Nodes in θ, of each smooth piece where the map jumps or bends; at least 2.

    Raises:
        ValueError: A value lies outside its range.
    """

    pixels: int = 128
    points: int = 6
    name = "image"

    def __post_init__(self) -> None:
        if self.pixels < 8 or self.pixels % 2:
            raise ValueError(f"the cell has {self.pixels} pixels; take an even number from 8 on")
        require_points(self.points)

    def solve(
        self, radius_map: RadiusMap, matrix: Phase, inclusions: Sequence[Phase]
    ) -> list[Homogenised]:
        """One result for each of `inclusions`, in their order."""
        began = perf_counter()
        rule = theta_rule(radius_map, points=self.points)
        at_nodes = np.round(radius_map(rule.nodes), DIGITS)
        radii = np.unique(np.concatenate([at_nodes, np.round(extreme_radii(radius_map), DIGITS)]))
        nodes = np.searchsorted(radii, at_nodes)
        results = []
        for inclusion in inclusions:
            slices = [self.slice(radius, matrix, inclusion) for radius in radii]
            stiffness = np.array([(s.bounds.lower + s.bounds.upper) / 2 for s in slices])
            error = with_ratio_errors(np.array([s.bounds.relative_error for s in slices]))
            curve = curve_of(rule, stiffness[nodes])
            moduli = square_moduli(stiffness)
            errors = {
                "space": mean_errors(curve, error[nodes]),
                "theta": theta_error(
                    radius_map, rule, radii=radii, moduli=moduli, phases=(matrix, inclusion)
                ),
            }
            result = Homogenised(
                with_errors(curve, error[nodes]),
                self.name,
                "conjugate gradients, Fourier preconditioner",
                slices[0].upper.fields[0, 0].size,
                tuple(max(s.upper.iterations, s.lower.iterations) for s in slices),
                {"total": perf_counter() - began},
                errors,
                f"{rule.nodes.size} nodes in θ, proved bounds on {self.pixels}² pixels",
            )
            results.append(certified(result, Cell(matrix, inclusion, radius_map)))
        return results

    def slice(self, radius: float, matrix: Phase, inclusion: Phase) -> CrispBounds:
        """Bounds of the cell with a disc of this radius over half its side."""
        grid = Grid(self.pixels, self.pixels, 2.0, 2.0)
        outline = Equation(f"(x - 1)**2 + (y - 1)**2 <= {float(radius)!r}**2")
        phases = [
            ModuliInterval.crisp(PlaneModuli.of_young(phase.modulus, phase.poisson))
            for phase in (matrix, inclusion)
        ]
        images = moduli_images(*phase_ranges(outline.classify(grid)), phases)
        return solve_between(images, solver=ConjugateGradient())
