"""From a structure with fuzzy parameters to the envelopes of its outputs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import fields, replace
from time import perf_counter
from typing import Any, get_args

import numpy as np

from alphacut.base.arrays import Array, Ints, on_one_blas_thread
from alphacut.base.errors import require, require_choice
from alphacut.base.progress_bar import Progress, progress_reporter, subprogress
from alphacut.frame.bounds.box_proof import refusing
from alphacut.frame.boxes import ALPHA, Boxes, UnitFlow, boxes
from alphacut.frame.calculus.unproved import UnprovedError
from alphacut.frame.dynamics.flow import LinearFlow, exact_flow
from alphacut.frame.dynamics.integrators import Exact, Integrator
from alphacut.frame.dynamics.nonlinear import make_flow
from alphacut.frame.envelope import Ends, Envelope
from alphacut.frame.methods.auto import Auto
from alphacut.frame.methods.dual import DualProof
from alphacut.frame.methods.graph_follower import GraphFollower
from alphacut.frame.methods.improved_follower import ImprovedFollower
from alphacut.frame.methods.proof import Proof
from alphacut.frame.methods.sampled import Sampled
from alphacut.frame.structures.linear import evaluate, has_matrices, require_modal_order
from alphacut.frame.structures.model import StructureModel
from alphacut.frame.structures.storey import yields
from alphacut.frame.verification.self_test import with_motions_tested
from alphacut.frame.verification.step_error import step_error, with_node_deviation, with_step_error
from alphacut.fuzzy import FuzzyNumber

FIRST_STEPS = 3
"""Steps of the motions that show whether they exist."""
MAX_INPUTS = 4
"""Most inputs of a follower's envelope that a proof is made beside."""
OTHER_UNITS = 500
"""Factor between a support and the structure's own value from which on units must differ."""


Method = Auto | Proof | DualProof | GraphFollower | ImprovedFollower | Sampled
"""How an envelope is found, with its options as fields."""
METHODS: dict[str, type[Method]] = {x.name: x for x in get_args(Method)}
"""The methods by the words that a case file has for them."""
REMOVED_METHODS = {"search": "take auto, or improved-graph-follower with the integrator exact"}
"""Cures by the words of methods that were removed."""


@on_one_blas_thread
def envelope(
    model: StructureModel,
    inputs: Mapping[str, FuzzyNumber | float],
    method: Method | str | None = None,
    *,
    duration: float,
    step: float,
    alpha: Sequence[float] = ALPHA,
    integrator: str | Integrator | None = None,
    relative: bool = True,
    progress: Progress | bool | None = None,
    **options: Any,
) -> Envelope:
    """Return lower and upper envelopes of a structure's outputs over time, on every level.

    Args:
        model: A linear structure or a general Lagrangian system.
        inputs: Fuzzy parameters by name, in SI units; a plain number is a crisp one.
        method: A method such as `Proof()`, or its name, see `METHODS`; unless given `Auto()` for
            linear structures, and `ImprovedFollower()` for others.
        duration: Length of the simulation, in s.
        step: Distance of the nodes and step of the integrator, in s.
        alpha: Levels, rising within [0, 1].
        integrator: Time stepping of linear structures, an integrator or its name: exact (of auto
            and proofs unless given), midpoint (of all others). Of general Lagrangian systems
            it is midpoint.
        relative: Whether the method's tolerance is a fraction of each output's peak at the nominal
            parameters and some corners, instead of a number in SI units.
        progress: Called with the completed fraction; a bar on a terminal if not given, False for
            none.
        options: Options of a method that is named, or of auto.

    Returns:
        Bounds at the nodes with their nature, error, deviations between nodes, and the inputs that
        reach them; without these where the inputs' cuts are a box around a learned set.

    Raises:
        RefusedError: An unknown name or option, a value outside its range, a support that reaches
            values that are not allowed, or a motion that does not exist.
        FailedError: A step is too long, or a method finds no bounds.

    Example:
        >>> from alphacut.frame import StoreyFrame
        >>> from alphacut.fuzzy import Triangular
        >>> frame = StoreyFrame(masses=[1e3], stiffness=[4e4], q0=[0.1])
        >>> bounds = envelope(frame, {"m1": Triangular(900, 1000, 1100)}, duration=0.5, step=0.1)
        >>> str(bounds.nature)
        'guaranteed'
    """
    start = perf_counter()
    chosen, flow, levels, rows = _build_problem(
        model, inputs, method, duration, step, alpha, integrator, **options
    )
    flow = replace(flow, relative=relative)
    steps = step_error(flow)
    is_cheap = isinstance(flow.flow, LinearFlow) and len(flow.boxes.names) <= MAX_INPUTS
    proof: Proof | None = None  # of the motion that a follower has followed
    if is_cheap and isinstance(chosen, GraphFollower | ImprovedFollower):
        proof = Proof(gap=chosen.tolerance / 4, boxes=1000)
    with progress_reporter(progress) as tick:
        bounds = chosen.run(flow, subprogress(tick, 0.0, 0.5) if proof else tick)
        bounds = with_step_error(bounds, flow, steps)
        if proof:
            bounds = _with_proof(bounds, flow, proof, subprogress(tick, 0.5, 1.0))
        bounds = with_node_deviation(bounds, flow)
        if has_matrices(model) and np.isfinite(bounds.proved.upper).all():
            bounds = with_motions_tested(bounds, model)
        if tick:
            tick(1.0)
    bounds = _on_levels(bounds, levels, rows)
    if bounds.encloses:
        bounds = bounds.without_attained()
    return replace(bounds, seconds=perf_counter() - start)


