"""The cell of a case: its parts at crisp values, its model and what E is compared with."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, Self, cast

import numpy as np
from typing_extensions import TypedDict

from alphacut.base.arrays import Array
from alphacut.base.errors import FailedError, RefusedError
from alphacut.case.cell import CellContent
from alphacut.case.material import (
    AnyRadius,
    Mesh,
    MeshedCell,
    ModulusSection,
    RoundCell,
    ThetaSection,
)
from alphacut.fuzzy import FuzzyNumber
from alphacut.io.files import missing
from alphacut.rve.cell.cell import AnyPhase, Cell, Phase
from alphacut.rve.cell.outline import circle
from alphacut.rve.result.moduli import AXES, hashin_shtrikman, plane_constants
from alphacut.rve.result.result import HomogenisedStiffness
from alphacut.rve.series.model import SeriesModel
from alphacut.rve.spheres.model import SphereSeriesModel
from alphacut.rve.spheres.result import hill_average
from alphacut.stochastic import TruncatedNormal, gauss_rule
from alphacut.stochastic.particles.particles import SPHERES

GPA = 1e9
TOLERANCE_PART = 0.4
"""Fraction of the tolerance for the series at each θ, and again for the quadrature in θ."""
SPHERE_TOLERANCE = 1e-5
"""Default tolerance of E of spheres, relative: 1e-9 takes seconds near a reduced radius of 0.97."""
BOUNDS_SLACK = 5e-3
"""Allowed relative distance of E outside its bounds: packings meet a fraction to 0.5 %."""
MESH_OPTIONS = ("petsc", "parallel")
"""Options of elements that a mesh from a file takes."""


Solve = Callable[[Sequence[Any]], list[HomogenisedStiffness]]
"""A model of the cell: a result for each sample; the cells differ in their inclusion alone."""


class References(TypedDict, total=False):
    """References of a cell: mean particle fraction, as the case states it, and bounds of E.

    The classical bounds are those of isotropic composites, lower and upper, in GPa.
    """

    fraction: float
    fraction_of_case: float
    hashin_shtrikman_E_GPa: tuple[float, float]


ISOTROPIC = "Hashin–Shtrikman bounds of an isotropic E"
UPPER_BOUND = "C is an upper bound of this mesh: that of a finer one is smaller"
"""Of a mesh of one's own by Galerkin's method, whose fields have more energy than the true ones."""
AVERAGES = {"axes": "eq. 16", "isotropic": "isotropic"}
"""Averages of a plane stiffness by their names in a case, in words."""


def _solve_cells(
    model: Any, law: TruncatedNormal, is_averaged: bool, samples: Sequence[Any]
) -> list[HomogenisedStiffness]:
    """Result of each sample by a model of rve; `is_averaged`: E and ν of the isotropic average."""
    if isinstance(samples[0], Cell):
        first, inclusions = samples[0], [sample.inclusion for sample in samples]
        results = model.solve(first.radius_map, first.matrix, inclusions)
    else:
        results = [model.solve(law, phases)[0] for phases in samples]
    return [result.with_average("isotropic") for result in results] if is_averaged else results


@dataclass(frozen=True)
class CellProblem:
    """A cell that is no image, as the sections of a case state it.

    `radius` is the map of a round particle, or the law of θ of a mesh from a file;
    `stated_fraction` is what the particles take of the cell as the case says.
    """

    radius: AnyRadius | ThetaSection
    cell: RoundCell | MeshedCell
    mesh: Mesh
    modulus: ModulusSection
    stated_fraction: float | None = None

    @classmethod
    def of(cls, content: CellContent, **further: object) -> Self:
        """The cell of a case, with further fields of this class."""
        sections = *content.random_cell, content.mesh, content.modulus
        return cls(*sections, content.stated_fraction, **cast("dict[str, Any]", further))

    @property
    def numbers(self) -> dict[str, FuzzyNumber]:
        """Inputs of the cell by name, crisp or fuzzy, in SI."""
        return getattr(self.radius, "numbers", {}) | self.cell.constants

    @property
    def average_name(self) -> str:
        """Average of the stiffness that gives E and ν: "eq. 16", "isotropic" or "spheres"."""
        return "spheres" if self.cell.particles == "spheres" else AVERAGES[self.modulus.average]

    def model(self, **elements: object) -> Solve:
        """The function that solves cells by the model that the sections name.

        `elements` are options of the elements: petsc, parallel, estimate, modulus_range.
        """
        is_averaged = self.average_name == "isotropic"  # of the whole plane stiffness
        try:
            if isinstance(self.cell, RoundCell):
                model = self._particle_model(self.cell, {"stiffness": is_averaged, **elements})
            else:
                from alphacut.rve.prism.own_mesh import MeshModel

                assert self.mesh.file is not None
                options = {name: x for name, x in elements.items() if name in MESH_OPTIONS}
                mesh, refine = self.mesh.file, self.mesh.refine
                model = MeshModel(mesh, refine=refine, **cast("dict[str, Any]", options))
        except ImportError as error:
            value, cure = self.modulus.method, missing(error)
            raise RefusedError("modulus.method", value, "series", cure) from None
        return partial(_solve_cells, model, self.radius.law, is_averaged)

    def _particle_model(self, cell: RoundCell, prism_options: Mapping[str, Any]) -> Any:
        tolerance, method, mesh = self.modulus.tolerance, self.modulus.method, self.mesh
        if cell.has_series and method in ("auto", "series"):
            kind, options = SeriesModel, dict[str, Any](energies=bool(cell.losses))
            if cell.particles == "spheres":
                kind, tolerance = SphereSeriesModel, tolerance or SPHERE_TOLERANCE
            if tolerance is not None:
                options["accuracy"] = max(TOLERANCE_PART * tolerance, kind.MIN_ACCURACY)
            return kind(**options)
        outline = cell.outline or circle
        if method in ("auto", "slices"):
            from alphacut.rve.slices.model import SlicesModel

            return SlicesModel(mesh_size=mesh.size, outline=outline)
        from alphacut.rve.prism.model import PrismModel

        return PrismModel(mesh.size, mesh.layers, outline=outline, **prism_options)

    def at(self, values: Mapping[str, float]) -> Cell | dict[str, AnyPhase]:
        """The cell at crisp values of the inputs, in SI; of a mesh its phases by group."""
        if isinstance(self.cell, MeshedCell):
            phases = self.cell.phases.items()
            return {name: phase.phase(values.get(f"{name}_modulus")) for name, phase in phases}
        radius = cast("AnyRadius", self.radius).at(values)
        matrix = Phase(values["matrix_modulus"], values["matrix_poisson"])
        inclusion: AnyPhase | None = self.cell.stiffness
        if inclusion is None:
            inclusion = Phase(values["inclusion_modulus"], values["inclusion_poisson"])
        return Cell(matrix, inclusion, radius, self.cell.outline or circle)

    @property
    def nominal(self) -> Any:
        """The cell at the nominal values of its inputs."""
        return self.at({name: number.nominal for name, number in self.numbers.items()})

    def solve(self, **elements: object) -> HomogenisedStiffness:
        """The homogenised stiffness at the nominal values; `elements` as those of `model`."""
        return self.model(**elements)([self.nominal])[0]

    def references(self) -> References:
        """Particle fraction and Hashin–Shtrikman bounds of E at the nominal inputs.

        The bounds are at the stated fraction, else at the mean fraction of the radius map. Of
        anisotropic phases there is `fraction` alone; nothing of a mesh from a file.
        """
        if isinstance(self.cell, MeshedCell):
            return {}
        nominal: Cell = self.nominal
        matrix, inclusion = nominal.matrix, nominal.inclusion
        rule = gauss_rule(nominal.radius_map.distribution, points=40)
        spheres, stated = self.cell.particles == "spheres", self.stated_fraction
        radii = nominal.radius_map(rule.nodes)
        fractions = SPHERES.fractions(radii) if spheres else nominal.fraction(rule.nodes)
        found: References = {"fraction": float(np.asarray(rule.mean(fractions)))}
        if not isinstance(matrix, Phase) or not isinstance(inclusion, Phase):
            return found
        fraction = np.asarray(found["fraction"] if stated is None else stated)
        if stated is not None:
            found["fraction_of_case"] = stated
        fractions, phases = np.array([1 - fraction, fraction]), [matrix, inclusion]
        found["hashin_shtrikman_E_GPa"] = isotropic_bounds(fractions, phases, space=spheres)
        return found

    def require_mesh(self) -> None:
        """Refuses a mesh file that is no periodic cell of prisms, or does not fit [cell.phases]."""
        if self.mesh.file is None:
            return
        try:
            from alphacut.rve.mesh.file import read_grid
            from alphacut.rve.mesh.periodicity import MeshError
            from alphacut.rve.prism.own_mesh import in_order_of, mesh_law
        except ImportError as error:
            raise RefusedError("mesh.file", self.mesh.file, "no mesh", missing(error)) from None
        try:
            grid = read_grid(self.mesh.file)
        except MeshError as error:
            value, allowed = f"{self.mesh.file.name}: {error.what}", "a periodic cell of prisms"
            raise RefusedError("mesh.file", value, allowed, error.cure) from None
        try:
            mesh_law(grid, self.radius.law)  # both refuse what does not fit
            in_order_of(grid.names, self.nominal)
        except RefusedError as error:
            place = self.mesh.file.name
            raise RefusedError(error.key, error.value, error.allowed, error.cure, place) from None


def isotropic_bounds(
    fractions: Array, phases: Sequence[Phase], *, space: bool = False
) -> tuple[float, float]:
    """Lower and upper Hashin–Shtrikman bound of Young's modulus in GPa, of `space` or transverse.

    They are its values at the lower and at the upper bounds of the moduli K and G. Fractions have
    the shape (phases,).
    """
    bulk, shear = hashin_shtrikman(fractions, phases, space=space)  # lower and upper each
    if space:
        low, high = hill_average(np.stack([bulk, shear, shear], axis=-1))[:, 0]
    else:
        low, high = plane_constants(np.stack([2 * bulk, 2 * shear, shear], axis=-1), AXES)[:, 0]
    return float(low / GPA), float(high / GPA)


def key_and_unit(name: str) -> tuple[str, float]:
    """Key of an elastic constant in results, and its unit in SI: E_x_GPa and 1e9, nu_xy and 1."""
    return (name, 1.0) if name.startswith("nu") else (f"{name}_GPa", GPA)


def constant_label(key: str) -> str:
    """Label of a constant: nu_LT as ν_LT, E_T_GPa as E_T, GPa."""
    return key.replace("nu", "ν").replace("_GPa", ", GPa")


def isotropic_label(average: str) -> str:
    """Label of the Hashin–Shtrikman bounds beside E of an average, in words."""
    is_other = average == AVERAGES[AXES]
    return f"{ISOTROPIC}, which that of {average} is not" if is_other else ISOTROPIC


def require_isotropic(result: HomogenisedStiffness) -> None:
    """Refuses E and ν of a cell whose stiffness no isotropic solid has."""
    if not result.has_isotropic_constants:
        value, cure = f"{result.modulus / GPA:.4g} GPa", "take the stiffness of `alphacut cell`"
        raise FailedError(f"E would be {value}: 2 G_T exceeds 3 (C11 + C12)", cure)


def require_bounds(young: tuple[float, float], references: References, particles: str) -> None:
    """Refuses E of spheres outside the Hashin–Shtrikman bounds of the fraction that a case states.

    E is outside by more than `BOUNDS_SLACK` where the radius map holds another fraction, since
    cells denser than any cube are cut off, or because the mean over cells with different spheres
    need not obey the bounds. `young` has the bounds of E at the nominal inputs, in GPa.
    """
    if particles != "spheres" or "fraction_of_case" not in references:
        return
    low, high = references["hashin_shtrikman_E_GPa"]
    fraction = references["fraction_of_case"]
    if young[1] < low * (1 - BOUNDS_SLACK) or young[0] > high * (1 + BOUNDS_SLACK):
        value = f"{young[0]:.5g} GPa, of a map that holds {references['fraction']:.4g}"
        limits = f"Hashin–Shtrikman's {low:.5g} … {high:.5g} GPa at {fraction:g}"
        cure = f"set cell.fraction = {fraction:g} in place of [microstructure] or [radius]"
        raise RefusedError("E of spheres", value, limits, cure)


def require_tolerance(error: Mapping[str, float], tolerance: float | None) -> None:
    """Requires the sum of the declared relative errors of E within a tolerance, if any."""
    total = sum(error.values())
    if tolerance is not None and total > tolerance * (1 + 1e-9):
        what = f"the relative error of E is {total:.2g}; the case allows {tolerance:.2g}"
        raise FailedError(what, "method auto reaches it")
