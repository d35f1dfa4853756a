"""The cell of a case: its nominal phases and fuzzy inputs, and the model that it asks for."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Self, TypedDict, cast

from alphacut.base.errors import FailedError, RefusedError, require
from alphacut.case.cell import CellContent
from alphacut.case.material import (
    Mesh,
    MeshedCell,
    ModulusSection,
    RadiusMapSection,
    RoundCell,
    ThetaSection,
)
from alphacut.fuzzy import FuzzyNumber
from alphacut.io.files import missing
from alphacut.rve.cell.cell import Cell, Phase, Phases
from alphacut.rve.cell.lattice import lattice_of
from alphacut.rve.cell.outline import circle
from alphacut.rve.result.cell_model import AnyModel, Resolution
from alphacut.rve.result.moduli import AXES
from alphacut.rve.result.reference_bounds import reference_bounds
from alphacut.rve.result.result import HomogenisedStiffness
from alphacut.stochastic import FractionMap, RadiusMap, ThetaDistribution, gauss_rule

if TYPE_CHECKING:
    from alphacut.rve.image.bounds import StiffnessBounds
    from alphacut.rve.prism.own_mesh import MeshModel

GPA = 1e9


class References(TypedDict, total=False):
    """References of a cell: mean particle fraction, as the case states it, and bounds of E.

    The classical bounds are those of isotropic composites, lower and upper, in GPa.
    """

    fraction: float
    fraction_of_case: float
    hashin_shtrikman_E_GPa: tuple[float, float]


UPPER_BOUND = "C is an upper bound of this mesh: that of a finer one is smaller"
"""Of a mesh of one's own by Galerkin's method, whose fields have more energy than the true ones."""
BOTH_BOUNDS = "The bounds are guaranteed for this mesh's geometry"
"""Of a mesh of one's own with `mesh.bounds`."""
AVERAGES = {"axes": "eq. 16", "isotropic": "isotropic"}
"""Averages of a plane stiffness by their names in a case, in words."""


