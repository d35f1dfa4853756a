"""The cell of a case: its parts at crisp values, its model, and its result as a document."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from typing_extensions import TypedDict

from alphacut.case.material import Mesh, MeshedCell, ModulusSection, RoundCell
from alphacut.case.radius import AnyRadius, ThetaSection
from alphacut.fuzzy import FuzzyNumber
from alphacut.fuzzy.arrays import Array
from alphacut.fuzzy.refused import FailedError, RefusedError
from alphacut.io.files import Document
from alphacut.io.problem import missing
from alphacut.io.provenance import versions
from alphacut.rve.cell.cell import STRAIN, Cell, Interphase, Phase, VoigtPhase
from alphacut.rve.cell.outline import circle
from alphacut.rve.result import bounds
from alphacut.rve.result.engineering_constants import NAMES, engineering_constants
from alphacut.rve.result.result import HomogenisedStiffness, effective_modulus
from alphacut.rve.series.fibre_constants import fibre_constants
from alphacut.rve.series.model import SeriesModel
from alphacut.rve.spheres.model import SphereSeriesModel
from alphacut.rve.spheres.result import (
    HomogenisedSpheres,
    hashin_shtrikman,
    hill_average,
    mori_tanaka,
    volume_fraction,
)
from alphacut.stochastic import TruncatedNormal, gauss_rule

if TYPE_CHECKING:
    from alphacut.rve.prism.own_mesh import MeshModel

GPA = 1e9
TOLERANCE_PART = 0.4
"""Fraction of the tolerance for the series at each θ, and again for the quadrature in θ."""
SPHERE_TOLERANCE = 1e-5
"""Default tolerance of E of spheres, relative: 1e-9 takes seconds near a reduced radius of 0.97."""
BOUNDS_SLACK = 5e-3
"""Allowed relative distance of E outside its bounds: packings meet a fraction to 0.5 %."""
MESH_OPTIONS = ("petsc", "parallel")
"""Options of elements that a mesh from a file takes."""


@dataclass(frozen=True)
class MeshedSample:
    """Law of θ and phase of each physical group."""

    law: TruncatedNormal
    phases: Mapping[str, Phase | VoigtPhase]


def sample_at(values: Mapping[str, float], law: ThetaSection, cell: MeshedCell) -> MeshedSample:
    """The sample at crisp values of the inputs, in SI."""
    phases = {
        name: phase.phase(values.get(f"{name}_modulus")) for name, phase in cell.phases.items()
    }
    return MeshedSample(law.law, phases)


def modal_sample(law: ThetaSection, cell: MeshedCell) -> MeshedSample:
    """The sample at the modal values."""
    return sample_at({name: x.modal for name, x in cell.constants.items()}, law, cell)


def solve_samples(model: MeshModel, samples: Sequence[MeshedSample]) -> list[HomogenisedStiffness]:
    """One result for each sample, in their order."""
    return [model.solve(sample.law, sample.phases)[0] for sample in samples]


AnyCell = RoundCell | MeshedCell
AnySample = Cell | MeshedSample
Solve = Callable[[Sequence[Any]], list[HomogenisedStiffness]]
"""A model of the cell: a result for each sample; the cells differ in their inclusion alone."""


class References(TypedDict, total=False):
    """References of a cell: mean particle fraction, as the case states it; bounds, estimate of E.

    The classical bounds are those of isotropic composites, lower and upper, in GPa.
    """

    fraction: float
    fraction_of_case: float
    hashin_shtrikman_E_GPa: tuple[float, float]
    mori_tanaka_E_GPa: float


ISOTROPIC = "Hashin–Shtrikman bounds of an isotropic E"
AVERAGES = {"axes": "eq. 16", "isotropic": "isotropic"}
"""Averages of a plane stiffness by their names in a case, in words."""


def solve_and_average(model: Solve, cells: Sequence[AnySample]) -> list[HomogenisedStiffness]:
    """Results whose E and ν are those of the isotropic average of the plane stiffness."""
    return [result.with_average("isotropic") for result in model(cells)]


def solve_cells(
    model: Callable[..., list[HomogenisedStiffness]], cells: Sequence[Cell]
) -> list[HomogenisedStiffness]:
    """Result of each cell; the cells differ in their inclusion alone."""
    first = cells[0]
    interphase = () if first.interphase is None else (first.interphase,)
    return model(first.radius, first.matrix, [cell.inclusion for cell in cells], *interphase)


def average_name(cell: AnyCell, modulus: ModulusSection) -> str:
    """Name of the average of the stiffness that gives E and ν: "eq. 16", "isotropic", "spheres"."""
    return "spheres" if cell.particles == "spheres" else AVERAGES[modulus.average]


def model_of(cell: AnyCell, mesh: Mesh, modulus: ModulusSection, **elements: Any) -> Solve:
    """The function that solves cells by the model that the sections of a case name.

    `elements` are options of the product-space elements: petsc, parallel, estimate, moduli.
    """
    is_averaged = average_name(cell, modulus) == "isotropic"  # of the whole plane stiffness
    options = {"stiffness": is_averaged, **elements}
    try:
        if isinstance(cell, RoundCell):
            model: Solve = partial(solve_cells, _model_of_particle(cell, mesh, modulus, options))
        else:
            from alphacut.rve.prism.own_mesh import MeshModel

            assert mesh.file is not None
            elements = {name: value for name, value in elements.items() if name in MESH_OPTIONS}
            model = partial(solve_samples, MeshModel(mesh.file, **elements))
    except ImportError as error:
        raise RefusedError("modulus.method", modulus.method, "series", missing(error)) from None
    return partial(solve_and_average, model) if is_averaged else model


def _model_of_particle(
    cell: RoundCell, mesh: Mesh, modulus: ModulusSection, prism_options: Mapping[str, Any]
) -> Callable[..., list[HomogenisedStiffness]]:
    """Method `solve` of the first of series, slices and prisms that the case allows."""
    tolerance, method = modulus.tolerance, modulus.method
    if cell.particles == "spheres":
        accuracy = max(TOLERANCE_PART * (tolerance or SPHERE_TOLERANCE), 1e-11)
        return SphereSeriesModel(accuracy=accuracy, energies=bool(cell.losses)).solve
    if cell.has_series and method in ("auto", "series"):
        accuracy = SeriesModel.accuracy
        if tolerance is not None:
            accuracy = max(TOLERANCE_PART * tolerance, 1e-12)
        return SeriesModel(accuracy=accuracy, energies=bool(cell.losses)).solve
    outline = cell.outline or circle
    if method in ("auto", "slices"):
        from alphacut.rve.slices.model import SlicesModel

        return SlicesModel(mesh_size=mesh.size, outline=outline).solve
    from alphacut.rve.prism.model import PrismModel

    return PrismModel(mesh.size, mesh.layers, outline=outline, **prism_options).solve


def inputs_of(radius: AnyRadius | ThetaSection, cell: AnyCell) -> dict[str, FuzzyNumber]:
    """Inputs of the cell by name, crisp or fuzzy, in SI."""
    map_inputs = radius.numbers if isinstance(radius, AnyRadius) else {}
    return map_inputs | cell.constants


def cell_at(
    values: Mapping[str, float], radius: AnyRadius | ThetaSection, cell: AnyCell
) -> AnySample:
    """The cell at crisp values of the inputs, in SI."""
    if isinstance(cell, MeshedCell):
        return sample_at(values, cast("ThetaSection", radius), cell)
    return particle_at(values, cast("AnyRadius", radius), cell)


def particle_at(values: Mapping[str, float], radius: AnyRadius, cell: RoundCell) -> Cell:
    """The cell with one particle at crisp values of the inputs, in SI."""
    matrix = Phase(values["matrix_modulus"], values["matrix_poisson"])
    inclusion = cell.stiffness or Phase(values["inclusion_modulus"], values["inclusion_poisson"])
    interphase = None
    if cell.interphase_thickness is not None:
        phase = Phase(values["interphase_modulus"], values["interphase_poisson"])
        interphase = Interphase(values["interphase_thickness"], phase)
    return Cell(matrix, inclusion, radius.at(values), cell.outline or circle, interphase)


def modal_cell(radius: AnyRadius, cell: RoundCell) -> Cell:
    """The cell at the modal values."""
    return particle_at(modal_values(radius, cell), radius, cell)


def modal_values(radius: AnyRadius | ThetaSection, cell: AnyCell) -> dict[str, float]:
    """Modal values of the inputs by name, in SI."""
    return {name: number.modal for name, number in inputs_of(radius, cell).items()}


def solve(radius: AnyRadius | ThetaSection, cell: AnyCell, model: Solve) -> HomogenisedStiffness:
    """The homogenised stiffness of the cell at the modal values of its inputs."""
    return model([cell_at(modal_values(radius, cell), radius, cell)])[0]


def references(
    radius: AnyRadius | ThetaSection, cell: AnyCell, stated: float | None = None
) -> References:
    """Particle fraction, Hashin–Shtrikman bounds and Mori–Tanaka estimate of E at modal inputs.

    The bounds are at the fraction `stated`, else at the mean fraction of the radius map.

    Of anisotropic phases or with an interphase there is `fraction` alone; nothing of a mesh from a
    file.
    """
    if isinstance(cell, MeshedCell):
        return {}
    modal = modal_cell(cast("AnyRadius", radius), cell)
    radius_map, matrix, inclusion = modal.radius, modal.matrix, modal.inclusion
    rule, spheres = gauss_rule(radius_map.distribution, points=40), cell.particles == "spheres"
    radii = radius_map(rule.nodes)
    fractions = volume_fraction(radii) if spheres else modal.fraction(rule.nodes)
    mean_fraction = float(np.asarray(rule.mean(fractions)))
    if not isinstance(matrix, Phase) or not isinstance(inclusion, Phase) or modal.interphase:
        return {"fraction": mean_fraction}
    found: References = {"fraction": mean_fraction}
    if stated is not None:
        found["fraction_of_case"] = stated
    fraction = np.asarray(mean_fraction if stated is None else stated)
    if spheres:
        moduli = hashin_shtrikman(fraction, matrix, inclusion).T
        low, high = (_young(*bulk_and_shear) / GPA for bulk_and_shear in moduli)
        young_bounds = low, high
        estimate = _young(*mori_tanaka(fraction, matrix, inclusion))
    else:
        phase_fractions = np.array([1 - fraction, fraction])
        young_bounds = isotropic_bounds(phase_fractions, [matrix.stiffness, inclusion.stiffness])
        bulk, _, shear = bounds.mori_tanaka(fraction, matrix, inclusion)
        estimate = _transverse_young(bulk / 2, shear)
    found["hashin_shtrikman_E_GPa"] = young_bounds
    if modal.square or spheres:
        found["mori_tanaka_E_GPa"] = estimate / GPA
    return found


def isotropic_bounds(fractions: Array, stiffness: Sequence[Array]) -> tuple[float, float]:
    """Lower and upper Hashin–Shtrikman bound of the transverse Young's modulus in GPa.

    They are its values at the lower and at the upper bounds of the plane moduli K and G.
    Area fractions have shape (phases,), plane stiffnesses in Pa (3, 3) each.
    """
    moduli = bounds.hashin_shtrikman(fractions, stiffness).T
    low, high = (_transverse_young(*bulk_and_shear) / GPA for bulk_and_shear in moduli)
    return low, high


def _transverse_young(bulk: float, shear: float) -> float:
    """Transverse Young's modulus in Pa of an isotropic plane with moduli K and G in Pa (eq. 16)."""
    return effective_modulus(2 * STRAIN * float(bulk), 2 * STRAIN * float(shear))[0]


