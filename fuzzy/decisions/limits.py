"""Possibility and necessity that a function exceeds a limit, and its fuzzy safety margin, proved.

Exceeding is possible to the degree of the highest cut in which some point exceeds the limit, and
necessary to one minus the degree to which staying below is possible (Dubois and Prade, Possibility
Theory, chapter 1). Inputs with claims make a bound of the possibility one of the probability.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from alphacut.fuzzy.arguments import fuzzy_inputs
from alphacut.fuzzy.campaign.campaign import CampaignError
from alphacut.fuzzy.counted import counted, ranged
from alphacut.fuzzy.decisions.nested_boxes import ByLevel, Scaled, Threshold, Verdict, threshold
from alphacut.fuzzy.knowledge.enclosure import Enclosed
from alphacut.fuzzy.plans.branch_and_bound import BranchAndBound
from alphacut.fuzzy.progress_bar import Progress, part, told
from alphacut.fuzzy.propagation import on_interrupt, propagate
from alphacut.fuzzy.samples.result import FuzzyResult
from alphacut.fuzzy.sets.boxes import Domain, levels
from alphacut.fuzzy.sets.given import finite, finite_by_name, positive
from alphacut.fuzzy.sets.numbers import Array, Crisp, FuzzyNumber, Interval
from alphacut.fuzzy.tables import html_table

Limits = Mapping[str, float]
_UNKEPT = "keeps nothing: a larger tolerance or a smaller budget ends it sooner"


@dataclass(frozen=True)
class Limited:
    """A function of which no output may exceed its limit (or fall below it).

    Args:
        function: Written in arithmetic and numpy's functions, of named arrays; its output is `y`
            unless it returns a mapping.
        names: Its inputs.
        limits: Limit of each output.
        sign: +1 where outputs must stay at most at their limits, −1 where at least.
        precision: Gap of the proved bounds, as a share of the range of the output.
        budget: As of `BranchAndBound`, for each box.
        vectorised: Whether the function takes arrays, as `takes_arrays` tells.
    """

    function: Callable[..., object]
    names: tuple[str, ...]
    limits: Limits
    sign: int = 1
    precision: float = 1e-9
    budget: int = 50_000
    vectorised: bool = True

    @np.errstate(invalid="ignore", divide="ignore")  # told as the box's failure
    def __call__(self, lower: Array, upper: Array) -> Verdict:
        """What branch and bound proves of a box, two arrays of shape (inputs,)."""
        ends = zip(self.names, map(float, lower), map(float, upper), strict=True)
        inputs = {
            name: Interval(low, high) if high > low else Crisp(low) for name, low, high in ends
        }
        plan, arrays = BranchAndBound(self._limited, self.precision, self.budget), self.vectorised
        try:
            found = propagate(
                self._limited, inputs, plan, alpha=[1.0], vectorised=arrays, progress=False
            )
        except CampaignError as error:
            if not (upper > lower).any():
                raise
            return Verdict(False, runs=error.total, failure=str(error).partition(": ")[2])
        return replace(self._verdict(found), runs=found.runs)

    @cached_property
    def _limited(self) -> Callable[..., object]:
        """The outputs that have limits: bounds of others would take time and decide nothing."""
        function, asked = self.function, tuple(self.limits)
        if "y" in asked or any("[" in name for name in asked):
            return function  # which may give its values without their names

        def limited(**point: object) -> object:
            found = function(**point)
            return {name: found[name] for name in asked}  # type: ignore[index]

        return limited

    def _verdict(self, found: FuzzyResult) -> Verdict:
        proved = (found.upper if self.sign > 0 else -found.lower)[0]
        at = (found.upper_at if self.sign > 0 else found.lower_at)[0]
        allowed = self.sign * np.array(
            [self.limits.get(name, np.inf * self.sign) for name in found.outputs]
        )
        if (proved <= allowed).all():
            return Verdict(True)
        for column in np.flatnonzero(proved > allowed):
            if self.sign * self._value(at[column], found.outputs[column]) > allowed[column]:
                return Verdict(False, at[column])
        return Verdict(False)

    def _value(self, point: Array, output: str) -> float:
        found = self._enclosed(point[None], point[None])[output].value
        return float(found[0 if self.sign > 0 else 1][0])

    @cached_property
    def _enclosed(self) -> Enclosed:
        return Enclosed(self.function, self.names)


@dataclass(frozen=True, eq=False, repr=False)
class Decision:
    """How possible and how necessary it is that a limit is exceeded.

    Args:
        possibility: Proved lower and upper bound, two numbers from 0 to 1.
        necessity: Proved lower and upper bound, likewise.
        margin: Limit less output by name of the output, in its unit: lower and upper ends, two
            arrays of shape (levels,).
        alpha: Levels of the margin, rising.
        witness: The most possible inputs found that exceed a limit, by name; None where none do.
        claim: What the cuts of the inputs claim.
        runs: Samples of the function; its enclosures over boxes are not among them.
    """

    possibility: tuple[float, float]
    necessity: tuple[float, float]
    margin: Mapping[str, tuple[Array, Array]]
    alpha: tuple[float, ...]
    witness: Mapping[str, float] | None
    claim: str
    runs: int

    @property
    def verdict(self) -> str:
        """Safe where exceeding is proved impossible, unsafe where it is proved necessary to 1."""
        if self.possibility[1] == 0:
            return "safe"
        return "unsafe" if self.necessity[0] == 1 else "undecided"

    def __str__(self) -> str:
        """The decision, the margin to each limit at the lowest level, and what is claimed."""
        possible, necessary = ranged(*self.possibility), ranged(*self.necessity)
        degrees = f"possibility of exceeding {possible}, necessity {necessary}"
        head = f"{self.verdict}: {degrees}; {counted(self.runs, 'run')}"
        if self.verdict == "undecided" and " … " not in possible:
            head = f"possible, not certain: {head.split(': ', 1)[1]}"
        margins = [
            f"margin of {name} {ranged(low[0], high[0])} at α = {self.alpha[0]:g}"
            + (", so that its limit may be passed" if low[0] < 0 else "")
            for name, (low, high) in self.margin.items()
        ]
        return "\n".join([head, *margins, *([self.claim] if self.claim else [])])

    __repr__ = __str__

    def _repr_html_(self) -> str:
        """The decision over its margins as a table, for notebooks."""
        rows = [
            (name, f"{alpha:g}", f"{low:.6g}", f"{high:.6g}")
            for name, ends in self.margin.items()
            for alpha, low, high in zip(self.alpha, *ends, strict=True)
        ]
        at = ", ".join(f"{name} = {x:.6g}" for name, x in (self.witness or {}).items())
        below = "\n".join([str(self), *([f"a limit is exceeded at {at}"] if at else [])])
        return html_table(("output", "α", "margin from", "margin to"), rows, below=below)


def decide(
    function: Callable[..., object],
    inputs: Mapping[str, FuzzyNumber | float],
    limits: Limits,
    *,
    alpha: Sequence[float] | None = None,
    tolerance: float = 1e-7,
    budget: int = 50_000,
    progress: Progress | bool | None = None,
) -> Decision:
    """Decision on whether outputs exceed their limits, any of them.

    Args:
        function: Written in arithmetic and numpy's functions, as for `BranchAndBound`.
        inputs: Fuzzy inputs; claims are joined as `propagate` does.
        limits: Limit by output; `{"y": limit}` of a function without named outputs.
        alpha: Levels of the safety margin; 0, ¼, ½, ¾, 1 if not given.
        tolerance: Wanted distance of the bounds of possibility and necessity.
        budget: Boxes per bound at which a proof ends at the latest, as of `BranchAndBound`.
        progress: As for `propagate`.

    Raises:
        ValueError: An argument is wrong, a limit is not finite or names no output, or the function
            cannot be enclosed.
    """
    limits = finite_by_name("limits", limits, "{'y': 4.5}")
    positive("the tolerance", tolerance)
    domain = Domain(fuzzy_inputs(inputs), levels(4) if alpha is None else alpha)
    sides = [(limits, 1), *(({name: limit}, -1) for name, limit in limits.items())]
    family, parts, found = ByLevel(domain), 1 + len(sides), []
    arrays = takes_arrays(function, domain.names, *family.at(1.0), limits)
    with told(progress) as tell, on_interrupt(lambda: f"`decide` {_UNKEPT}"):
        whole = propagate(
            function,
            domain.inputs,
            BranchAndBound(function, budget=budget),
            alpha=domain.alpha,
            vectorised=arrays,
            progress=part(tell, 0, parts),
        )
        for turn, (asked, sign) in enumerate(sides, 1):
            judge = Limited(function, domain.names, asked, sign, budget=budget, vectorised=arrays)
            tick = part(tell, turn, parts) or None
            found.append(threshold(family, judge, tolerance=tolerance, progress=tick))
            if tick:
                tick(1.0)
    below = found[0]
    possible, *staying = [_degree(one, domain.inputs.values()) for one in found]
    necessary = max(1 - high for _, high in staying), max(1 - low for low, _ in staying)
    ends = {name: whole.bounds(name) for name in limits}
    margin = {name: (limits[name] - high, limits[name] - low) for name, (low, high) in ends.items()}
    at = below.witness
    witness = None if at is None else dict(zip(domain.names, map(float, at), strict=True))
    levels_of, runs = tuple(domain.alpha), whole.runs + sum(one.runs for one in found)
    return Decision(possible, necessary, margin, levels_of, witness, str(whole.claim), runs)


@np.errstate(invalid="ignore", divide="ignore")
def takes_arrays(
    function: Callable[..., object],
    names: Sequence[str],
    lower: Array,
    upper: Array,
    limits: Limits,
) -> bool:
    """Whether a function gives for arrays of points what it encloses; else it is run by points.

    Raises:
        ValueError: It cannot be enclosed, so that nothing of it can be proved, or a limit names no
            output.
    """
    points = np.stack([lower, upper])
    try:
        found = Enclosed(function, names)(points, points)
    except ValueError as error:
        what = f"{error}; of any other function `propagate` estimates bounds to set beside a limit"
        raise ValueError(f"nothing is proved: {what}") from None
    for name in limits:
        if name not in found:
            raise ValueError(f"limit '{name}' names no output; there are {', '.join(found)}")
    try:
        given = function(**dict(zip(names, points.T, strict=True)))
        values = given.values() if isinstance(given, Mapping) else [given]
        pairs = zip(found.values(), values, strict=True)
        return all(np.allclose(one.value, np.asarray(value, float)) for one, value in pairs)
    except Exception:
        return False


def _degree(found: Threshold, numbers: Iterable[FuzzyNumber]) -> tuple[float, float]:
    """Bounds of the possibility that a box of the cuts is left: of the highest α with a witness."""
    upper = 1.0 if found.safe is None else max(1 - found.safe, 0.0)
    if found.witness is None:
        return 0.0, upper
    return min(number.known(1 - min(found.unsafe, 1.0)) for number in numbers), upper


def safe_scale(
    function: Callable[..., object],
    nominal: Mapping[str, float],
    tolerances: Mapping[str, float | tuple[float, float]],
    limits: Limits,
    *,
    most: float = 10.0,
    tolerance: float = 1e-8,
    budget: int = 50_000,
    progress: Progress | bool | None = None,
) -> Threshold:
    """Largest factor on given tolerances for which the limits provably hold.

    Args:
        function: Written in arithmetic and numpy's functions, as for `BranchAndBound`.
        nominal: Nominal value of every input.
        tolerances: ± of each input, or (below, above); one that is left out is exact.
        limits: Limit by output.
        most: Largest factor that is asked for.
        tolerance: Wanted distance of the proved and the refuted factor, as a share of `most`.
        budget: As for `decide`.
        progress: As for `propagate`.

    Raises:
        CampaignError: The function has no value at the nominal inputs.
        ValueError: A number is not finite, a tolerance is negative or names no input, a limit
            names no output, or the function cannot be enclosed.
    """
    limits = finite_by_name("limits", limits, "{'y': 4.5}")
    nominal = finite_by_name("nominal values", nominal, "{'x': 1.0}")
    positive("most", most)
    positive("the tolerance", tolerance)
    if not isinstance(tolerances, Mapping):
        raise ValueError(f"the tolerances are {tolerances!r}; they must be ± by name: {{'x': 0.1}}")
    unknown = sorted(set(tolerances) - set(nominal))
    if unknown:
        raise ValueError(
            f"the tolerances name {', '.join(unknown)}; inputs are {', '.join(nominal)}"
        )
    pairs = np.array([_reach(tolerances.get(name, 0.0)) for name in nominal])
    if not (pairs >= 0).all():
        raise ValueError(
            f"the tolerances are {dict(tolerances)}; they must be 0 or greater, finite"
        )
    family = Scaled(np.array([*nominal.values()], float), pairs[:, 0], pairs[:, 1])
    arrays = takes_arrays(function, tuple(nominal), *family.at(0.0), limits)
    judge = Limited(function, tuple(nominal), limits, budget=budget, vectorised=arrays)
    with told(progress) as tell, on_interrupt(lambda: f"`safe_scale` {_UNKEPT}"):
        found = threshold(family, judge, most=most, tolerance=tolerance, progress=tell)
        if tell:
            tell(1.0)
        return found


def _reach(tolerance: float | tuple[float, float]) -> tuple[float, float]:
    """A tolerance below and above."""
    ends = tuple(tolerance) if isinstance(tolerance, Sequence | np.ndarray) else (tolerance,) * 2
    if len(ends) != 2:
        raise ValueError(f"a tolerance is {tolerance!r}; it must be ± or (below, above)")
    return finite("a tolerance", ends[0]), finite("a tolerance", ends[1])