@dataclass(frozen=True)
class CellProblem:
    """A cell that is no image, as the sections of a case state it.

    Args:
        radius: Radius map of a round particle as its section, the map of particles of one size, or
            the distribution of θ of a mesh from a file.
        cell: Its phases.
        mesh: Discretisation.
        modulus: What is computed, and by which model.
        stated_fraction: Fraction of the cell that the particles take as the case says, if it does.
        petsc: PETSc options without their prefix `rve_`.
    """

    radius: RadiusMapSection | ThetaSection | FractionMap
    cell: RoundCell | MeshedCell
    mesh: Mesh
    modulus: ModulusSection
    stated_fraction: float | None = None
    petsc: Mapping[str, str] = field(default_factory=dict)

    @classmethod
    def of(cls, content: CellContent, petsc: Mapping[str, str] | None = None) -> Self:
        """Return the cell of a case."""
        # The stated fraction goes along to be compared with that of a computed radius map.
        radius, cell = content.radius_and_cell
        stated = content.stated_fraction
        return cls(radius, cell, content.mesh, content.modulus, stated, petsc or {})

    @property
    def numbers(self) -> dict[str, FuzzyNumber]:
        """Parameters of the cell by name, crisp or fuzzy, in SI."""
        # The map of particles of one size follows from the fraction, which is then the parameter.
        of_radius = getattr(self.radius, "numbers", {})
        if isinstance(self.cell, RoundCell) and self.cell.fraction is not None:
            of_radius = {"fraction": self.cell.fraction}
        return of_radius | self.cell.constants

    @property
    def inputs(self) -> dict[str, FuzzyNumber]:
        """Return the fuzzy parameters of the cell by name, in SI units.

        If all are crisp, a single crisp one stands for them: the modulus of the inclusion, else of
        the matrix, else any. It is empty only without any parameter, as a mesh from a file may be.
        """
        numbers = self.numbers
        fuzzy = {name: number for name, number in numbers.items() if number.support.width > 0}
        if fuzzy:
            return fuzzy
        # A campaign of samples needs one input at least, though it may be crisp.
        for name in ("inclusion_modulus", "matrix_modulus", *numbers):
            if name in numbers:
                return {name: numbers[name]}
        return {}

    @property
    def nominal_radius(self) -> RadiusMap | ThetaDistribution:
        """Radius map at the nominal values; of a mesh the distribution of θ."""
        if isinstance(self.radius, FractionMap):
            return self.radius
        return self.radius.nominal

    @property
    def nominal_phases(self) -> Phases:
        """Phases at the nominal values: matrix and particle, or those of a mesh by name."""
        return self.cell.nominal_phases

    @property
    def nominal(self) -> Cell:
        """The cell with one particle at the nominal values of its inputs."""
        assert isinstance(self.cell, RoundCell)  # a mesh from a file may have any number of phases
        matrix, inclusion = self.cell.nominal_phases
        radius = cast("RadiusMap", self.nominal_radius)
        lattice = lattice_of(self.cell.lattice)
        return Cell(matrix, inclusion, radius, self.cell.outline or circle, lattice)

    @property
    def average(self) -> str | None:
        """Average of a plane stiffness that the case asks for; None of spheres."""
        # A cubic stiffness has one average alone, that of Hill.
        if self.cell.particles == "spheres":
            return None
        return self.modulus.average

    def model(self, *, estimate: bool = True, parallel: bool = False) -> AnyModel:
        """Return the model that the sections name: prisms, slices or series, or an own mesh.

        Of "auto" it is the preferred one of those that can solve this kind of particle, which is
        the analytic series where there is one.

        Args:
            estimate: Whether it declares errors, if need be by a reference solution.
            parallel: Whether all MPI ranks work on one cell together.

        Raises:
            RefusedError: The model needs DOLFINx, which is not installed.
        """
        cell = self.cell
        # DOLFINx takes seconds to import, and is not on every machine: only the models that need it
        # import it, when they are asked for.
        try:
            if isinstance(cell, RoundCell):
                name = self.modulus.method
                if name == "auto":
                    name = next(iter(cell.models))
                resolution = Resolution(
                    tolerance=self.modulus.tolerance,
                    mesh_size=self.mesh.size,
                    layers=self.mesh.layers,
                    outline=cell.outline or circle,
                    lattice=cell.lattice,
                    # The average along the axes takes C11 + C12 and C33, not C11 − C12.
                    whole_stiffness=self.average != AXES,
                    energies=bool(cell.losses),
                    petsc=self.petsc,
                    parallel=parallel,
                    estimate=estimate,
                )
                return cell.models[name].load().with_resolution(resolution)
            from alphacut.rve.prism.own_mesh import MeshModel

            assert self.mesh.file is not None  # the only other kind of cell is one of a mesh file
            options: Any = {"petsc": self.petsc, "parallel": parallel}
            return MeshModel(self.mesh.file, refine=self.mesh.refine, **options)
        except ImportError as error:
            value = self.modulus.method
            raise RefusedError("modulus.method", value, "series", missing(error)) from None

    def solve(self, **options: bool) -> HomogenisedStiffness:
        """Return the homogenised stiffness at the nominal values of all parameters.

        Its E and ν belong to the average of the stiffness that the case asks for.

        Args:
            options: `estimate`, whether errors are declared, if need be by a reference solution (by
                default true), and `parallel`, whether all MPI ranks work on one cell together (by
                default false).

        Raises:
            RefusedError: The model needs a library that is not installed, or cannot solve the cell.
            FailedError: A linear system was not solved, or a series does not converge.
        """
        model: Any = self.model(**options)
        if isinstance(self.cell, MeshedCell):
            result: HomogenisedStiffness = model.solve(self.nominal_radius, self.nominal_phases)[0]
        else:
            # Models solve cells with several inclusions of the same geometry at once: here is one.
            cell = self.nominal
            result = model.solve(cell.radius_map, cell.matrix, [cell.inclusion])[0]
        if self.average is None:
            return result
        return result.with_average(self.average)

    def mesh_bounds(
        self, levels: Sequence[float | None], *, parallel: bool = False
    ) -> list[StiffnessBounds]:
        """Return guaranteed bounds of the stiffness of a mesh from a file at α-levels.

        Args:
            levels: Levels of the phases' moduli; None for the nominal ones.
            parallel: Whether all MPI ranks work on one cell together.

        Raises:
            FailedError: The cell is not solved, or the mesh is too coarse for a lower bound.
            RefusedError: A library is missing, or the mesh is not allowed.
        """
        from alphacut.rve.guaranteed_cuts import bounds_between  # takes time to import

        cell = cast("MeshedCell", self.cell)
        model = cast("MeshModel", self.model(parallel=parallel))
        law = cast("ThetaDistribution", self.nominal_radius)
        return bounds_between(model, law, [cell.extreme_phases(level) for level in levels])

    def references(self) -> References:
        """Return the particle fraction and the Hashin–Shtrikman bounds of E at the nominal inputs.

        Returns:
            `fraction` is the mean over θ of the particle fraction of the radius map, by volume for
            spheres, else by area. `fraction_of_case` is the fraction that the case states, if any.
            `hashin_shtrikman_E_GPa` has the lower and upper bound of E in GPa at this fraction, or
            else at the mean one. The last two are missing if a phase is anisotropic, all for a mesh
            from a file.
        """
        if isinstance(self.cell, MeshedCell):
            return {}
        radius_map = self.nominal.radius_map
        # The fraction is smooth in θ, so that Gauss quadrature with the density of θ as its weight
        # converges exponentially: 40 nodes give the mean to rounding.
        rule = gauss_rule(radius_map.distribution, points=40)
        is_space = self.cell.particles == "spheres"
        if is_space:
            fractions = self.cell.shape.fractions(radius_map(rule.nodes))
        else:
            fractions = self.nominal.fraction(rule.nodes)
        fraction = float(rule.mean(fractions))
        found: References = {"fraction": fraction}
        # The classical bounds are those of two isotropic phases.
        phases = [phase for phase in self.cell.nominal_phases if isinstance(phase, Phase)]
        if len(phases) < 2:
            return found
        if self.stated_fraction is not None:
            fraction = found["fraction_of_case"] = self.stated_fraction
        # These bounds are by Hashin and Shtrikman (1963) in space, and by Hashin (1965) in the
        # plane across fibres. Both hold for isotropic composites.
        bounds = reference_bounds(phases, fractions=[1 - fraction, fraction], space=is_space)
        lower, upper = bounds.young
        found["hashin_shtrikman_E_GPa"] = lower / GPA, upper / GPA
        return found

    def require_mesh(self) -> None:
        """Refuse a mesh file that is no periodic cell of prisms, or does not fit [cell.phases].

        Without `mesh.file` there is nothing to refuse.

        Raises:
            RefusedError: The file is not read or no such mesh, a physical group has no phase, the
                range of θ is not that of the case, or a library for meshes is missing.
        """
        if self.mesh.file is None:
            return
        try:
            from alphacut.rve.mesh.file import read_grid
            from alphacut.rve.mesh.periodicity import MeshError
            from alphacut.rve.prism.own_mesh import in_order_of, mesh_law
        except ImportError as error:
            raise RefusedError("mesh.file", self.mesh.file, "no mesh", missing(error)) from None
        try:
            law = cast("ThetaDistribution", self.nominal_radius)
            grid = read_grid(self.mesh.file, (law.lower, law.upper))
        except MeshError as error:
            value = f"{self.mesh.file.name}: {error.what}"
            allowed = "a periodic cell of prisms"
            raise RefusedError("mesh.file", value, allowed, error.cure) from None
        try:
            # Both refuse what does not fit: a range of θ other than that of [radius], and physical
            # groups that have no phase in the case or phases that have no group.
            mesh_law(grid, self.nominal_radius)
            in_order_of(grid.names, self.nominal_phases)
        except RefusedError as error:
            place = self.mesh.file.name
            raise RefusedError(error.key, error.value, error.allowed, error.cure, place) from None