def _young(bulk: float, shear: float) -> float:
    """Young's modulus in Pa of an isotropic material with moduli K and G in Pa."""
    return float(hill_average(np.array([bulk, shear, shear]))[0])


def document(result: HomogenisedStiffness) -> Document:
    """The result of a cell as a JSON document; moduli and stresses in GPa."""
    s11, s12 = result.curve.mean
    is_isotropic = result.has_isotropic_constants
    return {
        "E_GPa": result.modulus / GPA if is_isotropic else None,
        "nu": result.poisson if is_isotropic else None,
        "stress_GPa": {"s11": s11 / GPA, "s12": s12 / GPA},
        "fibres": fibres(result),
        "stiffness_GPa": None if result.stiffness is None else result.stiffness / GPA,
        "stiffness_error_GPa": stiffness_errors(result),
        "plane": plane_constants(result),
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
        "checks": dict(result.checks),
        "versions": versions(),
    }


def fibres(result: HomogenisedStiffness) -> Document:
    """Constants of fibres with their declared errors, moduli in GPa; empty for other particles."""
    cell = result.cell
    if isinstance(result, HomogenisedSpheres) or cell is None or not cell.square or cell.interphase:
        return {}
    constants = fibre_constants(result)
    return dict(_constant(x, value, constants.errors[x]) for x, value in constants.values.items())


