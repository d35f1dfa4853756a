"""Families of growing boxes, and the size at which one ceases to be safe."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from alphacut.fuzzy.counted import counted
from alphacut.fuzzy.progress_bar import Progress
from alphacut.fuzzy.sets.boxes import Domain
from alphacut.fuzzy.sets.numbers import Array
from alphacut.fuzzy.tables import html_table


@dataclass(frozen=True, eq=False)
class Scaled:
    """Boxes centre − size · below … centre + size · above.

    Args:
        centre: Box of size 0, shape (inputs,).
        below: Reach to the left at size 1, not negative, shape (inputs,).
        above: Reach to the right at size 1.
    """

    centre: Array
    below: Array
    above: Array

    def at(self, size: float) -> tuple[Array, Array]:
        """Corners of the box of a size."""
        return self.centre - size * self.below, self.centre + size * self.above

    def size_of(self, point: Array) -> float:
        """Least size whose box holds a point; infinite where none does."""
        step = point - self.centre
        reach = np.where(step > 0, self.above, self.below)
        with np.errstate(divide="ignore", invalid="ignore"):
            sizes = np.where(step == 0, 0.0, np.abs(step) / reach)
        return float(sizes.max())


@dataclass(frozen=True, eq=False)
class ByLevel:
    """The cuts of fuzzy inputs, of size 1 − α.

    Args:
        domain: The inputs.
    """

    domain: Domain

    def at(self, size: float) -> tuple[Array, Array]:
        """Corners of the cut at α = 1 − size."""
        cuts = np.array([number.cut(1 - size) for number in self.domain.inputs.values()])
        return cuts[:, 0], cuts[:, 1]

    def size_of(self, point: Array) -> float:
        """1 − the least membership of the point's values."""
        numbers = self.domain.inputs.values()
        least = min(float(x.membership(p)) for x, p in zip(numbers, point, strict=True))
        return 1 - least


@dataclass(frozen=True, eq=False)
class Verdict:
    """What is known of a box: proved safe, or a point of it is not, or neither.

    Args:
        safe: Whether the limits are proved to hold in all of the box.
        witness: A point where one does not hold, shape (inputs,); None where none is known.
        runs: Samples of the function that this took.
        failure: Where the function has no value in it, in words; empty where none was found.
    """

    safe: bool
    witness: Array | None = None
    runs: int = 0
    failure: str = ""


Judge = Callable[[Array, Array], Verdict]


@dataclass(frozen=True, eq=False, repr=False)
class Threshold:
    """Size at which boxes cease to be safe.

    Args:
        safe: Largest size proved safe; None where not even the least box is.
        unsafe: Size of the least box that holds the witness; infinite without one.
        witness: The point that breaks a limit, shape (inputs,), or None.
        judged: Boxes that were judged.
        runs: Samples of the function that this took.
        failure: Without a witness the least size of a box with a point without a value, in words.
    """

    safe: float | None
    unsafe: float
    witness: Array | None
    judged: int
    runs: int = 0
    failure: str = ""

    @property
    def gap(self) -> float:
        """Distance of the witness beyond what is proved, as a share of it; infinite without one."""
        return self.unsafe / self.safe - 1 if self.safe else float("inf")

    def __str__(self) -> str:
        """Both sizes, and the point that breaks a limit."""
        return "; ".join(" ".join(row) for row in self._told())

    __repr__ = __str__

    def _repr_html_(self) -> str:
        """Both sizes as a table, for notebooks."""
        return html_table(("what", "size"), self._told())

    def _told(self) -> list[tuple[str, str]]:
        safe = "none" if self.safe is None else f"{self.safe:.9g}"
        rows = [("proved safe up to", safe)]
        if self.witness is not None:
            at = ", ".join(f"{x:.6g}" for x in self.witness)
            rows.append(("unsafe from", f"{self.unsafe:.9g}, at ({at})"))
        if self.failure:
            rows.append(("the function has no value in the box of size", self.failure))
        return [*rows, ("boxes judged", f"{self.judged}, with {counted(self.runs, 'run')}")]


def threshold(
    family: Scaled | ByLevel,
    judge: Judge,
    *,
    most: float = 1.0,
    tolerance: float = 1e-3,
    limit: int = 100,
    progress: Progress | None = None,
) -> Threshold:
    """Halves the interval between the largest box proved safe and the least one that is not.

    Args:
        family: The boxes.
        judge: Tells what is known of a box.
        most: Largest size that is asked for.
        tolerance: Wanted distance of both sizes, as a share of `most`.
        limit: Most boxes that are judged.
        progress: Called with the share done.

    Raises:
        ValueError: A number is not positive.
    """
    if not (most > 0 and tolerance > 0 and limit >= 2):
        raise ValueError(
            f"most, tolerance and limit are {most:g}, {tolerance:g}, {limit}; they must be positive"
        )
    last, first = judge(*family.at(most)), judge(*family.at(0.0))
    runs, failure = last.runs + first.runs, last.failure and f"{most:.6g}, {last.failure}"
    if last.safe:
        return Threshold(most, np.inf, None, 2, runs)
    if first.witness is not None or not (first.safe or last.witness is not None):
        return Threshold(None, 0.0 if first.witness is not None else np.inf, first.witness, 2, runs)
    safe, unsafe, witness, judged = 0.0, np.inf, last.witness, 2
    if witness is not None:
        unsafe = min(family.size_of(witness), most)
    undecided = [] if witness is not None else [most]
    while judged < limit:
        top, bottom = min(undecided, default=unsafe), max(undecided, default=safe)
        if top - safe > tolerance * most:
            middle = (safe + top) / 2
        elif witness is not None and unsafe - bottom > tolerance * most:
            middle = (bottom + unsafe) / 2
        else:
            break
        found, judged = judge(*family.at(middle)), judged + 1
        runs += found.runs
        if found.safe:
            safe = middle
        elif found.witness is not None:
            unsafe, witness = min(family.size_of(found.witness), middle), found.witness
        else:
            undecided.append(middle)
            failure = f"{middle:.6g}, {found.failure}" if found.failure else failure
        undecided = [size for size in undecided if safe < size < unsafe]
        if progress:  # each box halves what is open, down to the tolerance
            left = max((min(unsafe, most) - safe) / most, tolerance)
            progress(max(judged / limit, float(np.log(left) / min(np.log(tolerance), -1e-9))))
    least = None if safe == 0 and not first.safe else safe
    return Threshold(least, unsafe, witness, judged, runs, failure if witness is None else "")
