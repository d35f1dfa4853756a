"""Admissible values of fuzzy parameters, over their whole supports."""

from __future__ import annotations

import warnings
from functools import singledispatch

import numpy as np

from alphacut.frame.boxes import Boxes
from alphacut.frame.calculus.jet import Array
from alphacut.frame.checks.step_error import probes
from alphacut.frame.structures.lagrangian import LagrangianSystem
from alphacut.frame.structures.linear import LinearSystem, evaluate, round_off
from alphacut.frame.structures.matrix import MatrixStructure
from alphacut.frame.structures.quantities import RATIO, Parameter, of_storey_frame
from alphacut.frame.structures.storey import StoreyFrame

OTHER_UNITS = 500  # from so many times the structure's own value on, or that part of it
SLOW = 10  # periods longer than so many durations are warned of
ROUNDING = 1e-6
"""Share of a peak that round-off may leave without a word."""
NODES = 3  # or all of fewer steps than these


@singledispatch
def parameter(system: LinearSystem | LagrangianSystem, name: str) -> Parameter:
    """A parameter of `system`, with the unit and the range that are known of it."""
    return Parameter(name)


@parameter.register
def _(system: StoreyFrame, name: str) -> Parameter:
    return of_storey_frame(name)


@parameter.register
def _(system: MatrixStructure, name: str) -> Parameter:
    ratio = name in [ratio for ratio in system.ratios if isinstance(ratio, str)]
    return Parameter(name, range=RATIO if ratio else "")


def require_admissible(
    system: LinearSystem | LagrangianSystem, cuts: Boxes, duration: float, step: float
) -> None:
    """Refuses supports that reach values without a meaning.

    Args:
        system: The structure.
        cuts: Its uncertain parameters.
        duration: Length of the simulation, in s.
        step: Distance of nodes, in s.

    Raises:
        ValueError: A support is not finite or reaches what its parameter must not be, or is of
            another size than the structure's own value, as one in other units, or the mass
            matrix of a linear structure is not positive definite at the modal parameters or a
            corner, or nothing moves it, or the weight may buckle a storey.

    Warns:
        UserWarning: A stiffness or damping has a negative eigenvalue there, or all periods are
            long beside the duration, or short beside the step.
    """
    for name, low, high in zip(cuts.names, cuts.lower.min(0), cuts.upper.max(0), strict=True):
        own = parameter(system, name)
        if not own.admits(low, high):
            raise ValueError(
                f"uncertain parameter {name}: its support [{low:g}, {high:g}] must be"
                f" {own.range or 'finite'}; narrow it"
            )
        require_size(name, system.parameters[name], np.array([low, high]))
    if isinstance(system, StoreyFrame):
        ends = zip(cuts.lower.min(0).tolist(), cuts.upper.max(0).tolist(), strict=True)
        system.require_standing(dict(zip(cuts.names, ends, strict=True)))
    if not isinstance(system, LagrangianSystem):
        require_motion(system, cuts.names, probes(cuts), duration, step)


def require_size(name: str, own: float, support: Array) -> None:
    """Refuses a support that lies as far from the structure's own value as kN from N.

    Raises:
        ValueError: It does.
    """
    size = np.abs(support) / abs(own) if own else np.ones(2)
    if size.min() >= OTHER_UNITS or (0 < size.max() <= 1 / OTHER_UNITS):
        low, high = support
        raise ValueError(
            f"uncertain parameter {name}: its support [{low:g}, {high:g}] is of another size than"
            f" the structure's own value, {own:g}; give both in SI units (Pa, kg, m, s, N)"
        )


def require_motion(
    system: LinearSystem, names: tuple[str, ...], points: Array, duration: float, step: float
) -> None:
    """As `require_admissible`, at parameters `points` (S, d) of a linear structure."""
    periods, rounding = [], [0.0]  # the longest natural one at each point
    moved = system.ground is not None and np.any(system.ground.acceleration)
    growing: dict[str, str] = {}
    for point in points:
        at = ", ".join(f"{name} = {x:g}" for name, x in zip(names, point, strict=True))
        try:
            found = evaluate(system, names, point[None], derivatives=False)[0]
            positive = bool(np.linalg.eigvalsh(found.mass.value).min() > 0)
        except np.linalg.LinAlgError:  # from damping by ratios, which divides by the mass
            positive = False
        if not positive:
            raise ValueError(
                f"mass: the matrix is not positive definite at {at}; narrow the supports to where"
                " every unknown has a mass"
            )
        squares = np.linalg.eigvals(np.linalg.solve(found.mass.value[0], found.stiffness.value[0]))
        periods.append(_longest_period(squares.real))
        slowest = 2 * np.pi / periods[-1] if periods[-1] else np.inf
        rounding.append(float(round_off(np.abs(squares).max(), slowest, np.array(duration))))
        moved = moved or found.q0.value.any() or found.v0.value.any()
        for kind, jet in (("stiffness", found.stiffness), ("damping", found.damping)):
            rates = np.linalg.eigvalsh((jet.value[0] + jet.value[0].T) / 2)
            if rates[0] < -1e-9 * np.abs(rates).max():
                growing[kind] = f"{rates[0]:.3g} beside {rates[-1]:.3g} at {at}"
    if not moved:
        raise ValueError(
            "nothing moves the structure: q0 and v0 are zero, and there is no ground motion; give"
            " q0 or v0 that is not zero, or ground=Accelerogram(step, acceleration)"
        )
    said = [
        f"{kind}: the matrix has the negative eigenvalue {seen}, so that motions may grow without"
        " end; check its entries and their signs"
        for kind, seen in growing.items()
    ]
    if (share := max(rounding)) > ROUNDING:
        what = f"stiffness: beside its stiffest parts round-off alone may leave {share:.0e} of each"
        said.append(
            f"{what} peak, or twenty times as much with a follower; soften nearly rigid parts"
        )
    for line in said:
        warnings.warn(line, stacklevel=4)
    every = system.ground.step if moved and system.ground is not None else 0.0
    _warn_of_units(min(periods, default=np.inf), max(periods, default=0.0), duration, step, every)


def _warn_of_units(
    shortest: float, longest: float, duration: float, step: float, every: float
) -> None:
    """Warns where first natural periods are unlike what is asked, as with t for kg."""
    units = "check the units, which are SI (Pa, kg, m, s, N)"
    seen = {
        f"the longest natural period is {shortest:.3g} s beside a duration of {duration:g} s: the"
        f" structure hardly moves; {units}": shortest > SLOW * duration,
        f"the longest natural period is {longest:.3g} s beside a step of {step:g} s: most peaks"
        f" fall between nodes; take a smaller step, or {units}": 0 < longest < NODES * step,
        f"the record has a value every {every:g} s and the longest natural period is"
        f" {longest:.3g} s: the structure swings between them; {units}": 0 < longest < every,
    }
    for line in (line for line, true in seen.items() if true):
        warnings.warn(line, stacklevel=5)


def _longest_period(squares: Array) -> float:
    """Longest natural period in s, of squared frequencies; 0 where nothing swings."""
    swinging = squares[squares > 1e-13 * np.abs(squares).max()]
    return float(2 * np.pi / np.sqrt(swinging.min())) if len(swinging) else 0.0
