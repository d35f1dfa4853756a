"""Fuzzy numbers with a claim: how often their cuts contain a quantity, under which conditions."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from alphacut.base.arrays import Array
from alphacut.base.errors import RefusedError
from alphacut.fuzzy.sets.numbers import Cut, Cuts, FuzzyNumber, Stepwise, checked_level


@dataclass(frozen=True)
class CoverageClaim:
    """P(quantity in the cut at α) >= 1 − α at every α, over repeated samples, under conditions.

    The quantity is `about`: "next value", "mean", "quantile 0.9", or what a joint claim means.
    """

    about: str
    conditions: tuple[str, ...] = ()

    def __str__(self) -> str:
        claim = f"the {self.about} lies in its α-cut with P >= 1 - α over repeated samples"
        if self.conditions:
            claim += f", given {'; '.join(self.conditions)}"
        return claim


@dataclass(frozen=True)
class JointRule:
    """Rule by which claims are joined.

    Args:
        names: The claimed inputs.
        independent: Whether their sources are independent; unknown dependence otherwise.
        means: What the joint claim means: the kind of all claims, or a name given by the user.
        named: Whether the user gave it.
    """

    names: tuple[str, ...]
    independent: bool
    means: str
    named: bool = False

    def joint_level(self, beta: Array) -> Array:
        """Return the level α of the joint cut that consists of single cuts at level β.

        With m claimed inputs, the fields `names`, it is α = 1 − (1 − β)^m if their samples are
        independent of each other, and min(m β, 1) otherwise (Bonferroni). All m quantities lie in
        their cuts at β with P ≥ 1 − α.

        Args:
            beta: Levels β in [0, 1], any shape, which the result has, too.
        """
        m = len(self.names)
        if m == 1:
            return np.asarray(beta, float)
        if not self.independent:
            return np.asarray(np.minimum(m * beta, 1.0))
        # 1 − (1 − β)^m = −expm1(m log1p(−β)). With logarithms the formula keeps its digits at small
        # β, where 1 − β is rounded to 1. At β = 1 the logarithm is infinite, so β stays just below.
        below_1 = np.minimum(beta, 1 - 1e-16)
        return np.asarray(-np.expm1(m * np.log1p(-below_1)))

    @property
    def words(self) -> str:
        """Number of sources and their dependence, in words; empty for a single source."""
        if len(self.names) == 1:
            return ""
        sources = "independent sources" if self.independent else "sources of unknown dependence"
        return f"{len(self.names)} {sources}"


@dataclass(frozen=True)
class ClaimedNumber(FuzzyNumber):
    """A fuzzy number with a claim.

    Args:
        number: The cuts; below `decided` they repeat the first one that the values decide.
        claim: Which quantity the cuts contain, how often, and under which conditions.
        decided: Smallest α at which the values decide both ends of the cut; 0 where they do
            everywhere, or physical bounds fill in.
        joint: Rule by which its cuts were widened to hold together with others; None where they
            hold by themselves.
    """

    number: Stepwise
    claim: CoverageClaim
    decided: float = 0.0
    joint: JointRule | None = None

    def __post_init__(self) -> None:
        checked_level(self.decided)

    @property
    def encloses(self) -> str:
        """Name of the set that the box of the cuts encloses; see `FuzzyNumber.encloses`."""
        return self.number.encloses

    @property
    def cuts(self) -> Cuts:
        """The α-cuts at all levels; RefusedError where the values do not decide those at low α."""
        self.cut(0.0)
        return self.number.cuts

    def cut(self, alpha: float) -> Cut:
        """Return the α-cut, which contains the claimed quantity with P ≥ 1 − α.

        Args:
            alpha: Level in [0, 1].

        Raises:
            RefusedError: The level is outside [0, 1], or below `decided`, the smallest level at
                which the measured values or physical bounds decide both ends of the cut.
        """
        # Below `decided` an end lies beyond all values, where nothing is known; the cut of
        # `self.number` is there only so that this number can be stored, and holds no claim.
        if checked_level(alpha) < self.decided:
            allowed = f"levels from {self.decided:.4g} on, which the values decide"
            cure = "give bounds=(lower, upper), what is physically possible, or measure more"
            raise RefusedError(f"alpha of the {self.claim.about}", alpha, allowed, cure)
        return self.number.cut(alpha)

    def __str__(self) -> str:
        widest = self.cut(self.decided)
        ends = f"{widest.lower:.6g} … {widest.upper:.6g} at α = {self.decided:.4g}"
        return f"{type(self).__name__}({self.claim.about}: {ends})"

    __repr__ = __str__


def widest_cut(number: FuzzyNumber) -> Cut:
    """Return the support of a number, or the widest cut that a claim determines."""
    if isinstance(number, ClaimedNumber):
        return number.cut(number.decided)
    return number.support
