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

from alphacut.base.errors import require
from alphacut.fuzzy.sets.boxes import fuzzy_inputs
from alphacut.fuzzy.sets.claimed import ClaimedNumber, CoverageClaim, JointRule
from alphacut.fuzzy.sets.numbers import FuzzyNumber, Stepwise


def jointly(
    inputs: Mapping[str, FuzzyNumber | float], *, independent: bool = False, means: str = ""
) -> dict[str, FuzzyNumber | float]:
    """Return inputs whose α-cuts contain all claimed quantities jointly with P >= 1 − α.

    Each of m claimed numbers alone contains its quantity in its cut at β with P ≥ 1 − β. The joint
    cut at α consists of their cuts at β, with 1 − (1 − β)^m = α for independent samples and m β = α
    otherwise (Bonferroni): the cuts become wider.

    Args:
        inputs: Fuzzy numbers by name; plain numbers are crisp. They are not changed.
        independent: Whether the samples behind different inputs are independent of each other;
            unknown dependence if not stated.
        means: Quantity of the joint claim, in words; required where the claims are of different
            kinds, such as "mean" and "next value".

    Returns:
        All inputs in their order. Numbers with a claim are replaced by copies with wider cuts,
        whose field `joint` says how they were joined; numbers joined before are widened again.
        Inputs without a claim are returned as they are. `decided`, the level from which values
        decide the cuts, grows with the cuts.

    Raises:
        RefusedError: Claims of different kinds are joined without `means`, or inputs that are said
            to be independent have the same number.

    Example:
        >>> from alphacut.fuzzy import from_data
        >>> numbers = {name: from_data([1, 2, 3, 4, 5, 6, 7], "median") for name in ("a", "b")}
        >>> numbers["a"].decided, jointly(numbers)["a"].decided
        (0.015625, 0.03125)
    """
    claimed = {name: number for name, number in inputs.items() if isinstance(number, ClaimedNumber)}
    if not claimed:
        return dict(inputs)
    kinds = sorted({number.claim.about for number in claimed.values()})
    require(
        bool(means) or len(kinds) == 1,
        "claims of the inputs",
        value=kinds,
        allowed="of one kind",
        cure="say what the joint one means: jointly(inputs, means='drift of the next frame')",
    )
    rule = JointRule(tuple(claimed), independent, means or kinds[0], named=bool(means))
    for (first, number), (second, second_number) in combinations(claimed.items(), 2):
        cure = f"{first} and {second} rest on the same values"
        # Two numbers with equal cuts almost surely come from the same values, which are not
        # independent.
        is_allowed = not independent or number.number != second_number.number
        require(is_allowed, "independent", value=True, allowed="False", cure=cure)
    return {**inputs, **{name: _join_levels(number, rule) for name, number in claimed.items()}}


def joined_inputs(inputs: Mapping[str, FuzzyNumber | float]) -> dict[str, FuzzyNumber]:
    """Return the inputs as fuzzy numbers whose claims hold jointly, for unknown dependence.

    If all numbers with a claim have been joined by one call of `jointly`, they stay as they are.
    Otherwise all are joined here, and their cuts become wider.

    Args:
        inputs: Fuzzy numbers by name; a plain number becomes a `Crisp`.

    Raises:
        RefusedError: `inputs` is no mapping or is empty, a value is neither a fuzzy nor a finite
            number, or claims of different kinds, such as "mean" and "next value", have not been
            joined by the caller.
    """
    numbers = fuzzy_inputs(inputs)
    rules = {number.joint for number in numbers.values() if isinstance(number, ClaimedNumber)}
    # Joined inputs share one rule. Joining them again would widen their cuts twice.
    are_joined = len(rules) == 1 and None not in rules
    if are_joined:
        return numbers
    return fuzzy_inputs(jointly(numbers))


def _join_levels(number: ClaimedNumber, rule: JointRule) -> ClaimedNumber:
    """Return a copy of a claimed number whose cuts stand at the higher levels of the joint claim.

    With m joined numbers the cut at level β moves up to the level α = 1 − (1 − β)^m if their
    samples are independent, else to min(m β, 1). The support at α = 0 stays. If several cuts arrive
    at one level, such as 1, the narrowest is kept.

    Args:
        number: Fuzzy number with a claim, whose cuts are given at some levels and hold up to the
            next one.
        rule: Number of the joined claims and their dependence; it is stored in the copy.
    """
    cuts = number.number
    levels = rule.joint_level(np.asarray(cuts.alpha))
    is_last = np.append(np.diff(levels) > 0, True)
    kept = np.flatnonzero(is_last & (levels <= 1))
    joint_cuts = Stepwise(
        tuple(levels[kept]),
        tuple(np.asarray(cuts.lower)[kept]),
        tuple(np.asarray(cuts.upper)[kept]),
        cuts.encloses,
    )
    # The level from which the values decide the cuts moves up with the cuts.
    decided = float(rule.joint_level(np.asarray(number.decided)))
    return replace(number, number=joint_cuts, decided=decided, joint=rule)


