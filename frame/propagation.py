"""From a structure with fuzzy parameters to the envelopes of its outputs."""

from __future__ import annotations

import re
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from alphacut.frame.boxes import ALPHA, Kept, UnitFlow, boxes
from alphacut.frame.calculus.jet import Array
from alphacut.frame.checks.admissible import require_admissible
from alphacut.frame.checks.between_nodes import ground_stray, with_stray
from alphacut.frame.checks.step_error import (
    require_stable,
    step_error,
    step_error_at_bounds,
    warn_of_steps,
    with_step_error,
)
from alphacut.frame.checks.tolerance import LIMIT
from alphacut.frame.dynamics.flow import LinearFlow
from alphacut.frame.dynamics.integrators import INTEGRATORS, Integrator
from alphacut.frame.dynamics.nonlinear import LagrangianFlow
from alphacut.frame.envelope import Envelope
from alphacut.frame.methods.auto import Auto
from alphacut.frame.methods.foreseen import foreseen
from alphacut.frame.methods.judged import judged
from alphacut.frame.methods.named import Method, named, options_of
from alphacut.frame.methods.plan import Candidate
from alphacut.frame.structures.lagrangian import LagrangianSystem
from alphacut.frame.structures.linear import LinearSystem, relative_to_ground
from alphacut.frame.structures.storey import StoreyFrame
from alphacut.fuzzy import FuzzyNumber
from alphacut.fuzzy.arguments import fuzzy_inputs
from alphacut.fuzzy.knowledge.joint import JointClaim
from alphacut.fuzzy.progress_bar import Progress, told


