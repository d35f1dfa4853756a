"""From the name of a cell model to the model; may import DOLFINx."""

from __future__ import annotations

import os
from dataclasses import fields
from importlib import import_module
from pathlib import Path
from typing import Any, cast

from alphacut.io.problem import BadInput, Problem
from alphacut.rve.model import MODELS, named
from alphacut.stages.cell import CellChoice, CellModel


def table_folder() -> Path | None:
    """Cache folder of the cell's tables; None if it cannot be made."""
    base = (
        os.environ.get("ALPHACUT_CACHE")
        or Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "alphacut"
    )
    folder = Path(base) / "tables"
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError:
        return None
    return folder


def cell_model(choice: CellChoice) -> CellModel:
    """The model that `choice` names, with those of its options that the model has.

    Raises:
        BadInput: The model needs what is not installed, or refuses an option.
    """
    module, maker = MODELS[choice.method]
    try:
        known = {field.name for field in fields(getattr(import_module(module), maker))}
        if choice.method in ("slices", "prism") or (
            choice.method == "auto" and "series" in choice.exclude
        ):
            # DOLFINx is loaded before the clock starts: times are those of computing
            import_module("alphacut.rve.planar.problem")
    except ImportError as error:
        what = (
            f"this model cannot be loaded ({error}); ./enter brings an environment that has"
            " everything"
        )
        raise BadInput(
            Problem("modulus.method", what, choice.method, "series needs NumPy and SciPy alone")
        ) from None
    if choice.petsc and "petsc" not in known:
        what = f"method {choice.method} does not use PETSc"
        raise BadInput(
            [Problem(f"-rve_{name}", what, allowed="--method prism") for name in choice.petsc]
        )
    offered: dict[str, Any] = {
        "layers": choice.layers,
        "mesh_size": choice.size,
        "interface": choice.interface,
        "petsc": dict(choice.petsc),
        "tolerance": choice.tolerance,
        "exclude": choice.exclude,
        "parallel": choice.parallel,
        "cache": table_folder(),
        "moduli": choice.moduli,
        "estimate": choice.estimate,
        "stiffness": choice.stiffness,
    }
    try:
        return cast(
            CellModel,
            named(
                choice.method, **{name: value for name, value in offered.items() if name in known}
            ),
        )
    except ValueError as error:
        raise BadInput(Problem("mesh", str(error))) from None
