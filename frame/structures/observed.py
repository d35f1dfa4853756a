"""A structure reduced to some of its outputs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TypeVar, cast

from alphacut.base.errors import require_choice
from alphacut.frame.structures.lagrangian import LagrangianSystem
from alphacut.frame.structures.matrix import MatrixStructure
from alphacut.frame.structures.quantities import Output
from alphacut.frame.structures.storey import StoreyFrame

Model = TypeVar("Model", bound=StoreyFrame | MatrixStructure | LagrangianSystem)


def with_outputs(model: Model, outputs: Sequence[str]) -> Model:
    """Return a structure that observes some outputs alone.

    A storey frame may observe any quantity that it has, listed before or not. A system that is not
    linear always computes all of its outputs, and is returned as it is.

    Raises:
        RefusedError: The structure has no such output.
    """
    if isinstance(model, StoreyFrame):
        return cast("Model", replace(model, outputs=tuple(outputs)))
    for output in outputs:
        require_choice("outputs", output, model.outputs)
    matrices: object = model
    if not isinstance(matrices, MatrixStructure):
        return model
    observed = {name: row for name, row in matrices.observed.items() if name in outputs}
    factors = {name: x for name, x in matrices.row_factors.items() if name in outputs}
    return cast("Model", replace(matrices, observed=observed, row_factors=factors))


def unit_of_output(model: StoreyFrame | MatrixStructure | LagrangianSystem, output: str) -> str:
    """Return the SI unit of an output, observed or of the kind of a storey frame's."""
    return Output(next((name for name in model.outputs if name == output), output)).unit
