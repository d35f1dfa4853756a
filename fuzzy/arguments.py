"""Checks of a user's arguments before any sample is run."""

from __future__ import annotations

import inspect
from collections.abc import Iterable, Mapping, Sequence

from alphacut.fuzzy.knowledge.joint import joined_once
from alphacut.fuzzy.knowledge.known import Known
from alphacut.fuzzy.sets.boxes import Domain
from alphacut.fuzzy.sets.given import is_real
from alphacut.fuzzy.sets.interaction import Interaction
from alphacut.fuzzy.sets.numbers import Crisp, FuzzyNumber


def fuzzy_inputs(inputs: Mapping[str, FuzzyNumber | float]) -> dict[str, FuzzyNumber]:
    """The inputs by name, a plain number as a crisp one, claims joined (`jointly`).

    Raises:
        ValueError: The inputs are no mapping, a value is neither a fuzzy number nor a number, or
            claims of different kinds are joined without a meaning.
    """
    if not isinstance(inputs, Mapping):
        raise ValueError(
            f"the inputs are a {type(inputs).__name__}; they must map names to fuzzy numbers, as"
            " {'E': Triangular(24, 25, 26)}"
        )
    for name in inputs:
        if not isinstance(name, str):
            raise ValueError(f"an input is named {name!r}; a name must be text, as in {{'E': …}}")
    return joined_once({name: _fuzzy(name, value) for name, value in inputs.items()})


def _fuzzy(name: str, value: object) -> FuzzyNumber:
    if isinstance(value, FuzzyNumber):
        return value
    if is_real(value):
        return Crisp(value)  # type: ignore[arg-type]
    units = "; text with units is read by alphacut.io.quantity.fuzzy('[24, 25, 26] GPa', 'Pa')"
    raise ValueError(
        f"the input {name!r} is {value!r}; it must be a number or a fuzzy number such as"
        f" Triangular(24, 25, 26){units if isinstance(value, str) else ''}"
    )


def shared_numbers(domain: Domain) -> tuple[str, ...]:
    """Note for each fuzzy number that stands for several independent inputs."""
    names: dict[int, list[str]] = {}
    lower, upper = domain.boxes
    for column, (name, number) in enumerate(domain.inputs.items()):
        if (upper > lower)[:, column].any():
            names.setdefault(id(number), []).append(name)
    cure = "where they are one quantity, make it one input"
    return tuple(
        f"inputs {', '.join(same)} share one fuzzy number and vary independently; {cure}"
        for same in names.values()
        if len(same) > 1
    )


def wider_steps(domain: Domain) -> tuple[str, ...]:
    """Note on levels at which a cut stands for a narrower one that is not known."""
    pairs = zip(domain.alpha, domain.exact, strict=True)
    between = ", ".join(f"{level:g}" for level, exact in pairs if not exact)
    what = "an input's cut is that of a level below, as its own is not known: bounds are that cut's"
    return (f"at α = {between} {what}",) if between else ()


def known_facts(known: object, names: Sequence[str]) -> Known:
    """Facts known of the model; none if not given.

    Raises:
        ValueError: It is no `Known`, or names what is no input.
    """
    if not isinstance(known, Known | None):
        raise ValueError(
            f"known is {known!r}; it must be what is known of the function, as"
            " fuzzy.Known(signs={'x': 1})"
        )
    facts = known or Known()
    facts.check(names)
    return facts


def interaction_list(interactions: object) -> tuple[Interaction, ...]:
    """The interactions between the inputs.

    Raises:
        ValueError: They are no list of interactions.
    """
    listed = (
        interactions
        if isinstance(interactions, Iterable) and not isinstance(interactions, str)
        else (None,)
    )
    found = tuple(listed)
    if not all(hasattr(one, "slack") for one in found):
        raise ValueError(
            f"the interactions are {interactions!r}; they must be a list such as"
            " [fuzzy.Linear({'x': 1}, 2)]"
        )
    return found


def require_plan(plan: object) -> None:
    """A plan is an object that runs, not its name.

    Raises:
        ValueError: It is not.
    """
    if isinstance(plan, type) or not hasattr(plan, "run"):
        raise ValueError(
            f"the plan is {plan!r}; it must be a plan such as fuzzy.General(), fuzzy.Reduced() or"
            " fuzzy.Signed()"
        )


def require_callable(function: object, names: Sequence[str], *, by_name: bool, sent: bool) -> None:
    """Refuse a function that the inputs or the worker processes cannot call.

    Raises:
        ValueError: It cannot.
    """
    if not callable(function):
        raise ValueError(f"the function is {function!r}, which cannot be called")
    if by_name:
        try:
            inspect.signature(function).bind(**dict.fromkeys(names))
        except TypeError as mismatch:
            raise ValueError(
                f"the function cannot be called with the inputs {', '.join(names)}: {mismatch}"
            ) from None
        except ValueError:
            pass  # a function of C without a signature
    if sent:
        from joblib.externals import cloudpickle

        try:
            cloudpickle.dumps(function)
        except Exception as failure:
            cure = "take out of it what cannot be copied, or take workers=1"
            raise ValueError(
                f"the function cannot be sent to worker processes ({failure}): {cure}"
            ) from None
