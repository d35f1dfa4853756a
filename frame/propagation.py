"""From a structure with fuzzy parameters to the envelopes of its outputs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import fields, replace
from time import perf_counter
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from alphacut.base.arrays import Array, Ints, on_one_blas_thread
from alphacut.base.errors import RefusedError, require, require_choice
from alphacut.base.progress_bar import Progress, progress_reporter, searching, subprogress
from alphacut.frame.boxes import ALPHA, Boxes, UnitFlow, boxes
from alphacut.frame.calculus.unproved import UnprovedError
from alphacut.frame.dynamics.flow import LinearFlow
from alphacut.frame.dynamics.integrators import Exact, Integrator
from alphacut.frame.dynamics.nonlinear import make_flow
from alphacut.frame.methods.method import METHODS, Method
from alphacut.frame.result import Ends, Envelope
from alphacut.frame.structures.linear import (
    LinearSystem,
    Matrices,
    evaluate,
    has_matrices,
    require_modal_order,
)
from alphacut.frame.structures.model import StructureModel
from alphacut.frame.structures.storey import yields
from alphacut.frame.verification.step_error import step_error, with_node_deviation, with_step_error
from alphacut.fuzzy import FuzzyNumber

if TYPE_CHECKING:
    from alphacut.frame.methods.proof import Proof


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
    """Return lower and upper envelopes of the outputs of a structure over time, on every level.

    Args:
        model: A linear structure or a general Lagrangian system.
        inputs: Fuzzy parameters by name, in SI units; a plain number is a crisp one.
        method: A method such as `Proof()`, or its name, see `METHODS`; by default `Auto()` for
            linear structures and `ImprovedFollower()` for others.
        duration: Length of the simulation, in s.
        step: Distance of the time nodes and step of the integrator, in s.
        alpha: Levels, rising within [0, 1].
        integrator: Time stepping of linear structures, an integrator or its name: "exact" (the
            default of `Auto` and of proofs) or "midpoint" (the default of all others). General
            Lagrangian systems always use the midpoint rule.
        relative: Whether the tolerance of the method is a fraction of the peak of each output at
            the nominal parameters and some corners, instead of a number in SI units.
        progress: Called with the completed fraction; by default a bar on a terminal; False for
            none.
        options: Options of a method that is given by its name, or of `Auto`.

    Returns:
        Envelope: `lower` and `upper` at the nodes `time` in SI, shape (levels, times, outputs),
        their `nature` (guaranteed, estimated or attained) and `error`, the deviations `between` the
        nodes, and the inputs `lower_at` and `upper_at` that attain them. Attained values and inputs
        are missing if the cuts of the inputs are a box around a learned set.

    Raises:
        RefusedError: A name or an option is unknown, a value is out of range, a support contains
            inadmissible values, or a response does not exist.
        FailedError: A step is too long, or a method finds no bounds.

    Example:
        >>> from alphacut.frame import StoreyFrame
        >>> from alphacut.fuzzy import Triangular
        >>> frame = StoreyFrame(masses=[1e3], stiffness=[4e4], q0=[0.1])
        >>> bounds = envelope(frame, {"m1": Triangular(900, 1000, 1100)}, duration=0.5, step=0.1)
        >>> str(bounds.nature)
        'guaranteed'
    """
    from alphacut.frame.methods.graph_follower import GraphFollower, with_ascents
    from alphacut.frame.methods.improved_follower import ImprovedFollower
    from alphacut.frame.methods.proof import Proof
    from alphacut.frame.methods.sampled import Sampled

    start = perf_counter()
    problem = _build_problem(model, inputs, method, duration, step, alpha, integrator, **options)
    chosen = problem.method
    flow = replace(problem.flow, relative=relative)
    steps = step_error(flow)
    # A follower's envelope is compared with a proof if that is cheap: for linear structures with up
    # to four inputs (tuned).
    proof: Proof | None = None
    is_cheap = isinstance(flow.flow, LinearFlow) and len(flow.boxes.names) <= 4
    if is_cheap and isinstance(chosen, GraphFollower | ImprovedFollower):
        proof = Proof(gap=chosen.tolerance / 4, boxes=1000)
    proved: Envelope | None = None
    with progress_reporter(progress) as tick:
        # Of samples the number is known, of all other methods what they will need is not.
        method_progress = tick if isinstance(chosen, Sampled) else searching(tick)
        if proof:
            proved = _proved(flow, proof, searching(subprogress(tick, 0.0, 0.5)))
            method_progress = searching(subprogress(tick, 0.5, 1.0))
        bounds = chosen.run(flow, method_progress)
        if proved is None and isinstance(chosen, GraphFollower):
            bounds = with_ascents(bounds, flow)
        bounds = with_step_error(bounds, flow, steps)
        if proved:
            bounds = _with_proof(bounds, flow, proved)
        # Between the nodes proofs state a bound; for other methods some trajectories give an
        # estimate.
        bounds = with_node_deviation(bounds, flow)
        # Guaranteed bounds are tested by exact responses that another algorithm computes. Those of
        # columns that yield have been tested by the proof.
        is_bounded = np.isfinite(bounds.proved.upper).all()
        if has_matrices(model) and not yields(model) and is_bounded:
            from alphacut.frame.verification.self_test import with_motions_tested  # needs SciPy

            bounds = with_motions_tested(bounds, model)
        if tick:
            tick(1.0)
    bounds = _on_levels(bounds, problem.alpha, problem.rows)
    if bounds.encloses:
        bounds = bounds.without_attained()
    return replace(bounds, seconds=perf_counter() - start)


class Problem(NamedTuple):
    """An envelope to be computed.

    Args:
        method: The method.
        flow: The response over the cuts that differ from each other.
        alpha: All levels, shape (levels,).
        rows: Row of the cut of each level in `flow`, shape (levels,).
    """

    method: Method
    flow: UnitFlow
    alpha: Array
    rows: Ints


def _build_problem(
    model: StructureModel,
    inputs: Mapping[str, FuzzyNumber | float],
    method: Method | str | None,
    duration: float,
    step: float,
    alpha: Sequence[float] = ALPHA,
    integrator: str | Integrator | None = None,
    **options: Any,
) -> Problem:
    """Check the arguments of `envelope`, fill in defaults and return the problem that they state.

    Args:
        model: The structure.
        inputs: Fuzzy parameters by name, in SI units; a plain number is a crisp one.
        method: Method or its name. None takes `Auto()` for structures with matrices of mass,
            damping and stiffness, and `ImprovedFollower()` for other Lagrangian systems.
        duration: Length of the simulation, in s.
        step: Distance of the time nodes, in s.
        alpha: Levels, rising within [0, 1].
        integrator: Time integrator or its name. None takes "exact" if columns yield or the method
            is `Auto` or a proof, and the structure has matrices; "midpoint" otherwise.
        options: Fields of the method; only beside a name, or beside None.

    Returns:
        The method, the response over those cuts that differ from the cut of the next lower level,
        all levels, and the row of the cut of each level.

    Raises:
        RefusedError: The model is no structure; a method, an option, a parameter or an integrator
            is unknown; the method needs derivatives, and columns yield; the duration is not a
            whole number of steps; levels do not rise; or a support contains inadmissible values,
            see `require_admissible`.
    """
    allowed = "a StoreyFrame, a MatrixStructure or a LagrangianSystem"
    is_structure = isinstance(model, StructureModel)
    require(is_structure, "model", value=type(model).__name__, allowed=allowed)
    if method is None:
        method = "auto" if has_matrices(model) else "improved-graph-follower"
    chosen = _chosen_method(method, options)
    require_kinks(model, chosen)
    if integrator is None:
        # Proofs hold for the exact response.
        is_exact = yields(model) or chosen.is_exact
        integrator = "exact" if is_exact and has_matrices(model) else "midpoint"
    cuts = boxes(inputs, alpha)
    flow = make_flow(model, cuts.names, duration, step, integrator)
    require_admissible(model, cuts)
    # The cuts of intervals are equal on all levels and need not be computed twice.
    distinct_cuts, rows = cuts.without_repetitions()
    return Problem(chosen, UnitFlow(flow, distinct_cuts), cuts.alpha, rows)


def require_kinks(model: StructureModel, method: Method | type[Method]) -> None:
    """Refuse a method that needs derivatives of the response where columns of a model yield.

    Raises:
        RefusedError: The response has kinks as a function of the parameters.
    """
    if yields(model) and not method.takes_kinks:
        names = [name for name, known in METHODS.items() if known.takes_kinks]
        allowed = f"{', '.join(names)} where columns yield"
        raise RefusedError("method", method.name, allowed)


def _chosen_method(method: Method | str, options: Mapping[str, Any]) -> Method:
    """Return the method with a name and with options as its fields, or a given object itself.

    Args:
        method: Name of a method as in a case file, such as "proof", or a method object.
        options: Values of the method's fields by their names; must be empty beside an object.

    Raises:
        RefusedError: The name or an option is unknown, the value of an option is not allowed, the
            object is no method, or options are given beside an object.
    """
    if not isinstance(method, str):
        if not isinstance(method, Method):
            allowed = f"{', '.join(METHODS)}, or an object as Proof()"
            raise RefusedError("method", repr(method), allowed)
        allowed = "none beside a method that is no name"
        require(not options, "options", value=[*options], allowed=allowed)
        return method
    cure = ""
    if method == "search":  # removed
        cure = "take auto, or improved-graph-follower with the integrator exact"
    require(method in METHODS, "method", value=method, allowed=", ".join(METHODS), cure=cure)
    for option in options:
        known = [field.name for field in fields(METHODS[method])]
        require_choice(f"option of {method}", option, known)
    return METHODS[method](**options)


def require_envelope(
    model: StructureModel,
    inputs: Mapping[str, FuzzyNumber | float],
    method: Method | str | None = None,
    **arguments: Any,
) -> None:
    """Raise the errors of wrong arguments of `envelope` without computing an envelope.

    The responses at the nominal inputs and at some corners of the box of the inputs are computed
    for three time steps. For a proof it is also checked whether it is possible at all. Errors that
    appear later in a response, or elsewhere in the box, are not found.

    Args:
        model: The structure.
        inputs: Fuzzy parameters by name, in SI units; a plain number is a crisp one.
        method: Method or its name; the default of `envelope` if it is None.
        arguments: `duration` and `step`, both required, in s; `alpha`, `integrator`, and the
            options of a method that is given by its name.

    Raises:
        RefusedError: A name or an option is unknown, a value is out of range, a support contains
            inadmissible values, or a response does not exist.
        UnprovedError: A proof is asked for, and there is none for such a structure.
        FailedError: A time step did not converge.
    """
    problem = _build_problem(model, inputs, method, **arguments)
    flow = problem.flow.flow
    # Three steps show whether the response exists, at little cost.
    first_steps = replace(flow, duration=min(3 * flow.step, flow.duration))
    if isinstance(first_steps, LinearFlow):
        first_steps = replace(first_steps, by_modes=False)  # loads no compiled code
    first_steps.values(problem.flow.boxes.probes)
    problem.method.require_possible(flow, problem.flow.boxes)


def _proved(over: UnitFlow, proof: Proof, tick: Progress) -> Envelope | None:
    """Return guaranteed bounds of the exact response of a linear structure, or None.

    Args:
        over: The response over the boxes of the inputs.
        proof: The method of the proof. If it fails with an `UnprovedError`, None is returned.
        tick: Called with the completed fraction.

    Raises:
        FailedError: The proof contradicts attained values.
    """
    assert isinstance(over.flow, LinearFlow)
    exact = replace(over, flow=replace(over.flow, integrator=Exact()))
    try:
        return proof.run(exact, tick)
    except UnprovedError:
        return None


def _with_proof(followed: Envelope, over: UnitFlow, proved: Envelope) -> Envelope:
    """Add guaranteed bounds of the exact response to an envelope from trajectories.

    Args:
        followed: The envelope, whose bounds are estimated or attained.
        over: The response over the boxes of the inputs, for which it was computed.
        proved: Guaranteed bounds for the same boxes, with attained values.

    Returns:
        A copy with the guaranteed bounds as `outer`, their addition between the time nodes as
        `between`, and as `error` the larger distance of each end from the guaranteed bound and from
        the attained value of the proof. The facts "gap" and "estimated_error" are those of the
        proof and of this error.
    """
    # The true bounds lie between the guaranteed bounds (`proved.proved`) and the attained values
    # (`proved.attained`). The error is the larger one of the distances from both.
    ends = np.stack([followed.lower, followed.upper])  # (lower or upper, levels, times, outputs)
    distances = [np.abs(ends - np.stack(known)) for known in (proved.proved, proved.attained)]
    # The larger one over both known bounds and over both ends: (levels, times, outputs).
    error = np.max(distances, axis=(0, 1))
    largest = float((error / over.scale).max())
    facts = {**followed.facts, "gap": proved.facts["gap"], "estimated_error": largest}
    return replace(followed, outer=proved.proved, between=proved.between, error=error, facts=facts)


def require_admissible(system: StructureModel, cuts: Boxes) -> None:
    """Check that a structure has a response for all values of its parameters in a box.

    Ranges and buckling are checked over the whole box. Mass matrices and the order of the modes are
    checked at the nominal inputs and at up to 16 corners only. Of a structure without matrices of
    mass, damping and stiffness the ranges alone are checked.

    Args:
        system: The structure.
        cuts: Boxes of the parameters; the widest one is checked.

    Raises:
        RefusedError: A support leaves the range of its parameter, or seems to be in another unit
            than the own value of the structure; the weight may buckle a storey; a mass matrix is
            not positive definite; modes of unequal damping ratio may change places; or no initial
            state, record or force moves the structure.
    """
    for name, low, high in zip(cuts.names, cuts.lower[0], cuts.upper[0], strict=True):
        _require_range(system, name, low, high)
    if not has_matrices(system):
        return
    ends = zip(cuts.lower[0].tolist(), cuts.upper[0].tolist(), strict=True)
    # Second-order effects of the weight reduce the stiffness of a storey.
    system.require_standing(dict(zip(cuts.names, ends, strict=True)))
    try:
        matrices = _checked_matrices(system, cuts.names, cuts.probes)
    except RefusedError:
        for point in cuts.probes:  # the first one that is refused is told
            _checked_matrices(system, cuts.names, point[np.newaxis])
        raise
    # A structure that nothing moves has no peaks to bound.
    is_moved = system.ground is not None and np.any(system.ground.samples)
    has_forces = matrices.forces is not None and matrices.forces.value.any()
    is_moved = is_moved or has_forces or matrices.start.value.any()
    value = "at rest for ever: its start, record and forces are all zero"
    allowed = "a start, a record or a force that moves something"
    require(is_moved, "structure", value, allowed)
    if len(system.ratios) > 1:
        # Damping ratios are given by the order of the modes, which must be the same everywhere.
        ratios = [system.parameters[x] if isinstance(x, str) else x for x in system.ratios]
        points = np.vstack([cuts.nominal, cuts.probes])
        matrices = evaluate(system, cuts.names, points, derivatives=False)[0]
        require_modal_order(matrices.mass.value, matrices.stiffness.value, np.array(ratios))


def _checked_matrices(system: LinearSystem, names: Sequence[str], points: Array) -> Matrices:
    """Return the matrices of a structure, and refuse mass matrices that are not positive definite.

    Args:
        system: The structure.
        names: Names of its d parameters that are not nominal.
        points: Their values at S parameter sets in SI units, shape (S, d).

    Raises:
        RefusedError: A mass matrix is not positive definite; the message has the first parameter
            set, also where another one is at fault. Or damping is given by ratios, and a stiffness
            is not positive definite.
    """
    try:
        matrices = evaluate(system, names, points, derivatives=False)[0]
        is_positive = bool(np.linalg.eigvalsh(matrices.mass.value).min() > 0)
    except np.linalg.LinAlgError:  # from damping by a ratio, which divides by the mass
        is_positive = False
    at = ", ".join(f"{name} = {x:g}" for name, x in zip(names, points[0], strict=True))
    value = f"not positive definite at {at}"
    require(is_positive, "mass", value=value, allowed="a mass for every unknown")
    return matrices


def _require_range(system: StructureModel, name: str, low: float, high: float) -> None:
    """Check that the support of a parameter is within its range and not in a wrong unit.

    Args:
        system: Structure that has the parameter.
        name: Name of the parameter.
        low: Lower end of the support, in SI units.
        high: Upper end.

    Raises:
        RefusedError: The support leaves the range, such as positive or finite values, or all of
            its values differ from the value that the structure itself has by a factor of 500 or
            more. If either is zero, no unit can be told from them, and the latter is not checked.
    """
    key = f"support of {name}"
    shown = f"[{low:g}, {high:g}]"
    parameter = system.parameter(name)
    require(parameter.admits(low, high), key, value=shown, allowed=parameter.range or "finite")
    # A support whose values all are 500 times larger or smaller than the own value of the
    # structure is taken to be in another unit: units differ by factors of 1000.
    nominal = abs(system.parameters.get(name, 0.0))
    smallest, largest = sorted((abs(low), abs(high)))
    is_same_unit = smallest < 500 * nominal and nominal < 500 * largest
    is_admissible = is_same_unit or nominal == 0 or largest == 0
    allowed = f"values of the size of {nominal:g}, the structure's own"
    require(is_admissible, key, value=shown, allowed=allowed, cure="give both in SI units")


def _on_levels(bounds: Envelope, alpha: Array, rows: Ints) -> Envelope:
    """Return an envelope on more levels, with the bounds of each level copied from a row.

    Cuts that are equal on several levels are computed once; here each level gets its bounds back.
    What does not depend on the level, such as the addition between time nodes, stays as it is.

    Args:
        bounds: The envelope.
        alpha: The levels, rising, shape (levels,).
        rows: Row of the bounds in `bounds` for each level, shape (levels,).
    """
    names = ("lower", "upper", "lower_at", "upper_at", "error")
    changes: dict[str, Any] = {name: getattr(bounds, name)[rows] for name in names}
    peaks = bounds.searched_peaks
    if peaks is not None:
        of_peaks: dict[str, Any] = {name: getattr(peaks, name)[rows] for name in names}
        if peaks.inner is not None:
            of_peaks["inner"] = Ends(peaks.inner.lower[rows], peaks.inner.upper[rows])
        changes["searched_peaks"] = replace(peaks, alpha=alpha, **of_peaks)
    for name in ("inner", "outer", "least_peaks"):
        ends = getattr(bounds, name)
        if ends is not None:
            changes[name] = Ends(ends.lower[rows], ends.upper[rows])
    return replace(bounds, alpha=alpha, **changes)
