"""Values that fuzzy parameters may have, over their whole supports."""

from __future__ import annotations

import warnings

import numpy as np

from alphacut.frame.boxes import Boxes
from alphacut.frame.checks.step_error import probes
from alphacut.frame.structures.lagrangian import LagrangianSystem
from alphacut.frame.structures.linear import LinearSystem, evaluate
from alphacut.frame.structures.storey import StoreyFrame
from alphacut.fuzzy.arrays import Array
from alphacut.fuzzy.refused import RefusedError, require

OTHER_UNITS = 500
"""From so many times the structure's own value on, or that part of it, units differ."""


def require_admissible(system: LinearSystem | LagrangianSystem, cuts: Boxes) -> None:
    """Refuse supports that reach values without a meaning.

    Raises:
        RefusedError: A support is not finite, reaches what its parameter must not be, or is of
            another size than the structure's own value, as one in other units; or the mass matrix
            of a linear structure is not positive definite at the modal parameters or a corner, or
            nothing moves it, or the weight may buckle a storey.
    """
    for name, low, high in zip(cuts.names, cuts.lower.min(0), cuts.upper.max(0), strict=True):
        own = system.parameter(name)
        if not own.admits(low, high):
            raise RefusedError(f"support of {name}", f"[{low:g}, {high:g}]", own.range or "finite")
        if name in system.parameters:
            require_size(name, system.parameters[name], np.array([low, high]))
    if isinstance(system, StoreyFrame):
        ends = zip(cuts.lower.min(0).tolist(), cuts.upper.max(0).tolist(), strict=True)
        system.require_standing(dict(zip(cuts.names, ends, strict=True)))
    if not isinstance(system, LagrangianSystem):
        require_motion(system, cuts.names, probes(cuts))


def require_size(name: str, own: float, support: Array) -> None:
    """Refuse a support that lies as far from the structure's own value as kN from N."""
    size = np.abs(support) / abs(own) if own else np.ones(2)
    if size.min() >= OTHER_UNITS or (0 < size.max() <= 1 / OTHER_UNITS):
        shown = f"[{support[0]:g}, {support[1]:g}]"
        near = f"values of the size of {own:g}, the structure's own"
        raise RefusedError(f"support of {name}", shown, near, "give both in SI units")


def require_motion(system: LinearSystem, names: tuple[str, ...], points: Array) -> None:
    """As `require_admissible`, at parameters `points` (S, d) of a linear structure.

    Warns:
        UserWarning: A stiffness or damping has a negative eigenvalue there.
    """
    moved = system.ground is not None and np.any(system.ground.acceleration)
    growing: dict[str, str] = {}
    for point in points:
        at = ", ".join(f"{name} = {x:g}" for name, x in zip(names, point, strict=True))
        try:
            at_point = evaluate(system, names, point[None], derivatives=False)[0]
            positive = bool(np.linalg.eigvalsh(at_point.mass.value).min() > 0)
        except np.linalg.LinAlgError:  # from damping by ratios, which divides by the mass
            positive = False
        require(positive, "mass", f"not positive definite at {at}", "a mass for every unknown")
        moved = moved or at_point.q0.value.any() or at_point.v0.value.any()
        for kind, jet in (("stiffness", at_point.stiffness), ("damping", at_point.damping)):
            rates = np.linalg.eigvalsh((jet.value[0] + jet.value[0].T) / 2)
            if rates[0] < -1e-9 * np.abs(rates).max():
                growing[kind] = f"{rates[0]:.3g} beside {rates[-1]:.3g} at {at}"
    require(moved, "q0, v0 and ground", "zero", "a start or a record that moves something")
    for kind, seen in growing.items():
        what = (
            f"{kind}: the matrix has the negative eigenvalue {seen}: motions may grow without end"
        )
        warnings.warn(what, stacklevel=4)