def _build_problem(
    model: StructureModel,
    inputs: Mapping[str, FuzzyNumber | float],
    method: Method | str | None,
    duration: float,
    step: float,
    alpha: Sequence[float] = ALPHA,
    integrator: str | Integrator | None = None,
    **options: Any,
) -> tuple[Method, UnitFlow, Array, Ints]:
    """Return the method, the motion over distinct cuts, the levels, and the cut of each level."""
    allowed = "a StoreyFrame, a MatrixStructure or a LagrangianSystem"
    is_structure = isinstance(model, StructureModel)
    require(is_structure, "model", value=type(model).__name__, allowed=allowed)
    if method is None:
        method = "auto" if has_matrices(model) else "improved-graph-follower"
    if isinstance(method, str):
        cure = REMOVED_METHODS.get(method, "")
        require(method in METHODS, "method", value=method, allowed=", ".join(METHODS), cure=cure)
        names = [field.name for field in fields(METHODS[method])]
        for option in options:
            require_choice(f"option of {method}", option, names)
        chosen: Method = METHODS[method](**options)
    else:
        allowed = f"{', '.join(METHODS)}, or an object as Proof()"
        require(isinstance(method, Method), "method", value=repr(method), allowed=allowed)
        allowed = "none beside a method that is no name"
        require(not options, "options", value=[*options], allowed=allowed)
        chosen = method
    needs_derivatives = isinstance(chosen, Proof | DualProof | GraphFollower | ImprovedFollower)
    allowed = "auto or quasi-monte-carlo where columns yield"
    is_possible = not (yields(model) and needs_derivatives)
    require(is_possible, "method", value=chosen.name, allowed=allowed)
    if integrator is None:
        is_exact = yields(model) or isinstance(chosen, Auto | Proof | DualProof)
        integrator = "exact" if is_exact and has_matrices(model) else "midpoint"
    cuts = boxes(inputs, alpha)
    flow = make_flow(model, cuts.names, duration, step, integrator)
    require_admissible(model, cuts)
    distinct_cuts, rows = cuts.without_repetitions()
    return chosen, UnitFlow(flow, distinct_cuts), cuts.alpha, rows


def require_envelope(
    model: StructureModel,
    inputs: Mapping[str, FuzzyNumber | float],
    method: Method | str | None = None,
    **arguments: Any,
) -> None:
    """Refuse arguments that `envelope` refuses, from the first steps of a few trajectories.

    Raises:
        RefusedError: As `envelope`.
        UnprovedError: A proof is asked for, and there is none of such a structure.
    """
    chosen, flow, _, _ = _build_problem(model, inputs, method, **arguments)
    duration = min(FIRST_STEPS * flow.flow.step, flow.flow.duration)
    first_steps = replace(flow.flow, duration=duration)
    if isinstance(first_steps, LinearFlow):
        first_steps = replace(first_steps, by_modes=False)  # loads no compiled code
    first_steps.values(flow.boxes.probes)
    if isinstance(chosen, Proof | DualProof):
        with refusing():
            chosen.forecast(exact_flow(flow.flow), flow.boxes)


