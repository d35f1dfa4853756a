"""From a function and its fuzzy inputs to its fuzzy outputs."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Executor
from contextlib import contextmanager, nullcontext
from dataclasses import replace
from pathlib import Path
from time import perf_counter

from alphacut.fuzzy.arguments import (
    fuzzy_inputs,
    interaction_list,
    known_facts,
    require_callable,
    require_plan,
    shared_numbers,
    wider_steps,
)
from alphacut.fuzzy.campaign.call import Call, Function
from alphacut.fuzzy.campaign.campaign import Campaign
from alphacut.fuzzy.campaign.sample_store import shelf
from alphacut.fuzzy.campaign.spot_check import SpotCheck
from alphacut.fuzzy.campaign.store import Identity, Store
from alphacut.fuzzy.campaign.workers import pool, require_executor, require_workers
from alphacut.fuzzy.counted import counted
from alphacut.fuzzy.knowledge.known import Known
from alphacut.fuzzy.plans.automatic import Automatic
from alphacut.fuzzy.progress_bar import Progress, told
from alphacut.fuzzy.samples.result import FuzzyResult, Plan
from alphacut.fuzzy.sets.boxes import Domain, levels
from alphacut.fuzzy.sets.interaction import Interaction
from alphacut.fuzzy.sets.numbers import FuzzyNumber


def propagate(
    function: Function,
    inputs: Mapping[str, FuzzyNumber | float],
    plan: Plan | None = None,
    *,
    alpha: Sequence[float] | None = None,
    interactions: Sequence[Interaction] = (),
    shared: Sequence[str] = (),
    vectorised: bool = False,
    workers: int = 1,
    executor: Executor | None = None,
    known: Known | None = None,
    store: Store | str | Path | None = None,
    identity: Identity | None = None,
    spot_check: float = 0.05,
    progress: Progress | bool | None = None,
) -> FuzzyResult:
    """Fuzzy outputs of a function of fuzzy inputs.

    Args:
        function: Gets the inputs by name and returns a number, an array, or a mapping of names to
            either. With `shared` it gets a list of points (mappings of names to numbers) that agree
            in those inputs and returns a list of outputs; with `vectorised` it gets arrays, shape
            (n,), and returns arrays whose first axis is n.
        inputs: Fuzzy number of each input; a plain number is crisp. Inputs are independent, also
            where one number object stands for two.
        plan: How the boxes of the inputs are searched; if not given, a search that sees extremes
            inside and says what was verified.
        alpha: Rising levels; 0, ¼, ½, ¾, 1 if not given.
        interactions: Constraints between the inputs; plans that cannot respect them refuse.
        shared: Inputs whose equality lets samples share one call.
        vectorised: Whether the function takes arrays.
        workers: Processes of this machine; the result is the same for any number. They import the
            main script, so its calls must stand under `if __name__ == "__main__":` and the function
            in a file.
        executor: Any `concurrent.futures` executor, instead of `workers`.
        known: Facts about the function, such as the signs of its effects, on which guaranteed
            bounds rest.
        store: Where samples are kept (or its path): a campaign that was stopped, however, resumes
            from it.
        identity: What a sample depends on besides its inputs (case, options, versions), as JSON can
            say it; a store needs it, not empty. The store cannot see that the function changed: say
            so here, by a version or a hash of its text.
        spot_check: Time for running samples from the store again, as a share of the time that they
            took: the modal point (or another, if it is not stored) in any case, then random ones.
            The store is refused if one gives something else; 0 runs none. Without store and budget
            the first of 20 samples or more is run again: random functions are warned of.
        progress: Called with the share done, 0 … 1; of a plan that goes on from its samples a
            guess that never falls. If not given, a bar appears on a terminal or in a notebook after
            a second; False shows none.

    Raises:
        ValueError: An argument is wrong.
        KeyboardInterrupt: Interrupted; its message says what the store keeps.
        CampaignError: Samples failed; the others were run first.
        StoreError: The store cannot be written.
        RuntimeError: The workers cannot start.
    """
    domain = Domain(
        fuzzy_inputs(inputs), levels(4) if alpha is None else alpha, interaction_list(interactions)
    )
    known = known_facts(known, domain.names)
    plan = plan or Automatic()
    require_plan(plan)
    require_workers(workers)
    require_executor(executor, workers)
    require_callable(function, domain.names, by_name=not shared, sent=workers > 1)
    call = Call(function, domain.names, tuple(shared), vectorised)
    start = perf_counter()
    with (
        told(progress) as tell,
        nullcontext(executor) if executor else pool(workers) as running,
        shelf(store, identity, domain.names) as samples,
    ):
        check = SpotCheck(spot_check, domain.modal)
        campaign = Campaign(
            call, running, tell, known, samples, stepwise=plan.stepwise, spot_check=check
        )
        with on_interrupt(lambda: _kept(campaign, store)):
            result = plan.run(campaign, domain)
            within = store is None and not (isinstance(plan, Automatic) and plan.budget)
            doubt = campaign.randomness() if within else ""
        result = result.confronted(known.stated(domain.names, result.outputs))
        campaign.report(1.0)
    if doubt:
        warnings.warn(doubt, stacklevel=2)
    own = filter(None, (TORN if samples is not None and samples.torn else "", doubt))
    noted = (*shared_numbers(domain), *wider_steps(domain), *own)
    result = replace(result, notes=(*result.notes, *noted))
    cost = {"calls": campaign.calls, "reused": campaign.reused, "seconds": perf_counter() - start}
    return replace(result, **cost)  # type: ignore[arg-type]


TORN = (
    "the store ended within a sample, as after a kill or a partial copy: what is whole was taken,"
    " the rest was run anew"
)


@contextmanager
def on_interrupt(words: Callable[[], str]) -> Iterator[None]:
    """Say on Ctrl-C what is kept, in words."""
    try:
        yield
    except KeyboardInterrupt:
        raise KeyboardInterrupt(f"interrupted; {words()}") from None


def _kept(campaign: Campaign, store: Store | str | Path | None) -> str:
    """How many samples are kept, and how to go on."""
    done = campaign.runs + campaign.reused
    if store is None or campaign.shelf is None:
        were = f"{counted(done, 'sample')} {'was' if done == 1 else 'were'} done"
        return f"{were} and none is kept: `propagate` keeps them in a store="
    path, more = store.path if isinstance(store, Store) else store, campaign.shelf.held
    mine = f"the {counted(done, 'sample')} of this call {'is' if done == 1 else 'are'} in {path}"
    mine = mine if done else f"no sample of this call is in {path}"
    more -= campaign.reused
    return f"{mine}{f', which holds {more} more' * (more > 0)}: the same call goes on from there"
