"""Proved bound of the polynomials' error in a modal model, over the whole box.

Polynomials z_k = [φ_k; w_k] for the states of the modes make q(t) = 2 Re Σ φ_k exp(λ_k t) a motion
that nearly obeys the equations. What it misses, λ_k φ_k − w_k and λ_k M w_k + D w_k + K φ_k, is a
polynomial in the parameters, bounded by its Chebyshev coefficients. Damping only takes energy, so
the deviation from the true motion, in the norm √(qᵀ K q + vᵀ M v), grows no faster than this
defect: no eigenvalue problem is solved anew, and nothing rests on a distance between eigenvalues.
Damping by one ratio for all modes is no polynomial; `ratio_damping` bounds what that adds.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from alphacut.frame.bounds.ratio_damping import LoewnerBounds, RatioDamping
from alphacut.frame.bounds.remainder import MotionPart, largest_growth, parts, suprema
from alphacut.frame.calculus.jet import Array, Jet
from alphacut.frame.calculus.polynomial import LowerGrid, Polynomial
from alphacut.frame.calculus.unproved import UnprovedError
from alphacut.frame.modal.fitting import fit_states
from alphacut.frame.modal.ground_response import Direct
from alphacut.frame.modal.model import ModalModel
from alphacut.frame.structures import polynomial_dependence
from alphacut.frame.structures.linear import LinearSystem, Matrices, evaluate, histories

MOST_NUMBERS = 60_000_000
"""Values of the defects on their grid, at most: 0.5 GB."""
CHUNK = 10_000
Sample = Callable[[Array], dict[str, Array]]


def proved_error(model: ModalModel) -> Array:
    """Bound of |modal model − true motion| over the box, shape (T, m), in units of the outputs.

    Defects of the model in the equations of motion push the motion off in the norm of energy; an
    output reads a part of this deviation, and its own defects add to it.

    Raises:
        UnprovedError: The structure is not known to be a polynomial that loses energy, or the
            box is so wide or has so many parameters that the bound cannot be computed.
    """
    reach, m = np.ones(len(model.boxes.names)), len(model.outputs)
    ratio, growth = RatioDamping.from_model(model), largest_growth(model.eigenvalue, reach)
    states = fit_states(model)
    defects_of_parts = [
        (part, partial(_defects, model, part, states, ratio)) for part in parts(model, growth)
    ]
    grid = _grid(model)
    for _, defects in defects_of_parts:
        _require_affordable(grid, defects)
    structure = _expanded(grid, partial(_structure, model))
    stiffness, mass = LoewnerBounds(structure["stiffness"]), LoewnerBounds(structure["mass"])
    deviation, output_error = np.zeros(len(model.time)), np.zeros((len(model.time), m))
    for part, defects in defects_of_parts:
        defect = _expanded(grid, defects)
        if isinstance(part.load, Direct):
            output_error += 2 * part.waves[0][:, :1] * np.abs(defect["outputs"][:, 0]).sum(0)
            continue
        deviation += part.push * _size_of_start(defect, stiffness, mass)
        for k in range(model.count):
            force = mass.sup_dual(defect["dynamic"][:, k])
            if ratio is not None:
                damping_error = ratio.damping_error(defect, k, stiffness, mass)
                force += damping_error
                wave = part.waves[0][:, k : k + 1]
                output_error += 2 * wave * damping_error / ratio.root_masses
            energy_rate = np.hypot(stiffness.sup(defect["kinematic"][:, k]), force)
            deviation += 2 * energy_rate * part.elapsed[:, k]
        largest = suprema(part.share, reach)[0].reshape(model.count, m)
        of_modes = np.abs(defect["outputs"]).sum(0) + part.left_out[:, None] * largest
        output_error += 2 * part.waves[0] @ of_modes
    gain = _output_gains(structure["rows"], stiffness, mass, ratio)
    return deviation[:, None] * gain + output_error


def _output_gains(
    rows: Array, stiffness: LoewnerBounds, mass: LoewnerBounds, ratio: RatioDamping | None
) -> Array:
    """Bound of each output's error over the deviation √(qᵀ K q + vᵀ M v), shape (m,).

    `rows` (J, m, 2N) are Chebyshev coefficients of the outputs' rows on [q, v]; with `ratio`, the
    damping by one ratio, accelerations of floors read its force too.
    """
    size = len(stiffness.factor)
    rows = np.moveaxis(rows, 1, 0)  # (m, J, 2N)
    of_displacement = np.array([stiffness.sup_dual(row[:, :size]) for row in rows])
    of_velocity = np.array([mass.sup_dual(row[:, size:]) for row in rows])
    if ratio is not None:
        of_velocity = of_velocity + ratio.acceleration_gains(stiffness, mass)
    return np.asarray(np.hypot(of_displacement, of_velocity))


def _grid(model: ModalModel) -> LowerGrid:
    """Grid of unit coordinates whose values determine all defects, which are polynomials."""
    ends = zip(model.boxes.lower[0].tolist(), model.boxes.upper[0].tolist(), strict=True)
    exponents = polynomial_dependence.degrees(
        model.flow.system, dict(zip(model.boxes.names, ends, strict=True))
    )
    return LowerGrid(tuple(exponents[name] for name in model.boxes.names), 2 * model.degree)


def _require_affordable(grid: LowerGrid, sample: Sample) -> None:
    """Refuse a grid on which the arrays of `sample` take more than `MOST_NUMBERS` numbers.

    Raises:
        UnprovedError: They do.
    """
    d = len(grid.degrees)
    values = sample(np.zeros((1, d))).values()
    width = sum(x.size * (2 if np.iscomplexobj(x) else 1) for x in values)
    if len(grid) * width > MOST_NUMBERS:
        raise UnprovedError(
            f"the error of the modes takes {len(grid)} points of {d} fuzzy inputs, and"
            f" {MOST_NUMBERS // width} are affordable; fewer outputs at once, narrower or fewer"
            " inputs, or a shorter duration, can be proved"
        )


def _expanded(grid: LowerGrid, sample: Sample) -> dict[str, Array]:
    """Chebyshev coefficients of `sample` at unit coordinates (S, d), each (J, …)."""
    pieces = [sample(chunk) for chunk in np.array_split(grid.points, -(-len(grid) // CHUNK))]
    return {
        name: grid.coefficients(np.concatenate([piece.pop(name) for piece in pieces]))
        for name in list(pieces[0])
    }


def _structure(model: ModalModel, unit: Array) -> dict[str, Array]:
    """Values of M, K and the outputs' rows at unit coordinates (S, d), by name."""
    matrices, rows = _evaluate(model, unit)
    return {"mass": matrices.mass.value, "stiffness": matrices.stiffness.value, "rows": rows.value}


