"""The cell of a case: its parts at crisp values, its model, and its result as a document."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np

from alphacut.case.case import Case
from alphacut.fuzzy import FuzzyNumber
from alphacut.io.files import Document
from alphacut.io.problem import BadInput
from alphacut.io.provenance import versions
from alphacut.rve.anisotropy import directional_shear, directional_young
from alphacut.rve.cell import Phase
from alphacut.rve.result import Homogenised, error_of_means, error_of_stiffness
from alphacut.rve.spheres.result import HomogenisedSpheres
from alphacut.stages.material import spheres
from alphacut.stochastic import RadiusMap
from alphacut.stochastic.radius_map import CaseMap, MapFamily
from alphacut.stochastic.theta.truncated_normal import Array

GPA = 1e9
POSITIVE = "divide the pixels (cell.division) or take phases of less contrast"  # E of an image
DIRECTIONS = np.arange(0, 91, 15)  # in degrees
INPUTS = (
    "a1",
    "a2",
    "a3",
    "a4",
    "matrix_modulus",
    "matrix_poisson",
    "inclusion_modulus",
    "inclusion_poisson",
)
# what samples of one task have in common
SHARED = tuple(name for name in INPUTS if name != "inclusion_modulus")


def cell_inputs(case: Case) -> dict[str, FuzzyNumber]:
    """The values of those of `INPUTS` that the map has, crisp or fuzzy, in SI."""
    return case.radius.numbers | cell_phases(case)


def cell_phases(case: Case) -> dict[str, FuzzyNumber]:
    """The elastic constants among them."""
    cell = case.cell
    return {
        "matrix_modulus": cell.matrix_modulus,
        "matrix_poisson": cell.matrix_poisson,
        "inclusion_modulus": cell.inclusion_modulus,
        "inclusion_poisson": cell.inclusion_poisson,
    }


class CellModel(Protocol):
    """Model of the cell as the front door needs it."""

    def solve(
        self, radius_map: RadiusMap, matrix: Phase, inclusions: Sequence[Phase]
    ) -> Sequence[Homogenised]:
        """One result for each inclusion material; mesh and assembly are shared."""


@dataclass(frozen=True)
class CellChoice:
    """Choice of a cell model and its resolution, small enough for workers.

    Args:
        method: prism, slices, table, series, image or auto.
        layers: Element layers in θ.
        size: Element size over half the cell's side.
        interface: conforming, or sign.
        tolerance: Relative error of E asked for; None for each model's own accuracy, and 1e-4 of
            method auto.
        named: Whether the resolution is named, so that no tolerance refines it.
        petsc: PETSc options that override the solver's, without their prefix.
        parallel: Whether all MPI ranks work on one cell together.
        moduli: Moduli of the particle that all samples together span, in Pa, for a table or a few
            solutions that they share; None if not known.
        estimate: Whether a model that can is to estimate its error at an extra cost.
        stiffness: Whether a model that can leave it out is to make the whole planar stiffness.
        particles: cylinders or spheres.
        average: What E of cylinders is of: "axes", eq. 16, or "isotropic", all directions.
    """

    method: str = "prism"
    layers: int = 12
    size: float = 0.15
    interface: str = "conforming"
    tolerance: float | None = None
    named: bool = True
    petsc: Mapping[str, str] = field(default_factory=dict)
    parallel: bool = False
    moduli: tuple[float, float] | None = None
    estimate: bool = False
    stiffness: bool = False
    particles: str = "cylinders"
    average: str = "axes"

    @property
    def meaning(self) -> str:
        """What E and ν are of: cylinders (eq. 16), isotropic or spheres."""
        return "isotropic" if self.averages else self.particles

    @property
    def averages(self) -> bool:
        """True if E and ν are those of the isotropic average of a plane stiffness."""
        return self.average == "isotropic" and self.particles == "cylinders"

    @property
    def words(self) -> str:
        """One line: the model of each sample, and what it is to keep."""
        mesh = f", {self.layers} layers" if self.method == "prism" else ""
        mesh = f", mesh size {self.size:g}{mesh}" if self.method in ("prism", "slices") else ""
        mesh += f", interface {self.interface}" if self.method == "prism" else ""
        asked = "" if self.tolerance is None else f", relative error of E up to {self.tolerance:g}"
        refined = self.tolerance is not None and not self.named
        shape = ", spheres" if self.particles == "spheres" else ""
        shape = ", isotropic average" if self.averages else shape
        return f"each sample by method {self.method}{shape}{'' if refined else mesh}{asked}"


def cell_choice(case: Case, *, petsc: Mapping[str, str] | None = None) -> CellChoice:
    """The model that a case asks for."""
    method, mesh = case.modulus.method, case.mesh
    return CellChoice(
        method,
        mesh.layers,
        mesh.size,
        mesh.interface,
        case.modulus_tolerance,
        case.names_mesh or bool(petsc),
        petsc or {},
        particles=case.cell.particles,
        average=case.modulus.average,
        stiffness=case.modulus.average == "isotropic",
    )


def parts(values: Mapping[str, float], family: MapFamily) -> tuple[CaseMap, Phase, Phase]:
    """Radius map, matrix and inclusion from the values of `INPUTS`, in SI."""
    return family(values), *phases_of(values)


def modal_parts(case: Case) -> tuple[CaseMap, Phase, Phase]:
    """Radius map, matrix and inclusion at the modal values of a case."""
    return parts(modal_values(case), case.radius.family)


def phases_of(values: Mapping[str, float]) -> tuple[Phase, Phase]:
    """Matrix and inclusion from the values of `INPUTS`, in SI; remarks tell of odd ones."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        matrix = Phase(values["matrix_modulus"], values["matrix_poisson"])
        return matrix, Phase(values["inclusion_modulus"], values["inclusion_poisson"])