def envelope(
    model: LinearSystem | LagrangianSystem,
    inputs: Mapping[str, FuzzyNumber | float],
    *,
    duration: float,
    step: float,
    alpha: Sequence[float] = ALPHA,
    method: str | None = None,
    integrator: str | Integrator | None = None,
    relative: bool = False,
    progress: Progress | bool | None = None,
    kept: Kept | None = None,
    **options: object,
) -> Envelope:
    """Lower and upper envelopes of the outputs of `model`.

    Args:
        model: A linear structure or a general Lagrangian system.
        inputs: Fuzzy parameters by name, in SI units; a plain number is a crisp one.
        duration: Length of the simulation, in s.
        step: Distance of the nodes and step of the integrator, in s.
        alpha: Levels, rising within [0, 1].
        method: Name of a method, see `METHODS`; unless given, auto for linear structures with an
            error of 1e-4 m, or of a thousandth of each peak where no output is a displacement, and
            improved-graph-follower for others.
        integrator: Time stepping. Of linear structures an integrator or its name: exact (of auto
            and modal unless given), midpoint (of all others), rk4. Of general Lagrangian
            systems midpoint (unless given), composition4 or rk4.
        relative: Whether the method's tolerance is a share of each output's peak at the modal
            parameters, instead of a length in SI units.
        progress: Called with the share done; a bar on a terminal or in a notebook if not given,
            False for none.
        kept: Keeps what a search of modal intervening variables has found so far, from which the
            same call goes on; None for nothing.
        options: Options of the method, see below.

    Options, in SI units; a tolerance is in m, or in the unit of the first output where none is a
    displacement, others in proportion:

    - auto: `tolerance` (wanted error, 1e-4), `exclude` (of modal and improved-graph-follower),
      `budget` (most trajectories, 20000), `seconds` (largest estimate of a method that is started,
      3600), `seed`, `workers` (of the proof; all cores).
    - modal: `tolerance` (of the polynomials of the modes, 1e-6), `budget` (most eigen-analyses,
      280), `seed`; `certify` (wanted gap between attained and proved bounds; none), then `boxes`
      (most boxes for each bound, 4000) and `workers` (processes, 1); `passes` (most independent
      passes of the search, 8; 1 takes the least effort, for two digits).
    - improved-graph-follower: `tolerance` (promised gain worth a trajectory, 7e-5), `budget` (most
      trajectories, 5000), `spread` (first points on each level, 64), `batch` (computed together,
      32), `reach` (trust region, share of the box, 0.6), `order` (2), `contests`.
    - graph-follower: `order` (of the Taylor models, 1 or 2), `tolerance` (1e-4), `budget` (none),
      `record` (False); see `GraphFollower`.
    - vertex: none. monte-carlo, quasi-monte-carlo: `samples` on each level (1000, 1024), `seed`.
    - Where no method is named: those of auto, or those of modal with one of its own.

    Raises:
        ValueError: An unknown name or option, a value outside its range, a support that reaches
            values without a meaning, an unstable step, or a motion that does not exist.
        StepError: A step did not converge, or leaves the motion.
        ToleranceError: No method reaches the wanted error.
        ModalError: The method is modal, and the structure has no smooth oscillating modes over the
            box.

    Warns:
        UserWarning: The error of time stepping passes a hundredth of a peak; or the method is
            modal, and its error passes that and the tolerance.
    """
    own = ", ".join(sorted(set(options) - set(options_of("auto")))) if method is None else ""
    method, way, asked, scheme = _prepared(
        model, inputs, duration, step, alpha, method, integrator, relative, options
    )
    cuts, which = asked.boxes.distinct()
    over = replace(asked, boxes=cuts, kept=kept)
    steps = step_error(over)
    with told(progress) as tell:
        found = way.run(over, tell)
    steps = step_error_at_bounds(found, over, steps)
    if isinstance(way, Auto):
        way.left(over, steps)
    found = with_step_error(found, over, scheme, steps)
    if method.endswith("graph-follower"):
        found = judged(found, over, steps)
    found = with_stray(found, over)
    claim = str(JointClaim.of(fuzzy_inputs(inputs)).resting_on(found.nature))
    found = replace(found, facts={**found.facts, "claim": claim}) if claim else found
    if own and method == "modal" and "proof" not in found.facts:
        why = f"{own} chose the method modal, which proves nothing without certify; auto does"
        found = replace(found, facts={**found.facts, "unproved": why})
    found = shifted(found, model) if isinstance(model, StoreyFrame) else found
    warn_of_steps(found, over, steps.max(0))
    if method == "modal":
        warn_of_roughness(found)
    return found.on_levels(asked.boxes.alpha, which)


def plan(
    model: LinearSystem | LagrangianSystem,
    inputs: Mapping[str, FuzzyNumber | float],
    *,
    duration: float,
    step: float,
    alpha: Sequence[float] = ALPHA,
    method: str | None = None,
    integrator: str | Integrator | None = None,
    relative: bool = False,
    **options: object,
) -> tuple[Candidate, ...]:
    """What `envelope` would do with the same arguments, with the seconds expected.

    Of auto the methods that it may take, in their order; else the one method.

    Raises:
        ValueError: As `envelope`.
    """
    method, way, over, _ = _prepared(
        model, inputs, duration, step, alpha, method, integrator, relative, options
    )
    return foreseen(method, way, replace(over, boxes=over.boxes.distinct()[0]))


def _prepared(
    model: LinearSystem | LagrangianSystem,
    inputs: Mapping[str, FuzzyNumber | float],
    duration: float,
    step: float,
    alpha: Sequence[float],
    method: str | None,
    integrator: str | Integrator | None,
    relative: bool,
    options: Mapping[str, object],
) -> tuple[str, Method, UnitFlow, str]:
    """The method's name, the method, the trajectories, and the name of the time stepping.

    Accelerations relative to the ground are found as absolute ones, under their own names.
    """
    if not isinstance(model, LagrangianSystem) and not hasattr(model, "matrices"):
        raise ValueError(f"model: {_no_structure(model)}")
    if method is None:
        method = _default(isinstance(model, LagrangianSystem), options)
    way = named(method, options)
    cuts = boxes(inputs, alpha)
    flow: LagrangianFlow | LinearFlow
    called = model.outputs
    model = absolute(model) if isinstance(model, StoreyFrame) else model
    if isinstance(model, LagrangianSystem):
        scheme = str(integrator or "midpoint")
        flow = LagrangianFlow(model, cuts.names, duration, step, scheme)
    else:
        flow = LinearFlow(model, cuts.names, duration, step, _integrator(integrator, method))
        scheme = flow.integrator.name
    require_admissible(model, cuts, duration, step)
    require_stable(flow, cuts)
    return method, way, UnitFlow(flow, cuts, relative, called=called), scheme


