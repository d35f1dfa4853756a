"""Possibility that a storey frame exceeds a limit at some time, with its fuzzy safety margin.

The cuts of the inputs are a family of boxes that grow as α falls. The largest one proved safe and
the least one with a motion beyond a limit bound the possibility from both sides. The largest one
all of whose motions are proved to pass a limit, and the least one with a motion that keeps all,
bound the necessity. That any of several limits is exceeded is as possible as the most possible of
them, and may be more necessary than each.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from alphacut.frame.calculus.jet import Array
from alphacut.frame.decisions.limit_search import LimitSearch, Unproved
from alphacut.frame.decisions.safe_scale import SafeScale, limit_search, safe_scale
from alphacut.frame.decisions.sure_exceeding import sure_exceeding
from alphacut.frame.structures.modes import ModalError, UnsuitedOutputError
from alphacut.frame.structures.storey import StoreyFrame
from alphacut.fuzzy import FuzzyNumber
from alphacut.fuzzy.counted import ranged
from alphacut.fuzzy.knowledge.joint import JointClaim
from alphacut.fuzzy.knowledge.joint import joined_inputs as fuzzy_inputs
from alphacut.fuzzy.progress_bar import Progress


@dataclass(frozen=True, eq=False)
class Exceeding:
    """How possible it is that any limit is exceeded at any node.

    Args:
        possibility: Lower and upper bound.
        necessity: Lower and upper bound.
        scale: What was proved of boxes of size 1 − α, and the witness.
        claim: What the cuts of the inputs claim.
        lowest: Lowest level looked at.
    """

    possibility: tuple[float, float]
    necessity: tuple[float, float]
    scale: SafeScale
    claim: str
    lowest: float = 0.0

    @property
    def verdict(self) -> str:
        """Safe where exceeding is impossible, unsafe where it is sure; or from which level up."""
        whole, up = self.lowest == 0, f"from α = {self.lowest:g} up; open below"
        if self.possibility[1] <= self.lowest:
            return "safe" if whole else f"kept {up}"
        sure = "unsafe" if whole else f"exceeded {up}"
        return sure if self.necessity[0] >= 1 - self.lowest else "undecided"

    def __str__(self) -> str:
        """The decision with what it rests on."""
        possible, necessary = ranged(*self.possibility), ranged(*self.necessity)
        degrees = f"possibility of exceeding {possible}, necessity {necessary}"
        lines = [f"{self.verdict}: {degrees} ({self.scale.nature})"]
        return "\n".join([*lines, *([self.claim] if self.claim else [])])


def exceeding(
    frame: StoreyFrame,
    inputs: Mapping[str, FuzzyNumber | float],
    limits: Mapping[str, float],
    *,
    duration: float,
    step: float,
    lowest: float = 0.0,
    workers: int = 1,
    progress: Progress | bool | None = None,
    failed: Unproved | None = None,
) -> Exceeding:
    """Bounds of the possibility and the necessity that some |output| exceeds its limit at a node.

    Args:
        frame: The structure with its ground motion and initial state.
        inputs: Fuzzy numbers of the uncertain parameters, in SI units; claims are joined as
            `propagate` does.
        limits: Largest magnitude allowed by output: drifts, accelerations, shears, one or several.
        duration: Length of the motion, in s.
        step: Distance of nodes, in s.
        lowest: Lowest level that the inputs decide.
        workers: Processes of the proof.
        progress: As for `envelope`.
        failed: As for `safe_scale`, of limits on the same inputs.

    Raises:
        ValueError: A limit is not positive, or an input is no parameter.
    """
    numbers, most = fuzzy_inputs(fuzzy_inputs(inputs)), 1.0 - lowest
    nominal = {name: number.modal for name, number in numbers.items()}

    def reach(size: float) -> tuple[Array, Array]:
        cuts = np.array([x.cut(max(1 - size, lowest)) for x in numbers.values()])
        return cuts[:, 0], cuts[:, 1]

    proof = partial(safe_scale, frame, nominal, reach, limits, duration=duration, step=step)
    necessity, sampled = (0.0, 0.0), ""

    def known(level: float) -> float:
        return max(min([level, *(x.known(max(level, 0.0)) for x in numbers.values())]), 0.0)

    seek = partial(limit_search, frame, nominal, reach, limits, duration, step, failed)
    try:
        found = proof(most=most, workers=workers, progress=progress, failed=failed)
        if found.safe is None:
            search = seek()
            sure = sure_exceeding(search, most)
            necessity, sampled = (
                (sure.size or 0.0, 1 - known(1 - min(sure.kept, 1.0))),
                search.reason,
            )
    except UnsuitedOutputError:
        raise
    except ModalError as error:
        return _unknown(seek(), str(error), str(JointClaim.of(numbers)), lowest)
    safe = 0.0 if found.safe is None else found.safe
    upper = lowest if safe >= most else 1 - safe
    lower = known(1 - found.unsafe) if np.isfinite(found.unsafe) else 0.0
    if sampled:
        found = replace(found, nature="verified by sampling", reason=sampled)
    claim = str(JointClaim.of(numbers).resting_on(found.nature))
    return Exceeding((lower, upper), necessity, found, claim, lowest)


def _unknown(search: LimitSearch, why: str, claim: str, lowest: float) -> Exceeding:
    """What the nominal motion tells, where there is no model to rest a proof on."""
    centre, share = search.nominal, search.share(search.nominal)
    passed, told = search.exceeded(centre), ("guaranteed", why.partition(";")[0], 0, 0.0)
    safe, unsafe, witness = (None, 0.0, centre) if passed else (0.0, np.inf, None)
    box = safe, centre, centre, unsafe, witness, share * passed, share
    scale = SafeScale(search.flow.names, centre, *box, *told)
    return Exceeding((float(passed), 1.0), (0.0, 1.0 if passed else 0.0), scale, claim, lowest)


def any_exceeding(each: Mapping[str, Exceeding], together: Exceeding | None = None) -> Exceeding:
    """That any limit is exceeded, from each by itself.

    Args:
        each: The decision on each limit, one at least.
        together: The decision on all limits at once, where one of them is passed at the nominal
            values; its necessity may be greater than that of each.
    """

    def rank(one: Exceeding) -> tuple[tuple[float, float], bool]:
        """By possibility; of limits that are surely passed, one that is proved is enough."""
        return one.possibility, one.necessity[0] == 1 and one.scale.nature == "guaranteed"

    most = max(each.values(), key=rank)
    lower, upper = (max(one.possibility[side] for one in each.values()) for side in (0, 1))
    least, high = (max(one.necessity[side] for one in each.values()) for side in (0, 1))
    if together is not None:
        least, high = max(least, together.necessity[0]), together.necessity[1]
    weak, others = most, [*each.values(), *([together] if together else [])]
    if rank(most) != ((1.0, 1.0), True):  # where any limit may decide, the weakest proof counts
        weak = next((one for one in others if one.scale.nature != "guaranteed"), most)
    scale = replace(most.scale, nature=weak.scale.nature, reason=weak.scale.reason)
    return Exceeding((lower, upper), (least, high), scale, weak.claim, most.lowest)
