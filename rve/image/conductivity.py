"""The fuzzy conductivity of an image or a volume: proved bounds on each α-level.

It is that of heat in W/(m K), of electricity in S/m, or a diffusivity in m²/s: the equation is the
same, and bounds have the unit of the phases' conductivities.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from time import perf_counter
from typing import Any

import numpy as np

from alphacut.base.arrays import Array
from alphacut.base.errors import require
from alphacut.base.progress_bar import Progress, progress_reporter, subprogress
from alphacut.fuzzy import FuzzyNumber
from alphacut.fuzzy.sets.claimed import widest_cut
from alphacut.fuzzy.sets.numbers import checked_levels, fuzzy_number
from alphacut.rve.image.bounds import ConductivityBounds, Enclosure
from alphacut.rve.image.model import ConductionModel, nested
from alphacut.rve.image.phases import RIGID, ConductivityInterval
from alphacut.rve.image.study import (
    AlphaLevel,
    FuzzyImage,
    GreyImage,
    ImageStudy,
    as_fuzzy,
    cut_or_nominal,
    image_study,
)

MARGIN = 1e-15
"""Relative margin for the rounding of a product and a quotient of doubles."""


@dataclass(frozen=True)
class Conductor:
    """A phase of an image that conducts.

    Args:
        conductivity: Conductivity; 0 of an insulator, 1e18 or more of a perfect conductor.
    """

    conductivity: FuzzyNumber

    def is_solid_at(self, level: float) -> bool:
        """Return whether the lower end of an α-cut is above 0 and below infinity."""
        return 0 < self.conductivity.cut(level).lower < RIGID

    def interval(self, level: AlphaLevel, dimension: int) -> ConductivityInterval:
        """Return the conductivities at an α-level, or the nominal one if it is None.

        RefusedError for one that is not allowed.
        """
        return ConductivityInterval(*cut_or_nominal(self.conductivity, level))


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class FuzzyImageConductivity(FuzzyImage):
    """Proved bounds of the conductivity of an image or volume, repeated periodically, on α-levels.

    Args:
        bounds: Bounds of the tensor at each level.
        reference: Hashin–Shtrikman bounds of the mean for isotropic composites of the nominal
            phases; None beside insulators or perfect conductors.
        straight: Lower and upper bound of φ k₀, the conductivity of as much of the one conducting
            phase in straight channels, shape (A, 2), the upper one with the least k₀ of the level
            and the lower one with the greatest; None unless all other phases are insulators.
    """

    bounds: Sequence[ConductivityBounds]
    reference: Enclosure | None
    straight: Array | None

    @property
    def conductivity(self) -> FuzzyNumber:
        """Fuzzy mean over all directions; between two levels the wider α-cut holds.

        RefusedError where a bound is infinite, beside perfect conductors.
        """
        return fuzzy_number(self.alpha, self.mean)

    @property
    def mean(self) -> Array:
        """Bounds of the mean over all directions, the trace over the dimension, shape (A, 2)."""
        return nested([bounds.mean for bounds in self.bounds])

    @property
    def components(self) -> dict[str, Array]:
        """Bounds of the components of the tensor by name, as "k_xx", shape (A, 2) each."""
        names: tuple[str, ...] = ("k_xx", "k_yy", "k_xy")
        if len(self.lengths) == 3:
            names = ("k_xx", "k_yy", "k_zz", "k_yz", "k_xz", "k_xy")
        values = np.moveaxis(nested([bounds.components() for bounds in self.bounds]), 1, 0)
        return dict(zip(names, values, strict=True))

    @property
    def named_bounds(self) -> dict[str, Array]:
        """Bounds of the mean "k" and of the components by name, shape (A, 2) each."""
        return {"k": self.mean, **self.components}

    @property
    def tortuosity(self) -> dict[str, Array]:
        """Bounds of the tortuosity factor τ = φ k₀/k along the axes, as "tau_x", shape (A, 2) each.

        φ is the fraction of the one phase that conducts, k₀ its conductivity, and k that of the
        image along the axis. The upper bound is infinite where nothing is known to percolate.
        RefusedError unless all phases but one are insulators.
        """
        allowed = "insulators, of conductivity 0, beside one phase that conducts"
        require(self.straight is not None, "conductivities", "of several conductors", allowed)
        assert self.straight is not None
        found: dict[str, Array] = {}
        for axis in "xyz"[: len(self.lengths)]:
            # k rises with k₀ in proportion: each bound of k belongs to one end of k₀.
            with np.errstate(divide="ignore"):
                ends = self.straight / self.components[f"k_{axis}{axis}"][:, ::-1]
            found[f"tau_{axis}"] = ends * [1 - MARGIN, 1 + MARGIN]
        return found

    def _variables(self) -> dict[str, Any]:
        """Return the bounds of the tensor as variables of the dataset."""
        tensors = np.array([[bounds.lower, bounds.upper] for bounds in self.bounds])
        axes = ["x", "y", "z"][: len(self.lengths)]
        return {
            "conductivity": (("alpha", "bound", "row", "column"), tensors),
            "row": ("row", axes),
            "column": ("column", axes),
        }


def fuzzy_image_conductivity(
    image: GreyImage,
    conductivities: Sequence[FuzzyNumber | float],
    *,
    thresholds: Sequence[FuzzyNumber | float] = (),
    labels: Sequence[float] = (),
    alpha: Sequence[float] = (0.0, 0.5, 1.0),
    device: str = "cpu",
    progress: Progress | bool | None = None,
) -> FuzzyImageConductivity:
    """Return proved bounds of the conductivity of an image or volume on α-levels.

    The image is one cell of a periodic medium; that of a picture conducts in its plane.

    Args:
        image: The cell; see `read_image`.
        conductivities: Conductivity of each phase, dark first (by rising grey value), a number or a
            fuzzy number, in any one unit; 0 is an insulator, 1e18 and more a perfect conductor.
        thresholds: Grey value from which on a pixel is of the next phase, one fewer than phases.
        labels: Value of each phase in a labelled image, in place of thresholds.
        alpha: Rising levels from 0 to 1, one at least.
        device: "cpu", or "cuda" by CuPy.
        progress: Function called with the completed fraction; False for none; a bar on a terminal
            by default.

    Returns:
        Bounds at each level of the mean over directions and of the components of the tensor.

    Raises:
        RefusedError: A value is not allowed, or the image does not fit into memory.
        FailedError: The bounds contradict each other, or the solver does not converge.

    Example:
        >>> from alphacut.fuzzy import Triangular
        >>> from alphacut.rve import GreyImage, fuzzy_image_conductivity
        >>> stripes = GreyImage(np.tile([1, 2], (8, 4)), (1e-6, 1e-6))
        >>> found = fuzzy_image_conductivity(stripes, [Triangular(1, 2, 3), 6.0], labels=[1, 2])
        >>> found.components["k_yy"].round(3).tolist()  # along the stripes: the mean of both
        [[3.5, 4.5], [3.75, 4.25], [4.0, 4.0]]
    """
    start = perf_counter()
    alpha = checked_levels(alpha)
    phases = [Conductor(as_fuzzy("conductivity", value)) for value in conductivities]
    for phase in phases:
        low = widest_cut(phase.conductivity).lower
        require(low >= 0, "conductivity of a phase", f"from {low:g}", "conductivities of 0 or more")
    study = image_study(image, phases, thresholds=thresholds, labels=labels)
    study.require_solid(alpha)
    model = ConductionModel(**study.settings(device))
    with progress_reporter(progress) as tick:
        solution = model.solve(study.images(None, None))
        levels = subprogress(tick or (lambda done: None), 1 / (len(alpha) + 3), 1.0)
        bounds = study.bounds_at_levels(model, solution, alpha, levels)
    first, last = study.phase_ranges(alpha[0])
    nominal = np.array([phase.conductivity.nominal for phase in phases])
    reference = None
    if (nominal > 0).all() and (nominal < RIGID).all():
        fractions = np.array(list(study.fractions.values()))
        reference = hashin_shtrikman(nominal, fractions=fractions, dimension=study.dimension)
    conducting = [k for k, x in enumerate(phases) if widest_cut(x.conductivity).upper > 0]
    straight = None
    if len(conducting) == 1:
        straight = np.array([_straight(study, conducting[0], level) for level in alpha])
    return FuzzyImageConductivity(
        alpha=np.array(alpha, float),
        bounds=bounds,
        reference=reference,
        straight=straight,
        fractions=study.fractions,
        division=model.division,
        seconds=perf_counter() - start,
        phase=study.nominal_phase,
        is_open=first != last,
        lengths=image.lengths,
    )


def _straight(study: ImageStudy[Conductor], number: int, level: float) -> tuple[float, float]:
    """Return the bounds of φ k₀ of a phase at an α-level; see `FuzzyImageConductivity`."""
    first, last = study.phase_ranges(level)
    least = np.mean((first == number) & (last == number))
    greatest = np.mean((first <= number) & (last >= number))
    low, high = study.phases[number].conductivity.cut(level)
    return float(least * high), float(greatest * low)


def hashin_shtrikman(conductivities: Array, *, fractions: Array, dimension: int) -> Enclosure:
    """Return bounds of the conductivity of isotropic composites (Hashin and Shtrikman 1962).

    With k₀ the smallest or largest of the conductivities k_i, and c_i the fractions, the bound is
    [Σ c_i/(k_i + (d − 1) k₀)]⁻¹ − (d − 1) k₀ in d dimensions.

    Args:
        conductivities: Conductivity of each phase, positive and finite, shape (phases,).
        fractions: Fraction of each phase; their sum is 1.
        dimension: 2 or 3.
    """
    ends = []
    for extreme in (conductivities.min(), conductivities.max()):
        shift = (dimension - 1) * extreme
        ends.append(float(1 / np.sum(fractions / (conductivities + shift)) - shift))
    return Enclosure(min(ends), max(ends))  # of nearly equal phases rounding decides