def _constant(name: str, value: float, error: float) -> tuple[str, Document]:
    """Key and entry of a constant: a modulus in GPa, a ratio as it is; error None if unknown."""
    key, unit = (name, 1.0) if name.startswith("nu") else (f"{name}_GPa", GPA)
    return key, {"value": value / unit, "error": None if np.isnan(error) else error / unit}


def stiffness_errors(result: HomogenisedStiffness) -> Array | None:
    """Declared errors of the entries of a plane stiffness, in GPa; None where there are none."""
    errors = result.stiffness_errors if result.errors else None
    return None if errors is None else np.asarray(errors / GPA)


def constant_label(key: str) -> str:
    """Label of a constant: nu_LT as ν_LT, E_T_GPa as E_T, GPa."""
    return key.replace("nu", "ν").replace("_GPa", ", GPa")


def plane_constants(result: HomogenisedStiffness) -> Document:
    """Constants along x and y by definition and name, with their declared errors, in GPa."""
    return {
        definition: dict(map(_constant, NAMES, constants.values, constants.errors))
        for definition, constants in engineering_constants(result).items()
    }


def declared_errors(result: HomogenisedStiffness) -> Document | None:
    """Declared absolute errors of E, ν and the mean stresses; None where there are none."""
    if not result.errors:
        return None
    if isinstance(result, HomogenisedSpheres):
        modulus, nu = result.error_of(hill_average)
        # σ11 under ε11 = ε22 and σ12 under ε12, from the moduli m = K, (C11 − C12)/2 and C44
        s11, s12 = result.error_of(lambda m: STRAIN * np.array([2 * m[0] + 2 / 3 * m[1], 2 * m[2]]))
    else:
        modulus, nu = result.estimated_error * result.modulus, result.poisson_error
        s11, s12 = np.abs(result.curve.mean) * result.modulus_errors[[0, 2]]
    return {"E_GPa": modulus / GPA, "nu": nu, "stress_GPa": {"s11": s11 / GPA, "s12": s12 / GPA}}


