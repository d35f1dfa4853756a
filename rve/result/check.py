"""A common check of models of a cell, which every model of a cell with one particle passes."""

from __future__ import annotations

from alphacut.base.errors import require
from alphacut.rve.cell.cell import Phase
from alphacut.rve.result.cell_model import CellModel, Resolution
from alphacut.stochastic import RadiusMap


def check_cell_model(kind: type[CellModel], radius_map: RadiusMap) -> None:
    """Refuse a model of a cell that does not keep what campaigns ask of every model.

    It has a name, solves several inclusions at once in their order, gives the matrix itself where
    the particle is of the same material, and has a Young's modulus that rises with the particle's,
    between those of both phases.

    Args:
        kind: Class of the model.
        radius_map: Radius of the particle over θ.

    Raises:
        RefusedError: Naming the member that does not do what it says.
    """
    for name in ("name", "convention"):
        require(bool(getattr(kind, name, "")), name, None, "words for results")
    model = kind.with_resolution(Resolution(tolerance=1e-4))
    require(isinstance(model, kind), "with_resolution", type(model).__name__, kind.__name__)
    matrix = Phase(20e9, 0.3)
    particles = [Phase(20e9, 0.3), Phase(40e9, 0.3), Phase(80e9, 0.3)]
    found = [result.modulus for result in model.solve(radius_map, matrix, particles)]
    require(len(found) == len(particles), "solve", f"{len(found)} results", "one an inclusion")
    same = abs(found[0] / matrix.modulus - 1) < 1e-3
    require(same, "solve", f"E = {found[0]:g} Pa of a cell of one material", "that of the material")
    is_between = matrix.modulus < found[1] < found[2] < particles[2].modulus
    require(is_between, "solve", found, "moduli that rise between those of the phases")
    coarser = type(model.coarser())
    require(issubclass(coarser, kind), "coarser", coarser.__name__, "a model of the same class")