def key_and_unit(name: str) -> tuple[str, float]:
    """Return the key of an elastic constant in results, and its unit in SI.

    Args:
        name: Name of the constant, such as "E_x" or "nu_xy".

    Returns:
        "E_x_GPa" and 1e9 for a modulus E_x; "nu_xy" and 1 for a Poisson's ratio, which begins with
        "nu".
    """
    # Poisson's ratios are the only constants without a unit.
    if name.startswith("nu"):
        return name, 1.0
    return f"{name}_GPa", GPA


def constant_label(key: str) -> str:
    """Return the label of a constant: nu_LT as ν_LT, E_T_GPa as E_T, GPa."""
    return key.replace("nu", "ν").replace("_GPa", ", GPa")


def isotropic_label(average: str) -> str:
    """Return the label of the Hashin–Shtrikman bounds beside E of an average, in words."""
    label = "Hashin–Shtrikman bounds of an isotropic E"
    if average == AVERAGES[AXES]:
        label += f", which that of {average} is not"
    return label


def require_bounds(young: tuple[float, float], references: References, particles: str) -> None:
    """Refuse E of spheres outside the Hashin–Shtrikman bounds at the fraction that a case states.

    E can lie outside for two reasons. The radius map may hold another fraction than the case
    states, since it leaves out cells that are denser than any cube. And the mean over cells with
    different spheres need not obey the bounds. Half a per cent is forgiven: packings meet a
    fraction no better.

    Args:
        young: Lower and upper bound of E at the nominal inputs, in GPa.
        references: Bounds of E in GPa as `hashin_shtrikman_E_GPa`; the stated fraction as
            `fraction_of_case`, without which nothing is checked; and the fraction of the radius map
            as `fraction`.
        particles: Particles as the case has them; nothing is checked unless they are "spheres".

    Raises:
        RefusedError: E is outside.
    """
    if particles != "spheres" or "fraction_of_case" not in references:
        return
    # The interval of E and the interval of the bounds, widened by the slack, must have a point in
    # common. The bounds are for the stated fraction, E for the fraction of the map.
    low, high = references["hashin_shtrikman_E_GPa"]
    fraction = references["fraction_of_case"]
    slack = 5e-3
    if young[1] < low * (1 - slack) or young[0] > high * (1 + slack):
        value = f"{young[0]:.5g} GPa, of a map that holds {references['fraction']:.4g}"
        limits = f"Hashin–Shtrikman's {low:.5g} … {high:.5g} GPa at {fraction:g}"
        cure = f"set cell.fraction = {fraction:g} in place of [microstructure] or [radius]"
        raise RefusedError("E of spheres", value, limits, cure)


def require_tolerance(error: Mapping[str, float], tolerance: float | None) -> None:
    """Require the sum of the declared relative errors of E within a tolerance, if any."""
    if tolerance is None:
        return
    if not error:  # of a refined mesh
        what = "no error of E is declared, since phases of high contrast meet crosswise"
        raise FailedError(what, "set mesh.bounds = true, or leave out modulus.tolerance")
    # Errors of several sources may add up; 1e-9 of the tolerance is left to their own rounding.
    total = sum(error.values())
    if not total <= tolerance * (1 + 1e-9):
        what = f"the relative error of E is {total:.2g}; the case allows {tolerance:.2g}"
        raise FailedError(what, "method auto reaches it")


def require_levels(alpha: tuple[float, ...], key: str) -> None:
    """Refuse levels of a structure's modulus that neither go from 0 to 1 nor are 1 alone."""
    # A fuzzy number needs its support and its core; the highest level alone is a crisp number.
    complete = alpha == (1.0,) or (alpha[0], alpha[-1]) == (0, 1)
    require(complete, key, value=list(alpha), allowed="levels from 0 to 1, or 1 alone")
