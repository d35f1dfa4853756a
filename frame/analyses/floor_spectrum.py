"""Floor spectra: peaks of oscillators that stand on the floors of an uncertain structure."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Annotated, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from alphacut.base.arrays import Array
from alphacut.base.errors import checked_number, require
from alphacut.base.number_text import engineering, number_text, rounded_ends
from alphacut.base.progress_bar import Progress, nth_subprogress, progress_reporter
from alphacut.base.quantity import Quantity
from alphacut.frame.analyses.answer import Answer, Row
from alphacut.frame.analyses.floor_oscillators import (
    FloorOscillators,
    FloorValues,
    mean_values,
    moved_by,
    observed_accelerations,
    require_linear,
)
from alphacut.frame.analyses.peaks import PEAK_ERROR
from alphacut.frame.analyses.question import Asked, Question
from alphacut.frame.analyses.suites import record_names
from alphacut.frame.boxes import ALPHA, boxes
from alphacut.frame.dynamics.flow import time_nodes
from alphacut.frame.records.history import Accelerogram
from alphacut.frame.spectra.response_spectrum import checked_periods
from alphacut.frame.structures.linear import frequencies
from alphacut.frame.structures.model import StructureModel
from alphacut.fuzzy import FuzzyNumber
from alphacut.fuzzy.result import Nature


@dataclass(frozen=True)
class FloorQuestion(Question):
    """Spectra of light oscillators on floors, over the α-cuts of [envelope], with its time step.

    With [records] they are means over the records.

    Args:
        outputs: absolute accelerations of the floors, as a4 of [frame]
        damping: damping ratio of the oscillators; of several, as ["2 %", "5 %"], the figure shows
            all
        shortest: shortest period; short ones take long
        longest: longest period
        count: number of periods in geometric progression, beside 0, the floor's largest
            acceleration, and the nominal periods of the structure in this range
        periods: periods in place of these, as ["0 s", "0.2 s"]
    """

    records = "allowed"
    all_angles = False
    replaced: ClassVar = {"periods": ("shortest", "longest", "count")}
    outputs: tuple[str, ...]
    damping: tuple[Annotated[float, Quantity(minimum=0, maximum=0.999)], ...] = (0.05,)
    shortest: Annotated[float, Quantity("s", above=0)] = 0.05
    longest: Annotated[float, Quantity("s", above=0)] = 2.0
    count: Annotated[int, Quantity(minimum=2, maximum=500, is_integer=True)] = 20
    periods: tuple[Annotated[float, Quantity("s", minimum=0)], ...] = ()

    def __post_init__(self) -> None:
        """Refuse periods that are too short or given twice, and a range without width."""
        checked_periods(self.periods)
        checked_periods(self.shortest, "shortest")
        for name in ("periods", "damping"):
            values = getattr(self, name)
            text = ", ".join(f"{value:g}" for value in values)
            require(len(set(values)) == len(values), name, text, "each once")
        allowed = f"more than shortest, {self.shortest:g} s"
        require(self.shortest < self.longest, "longest", f"{self.longest:g} s", allowed)

    def require(self, model: StructureModel, components: int) -> None:
        """Refuse a structure without floor spectra, and outputs that are no accelerations."""
        motions = [(Accelerogram(1.0, np.zeros(2)),) * components] if components else []
        (moved,) = moved_by(model, motions)
        observed_accelerations(moved, self.outputs, {})

    def periods_of(self, model: StructureModel) -> Array:
        """Return the periods in s, shape (periods,), and nominal ones of the structure in a range.

        Spectra are largest about these.
        """
        if self.periods:
            return np.array(self.periods)
        stated = np.append(0.0, np.geomspace(self.shortest, self.longest, self.count))
        own = 2 * np.pi / frequencies(require_linear(model))
        return np.union1d(stated, own[(own >= self.shortest) & (own <= self.longest)])

    def answer(self, asked: Asked, progress: Progress) -> FloorSpectrum:
        """Return the bounds; with records, for the duration of the longest response."""
        durations = [record.duration for record in asked.records]
        return floor_spectrum(
            asked.model,
            asked.inputs,
            self.outputs,
            self.periods_of(asked.model),
            self.damping,
            duration=max(durations, default=asked.duration),
            step=asked.step,
            alpha=asked.alpha,
            records=[record.components for record in asked.records],
            progress=progress,
        )


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class FloorSpectrum(Answer):
    """Floor spectra of a structure over the tolerances of its inputs.

    Args:
        outputs: Name of the acceleration of the floor of each curve. An output has a curve for each
            damping ratio, one behind the other.
        damping: Damping ratio of the oscillators of each curve.
        alpha: Levels, rising, shape (levels,).
        periods: Periods of the oscillators in s, as they were given, shape (P,).
        nominal: Floor spectra at the nominal inputs, in m/s², shape (curves, P).
        bound: Upper bounds of the spectra in each cut, in m/s², shape (levels, curves, P);
            infinite where none is known.
        attained: Largest value in each cut that some inputs are known to have, the same shape;
            -∞ where none is known.
        natures: Guarantee of the bounds of each curve and period, nested sequences.
        suite: Names of the records over which all values are means; empty for one motion.
        unproved: Why some bounds are not guaranteed; empty if all are.
    """

    key = "floor_spectrum"
    title = "Which accelerations do oscillators on the floors have?"
    outputs: tuple[str, ...]
    damping: tuple[float, ...]
    alpha: Array
    periods: Array
    nominal: Array
    bound: Array
    attained: Array
    natures: tuple[tuple[Nature, ...], ...]
    unproved: str = ""
    suite: tuple[str, ...] = ()

    def text_rows(self) -> Iterator[Row]:
        """Yield a row for each curve and period, at the lowest level.

        The columns are output with period, and with the damping ratio if there are several, the
        bound, its guarantee, the attained value, and the value at the nominal inputs.
        """
        is_one = len(set(self.damping)) == 1
        for k, name in enumerate(self.outputs):
            for p, period in enumerate(map(float, self.periods)):
                nature = self.natures[k][p]
                _, bound = rounded_ends(0.0, float(self.bound[0, k, p]), nature)
                attained = float(self.attained[0, k, p])
                damping = "" if is_one else f", ζ = {self.damping[k]:.3g}"
                row: dict[str, str | Nature] = {
                    "spectrum of": f"{name}, T = {period:.4g} s{damping}",
                    f"Sa at α = {self.alpha[0]:g}": "not bounded",
                    "nature": nature,
                    "reached": "not known",
                    "nominal": engineering(float(self.nominal[k, p]), "m/s^2"),
                }
                if np.isfinite(bound):
                    row[f"Sa at α = {self.alpha[0]:g}"] = f"≤ {number_text(bound)} m/s^2"
                if np.isfinite(attained):
                    row["reached"] = engineering(attained, "m/s^2")
                yield row

    @property
    def largest_rows(self) -> list[int]:
        """Numbers of the rows of `table` with the largest bound of each curve, from 0 on."""
        count = len(self.periods)
        return [k * count + int(self.bound[0, k].argmax()) for k in range(len(self.outputs))]

    def number_rows(self) -> Iterator[Row]:
        """Yield a row for each curve, level and period, in s and m/s²."""
        for k, name in enumerate(self.outputs):
            for j, level in enumerate(self.alpha):
                for p, period in enumerate(self.periods):
                    yield {
                        "output": name,
                        "damping ratio": self.damping[k],
                        "alpha": level,
                        "period [s]": period,
                        "nominal [m/s^2]": self.nominal[k, p],
                        "attained [m/s^2]": self.attained[j, k, p],
                        "bound [m/s^2]": self.bound[j, k, p],
                        "nature": str(self.natures[k][p]),
                    }

    def words(self) -> str:
        """Return sentences on the oscillators, the curves, and what is not proved."""
        unproved = f" Not all bounds are guaranteed: {self.unproved}." if self.unproved else ""
        what = "Largest"
        if self.suite:
            what = f"Mean over {len(self.suite)} records of the largest"
        damping = " or ".join(f"{ratio:.3g}" for ratio in dict.fromkeys(self.damping))
        return (
            f"{what} |ω² w| of an oscillator with the damping ratio {damping} and the"
            " relative displacement w that stands on the floor and is too light to move it, within"
            " the duration. Some structure of the cut has the attained value, and none has more"
            f" than a guaranteed bound.{unproved}"
        )


def floor_spectrum(
    structure: StructureModel,
    inputs: Mapping[str, FuzzyNumber | float],
    outputs: str | Sequence[str],
    periods: ArrayLike,
    damping: float | Sequence[float] = 0.05,
    *,
    duration: float,
    step: float,
    alpha: Sequence[float] = ALPHA,
    error: float = PEAK_ERROR,
    records: Sequence[Accelerogram | Sequence[Accelerogram]] = (),
    progress: Progress | bool | None = None,
) -> FloorSpectrum:
    """Return upper bounds of the floor spectra of a structure over its uncertain inputs.

    An oscillator of the period T = 2π/ω and the damping ratio ζ stands on a floor that moves with
    the absolute acceleration a. Its displacement w relative to the floor follows from w'' +
    2 ζ ω w' + ω² w = -a, from rest, and the floor spectrum is the largest |ω² w| up to the
    duration, between time nodes as well. The oscillator does not act on the structure. It may have
    the frequency of a mode.

    Args:
        structure: A linear structure at rest, moved by the ground alone.
        inputs: Fuzzy parameters by name, in SI units; a number is a crisp one.
        outputs: Names of absolute accelerations, one or more: "a3" of a storey frame.
        periods: Periods in s, 0 or from 0.001 s on. At 0 the spectrum is the floor's largest
            acceleration.
        damping: Damping ratio of the oscillators, from 0 to 0.999, or several, each once.
        duration: Length of the simulation, in s. An oscillator may swing higher after the record.
        step: Largest distance of the time nodes, in s. It is divided for short periods.
        alpha: Levels, rising within [0, 1].
        error: Error that is aimed at, and need not be reached, as a fraction of each value.
        records: Records, or the components of each, which move the structure one after the other
            in place of its own ground motion; the spectra are then means over them.
        progress: Called with the completed fraction; None shows a bar on a terminal, False shows
            nothing.

    Raises:
        RefusedError: The structure is not linear, not at rest, under forces, or not moved by plain
            records; an output is no absolute acceleration; or an argument is not as said.
        FailedError: A step is too long, or no bounds are found.

    Example:
        >>> from alphacut.frame import Accelerogram, StoreyFrame, floor_spectrum
        >>> from alphacut.fuzzy import Interval
        >>> pulse = Accelerogram(0.02, [0.0, 3.0, -3.0, 0.0])
        >>> frame = StoreyFrame([2e4], stiffness=[8e6], damping_ratio=0.05, ground=pulse)
        >>> inputs = {"k1": Interval(7.8e6, 8.2e6)}
        >>> found = floor_spectrum(frame, inputs, "a1", [0.1, 0.3], duration=1.0, step=0.01)
        >>> found.natures[0][0], bool((found.attained <= found.bound).all())
        (<Nature.GUARANTEED: 'guaranteed'>, True)
    """
    names = (outputs,) if isinstance(outputs, str) else tuple(outputs)
    require(len(names) > 0, "outputs", None, "one acceleration or more")
    shaped = checked_periods(periods).ravel()
    require(len(shaped) > 0, "periods", None, "one period or more")
    ratios = [
        checked_number("damping", x, least=0, most=0.999) for x in np.atleast_1d(damping).tolist()
    ]
    is_once = len(set(ratios)) == len(ratios) > 0
    require(is_once, "damping", damping, "one damping ratio or more, each once")
    time_nodes(duration, step)  # refuses what is not whole steps, before these are divided
    cuts = boxes(inputs, alpha)
    motions = [(x,) if isinstance(x, Accelerogram) else tuple(x) for x in records]
    systems = [
        observed_accelerations(moved, names, inputs) for moved in moved_by(structure, motions)
    ]
    floor = FloorOscillators.of(
        systems[0], cuts, ratios[0], duration=duration, step=step, error=error
    )
    by_ratio: list[list[FloorValues]] = []  # with an entry for each period
    with progress_reporter(progress) as report:
        for r, ratio in enumerate(ratios):
            floors = [replace(floor, system=system, damping=ratio) for system in systems]
            tick = nth_subprogress(report, r, len(ratios))
            by_ratio.append(_values_of_periods(floors, shaped, tick))

    def of_curves(field: str) -> Array:
        """Return values of all curves from the field of `FloorValues`, shape (…, curves, P)."""
        columns = [[getattr(values, field) for values in found] for found in by_ratio]
        values = np.moveaxis(np.array(columns), (0, 1), (-2, -1))  # (…, outputs, ratios, P)
        return values.reshape(*values.shape[:-3], -1, len(shaped))

    natures = tuple(
        tuple(values.natures[k] for values in found)
        for k in range(len(names))
        for found in by_ratio
    )
    is_proved = all(nature is Nature.GUARANTEED for row in natures for nature in row)
    reason = floor.unproved or "branch and bound and the dual bound find none there"
    return FloorSpectrum(
        encloses=by_ratio[0][0].encloses,
        outputs=tuple(name for name in floor.system.outputs for _ in ratios),
        damping=tuple(ratios) * len(names),
        alpha=cuts.alpha,
        periods=shaped,
        nominal=of_curves("nominal"),
        bound=of_curves("bound"),
        attained=of_curves("attained"),
        natures=natures,
        unproved="" if is_proved else reason,
        suite=tuple(record_names(motions)) if motions else (),
    )


def _values_of_periods(
    floors: Sequence[FloorOscillators], periods: Array, progress: Progress
) -> list[FloorValues]:
    """Return the values at each period in s, which are means over motions of the structure.

    Args:
        floors: The oscillators on the structure under each motion.
        periods: The periods, shape (P,).
        progress: Called with the completed fraction.
    """
    found = []
    for p, period in enumerate(map(float, periods)):
        tick = nth_subprogress(progress, p, len(periods))
        of_motions = [
            floor.values(period, nth_subprogress(tick, r, len(floors)))
            for r, floor in enumerate(floors)
        ]
        found.append(mean_values(of_motions, floors[0].cuts))
    return found
