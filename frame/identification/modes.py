"""Natural modes of a storey frame: of a chain of masses on springs, and measured ones.

The stiffnesses of the chain are k_z = 12 c_z E I / l_z³ or given, so that the logarithms of
stiffnesses and masses are linear in the logarithms of the parameters. Natural frequencies rise with
every stiffness and fall with every mass (Courant and Fischer), so that their ranges over a box are
exact.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from alphacut.base.arrays import Array
from alphacut.base.errors import RefusedError, checked_number, require, require_numbers
from alphacut.frame.calculus.polynomials import Jet
from alphacut.frame.structures.linear import undamped_modes
from alphacut.frame.structures.storey import StoreyFrame, chain_matrix, diagonal
from alphacut.fuzzy import Crisp, FuzzyNumber, from_data
from alphacut.fuzzy.knowledge.from_data import from_scatter
from alphacut.fuzzy.sets.numbers import Cut


class Chain:
    """Chain of masses on springs: a storey frame with uncertain parameters.

    Args:
        frame: The frame. It must not be softened by weights, since its stiffnesses are no products
            of parameters then.
        names: Names of the uncertain parameters, which are parameters of stiffness or mass.

    Attributes:
        names: Names of the parameters.
        nominal: Their nominal values, shape (parameters,).
        stiffness: Nominal stiffnesses, shape (floors,), in N/m.
        mass: Nominal masses, shape (floors,), in kg.
        powers: Exponents of the parameters in stiffnesses and in masses, shape (2, floors,
            parameters).

    Raises:
        RefusedError: A name is no parameter of stiffness or mass, or weights soften the frame.
    """

    def __init__(self, frame: StoreyFrame, names: Sequence[str]) -> None:
        """Read the exponents of the parameters off their names, such as "k1", "E" or "l2"."""
        n = frame.floors
        values = frame.parameters
        allowed = "none: a storey softened by weight has no stiffness of such a product"
        require(not frame.gravity, "frame.gravity", value=frame.gravity, allowed=allowed)
        self.names = tuple(names)
        self.powers = np.zeros((2, n, len(names)))
        allowed = f"E, I, c1 … c{n} (columns), l1 …, m1 …, or k1 … k{n} (stiffnesses)"
        for column, name in enumerate(names):
            match = re.fullmatch(r"(E|[clmkI])(\d*)", name)
            if match is None or name not in values:
                raise RefusedError("identify.parameters", name, allowed)
            kind, number = match.groups()
            floors = slice(None)  # a name without a number stands for all floors
            if number:
                floors = slice(int(number) - 1, int(number))
            exponent = {"l": -3}.get(kind, 1)
            self.powers[int(kind == "m"), floors, column] = exponent
        constants = {name: Jet.constant([value], 0) for name, value in values.items()}
        self.nominal = np.array([values[name] for name in names])
        self.stiffness = frame.springs(constants).value[0]
        self.mass = np.asarray(frame.masses, float)

    def ranges(self, lower: Array, upper: Array) -> tuple[Array, Array]:
        """Return the exact ranges of stiffnesses and masses over a box of parameters.

        Parameters, stiffnesses and masses are all given by the logarithm of the value over the
        nominal value. In these the stiffnesses and masses are linear.

        Args:
            lower: Lower ends of the box, shape (parameters,).
            upper: Upper ends of the box.

        Returns:
            Lower and upper ends, shape (2, floors) each: the first row has the stiffnesses of the
            storeys, the second one the masses of the floors.
        """
        # A linear function has its extremes over a box at the ends of each coordinate.
        ends = np.sort([self.powers * lower, self.powers * upper], axis=0).sum(axis=-1)
        return ends[0], ends[1]


def chain_modes(stiffness: Array, mass: Array) -> tuple[Array, Array]:
    """Return the eigenvalues ω² and the mode shapes of chains of masses on springs.

    Args:
        stiffness: Stiffnesses of the springs, shape (…, floors): the first one joins the ground and
            the first mass, the next one the first and the second mass, and so on.
        mass: Masses, same shape, positive.

    Returns:
        The eigenvalues, rising, shape (…, floors), and the mode shapes φ as columns with
        φᵀM φ = 1, shape (…, floors, modes).

    Raises:
        numpy.linalg.LinAlgError: A mass is not positive.
    """
    return undamped_modes(diagonal(mass), chain_matrix(stiffness))


def eigenvalue_ranges(chain: Chain, lower: Array, upper: Array) -> tuple[Array, Array]:
    """Return proved bounds of all eigenvalues ω² of a chain over a box of parameters, in 1/s².

    Eigenvalues rise with every stiffness and fall with every mass (Courant and Fischer), so that
    they are smallest for the smallest stiffnesses and the largest masses. They are computed there
    and at the opposite corner, and moved outwards by a bound of their rounding.

    Args:
        chain: The chain.
        lower: Lower ends of the box, shape (parameters,): logarithms of the parameters over their
            nominal values.
        upper: Upper ends of the box.

    Returns:
        Lower and upper bounds of the eigenvalues in rising order, shape (floors,) each. A lower
        bound may be slightly negative by rounding.
    """
    low, high = chain.ranges(lower, upper)
    stiffness = chain.stiffness * np.exp(np.stack([low[0], high[0]]))
    mass = chain.mass * np.exp(np.stack([high[1], low[1]]))
    values, _ = chain_modes(stiffness, mass)
    # Computed eigenvalues have errors of some units of rounding of the largest one.
    rounding = 1e-13 * values[:, -1:] * values.shape[1]
    return (values - rounding)[0], (values + rounding)[1]


@dataclass(frozen=True)
class MeasuredMode:
    """A measured mode of a frame.

    Args:
        mode: Number of the mode by rising frequency, from 1.
        frequency: Natural frequency, in Hz.
        shape: Amplitude by floor, from 1, as a fraction of the amplitude of the reference floor,
            which is left out.
        reference: Floor whose amplitude is 1; 0 if no shape was measured.

    Raises:
        RefusedError: A number is below 1, the frequency is not positive, or the shape contains the
            reference floor or has none.
    """

    mode: int
    frequency: FuzzyNumber
    shape: Mapping[int, FuzzyNumber] = field(default_factory=dict)
    reference: int = 0

    def __post_init__(self) -> None:
        """Check the numbers of mode and floors, the frequency and the reference floor.

        Raises:
            RefusedError: The number of the mode or of a floor is below 1; the nominal frequency is
                not positive; or a shape has no reference floor, or one among its own floors.
        """
        key = f"mode {self.mode}"
        hertz = self.frequency.nominal
        numbers = [self.mode, *self.shape]
        allowed = "numbers from 1 on"
        require(min(numbers) >= 1, f"{key}: mode and floors", value=numbers, allowed=allowed)
        require(hertz > 0, f"{key}: frequency", value=hertz, allowed="positive values in Hz")
        is_beside = not self.shape or (self.reference >= 1 and self.reference not in self.shape)
        allowed = "a floor beside those of the shape"
        require(is_beside, f"{key}: reference", value=self.reference, allowed=allowed)

    @property
    def quantities(self) -> dict[str, FuzzyNumber]:
        """Measured quantities by name, such as "f1" of mode 1 and "shape1_3" of its third floor."""
        amplitudes = {f"shape{self.mode}_{floor}": number for floor, number in self.shape.items()}
        return {f"f{self.mode}": self.frequency, **amplitudes}

    def require_scatter(self) -> None:
        """Check that the frequency and all amplitudes of the mode have a scatter.

        Raises:
            RefusedError: One of them is a crisp number. It would claim to be exact, so that hardly
                any parameters would agree with it.
        """
        for name, number in self.quantities.items():
            kind = "frequency" if number is self.frequency else "shape"
            value = f"{name} = {number.nominal:.4g} without scatter"
            cure = f"measure several times, or set {kind}_deviation, such as 0.01"
            require(
                not isinstance(number, Crisp),
                f"mode {self.mode}",
                value=value,
                allowed="values that scatter",
                cure=cure,
            )

    def ranges(self, cut: Callable[[FuzzyNumber], Cut]) -> ModeCut:
        """Return the ranges of the eigenvalue ω² and of the amplitudes of the mode on a level.

        A negative end of the frequency, which a claim from few values may have, becomes 0. The
        reference floor gets the amplitude 1 exactly; without a shape there is none.

        Args:
            cut: Function that returns both ends of a fuzzy number on the level.
        """
        # A claim from few values may reach below zero.
        frequency = np.maximum(cut(self.frequency), 0.0)
        low, high = (2 * np.pi * frequency) ** 2
        shape = {floor: cut(number) for floor, number in self.shape.items()}
        if self.reference:
            shape[self.reference] = Cut(1.0, 1.0)
        return ModeCut(self.mode, float(low), float(high), shape)


@dataclass(frozen=True)
class ModeCut:
    """Ranges of the quantities of a mode on a level.

    Args:
        mode: Number of the mode, from 1.
        low: Smallest eigenvalue ω², in 1/s².
        high: Largest eigenvalue.
        shape: Ends of the amplitude by floor, with the reference floor; empty if no shape was
            measured.
    """

    mode: int
    low: float
    high: float
    shape: Mapping[int, tuple[float, float]]


def measured_mode(
    mode: int,
    frequencies: Sequence[float] | Array,
    shapes: Mapping[int, Sequence[float] | Array] | None = None,
    *,
    frequency_deviation: float | None = None,
    shape_deviation: float | None = None,
) -> MeasuredMode:
    """Return a mode from repeated measurements, with mean values as fuzzy numbers with claims.

    Args:
        mode: Number of the mode by rising frequency, from 1.
        frequencies: Measured frequencies, in Hz, at least one.
        shapes: Measured amplitudes by floor, as many for each floor as there are frequencies. Each
            set is divided by the amplitude of the reference floor, the highest floor whose mean
            amplitude is at least 0.8 times the largest.
        frequency_deviation: Standard deviation of one measured frequency as a fraction of the mean,
            if known from elsewhere; by default the scatter of the values. Values without scatter
            give a crisp number: nothing is learned from such a mode, but it can be held out.
        shape_deviation: Standard deviation of any amplitude as a fraction of the largest amplitude
            of the mode, likewise. It is the same for all floors.

    Returns:
        The mode with its mean frequency, and with the mean ratio of each floor's amplitude to that
        of the reference floor.

    Raises:
        RefusedError: There is no frequency, a value is no finite number, values contradict their
            deviation, a deviation is not positive, the counts differ, all amplitudes are 0, or that
            of the reference floor is 0 in a measurement or scatters by more than 20 %.
    """
    key = f"mode {mode}: frequencies"
    require_numbers(key, frequencies)
    values = np.asarray(frequencies, float)
    require(values.size > 0, key, value=[], allowed="one or more, in Hz")
    rows = {}
    for floor, row in (shapes or {}).items():
        require_numbers(f"mode {mode}: amplitudes of floor {floor}", row)
        rows[floor] = np.asarray(row, float)
    counts = [row.size for row in rows.values()]
    are_alike = values.ndim == 1 and not set(counts) - {values.size}
    allowed = f"{values.size} of each floor, as many as frequencies"
    require(are_alike, f"mode {mode}: amplitudes", value=counts, allowed=allowed)
    deviation = None
    if frequency_deviation is not None:
        deviation = frequency_deviation * float(values.mean())
    frequency = _mean(values, deviation, key, "frequency_deviation")
    if not rows:
        return MeasuredMode(mode, frequency)

    means = {floor: abs(float(row.mean())) for floor, row in rows.items()}
    largest = max(means.values())
    allowed = "a shape that moves a floor"
    require(largest > 0, f"mode {mode}: amplitudes", value="0 at every floor", allowed=allowed)
    # A large amplitude scatters little in proportion; among such floors the highest one is taken.
    reference = max(floor for floor, mean in means.items() if mean >= 0.8 * largest)
    ratio_deviation = None
    if shape_deviation is not None:
        ratio_deviation = shape_deviation * largest / means[reference]
    shape = {}
    for floor in [floor for floor in rows if floor != reference]:
        what = f"mode {mode}: amplitudes q{floor}/q{reference} of floor {floor}"
        with np.errstate(divide="ignore", invalid="ignore"):
            ratios = rows[floor] / rows[reference]
        shape[floor] = _mean_ratio(ratios, ratio_deviation, what, reference)
    return MeasuredMode(mode, frequency, shape, reference)


def _mean_ratio(ratios: Array, deviation: float | None, what: str, reference: int) -> FuzzyNumber:
    """Return the mean ratio of two amplitudes as a fuzzy number, without the bias of the division.

    Args:
        ratios: Measured amplitudes over those of the reference floor, shape (measurements,).
        deviation: Standard deviation of an amplitude over the amplitude of the reference floor; if
            None, it is estimated from the scatter of the ratios.
        what: Name of the ratio in messages.
        reference: Number of the reference floor, for messages.

    Returns:
        The mean as a number that carries a claim of coverage; a crisp number if the deviation is
        estimated and the ratios do not scatter.

    Raises:
        RefusedError: The reference amplitude is 0 or scatters by more than 20 %; or the ratios
            contradict the deviation.
    """
    # With the relative error x of the reference and the error y of the other amplitude, both with
    # the variance v, a ratio is (r + y) / (1 + x). To first order its variance is v (1 + r²).
    variance = (deviation or 0.0) ** 2
    if deviation is None and len(ratios) > 1:
        variance = float(ratios.var(ddof=1) / (1 + ratios.mean() ** 2))
    value = f"{np.sqrt(variance):.2g} of its amplitude"
    cure = "take means of several rows"
    key = f"{what}: scatter of floor {reference}"
    max_scatter = 0.2  # beyond it the expansions to second order are too inaccurate
    is_small = bool(np.isfinite(ratios).all()) and variance <= max_scatter**2
    require(is_small, key, value=value, allowed=f"values up to {max_scatter:g}", cure=cure)
    # The last factor bounds the terms of second order from above.
    widening = float(np.hypot(1, ratios.mean()) * np.sqrt(1 + 8 * variance))
    mean_of_inverse = 1 + variance + 3 * variance**2  # of 1 / (1 + x) for a normal x
    if deviation is not None:
        deviation *= widening
    return _mean(np.asarray(ratios / mean_of_inverse), deviation, what, "shape_deviation")


def _mean(values: Array, deviation: float | None, what: str, key: str) -> FuzzyNumber:
    """Return the mean of measured values as a fuzzy number with a claim of coverage.

    The values are taken for independent ones of a normal distribution, and the α-cut contains its
    mean with a probability of 1 - α: by Student's distribution if the deviation is estimated from
    the values, by the normal distribution if it is known.

    Args:
        values: Measured values, shape (measurements,), at least one.
        deviation: Standard deviation of a value; if None, it is estimated, and values that do not
            scatter give a crisp number.
        what: Name of the values in messages.
        key: Name of the option that states the deviation.

    Raises:
        RefusedError: The deviation is not positive, or the values scatter so much more that they
            contradict it (with a probability of error of 1e-6).
    """
    count = len(values)
    if deviation is None:
        # Equal values have no scatter to estimate a deviation from.
        if np.allclose(values, values[0], 1e-12, 0.0):
            return Crisp(float(values.mean()))
        return from_data(values, "mean", law="normal")
    checked_number(f"{what}: {key}", deviation, positive=True)
    from scipy.special import chdtri  # takes time to import

    # Chi-squared test: the scatter would be this large with a probability of 1e-6 at most.
    scatter = 0.0
    if count > 1:
        scatter = float(values.std(ddof=1))
    threshold = chdtri(max(count - 1, 1), 1e-6)
    is_plausible = (count - 1) * (scatter / deviation) ** 2 <= threshold
    allowed = f"values that explain the scatter, {scatter:.3g}"
    name = f"{what}: {key} times the mean"
    require(is_plausible, name, value=f"{deviation:.3g}", allowed=allowed, cure="leave it out")
    return from_scatter(float(values.mean()), deviation, count)
