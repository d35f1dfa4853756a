"""Natural modes of a storey frame: of a chain of masses on springs, and measured ones.

Stiffnesses of the chain are k_z = 12 c_z E I / l_z³ or given, so that logarithms of stiffnesses and
masses are linear in those of the parameters. Natural frequencies rise with every stiffness and fall
with every mass (Courant and Fischer): their ranges over a box are exact.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.special import chdtri

from alphacut.base.arrays import Array
from alphacut.base.errors import RefusedError, checked_number, require
from alphacut.frame.calculus.jet import Jet
from alphacut.frame.structures.linear import undamped_modes
from alphacut.frame.structures.storey import StoreyFrame, chain_matrix, diagonal
from alphacut.fuzzy import Crisp, FuzzyNumber, from_data
from alphacut.fuzzy.knowledge.from_data import from_scatter
from alphacut.fuzzy.sets.numbers import Cut

ROUND_OFF = 1e-13  # share of the largest eigenvalue by which a computed one may be wrong
NEAR = 0.8  # share of a mode's largest amplitude from which on a floor may be the reference
MAX_SCATTER = 0.2  # deviation of the reference's amplitude, as a share of it, that is refused above
CHANCE = 1e-6  # probability below which values contradict their deviation


class Chain:
    """Chain of n masses on springs: a frame of which d parameters are uncertain.

    They are parameters of stiffness or mass; a frame softened by weights is refused, since its
    stiffnesses are no products of them.

    Attributes:
        nominal: Their nominal values, shape (d,).
        stiffness: Nominal stiffnesses, shape (n,), in N/m.
        mass: Nominal masses, shape (n,), in kg.
        powers: Exponents of the parameters in stiffnesses and masses, shape (2, n, d).
    """

    def __init__(self, frame: StoreyFrame, names: Sequence[str]) -> None:
        n, values = frame.floors, frame.parameters
        allowed = "none: a storey softened by weight has no stiffness of such a product"
        require(not frame.gravity, "frame.gravity", value=frame.gravity, allowed=allowed)
        self.powers = np.zeros((2, n, len(names)))
        allowed = f"E, I, c1 … c{n} (columns), l1 …, m1 …, or k1 … k{n} (stiffnesses)"
        for column, name in enumerate(names):
            part = re.fullmatch(r"(E|[clmkI])(\d*)", name)
            if part is None or name not in values:
                raise RefusedError("identify.parameters", name, allowed)
            floors = int(part[2]) - 1 if part[2] else slice(None)
            self.powers[int(part[1] == "m"), floors, column] = -3 if part[1] == "l" else 1
        nominal = {name: Jet.constant([value], 0) for name, value in values.items()}
        self.names, self.nominal = tuple(names), np.array([values[name] for name in names])
        self.stiffness, self.mass = frame.springs(nominal).value[0], np.asarray(frame.masses, float)

    def ranges(self, lower: Array, upper: Array) -> tuple[Array, Array]:
        """Return bounds of logarithms of stiffnesses and masses over nominal ones, (2, n) each.

        `lower` and `upper` are corners of a box of logarithms of parameters over nominal values,
        shape (d,); stiffnesses come first in the bounds.
        """
        ends = np.sort([self.powers * lower, self.powers * upper], axis=0).sum(-1)
        return ends[0], ends[1]


def chain_modes(stiffness: Array, mass: Array) -> tuple[Array, Array]:
    """Return eigenvalues ω² (S, n) and shapes (S, floor, mode) of chains, as `undamped_modes`."""
    return undamped_modes(diagonal(mass), chain_matrix(stiffness))


def eigenvalue_ranges(chain: Chain, lower: Array, upper: Array) -> tuple[Array, Array]:
    """Return proved bounds of eigenvalues ω² over a box of `Chain.ranges`, (n,) each, in 1/s²."""
    # they rise with every stiffness and fall with every mass
    low, high = chain.ranges(lower, upper)
    stiffness = chain.stiffness * np.exp(np.stack([low[0], high[0]]))
    mass = chain.mass * np.exp(np.stack([high[1], low[1]]))
    values, _ = chain_modes(stiffness, mass)
    rounding = ROUND_OFF * values[:, -1:] * values.shape[1]
    return (values - rounding)[0], (values + rounding)[1]


@dataclass(frozen=True)
class MeasuredMode:
    """One mode of a frame as measured.

    Args:
        mode: Its number by rising frequency, from 1.
        frequency: Natural frequency, in Hz.
        shape: Amplitude by floor, from 1, as a fraction of that of the reference floor, which is
            left out.
        reference: The floor whose amplitude is 1; 0 where no shape was measured.

    Raises:
        RefusedError: A number is below 1, a frequency not positive, or the reference in the shape.
    """

    mode: int
    frequency: FuzzyNumber
    shape: Mapping[int, FuzzyNumber] = field(default_factory=dict)
    reference: int = 0

    def __post_init__(self) -> None:
        numbers, mode, hertz = [self.mode, *self.shape], f"mode {self.mode}", self.frequency.nominal
        allowed = "numbers from 1 on"
        require(min(numbers) >= 1, f"{mode}: mode and floors", value=numbers, allowed=allowed)
        require(hertz > 0, f"{mode}: frequency", value=hertz, allowed="positive values in Hz")
        is_beside = not self.shape or (self.reference >= 1 and self.reference not in self.shape)
        allowed = "a floor beside those of the shape"
        require(is_beside, f"{mode}: reference", value=self.reference, allowed=allowed)

    @property
    def quantities(self) -> dict[str, FuzzyNumber]:
        """Measured quantities by name: "f1", and "shape1_3" for the third floor."""
        amplitudes = {f"shape{self.mode}_{floor}": number for floor, number in self.shape.items()}
        return {f"f{self.mode}": self.frequency, **amplitudes}

    def require_scatter(self) -> None:
        """Refuse a crisp frequency or amplitude, from which nothing can be learned."""
        for name, number in self.quantities.items():
            kind = "frequency" if number is self.frequency else "shape"
            value, allowed = f"{name} = {number.nominal:.4g} without scatter", "values that scatter"
            cure = f"measure several times, or set {kind}_deviation, such as 0.01"
            is_wide = not isinstance(number, Crisp)
            require(is_wide, f"mode {self.mode}", value=value, allowed=allowed, cure=cure)

    def ranges(self, cut: Callable[[FuzzyNumber], Cut]) -> ModeCut:
        """Return ranges of eigenvalue and amplitudes, given a function that cuts fuzzy numbers."""
        low, high = (2 * np.pi * np.maximum(cut(self.frequency), 0.0)) ** 2
        shape = {floor: cut(number) for floor, number in self.shape.items()}
        shape |= {self.reference: Cut(1.0, 1.0)} if self.reference else {}
        return ModeCut(self.mode, float(low), float(high), shape)


@dataclass(frozen=True)
class ModeCut:
    """Ranges of a mode at a level: of its eigenvalue ω², in 1/s², and of amplitudes by floor.

    The reference floor is among the amplitudes; there are none where no shape was measured.
    """

    mode: int
    low: float
    high: float
    shape: Mapping[int, tuple[float, float]]


def measured_mode(
    mode: int,
    frequencies: Sequence[float] | Array,
    shapes: Mapping[int, Sequence[float]] | None = None,
    *,
    frequency_deviation: float | None = None,
    shape_deviation: float | None = None,
) -> MeasuredMode:
    """Return a mode from repeated measurements: mean values as fuzzy numbers with claims.

    Args:
        mode: Its number by rising frequency, from 1.
        frequencies: Measured values, in Hz.
        shapes: Measured amplitudes by floor, as many of each as frequencies. Each set is divided by
            that of the reference floor, the highest with a mean near the largest.
        frequency_deviation: Standard deviation of one value as a fraction of it, where it is known
            from elsewhere; from the values' own scatter otherwise. Of values without scatter the
            number is crisp: nothing is learned from such a mode, but it can be held out.
        shape_deviation: The same of any amplitude, as a fraction of the largest of the mode. Those
            of all floors are taken to scatter alike.

    Raises:
        RefusedError: Values contradict their deviation, counts differ, or an amplitude of the
            reference is 0 or scatters by more than `MAX_SCATTER`.
    """
    values = np.asarray(frequencies, float)
    rows = {floor: np.asarray(row, float) for floor, row in (shapes or {}).items()}
    counts = [row.size for row in rows.values()]
    are_alike = values.ndim == 1 and not set(counts) - {values.size}
    allowed = f"{values.size} of each floor, as many as frequencies"
    require(are_alike, f"mode {mode}: amplitudes", value=counts, allowed=allowed)
    spread = None if frequency_deviation is None else frequency_deviation * float(values.mean())
    number = _mean(values, spread, f"mode {mode}: frequencies", "frequency_deviation")
    if not rows:
        return MeasuredMode(mode, number)
    means = {floor: abs(float(row.mean())) for floor, row in rows.items()}
    largest = max(means.values())
    allowed = "a shape that moves a floor"
    require(largest > 0, f"mode {mode}: amplitudes", value="0 at every floor", allowed=allowed)
    reference = max(floor for floor, mean in means.items() if mean >= NEAR * largest)
    # deviation of an amplitude, relative to that of the reference floor
    deviation = shape_deviation and shape_deviation * largest / means[reference]
    shape = {}
    for floor in [floor for floor in rows if floor != reference]:
        what = f"mode {mode}: amplitudes q{floor}/q{reference} of floor {floor}"
        with np.errstate(divide="ignore", invalid="ignore"):
            ratios = rows[floor] / rows[reference]
        shape[floor] = _mean_ratio(ratios, deviation, what, reference)
    return MeasuredMode(mode, number, shape, reference)


def _mean_ratio(ratios: Array, deviation: float | None, what: str, reference: int) -> FuzzyNumber:
    """Mean of amplitude ratios (n,) as a fuzzy number, without the bias of the division."""
    # deviation of either amplitude, if known, and variance of the reference, relative to its mean
    variance = (deviation or 0.0) ** 2
    if deviation is None and len(ratios) > 1:
        variance = float(ratios.var(ddof=1) / (1 + ratios.mean() ** 2))
    value, cure = f"{np.sqrt(variance):.2g} of its amplitude", "take means of several rows"
    key = f"{what}: scatter of floor {reference}"
    is_small = bool(np.isfinite(ratios).all()) and variance <= MAX_SCATTER**2
    require(is_small, key, value=value, allowed=f"values up to {MAX_SCATTER:g}", cure=cure)
    # both amplitudes scatter; the last factor bounds the terms of second order from above
    widening = float(np.hypot(1, ratios.mean()) * np.sqrt(1 + 8 * variance))
    mean_of_inverse = 1 + variance + 3 * variance**2  # of 1/(1 + x), x normal
    combined = deviation and deviation * widening
    return _mean(np.asarray(ratios / mean_of_inverse), combined, what, "shape_deviation")


def _mean(values: Array, deviation: float | None, what: str, key: str) -> FuzzyNumber:
    """Return the mean of measured values, shape (n,), as a number with a claim.

    Without a known deviation, values that do not scatter make a crisp number.
    """
    count = len(values)
    if deviation is None:
        if np.allclose(values, values[0], 1e-12, 0.0):
            return Crisp(float(values.mean()))
        return from_data(values, "mean", law="normal")
    checked_number(f"{what}: {key}", deviation, positive=True)
    scatter = float(values.std(ddof=1)) if count > 1 else 0.0
    # chi-squared test of the scatter against the deviation
    is_plausible = (count - 1) * (scatter / deviation) ** 2 <= chdtri(max(count - 1, 1), CHANCE)
    value, allowed = f"{deviation:.3g}", f"values that explain the scatter, {scatter:.3g}"
    name = f"{what}: {key} times the mean"
    require(is_plausible, name, value=value, allowed=allowed, cure="leave it out")
    return from_scatter(float(values.mean()), deviation, count)