def require_isotropic(result: HomogenisedStiffness) -> None:
    """Refuses E and ν of a cell whose stiffness no isotropic solid has."""
    if not result.has_isotropic_constants:
        value, cure = f"{result.modulus / GPA:.4g} GPa", "take the stiffness of `alphacut cell`"
        raise FailedError(f"E would be {value}: 2 G_T exceeds 3 (C11 + C12)", cure)


def require_bounds(
    modulus_bounds: tuple[float, float], references: References, particles: str
) -> None:
    """Refuses E of spheres outside the Hashin–Shtrikman bounds of the fraction that a case states.

    E is outside by more than `BOUNDS_SLACK` where the radius map holds another fraction, since
    cells denser than any cube are cut off, or because the mean over cells with different spheres
    need not obey the bounds. `modulus_bounds` are those of E at the nominal inputs, in Pa.
    """
    if particles != "spheres" or "fraction_of_case" not in references:
        return
    low, high = references["hashin_shtrikman_E_GPa"]
    fraction = references["fraction_of_case"]
    young_low, young_high = (bound / GPA for bound in modulus_bounds)
    if young_high < low * (1 - BOUNDS_SLACK) or young_low > high * (1 + BOUNDS_SLACK):
        value = f"{young_low:.5g} GPa, of a map that holds {references['fraction']:.4g}"
        limits = f"Hashin–Shtrikman's {low:.5g} … {high:.5g} GPa at {fraction:g}"
        cure = f"set cell.fraction = {fraction:g} in place of [microstructure] or [radius]"
        raise RefusedError("E of spheres", value, limits, cure)


def require_tolerance(error: Mapping[str, float], tolerance: float | None) -> None:
    """Requires the sum of the declared relative errors of E within a tolerance, if any."""
    total = sum(error.values())
    if tolerance is not None and total > tolerance * (1 + 1e-9):
        what = f"the relative error of E is {total:.2g}; the case allows {tolerance:.2g}"
        raise FailedError(what, "method auto reaches it")


def require_mesh(mesh: Mesh, law: ThetaSection, cell: MeshedCell) -> None:
    """Refuses a mesh file that is no periodic cell of prisms, or does not fit [cell.phases]."""
    try:
        from alphacut.rve.mesh.file import read_grid
        from alphacut.rve.mesh.periodicity import MeshError
        from alphacut.rve.prism.own_mesh import mesh_phases
    except ImportError as error:
        raise RefusedError("mesh.file", mesh.file, "no mesh", missing(error)) from None
    assert mesh.file is not None
    try:
        grid = read_grid(mesh.file)
    except MeshError as error:
        raise RefusedError("mesh.file", Path(mesh.file).name, error.what, error.cure) from None
    sample = modal_sample(law, cell)
    mesh_phases(grid, sample.law, sample.phases)  # refuses what does not fit
