"""From the name of a cell model to the model: the only place of the front door that brings in DOLFINx."""

from __future__ import annotations

from alphacut.cell import CellChoice, CellModel
from alphacut.problem import BadInput, Problem


def cell_model(choice: CellChoice) -> CellModel:
    """The model that `choice` names, at its resolution.

    Raises:
        BadInput: The model needs what is not installed.
    """
    raise BadInput(Problem("modulus.method", "there is no such model here", choice.method))
