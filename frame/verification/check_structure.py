"""A common check of structures, which every kind of structure passes."""

from __future__ import annotations

import numpy as np

from alphacut.base.errors import require
from alphacut.frame.dynamics.nonlinear import make_flow
from alphacut.frame.structures.linear import frequencies, has_matrices
from alphacut.frame.structures.model import StructureModel


def check_structure(model: StructureModel, *, duration: float, step: float) -> None:
    """Refuse a structure that does not keep what analyses ask of every structure.

    Parameters and outputs have names and finite values; responses are finite and of one shape; and
    many sets of parameters at once give the responses that each of them gives alone. A linear
    structure has positive natural frequencies.

    Args:
        model: The structure.
        duration: Length in s of the responses that are computed.
        step: Distance of their time nodes in s.

    Raises:
        RefusedError: Naming the member that does not do what it says.
    """
    names = tuple(model.parameters)
    nominal = np.array([model.parameters[name] for name in names], float)
    require(len(names) > 0, "parameters", "none", "one parameter or more")
    require(bool(np.isfinite(nominal).all()), "parameters", nominal, "finite numbers")
    require(len(model.outputs) > 0, "outputs", "none", "one output or more")
    for name in names:
        require(bool(model.group(name)), "group", f"empty for {name}", "the parameter itself")
        require(model.parameter(name).name == name, "parameter", name, "the parameter of this name")
    for output in model.outputs:
        model.require_quantity(output)
        require(isinstance(model.unit_of(output), str), "unit_of", output, "the SI unit as a text")
    kept = tuple(model.with_outputs(model.outputs).outputs)
    require(kept == tuple(model.outputs), "with_outputs", kept, "the outputs that were asked for")
    if has_matrices(model):
        lowest = frequencies(model).min()
        require(lowest > 0, "assembly", f"a frequency of {lowest:g} rad/s", "frequencies above 0")
    flow = make_flow(model, names, duration, step)
    points = nominal * np.array([[1.0], [1.001], [0.999]])
    together = flow.values(points)
    n_nodes = round(duration / step) + 1
    shape = (len(points), n_nodes, len(model.outputs))
    require(together.shape == shape, "response", f"of shape {together.shape}", f"shape {shape}")
    require(bool(np.isfinite(together).all()), "response", "not finite", "finite numbers")
    size = np.abs(together).max(axis=(0, 1))
    for point, response in zip(points, together, strict=True):
        alone = flow.values(point[np.newaxis])[0]
        error = np.abs(alone - response).max(axis=0)
        allowed = "that of each set of parameters alone"
        is_same = bool((error <= 1e-9 * size + np.finfo(float).tiny).all())
        require(is_same, "response of many sets of parameters", error.tolist(), allowed)
