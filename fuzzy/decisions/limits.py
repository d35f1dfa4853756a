"""Possibility and necessity that a function exceeds a limit, and its fuzzy safety margin, proved.

Exceeding is possible to the degree of the highest cut in which some point exceeds the limit, and
necessary to one minus the degree to which staying below is possible (Dubois and Prade, Possibility
Theory, chapter 1). Inputs with claims make a bound of the possibility one of the probability.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from alphacut.fuzzy.arguments import fuzzy_inputs
from alphacut.fuzzy.decisions.nested_boxes import ByLevel, Scaled, Threshold, Verdict, threshold
from alphacut.fuzzy.html import html_table
from alphacut.fuzzy.plans.branch_and_bound import BranchAndBound
from alphacut.fuzzy.progress_bar import Progress, part, told
from alphacut.fuzzy.propagation import propagate
from alphacut.fuzzy.samples.result import FuzzyResult
from alphacut.fuzzy.sets.boxes import Domain, levels
from alphacut.fuzzy.sets.given import finite, finite_by_name, positive
from alphacut.fuzzy.sets.numbers import Array, Crisp, FuzzyNumber, Interval

Limits = Mapping[str, float]


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
    """

    function: Callable[..., object]
    names: tuple[str, ...]
    limits: Limits
    sign: int = 1
    precision: float = 1e-9

    def __call__(self, lower: Array, upper: Array) -> Verdict:
        """What branch and bound proves of a box, two arrays of shape (inputs,)."""
        ends = zip(self.names, map(float, lower), map(float, upper), strict=True)
        inputs = {
            name: Interval(low, high) if high > low else Crisp(low) for name, low, high in ends
        }
        plan = BranchAndBound(self.function, self.precision)
        found = propagate(self.function, inputs, plan, alpha=[1.0], vectorised=True, progress=False)
        return self._verdict(found)

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
        found = self.function(**dict(zip(self.names, point[:, None], strict=True)))
        value = found[output] if isinstance(found, Mapping) else found
        return float(np.asarray(value).ravel()[0])


@dataclass(frozen=True, eq=False, repr=False)
class Decision:
    """How possible and how necessary it is that a limit is exceeded.

    Args:
        possibility: Proved lower and upper bound.
        necessity: Proved lower and upper bound.
        margin: Limit less output at each level, lower and upper ends by output, over `alpha`.
        alpha: Levels of the margin.
        witness: The most possible inputs found that exceed a limit; None where none do.
        claim: What the cuts of the inputs claim.
    """

    possibility: tuple[float, float]
    necessity: tuple[float, float]
    margin: Mapping[str, tuple[Array, Array]]
    alpha: tuple[float, ...]
    witness: Mapping[str, float] | None
    claim: str

    @property
    def verdict(self) -> str:
        """Safe where exceeding is proved impossible, unsafe where it is proved necessary to 1."""
        if self.possibility[1] == 0:
            return "safe"
        return "unsafe" if self.necessity[0] == 1 else "undecided"

    def __str__(self) -> str:
        """The decision in a line, with what is claimed."""
        (a, b), (c, d) = self.possibility, self.necessity
        degrees = f"possibility of exceeding {a:.6g} … {b:.6g}, necessity {c:.6g} … {d:.6g}"
        return "\n".join([f"{self.verdict}: {degrees}", *([self.claim] if self.claim else [])])

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
    progress: Progress | bool | None = None,
) -> Decision:
    """Decision on whether outputs exceed their limits, any of them.

    Args:
        function: Written in arithmetic and numpy's functions, as for `BranchAndBound`.
        inputs: Fuzzy inputs; claims are joined as `propagate` does.
        limits: Limit by output; `{"y": limit}` of a function without named outputs.
        alpha: Levels of the safety margin; 0, ¼, ½, ¾, 1 if not given.
        tolerance: Wanted distance of the bounds of possibility and necessity.
        progress: As for `propagate`.

    Raises:
        ValueError: An argument is wrong, or a limit is not finite or names no output.
    """
    limits = finite_by_name("limits", limits, "{'y': 4.5}")
    positive("the tolerance", tolerance)
    domain = Domain(fuzzy_inputs(inputs), levels(4) if alpha is None else alpha)
    sides = [(limits, 1), *(({name: limit}, -1) for name, limit in limits.items())]
    family, parts, found = ByLevel(domain), 1 + len(sides), []
    with told(progress) as tell:
        whole = propagate(
            function,
            domain.inputs,
            BranchAndBound(function),
            alpha=domain.alpha,
            vectorised=True,
            progress=part(tell, 0, parts),
        )
        for name in limits:
            whole.column(name)
        for turn, (asked, sign) in enumerate(sides, 1):
            judge = Limited(function, domain.names, asked, sign)
            tick = part(tell, turn, parts) or None
            found.append(threshold(family, judge, tolerance=tolerance, progress=tick))
            if tick:
                tick(1.0)
    below, *above = found
    possible = _degree(below)
    staying = [_degree(one) for one in above]
    necessary = max(1 - high for _, high in staying), max(1 - low for low, _ in staying)
    margin = {}
    for name, limit in limits.items():
        lower, upper = whole.bounds(name)
        margin[name] = (limit - upper, limit - lower)
    witness = (
        None
        if below.witness is None
        else dict(zip(domain.names, map(float, below.witness), strict=True))
    )
    return Decision(possible, necessary, margin, tuple(domain.alpha), witness, str(whole.claim))


def _degree(found: Threshold) -> tuple[float, float]:
    """Bounds of the possibility that a box of the cuts is left: of the highest α with a witness."""
    upper = 1.0 if found.safe is None else max(1 - found.safe, 0.0)
    lower = 0.0 if found.witness is None else 1 - min(found.unsafe, 1.0)
    return lower, upper


def safe_scale(
    function: Callable[..., object],
    nominal: Mapping[str, float],
    tolerances: Mapping[str, float | tuple[float, float]],
    limits: Limits,
    *,
    most: float = 10.0,
    tolerance: float = 1e-8,
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
        progress: As for `propagate`.

    Raises:
        ValueError: A number is not finite, or a tolerance is negative or names no input.
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
    judge = Limited(function, tuple(nominal), limits)
    with told(progress) as tell:
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
