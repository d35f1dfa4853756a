"""The structure of a case before a stage has run, so that `check` judges no stand-in value."""

from __future__ import annotations

import re
from dataclasses import replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from alphacut.case.content import Content
from alphacut.case.material import (
    Mesh,
    MeshedCell,
    ModulusSection,
    RadiusMapSection,
    RoundCell,
    ThetaSection,
)
from alphacut.case.structure import Structure
from alphacut.fuzzy import Crisp, FuzzyNumber, Triangular
from alphacut.rve.result.loss_factors import loss_factors
from alphacut.rve.result.result import HomogenisedStiffness
from alphacut.stages.cell import CellProblem
from alphacut.stochastic import FractionMap


class Material(NamedTuple):
    """What a structure takes from its cell; None of what the case states itself.

    Args:
        modulus: Young's modulus in Pa.
        loss: Its loss factor.
    """

    modulus: FuzzyNumber | None = None
    loss: FuzzyNumber | None = None


def foreseen_material(content: Content) -> Material | None:
    """Return the material of the structure at the nominal values of the cell, from a fast model.

    The analytic series solves the cell in milliseconds, so that `check` can use it.

    Returns:
        Young's modulus in Pa and the loss factor, each None if the structure does not take it from
        the cell. None instead of a material if the series does not solve the cell, or the radius
        map is yet to be computed.

    Raises:
        RefusedError: The cell does not fit the series.
        FailedError: The series does not converge.
    """
    if content.has_stated_modulus and not content.has_material_damping:
        return Material()
    cell = content.particle_cell
    # A radius map that stage microstructure will compute is not there yet.
    has_map = cell is not None and bool(content.radius_map or cell.fraction_map)
    if cell is None or "series" not in cell.methods or not has_map:
        return None
    # A period, or whether a time step is fine enough, is judged by two digits: an error of E of
    # 1e-4 is far below that.
    section = content.modulus.model_copy(update={"method": "auto", "tolerance": 1e-4})
    problem = CellProblem.of(content)
    result = _solved(problem.radius, problem.cell, problem.mesh, section)
    loss = None
    if content.has_material_damping:
        # The case states one loss factor for each phase: of its Young's modulus, at a real ν. Then
        # the bulk and the shear modulus have the same one: `losses` has the shape (phases, 2).
        losses = np.array([[number.nominal] * 2 for number in cell.losses])
        loss = Crisp(loss_factors(result, losses).values["E"])
    if content.has_stated_modulus:
        return Material(loss=loss)
    return Material(Crisp(result.modulus), loss)


@lru_cache(maxsize=1)  # `check` asks for the material of its case twice
def _solved(
    radius: RadiusMapSection | ThetaSection | FractionMap,
    cell: RoundCell | MeshedCell,
    mesh: Mesh,
    modulus: ModulusSection,
) -> HomogenisedStiffness:
    """Return the stiffness of a cell as `CellProblem.solve` does, which nobody changes."""
    return CellProblem(radius, cell, mesh, modulus).solve()


def foreseen_structure(content: Content) -> Structure | None:
    """Return the structure of a case at the nominal values of its cell, as far as it is known.

    Returns:
        None if the case has no structure, or takes its material from a cell that no fast model
        solves.

    Raises:
        RefusedError: The cell does not fit the series, or the values make no structure.
        FailedError: The series does not converge.
    """
    if content.structure is None:
        return None
    material = foreseen_material(content)
    if material is None:
        return None
    return content.structure_of(material.modulus, material.loss)


def possible_materials(content: Content) -> tuple[Material, ...]:
    """Return the materials that stand for what a stage will give the structure of a case.

    Args:
        content: The case.

    Returns:
        The material at the nominal values of the cell, if a fast model finds it. Otherwise two
        extremes: a stiff one with a small loss factor, and a soft one with a large loss factor,
        both without the modulus if the case states it. A case that is refused with both is wrong
        whatever a stage will compute.

    Raises:
        RefusedError: The cell does not fit the series.
        FailedError: The series does not converge.
    """
    # A structure may be refused for a modulus that is too small and a loss factor that is too
    # large, or the reverse. What any material allows, one of the two extremes allows.
    known = foreseen_material(content)
    if known is not None:
        return (known,)
    small_loss = Crisp(1e-3)  # steel
    large_loss = Crisp(0.3)  # rubber
    if content.has_stated_modulus:
        return Material(loss=small_loss), Material(loss=large_loss)
    diamond = Crisp(1e12)
    polymer = Crisp(1e9)
    return Material(diamond, small_loss), Material(polymer, large_loss)


def structure_as_computed(content: Content, material: Material) -> Structure:
    """Return the structure of a material, with as many fuzzy numbers as stage modulus will make.

    Young's modulus E and the damping ratios zeta, zeta1 … become fuzzy where the α-cuts of the
    stage will have a width. Their own widths are not known yet: E gets 1 % and the damping ratios
    10 % to either side of the nominal value.

    Args:
        content: The case.
        material: Young's modulus in Pa and loss factor, None for what the case states.

    Raises:
        RefusedError: There is no such structure.
    """
    structure = content.structure_of(material.modulus, material.loss)
    if "modulus" not in content.stages:
        return structure
    # Which inputs are fuzzy decides on the method and its cost; how wide they are does not.
    has_cuts = content.modulus.alpha != (1.0,)  # at α = 1 alone everything is crisp
    is_fuzzy = has_cuts
    if has_cuts and content.image_cell is None and "microstructure" not in content.stages:
        inputs = CellProblem.of(content).inputs.values()
        is_fuzzy = any(number.support.width > 0 for number in inputs)
    numbers: dict[str, FuzzyNumber] = dict(structure.numbers)
    if "E" in numbers:
        young = numbers["E"].nominal
        numbers["E"] = Crisp(young)
        if is_fuzzy:
            numbers["E"] = Triangular(0.99 * young, young, 1.01 * young)
    losses: tuple[FuzzyNumber, ...] = ()
    if content.cell is not None:
        losses = content.cell.losses
    # The loss factor of the cell is a mean of the loss factors of its phases, weighted by energies,
    # which depend on the elastic inputs. It is fuzzy if these inputs or the loss factors are.
    has_fuzzy_losses = has_cuts and any(loss.support.width > 0 for loss in losses)
    if content.has_material_damping and (is_fuzzy or has_fuzzy_losses):
        for name, number in structure.numbers.items():
            if re.fullmatch(r"zeta\d*", name):
                ratio = number.nominal
                numbers[name] = Triangular(0.9 * ratio, ratio, 1.1 * ratio)
    return replace(structure, numbers=numbers)
