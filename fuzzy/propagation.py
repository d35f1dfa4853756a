"""Propagation of fuzzy inputs through a function, and what each input adds to a width."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from contextlib import nullcontext
from dataclasses import replace
from inspect import signature
from pathlib import Path
from time import perf_counter
from typing import NamedTuple, TypedDict

import numpy as np

from alphacut.base.arrays import Array
from alphacut.base.errors import require, require_choice
from alphacut.base.progress_bar import Progress, progress_reporter
from alphacut.fuzzy.campaign.call import Call, Function
from alphacut.fuzzy.campaign.campaign import Campaign
from alphacut.fuzzy.campaign.store import Identity, Store, model_key
from alphacut.fuzzy.campaign.workers import pool
from alphacut.fuzzy.knowledge.joint import joined_inputs
from alphacut.fuzzy.knowledge.known import Knowledge
from alphacut.fuzzy.plans.automatic import Automatic
from alphacut.fuzzy.plans.design import Plan
from alphacut.fuzzy.result import Bounds, Ends
from alphacut.fuzzy.sets.boxes import Domain, fuzzy_inputs, levels
from alphacut.fuzzy.sets.numbers import Crisp, FuzzyNumber


class CampaignOptions(TypedDict, total=False):
    """Arguments of `propagate` on how samples are evaluated, for functions that pass them on."""

    workers: int
    executor: Executor | None
    store: Store | str | Path | None
    identity: Identity | None
    progress: Progress | bool | None


def propagate(
    function: Function,
    inputs: Mapping[str, FuzzyNumber | float],
    method: Plan | None = None,
    *,
    alpha: Sequence[float] | None = None,
    knowledge: Knowledge | None = None,
    budget: int = 10_000,
    shared: Sequence[str] = (),
    vectorised: bool = False,
    workers: int = 1,
    executor: Executor | None = None,
    store: Store | str | Path | None = None,
    identity: Identity | None = None,
    progress: Progress | bool | None = None,
) -> Bounds:
    """Return the range of each output of a function of fuzzy inputs, on every α-level.

    Args:
        function: Takes the inputs by name; returns a number, an array, or a mapping of names to
            either.
        inputs: Fuzzy number of each input; a plain number is crisp. They vary independently.
            Numbers that claim a coverage are joined (`jointly`).
        method: Search of the boxes, such as ``General()``; `Automatic` if not given.
        alpha: Rising levels; 0, ¼, ½, ¾, 1 if not given.
        knowledge: Facts on which guaranteed bounds rest, such as the signs of the inputs' effects.
        budget: Evaluations that the call may take, stored ones among them. Methods that know their
            samples beforehand refuse to begin; a search ends, and says so.
        shared: Inputs whose equality lets samples share one call. The function then takes a list of
            mappings of names to numbers that agree in them, and returns a list of outputs.
        vectorised: Whether the function takes arrays, shape (n,), and returns arrays whose first
            axis is n.
        workers: Processes of this machine; the result is the same for any number. The function must
            stand in a file, and the call under ``if __name__ == "__main__":``.
        executor: Any `concurrent.futures` executor, instead of `workers`.
        store: Path of a file that keeps every sample: a call that was stopped goes on from there.
        identity: What a sample depends on besides its inputs (case, options, versions), as JSON. A
            store needs it, as it cannot see that the function changed.
        progress: Called with the completed fraction; a bar on a terminal if not given, False for
            none.

    Returns:
        Bounds: `lower` and `upper` of every output on every level of `alpha`, shape (levels, …),
        the inputs `lower_at` and `upper_at` where they are reached, their `nature` (attained,
        estimated or guaranteed), `evaluations`, and `plot`, `number` and `to_dataset`.

    Raises:
        RefusedError: An argument is wrong, or the budget does not carry the method.
        CampaignError: Samples failed; the others were run first, and are in the store.
        FailedError: The store cannot be written, or a worker died.

    Example:
        >>> from alphacut.fuzzy import Interval, Triangular
        >>> inputs = {"x": Triangular(1, 2, 4), "y": Interval(3, 5)}
        >>> propagate(lambda x, y: x * y, inputs, alpha=[0, 1], progress=False).bounds()
        Ends(lower=array([3., 6.]), upper=array([20., 10.]))
    """
    start = perf_counter()
    if alpha is None:
        alpha = levels(4)
    # Numbers that each hold with P ≥ 1 − α hold together less often: their cuts are widened.
    domain = Domain(joined_inputs(inputs), alpha)
    method = method or Automatic()
    _require_method(method)
    is_allowed = executor is None or (isinstance(executor, Executor) and workers == 1)
    allowed = "one of concurrent.futures (of dask client.get_executor()), without workers"
    require(is_allowed, "executor", value=executor, allowed=allowed)
    # Samples of another model in the same store have another key. Without a store nothing can be
    # mixed up, so that an identity need not be given.
    is_knowledge = knowledge is None or isinstance(knowledge, Knowledge)
    allowed = "facts, as Knowledge(signs={'load': 1})"
    require(is_knowledge, "knowledge", value=knowledge, allowed=allowed)
    model = b""
    if store is not None:
        model = model_key(identity or {})
    # A store or an executor that the caller made is not closed here: another call may follow that
    # takes its samples or its processes.
    with (
        progress_reporter(progress) as report,
        nullcontext(executor) if executor else pool(workers) as sample_executor,
        nullcontext(store) if isinstance(store, Store | None) else Store(store) as sample_store,
    ):
        campaign = Campaign(
            Call(function, domain.names, tuple(shared), vectorised),
            knowledge=knowledge or Knowledge(),
            budget=budget,
            executor=sample_executor,
            progress=report,
            store=sample_store,
            model=model,
        )
        bounds = method.run(campaign, domain)
        campaign.report(1.0)
    if bounds.encloses:
        # A point of the box that attains a bound need not belong to the set that the box encloses.
        bounds = bounds.without_attained()
    return replace(
        bounds,
        evaluations=len(campaign),
        samples=campaign.samples,
        budget=budget,
        seconds=perf_counter() - start,
    )


def _require_method(method: Plan) -> None:
    """Raise RefusedError unless an object is a plan, with a `run` of two arguments.

    A plan is an object such as ``General()`` whose `run` takes a campaign, which evaluates the
    model, and the domain of the inputs, and returns bounds.
    """
    # The usual mistakes are a class in place of an object, and a plan of random inputs, whose `run`
    # has other arguments.
    is_plan = hasattr(method, "run") and not isinstance(method, type)
    is_plan = is_plan and len(signature(method.run).parameters) == 2  # campaign and domain
    allowed = "an object such as General() or Signed()"
    cure = "demos/random_inputs.py shows random inputs beside fuzzy ones"
    require(is_plan, "method", value=repr(method), allowed=allowed, cure=cure)


class WidthFractions(NamedTuple):
    """Contribution of each input, or group of inputs, to the width of a result (Figs. 34, 35).

    Args:
        names: Names of the inputs, or of the groups.
        fraction: Fraction of the width, shape (names, …, outputs): the reduction of the width when
            the input is fixed at its nominal value, over the width with all inputs fuzzy; 0 where
            the width is 0. The fractions need not add up to 1: effects overlap.
    """

    names: tuple[str, ...]
    fraction: Array


def width_fractions(
    propagation: Callable[[Mapping[str, FuzzyNumber]], Bounds | tuple[Array, Array]],
    inputs: Mapping[str, FuzzyNumber | float],
    *,
    groups: Mapping[str, Sequence[str]] | None = None,
) -> WidthFractions:
    """Return how much of the width of a fuzzy result each input causes, by fixing one at a time.

    The width is computed with all inputs fuzzy, and then once for each group with the inputs of the
    group fixed at their nominal values, of membership 1. The fraction of a group is the reduction
    of the width, divided by the width with all inputs fuzzy.

    Args:
        propagation: From fuzzy inputs to bounds, as `lambda inputs: propagate(function, inputs)`,
            or to lower and upper ends, two arrays of one shape (…, outputs).
        inputs: The fuzzy inputs by name; plain numbers are crisp.
        groups: Names of inputs that are fixed together, by the name of their group; each input by
            itself if not given or empty.

    Returns:
        Names of the groups, and the fraction of each, shape (groups, …, outputs), where (…,
        outputs) is the shape of the bounds, such as (levels, outputs). A fraction is 0 where the
        width is 0, and never negative. Fractions need not add up to 1, since effects overlap.

    Raises:
        RefusedError: A group names what is no input, or an input is no number.
        Exception: Whatever `propagation` raises.

    Example:
        >>> from alphacut.fuzzy import Interval, Reduced
        >>> inputs = {"a": Interval(0, 1), "b": Interval(0, 3)}
        >>> total = lambda fuzzy: propagate(lambda a, b: a + b, fuzzy, Reduced(), alpha=[0])
        >>> width_fractions(total, inputs).fraction.ravel()
        array([0.25, 0.75])
    """
    numbers = fuzzy_inputs(inputs)
    members = groups or {name: (name,) for name in numbers}
    for group in members.values():
        for name in group:
            require_choice("input of a group", name, numbers)

    def ends_with(fixed: Sequence[str]) -> Ends:
        """Return the ends of the result with the inputs `fixed` at their nominal values."""
        crisp = {name: Crisp(numbers[name].nominal) for name in fixed}
        result = propagation({**numbers, **crisp})
        if isinstance(result, Bounds):
            return Ends(result.lower, result.upper)
        return Ends(np.asarray(result[0]), np.asarray(result[1]))

    ends = ends_with([])
    ends_by_group = [ends_with(group) for group in members.values()]
    lowers = np.array([x.lower for x in ends_by_group])
    uppers = np.array([x.upper for x in ends_by_group])
    # The whole box holds the boxes with inputs fixed. A search may have missed values in it that
    # were found in these. They are added to its width here, so that no fraction is negative.
    width = np.maximum(ends.upper, uppers.max(axis=0)) - np.minimum(ends.lower, lowers.min(axis=0))
    reduction = width - (uppers - lowers)
    fraction = np.divide(reduction, width, out=np.zeros_like(reduction), where=width > 0)
    return WidthFractions(tuple(members), fraction)
