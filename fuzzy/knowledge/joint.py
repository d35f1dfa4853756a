"""Joint claims: cuts of several inputs that contain all their quantities with P >= 1 − α.

With m claims, the joint cut at α is the box of their cuts at β with 1 − (1 − β)^m = α for
independent sources and m β = α for unknown dependence (Bonferroni). The box at β = α, the minimum
of the memberships, contains all quantities less often than with 1 − α.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from alphacut.fuzzy.refused import require
from alphacut.fuzzy.sets.boxes import fuzzy_inputs
from alphacut.fuzzy.sets.claimed import Claim, Claimed, Joint
from alphacut.fuzzy.sets.numbers import FuzzyNumber, Stepwise


def jointly(
    inputs: Mapping[str, FuzzyNumber | float], *, independent: bool = False, means: str = ""
) -> dict[str, FuzzyNumber | float]:
    """Return the inputs with claimed ones widened, so that their α-cuts hold jointly: P >= 1 − α.

    Args:
        inputs: Fuzzy numbers by name; plain numbers are crisp.
        independent: Whether the samples behind different inputs are independent of each other;
            unknown dependence if not stated.
        means: Quantity of the joint claim; required where the claims are of different kinds.

    Raises:
        RefusedError: Claims of different kinds are joined without a meaning, or one number stands
            for several independent inputs.

    Example:
        >>> from alphacut.fuzzy import from_data
        >>> numbers = {name: from_data([1, 2, 3, 4, 5, 6, 7], "median") for name in ("a", "b")}
        >>> numbers["a"].decided, jointly(numbers)["a"].decided
        (0.015625, 0.03125)
    """
    claimed = {name: number for name, number in inputs.items() if isinstance(number, Claimed)}
    if not claimed:
        return dict(inputs)
    rule = Joint(tuple(claimed), independent, means or _common(claimed), named=bool(means))
    if independent:
        _require_different_values(claimed)
    return {
        name: _widened(number, rule) if isinstance(number, Claimed) else number
        for name, number in inputs.items()
    }


def joined_inputs(inputs: Mapping[str, FuzzyNumber | float]) -> dict[str, FuzzyNumber]:
    """Return the inputs as fuzzy numbers whose claims hold jointly (`jointly`, if not done before).

    Raises:
        RefusedError: As `fuzzy_inputs` and `jointly`.
    """
    numbers = fuzzy_inputs(inputs)
    rules = {number.joint for number in numbers.values() if isinstance(number, Claimed)}
    joined = len(rules) == 1 and None not in rules
    return numbers if joined else fuzzy_inputs(jointly(numbers))


def _common(claimed: Mapping[str, Claimed]) -> str:
    """Return the claimed quantity, such as "median", which must be the same for all inputs."""
    kinds = {number.claim.about for number in claimed.values()}
    cure = "say what the joint one means: jointly(inputs, means='drift of the next frame')"
    require(
        len(kinds) == 1,
        "claims of the inputs",
        value=sorted(kinds),
        allowed="of one kind",
        cure=cure,
    )
    return kinds.pop()


def _require_different_values(claimed: Mapping[str, Claimed]) -> None:
    """Refuse inputs stated to be independent of which two have the same cuts, from one sample."""
    for (first, number), (second, partner) in combinations(claimed.items(), 2):
        cure = f"{first} and {second} rest on the same values"
        require(
            number.number != partner.number, "independent", value=True, allowed="False", cure=cure
        )


def _widened(number: Claimed, rule: Joint) -> Claimed:
    """Return the number with its cut at β moved to the joint level α(β), which is higher."""
    steps = number.number
    level = rule.joined(np.asarray(steps.alpha))
    last = np.append(np.diff(level) > 0, True) & (level <= 1)  # of equal levels the last cut
    lower, upper = (tuple(np.asarray(ends)[last]) for ends in (steps.lower, steps.upper))
    moved = Stepwise(tuple(level[last]), lower, upper)
    decided = float(rule.joined(np.asarray(number.decided)))
    return replace(number, number=moved, decided=decided, joint=rule)


@dataclass(frozen=True)
class JointClaim:
    """Claim of a result of several inputs.

    Args:
        rule: How the claims were joined; None where no input has one.
        conditions: Conditions of all claims.
        opinions: Fuzzy inputs without a claim.
    """

    rule: Joint | None
    conditions: tuple[str, ...]
    opinions: tuple[str, ...]

    @classmethod
    def from_inputs(
        cls, inputs: Mapping[str, FuzzyNumber], nature: str = "guaranteed"
    ) -> JointClaim:
        """Return the claim of a result of these inputs, with bounds of the given nature.

        Args:
            inputs: Fuzzy numbers by name.
            nature: "attained", "estimated" or "guaranteed"; unless guaranteed, that the true range
                stays inside the bounds is a condition.
        """
        claimed = {name: number for name, number in inputs.items() if isinstance(number, Claimed)}
        opinions = tuple(
            name
            for name, number in inputs.items()
            if name not in claimed and number.support.width > 0
        )
        alike: dict[str, list[str]] = {}
        for name, number in claimed.items():
            if number.claim.conditions:
                alike.setdefault(", ".join(number.claim.conditions), []).append(name)
        conditions = [f"{', '.join(names)}: {words}" for words, names in alike.items()]
        rules = (x.joint or Joint((name,), False, x.claim.about) for name, x in claimed.items())
        rule, where = next(rules, None), "their cuts" if len(opinions) > 1 else "its cut"
        assumptions = [f"{', '.join(opinions)} in {where} at α (opinions)"] if opinions else []
        words = [rule.words] if rule and rule.words else []
        if rule and nature != "guaranteed":
            assumptions.append(
                f"if the true range stays inside the {nature} bounds, which is not proved"
            )
        return cls(rule, (*conditions, *words, *assumptions), opinions)

    @property
    def claim(self) -> Claim | None:
        """The claim of a number computed from the inputs; None where no input has one."""
        return None if self.rule is None else Claim(self.rule.means, self.conditions)

    def __str__(self) -> str:
        """Return the claim as a sentence; without claims the names of the opinions, or nothing."""
        if self.rule is None:
            names = ", ".join(self.opinions)
            return names and f"{names}: opinions, so that no level has a probability"
        names = ", ".join(self.rule.names)
        subject = (
            self.rule.means if self.rule.named else f"result of the {self.rule.means} of {names}"
        )
        return str(Claim(subject, self.conditions))