def modal_values(case: Case) -> dict[str, float]:
    """The modal value of every input of the cell."""
    return {name: number.modal for name, number in cell_inputs(case).items()}


def solve(case: Case, model: CellModel) -> Homogenised:
    """Homogenise the cell at the modal values of its inputs.

    Raises:
        BadInput: r(θ) leaves (0, 1).
    """
    try:
        radius, matrix, inclusion = modal_parts(case)
    except ValueError as error:
        raise BadInput.of("radius", str(error), file=str(case.path)) from None
    return model.solve(radius, matrix, [inclusion])[0]


def anisotropy(
    radius: RadiusMap, matrix: Phase, inclusion: Phase, particles: str = "cylinders"
) -> tuple[float, float] | None:
    """Shear ratio of a cell and its declared error, by the series whatever model gives E.

    None where the series refuses. See `Homogenised.shear_ratio`.
    """
    from alphacut.rve.series.model import SeriesModel
    from alphacut.rve.spheres.series.model import SphereSeriesModel

    series = SphereSeriesModel if particles == "spheres" else SeriesModel
    try:
        return series(accuracy=1e-4).solve(radius, matrix, [inclusion])[0].shear_ratio
    except (RuntimeError, ValueError):
        return None


def directions(result: Homogenised) -> Document | None:
    """Moduli over the direction, and shear anisotropy; None without the stiffness.

    "young_GPa" is stress over strain in plane strain with free sides, 1/S11 of the planar
    compliance: E/(1 − ν²) in an isotropic material, so that E of eq. 16 lies below it.
    """
    if result.stiffness is None:
        return None
    young, shear = _over_directions(result.stiffness)
    return {
        "angle_deg": DIRECTIONS,
        "young_GPa": young / GPA,
        "shear_GPa": shear / GPA,
        "shear_ratio": result.shear_ratio[0],
    }


def _over_directions(stiffness: Array) -> Array:
    """Young's and the shear modulus along `DIRECTIONS` in Pa, shape (2, n)."""
    angle = np.deg2rad(DIRECTIONS)
    return np.stack([directional_young(stiffness, angle), directional_shear(stiffness, angle)])


def declared_errors(result: Homogenised) -> Document | None:
    """Declared error of every number of `document`, absolute and in its unit; None without any."""
    if isinstance(result, HomogenisedSpheres):
        return spheres.declared_errors(result)
    if not result.errors:
        return None
    modulus, nu, s11, s12 = error_of_means(result)
    found: dict[str, Any] = {
        "E_GPa": modulus / GPA,
        "nu": nu,
        "stress_GPa": {"s11": s11 / GPA, "s12": s12 / GPA},
        "stiffness_GPa": None,
        "directions": None,
        "curve": None,
    }
    if result.curve.error is not None:
        first, second = result.curve.error.T / GPA
        found["curve"] = {"s11": first * result.curve.s11, "s12": second * result.curve.s12}
    if result.stiffness is not None:
        young, shear = error_of_stiffness(result, _over_directions) / GPA
        found["stiffness_GPa"] = error_of_stiffness(result, np.asarray) / GPA
        ratio = result.shear_ratio[1]
        found["directions"] = {"young_GPa": young, "shear_GPa": shear, "shear_ratio": ratio}
    return found


def document(result: Homogenised) -> Document:
    """The result as it is printed with ``--json``; moduli and stresses in GPa."""
    mean11, mean12 = result.curve.mean
    if isinstance(result, HomogenisedSpheres):
        own = spheres.moduli(result)
    else:
        stiffness = None if result.stiffness is None else result.stiffness / GPA
        own = {"stiffness_GPa": stiffness, "directions": directions(result)}
    return {
        "E_GPa": result.modulus / GPA,
        "nu": result.poisson,
        "stress_GPa": {"s11": mean11 / GPA, "s12": mean12 / GPA},
        **own,
        "curve": {
            "theta": result.curve.theta,
            "weights": result.curve.weights,
            "s11": result.curve.s11 / GPA,
            "s12": result.curve.s12 / GPA,
        },
        "unknowns": result.unknowns,
        "iterations": list(result.iterations),
        "seconds": dict(result.seconds),
        "method": result.method,
        "solver": result.solver,
        "error": dict(result.error),
        "declared_error": declared_errors(result),
        "reason": result.reason,
        "checks": dict(result.checks),
        "versions": versions(),
    }