def _evaluate(model: ModalModel, unit: Array) -> tuple[Matrices, Jet]:
    """Matrices and rows at unit coordinates, but for damping by ratios, which is no polynomial."""
    points, flow = model.boxes.to_physical(unit), model.flow
    return evaluate(flow.system, flow.names, points, derivatives=False, by_ratios=False)


def _start(
    system: LinearSystem, matrices: Matrices, part: MotionPart, q: Array, v: Array
) -> dict[str, Array]:
    """Residuals of the initial conditions of a part of the motion, by name, shape (S, N) each.

    Of the free motion they are q − q₀ and v − v₀, or K q − f and M v − p where forces f and
    impulses p give its start. That of a load's part is its response to a unit impulse of the load.

    Args:
        system: The structure.
        matrices: Its matrices at S parameter sets.
        part: The part.
        q: Its displacements at t = 0, shape (S, N).
        v: Its velocities.
    """
    n = matrices.mass.value.shape[-1]
    if part.load is None:
        q, v = q - matrices.q0.value[..., 0], v - matrices.v0.value[..., 0]
        forces = [matrices.static, matrices.impulse]
        if forces == [None, None]:
            return {"start_q": q, "start_v": v}
        static, impulse = (np.zeros(n) if x is None else x.value[..., 0] for x in forces)
    else:
        of_ground = system.ground is not None
        if of_ground and part.number == 0:
            return {"start_q": q, "start_v": v + matrices.rigid[:, 0]}
        assert matrices.forces is not None
        static, impulse = np.zeros(n), matrices.forces.value[..., part.number - of_ground]
    M, K = matrices.mass.value, matrices.stiffness.value
    spring, momentum = ((x[:, None] @ A)[:, 0] for x, A in ((q, K), (v, M)))
    return {"start_spring": spring - static, "start_momentum": momentum - impulse}