def absolute(model: StoreyFrame) -> StoreyFrame:
    """The frame with absolute accelerations in place of those relative to the ground."""
    names = tuple(re.sub(r"^ar(?=\d)", "a", name) for name in model.outputs)
    return replace(model, outputs=names)


def shifted(found: Envelope, model: LinearSystem) -> Envelope:
    """An envelope whose accelerations are relative to the ground where those of `model` are.

    The ground's acceleration is known, so that all bounds move alike and stay as proved.

    Args:
        found: The envelope with absolute accelerations.
        model: The structure with its outputs.
    """
    if model.ground is None or not (moved := relative_to_ground(model)):
        return found
    taken, own = model.ground.at(found.time), ground_stray(model.ground, found.time)
    names = ("lower", "upper", "inner_lower", "inner_upper", "proved_lower", "proved_upper")
    changed: dict[str, Array] = {}
    for name in names:
        if (band := getattr(found, name)) is not None:
            changed[name] = band.copy()
            changed[name][:, :, moved] -= taken[None, :, None]
    if found.between is not None:
        changed["between"] = found.between.copy()
        changed["between"][:, moved] += own[:, None]
    return replace(found, **changed)  # type: ignore[arg-type]


def _no_structure(model: object) -> str:
    """Why a model has no trajectories, and what to take in its place."""
    kind = type(model).__name__
    ends = "(box), with the lower and upper end of each uncertain parameter by name"
    if hasattr(model, "reduced"):
        return f"{kind} is reduced to few shapes first: take model.reduced{ends}"
    if hasattr(model, "structure"):
        return f"{kind} describes a structure: take model.structure().reduced{ends}"
    return f"{model!r} is no structure; take a StoreyFrame, a MatrixStructure or a LagrangianSystem"


def _default(nonlinear: bool, options: Mapping[str, object]) -> str:
    """Name of the method where none is named: `modal` where an option is its own."""
    if nonlinear:
        return "improved-graph-follower"
    own = set(options) - set(options_of("auto"))
    return "modal" if own and own <= set(options_of("modal")) else "auto"


def _integrator(given: str | Integrator | None, method: str) -> Integrator:
    """The time stepping of a linear structure."""
    if given is None:
        given = "exact" if method in EXACT_BY_DEFAULT else "midpoint"
    if isinstance(given, str) and given not in INTEGRATORS:
        raise ValueError(f"integrator: '{given}' is unknown; allowed are {', '.join(INTEGRATORS)}")
    if not isinstance(given, str) and not hasattr(given, "step_map"):
        raise ValueError(
            f"integrator: {given!r} is none; take an integrator such as Exact(), or a name:"
            f" {', '.join(INTEGRATORS)}"
        )
    return INTEGRATORS[given] if isinstance(given, str) else given


def warn_of_roughness(found: Envelope) -> None:
    """Warn of an estimated envelope whose error passes tolerance and 1 % of the bound."""
    if "reason" not in found.facts or found.error is None:
        return
    peak = np.maximum(np.abs(found.lower), np.abs(found.upper)).max((0, 1))
    if (found.error.max((0, 1)) > LIMIT * peak).any():
        warnings.warn(f"envelope: {found.facts['reason']}", stacklevel=3)


EXACT_BY_DEFAULT = ("auto", "modal")