@dataclass(frozen=True)
class JointClaim:
    """Coverage claim of a result of several inputs.

    Args:
        rule: How the claims were joined; None where no input has one.
        conditions: Conditions of all claims.
        opinions: Fuzzy inputs without a claim.
    """

    rule: JointRule | None
    conditions: tuple[str, ...]
    opinions: tuple[str, ...]

    @classmethod
    def from_inputs(
        cls, inputs: Mapping[str, FuzzyNumber], nature: str = "guaranteed"
    ) -> JointClaim:
        """Return what may be claimed of a result that is computed from some inputs.

        A claim says that a quantity lies in its α-cut with P ≥ 1 − α under conditions. The claim of
        a result has the conditions of all inputs' claims, and the one under which these were
        joined. A further condition is that the inputs without a claim lie in their cuts.

        Args:
            inputs: Fuzzy numbers by name, whose claims have been joined (`jointly`) if there are
                several. Inputs that have a width but no claim are opinions; crisp ones do not
                matter.
            nature: What the bounds of the result promise: "attained", "estimated" or "guaranteed".
                Unless it is "guaranteed", that the true range stays inside the bounds is a further
                condition.

        Returns:
            The rule by which the claims were joined, None where no input has a claim; all
            conditions as texts; and the names of the opinions.
        """
        claimed = {name: x for name, x in inputs.items() if isinstance(x, ClaimedNumber)}
        opinions = [name for name in inputs if name not in claimed]
        opinions = [name for name in opinions if inputs[name].support.width > 0]
        conditions = _conditions_by_input(claimed)
        rule = None
        if claimed:
            rule = _rule_of(claimed)
            if rule.words:
                conditions.append(rule.words)
        if len(opinions) == 1:
            conditions.append(f"{opinions[0]} in its cut at α (opinions)")
        elif opinions:
            conditions.append(f"{', '.join(opinions)} in their cuts at α (opinions)")
        if rule and nature != "guaranteed":
            conditions.append(
                f"if the true range stays inside the {nature} bounds, which is not proved"
            )
        return cls(rule, tuple(conditions), tuple(opinions))

    @property
    def claim(self) -> CoverageClaim | None:
        """The claim of a number computed from the inputs; None where no input has one."""
        return None if self.rule is None else CoverageClaim(self.rule.means, self.conditions)

    def __str__(self) -> str:
        """Return the claim as a sentence, or what stands in its place.

        With a claim it is "the … lies in its α-cut with P >= 1 - α over repeated samples, given …".
        If no input has a claim, it names the opinions (fuzzy inputs without a claim), and is empty
        without any.
        """
        if self.rule is None:
            names = ", ".join(self.opinions)
            return names and f"{names}: opinions, so that no level has a probability"
        # If the user has named what the joint claim is about, the name is taken. Otherwise
        # `means` is the kind that all inputs' claims share, such as "mean".
        subject = self.rule.means
        if not self.rule.named:
            subject = f"result of the {subject} of {', '.join(self.rule.names)}"
        return str(CoverageClaim(subject, self.conditions))


def _rule_of(claimed: Mapping[str, ClaimedNumber]) -> JointRule:
    """Return the rule that all joined inputs share, or the rule of a single input by itself."""
    name, first = next(iter(claimed.items()))
    return first.joint or JointRule(names=(name,), independent=False, means=first.claim.about)


def _conditions_by_input(claimed: Mapping[str, ClaimedNumber]) -> list[str]:
    """Return the conditions of the claims as texts such as "E, nu: 12 values drawn alike".

    Inputs whose claims have equal conditions share one text, with their names in front. Several
    conditions of a claim are joined by commas. Inputs without conditions are left out.
    """
    names_by_condition: dict[str, list[str]] = {}
    for name, number in claimed.items():
        if number.claim.conditions:
            condition = ", ".join(number.claim.conditions)
            names_by_condition.setdefault(condition, []).append(name)
    return [f"{', '.join(names)}: {x}" for x, names in names_by_condition.items()]