def _size_of_start(
    defect: dict[str, Array], stiffness: LoewnerBounds, mass: LoewnerBounds
) -> float:
    """Bound of the initial conditions' defect in the norm √(qᵀ K q + vᵀ M v).

    `defect` has coefficients of residuals of q and v, or of K q and M v, as of `_start`.
    """
    if "start_q" in defect:
        return float(np.hypot(stiffness.sup(defect["start_q"]), mass.sup(defect["start_v"])))
    spring, momentum = defect["start_spring"], defect["start_momentum"]
    return float(np.hypot(stiffness.sup_dual(spring), mass.sup_dual(momentum)))


def _at_once(model: ModalModel, part: MotionPart, unit: Array) -> dict[str, Array]:
    """Defect of the direct feedthrough of a load, "outputs" (S, n, m), at unit coordinates."""
    system, (matrices, _) = model.flow.system, _evaluate(model, unit)
    assert matrices.feeds is not None
    missed = part.share(unit).reshape(len(unit), model.count, -1)
    missed[:, 0] -= matrices.feeds.value[..., part.number - len(histories(system))] / 2
    return {"outputs": missed}


def _defects(
    model: ModalModel,
    part: MotionPart,
    states: list[Polynomial],
    ratio: RatioDamping | None,
    unit: Array,
) -> dict[str, Array]:
    """Defects of one part of the modal model in the equations of motion, by name.

    Args:
        model: The modal model.
        part: Its free part, or that of a load.
        states: Polynomials of the states [φ_k; w_k]: of the free part, then of each load.
        ratio: Damping by one ratio for all modes; None for other damping.
        unit: Unit coordinates, shape (S, d).

    Returns:
        "kinematic" λ φ − w and "dynamic" λ M w + D w + K φ, (S, n, N) each; "outputs", (S, n, m);
        those of the start, and with `ratio` those of the damping.
    """
    if isinstance(part.load, Direct):
        return _at_once(model, part, unit)
    system, (matrices, rows) = model.flow.system, _evaluate(model, unit)
    M, D, K, C = matrices.mass.value, matrices.damping.value, matrices.stiffness.value, rows.value
    rate = model.eigenvalue(unit)[..., None]
    column = 0 if part.load is None else 1 + part.number
    z = states[column](unit).reshape(len(unit), model.count, -1)  # (S, n, 2N)
    shape, speed = np.split(z, 2, axis=-1)  # φ and w
    defects = {
        **_start(system, matrices, part, 2 * shape.real.sum(1), 2 * speed.real.sum(1)),
        "kinematic": rate * shape - speed,
        "dynamic": rate * (speed @ M) + speed @ D.swapaxes(-1, -2) + shape @ K,
        "outputs": part.share(unit).reshape(len(unit), model.count, -1) - z @ C.swapaxes(-1, -2),
    }
    if ratio is not None:
        damping, ratio_defect = ratio.defects(unit, model.boxes.to_physical(unit), speed, M, K)
        defects |= {**ratio_defect, "dynamic": defects["dynamic"] + damping}
        for column, floor in polynomial_dependence.accelerations(system).items():
            defects["outputs"][..., column] += damping[..., floor] / M[:, None, floor, floor]
    return defects