def _with_proof(followed: Envelope, over: UnitFlow, proof: Proof, tick: Progress) -> Envelope:
    """Return a follower's envelope with proved outer bounds of the exact motion, if there are."""
    assert isinstance(over.flow, LinearFlow)
    exact = replace(over, flow=replace(over.flow, integrator=Exact()))
    try:
        proved = proof.run(exact, tick)
    except UnprovedError:
        return followed
    # the true bounds lie between these: the error is the larger distance
    both = np.array([proved.proved, proved.attained])  # (2, lower or upper, A, T, m)
    error = np.abs(np.stack([followed.lower, followed.upper]) - both).max((0, 1))
    largest = float((error / over.scale).max())
    facts = {**followed.facts, "gap": proved.facts["gap"], "estimated_error": largest}
    return replace(followed, outer=proved.proved, between=proved.between, error=error, facts=facts)


def require_admissible(system: StructureModel, cuts: Boxes) -> None:
    """Refuse supports with values that are not allowed for their parameters.

    Raises:
        RefusedError: A support leaves the range of its parameter or is in another unit than the
            structure's own value; the weight may buckle a storey, or a mass matrix is not positive
            definite; modes of unequal damping ratio may change places; or nothing moves.
    """
    for name, low, high in zip(cuts.names, cuts.lower[0], cuts.upper[0], strict=True):
        parameter, key, shown = system.parameter(name), f"support of {name}", f"[{low:g}, {high:g}]"
        require(parameter.admits(low, high), key, value=shown, allowed=parameter.range or "finite")
        nominal, sizes = abs(system.parameters.get(name, 0.0)), (abs(low), abs(high))
        is_same_unit = min(sizes) < OTHER_UNITS * nominal and OTHER_UNITS * max(sizes) > nominal
        is_right = is_same_unit or nominal == 0 or not any(sizes)
        allowed = f"values of the size of {nominal:g}, the structure's own"
        require(is_right, key, value=shown, allowed=allowed, cure="give both in SI units")
    if not has_matrices(system):
        return
    ends = zip(cuts.lower[0].tolist(), cuts.upper[0].tolist(), strict=True)
    system.require_standing(dict(zip(cuts.names, ends, strict=True)))
    is_moved = system.ground is not None and np.any(system.ground.samples)
    for point in cuts.probes:
        at = ", ".join(f"{name} = {x:g}" for name, x in zip(cuts.names, point, strict=True))
        try:
            matrices = evaluate(system, cuts.names, point[None], derivatives=False)[0]
            is_positive = bool(np.linalg.eigvalsh(matrices.mass.value).min() > 0)
        except np.linalg.LinAlgError:  # from damping by a ratio, which divides by the mass
            is_positive = False
        value = f"not positive definite at {at}"
        require(is_positive, "mass", value=value, allowed="a mass for every unknown")
        has_forces = matrices.forces is not None and matrices.forces.value.any()
        is_moved = is_moved or has_forces or matrices.start.value.any()
    key, allowed = "q0, v0, ground and loads", "a start, a record or a force that moves something"
    require(is_moved, key, value="zero", allowed=allowed)
    if len(system.ratios) > 1:  # modes of unequal damping ratio must keep their order
        values = [system.parameters[x] if isinstance(x, str) else x for x in system.ratios]
        points = np.vstack([cuts.nominal, cuts.probes])
        matrices = evaluate(system, cuts.names, points, derivatives=False)[0]
        require_modal_order(matrices.mass.value, matrices.stiffness.value, np.array(values))


def _on_levels(bounds: Envelope, alpha: Array, which: Ints) -> Envelope:
    """Return the envelope on levels `alpha` (A,), the bounds of each copied from row `which`."""
    names = ("lower", "upper", "lower_at", "upper_at", "error")
    changes: dict[str, Any] = {name: getattr(bounds, name)[which] for name in names}
    if (peaks := bounds.searched_peaks) is not None:
        ends = {name: getattr(peaks, name)[which] for name in names}
        changes["searched_peaks"] = replace(peaks, alpha=alpha, **ends)
    for name in ("inner", "outer", "least_peaks"):
        pair = getattr(bounds, name)
        changes[name] = pair and Ends(*(x[which] for x in pair))
    return replace(bounds, alpha=alpha, **changes)
