"""Series model of the cell: round particles, whose multipoles are those of `circles`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from time import perf_counter
from typing import Any, ClassVar, Self

from alphacut.base.errors import RefusedError, is_number
from alphacut.rve.cell.cell import Cell, Phase, require_points, require_solve_arguments
from alphacut.rve.cell.lattice import Arrangement, lattice_of
from alphacut.rve.result.cell_model import AnyModel, Resolution
from alphacut.rve.result.checks import with_checks
from alphacut.rve.result.moduli import AVERAGES, AXES
from alphacut.rve.result.result import HomogenisedStiffness
from alphacut.rve.series.circles import series_of
from alphacut.rve.series.means import Series, converged_means, mean_energies
from alphacut.stochastic import RadiusMap


@dataclass(frozen=True)
class SeriesModel(AnyModel):
    """The cell by multipole series at the nodes of a Gauss rule in θ.

    Args:
        points: Number of nodes of the rule. None takes as many as bring the mean moduli of finer
            rules within `accuracy`.
        accuracy: Relative error allowed for the series at each θ and, without `points`, for the
            quadrature in θ; from `MIN_ACCURACY` to 0.1.
        energies: Whether to compute the energies of the phases, for loss factors. They are always
            computed where a phase has a loss factor.
        lattice: "square", "hexagonal", or the sides [a, b] of a rectangle; see `lattice_of`.

    Example:
        >>> from alphacut.rve import Phase
        >>> from alphacut.stochastic import HermiteMap
        >>> model = SeriesModel(points=8)
        >>> [result] = model.solve(HermiteMap(0.2, 0.1, 0.6, 0.1), Phase(20e9), [Phase(80e9)])
        >>> f"{result.modulus / 1e9:.3f} GPa"
        '22.773 GPa'
    """

    points: int | None = None
    accuracy: float = 1e-11
    energies: bool = False
    lattice: Arrangement = "square"
    name: ClassVar[str] = "series"
    convention: ClassVar[str] = AVERAGES[AXES]
    is_exact: ClassVar[bool] = True
    MIN_ACCURACY: ClassVar[float] = 1e-12
    MAX_ACCURACY: ClassVar[float] = 0.1
    DEFAULT_TOLERANCE: ClassVar[float | None] = None

    def __post_init__(self) -> None:
        """RefusedError for fewer than 2 points, or an accuracy or lattice that is not allowed."""
        require_points(self.points)
        lattice_of(self.lattice)
        accuracy = self.accuracy
        if not (is_number(accuracy) and self.MIN_ACCURACY <= accuracy <= self.MAX_ACCURACY):
            allowed = f"values in [{self.MIN_ACCURACY:g}, {self.MAX_ACCURACY:g}]"
            raise RefusedError("the accuracy of the series", repr(accuracy), allowed)

    @classmethod
    def with_resolution(cls, resolution: Resolution) -> Self:
        """Return the model whose E has at most the relative error that a resolution allows.

        An accuracy below `MIN_ACCURACY` of the class is not asked for, however small the tolerance.

        Args:
            resolution: Its `tolerance` of E (None, or 0, for `DEFAULT_TOLERANCE` of the class; if
                that is None too, for the default accuracy) and whether strain `energies` of the
                phases are wanted; all else concerns other models.

        Raises:
            RefusedError: The tolerance is so large that the accuracy would be above 0.1.
        """
        tolerance = resolution.tolerance or cls.DEFAULT_TOLERANCE
        shared: dict[str, Any] = {"energies": resolution.energies, "lattice": resolution.lattice}
        if tolerance is None:
            return cls(**shared)
        # The errors of the series at each θ and of the quadrature add up: .4 of the tolerance for
        # each leaves some for terms of second order.
        accuracy = max(0.4 * tolerance, cls.MIN_ACCURACY)
        return cls(accuracy=accuracy, **shared)

    @property
    def series(self) -> Series:
        """The multipole series of the lattice."""
        return series_of(lattice_of(self.lattice))

    def for_samples(self, moduli: tuple[float, float] | None, *, energies: bool) -> Self:
        """Return this model, with energies if they are needed; see `CellModel`."""
        return replace(self, energies=energies or self.energies)

    def coarser(self) -> Self:
        """Return the model with 100 times the error, by which declared errors are tested."""
        return replace(self, accuracy=min(100.0 * self.accuracy, self.MAX_ACCURACY))

    def solve(
        self, radius_map: RadiusMap, matrix: Phase, inclusions: Sequence[Phase]
    ) -> list[HomogenisedStiffness]:
        """Return the homogenised stiffness for each of the inclusions, in their order.

        Args:
            radius_map: Radius of the particle over θ, in halves of the distance of the nearest
                particles: of the cell's side, or its shorter side.
            matrix: Isotropic material around the particle.
            inclusions: Isotropic materials of the particle, which is solved with each.

        Returns:
            A HomogenisedStiffness for each inclusion, with `modulus` and `poisson` of its average,
            `stiffness` in Pa, declared errors by "space" (series) and "theta" (quadrature), checks
            against classical bounds, and the wall time of all together. Strain energies of the
            phases are there if `self.energies` is set or a phase has a loss factor.

        Raises:
            SeriesError: Particles nearly touch.
            RuleError: No quadrature rule converges, since the radius map is not smooth.
            RefusedError: A phase is not isotropic, there is no inclusion, a radius is outside (0,
                1), or the map jumps.
            CertificateError: A result violates a bound by more than its declared error.
        """
        require_solve_arguments(radius_map, matrix, inclusions)
        start = perf_counter()
        series = self.series
        solver = series.converged_moduli
        moduli = partial(solver, matrix=matrix, inclusions=inclusions, tolerance=self.accuracy)
        means = converged_means(radius_map, moduli, points=self.points, accuracy=self.accuracy)
        seconds = perf_counter() - start
        results = []
        for mean, inclusion in zip(means, inclusions, strict=True):
            cell = Cell(matrix, inclusion, radius_map, lattice=lattice_of(self.lattice))
            result = self._checked_result(
                curve=mean.curve,
                method=self.name,
                unknowns=series.unknowns(int(mean.terms.max())),
                seconds=seconds,
                errors=mean.errors,
                cell=cell,
            )
            if self.energies or matrix.loss is not None or inclusion.loss is not None:
                result = replace(result, energies=mean_energies(series, cell, mean))
            results.append(result)
        return results

    def _checked_result(self, **parts: Any) -> HomogenisedStiffness:
        """Return the result with its fields, and with checks of symmetry and bounds."""
        return with_checks(HomogenisedStiffness(**parts))
