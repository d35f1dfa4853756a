"""Floor spectra: peaks of oscillators that stand on the floors of an uncertain structure."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from alphacut.base.arrays import Array
from alphacut.base.errors import checked_number, require
from alphacut.base.number_text import Table, engineering, number_text, rounded_ends
from alphacut.base.progress_bar import Progress, nth_subprogress, progress_reporter
from alphacut.frame.analyses.answer import Answer, Record, known, table_of
from alphacut.frame.analyses.floor_oscillators import (
    FloorOscillators,
    FloorValues,
    mean_values,
    moved_by,
    observed_accelerations,
)
from alphacut.frame.analyses.peaks import PEAK_ERROR
from alphacut.frame.analyses.suites import record_names
from alphacut.frame.boxes import ALPHA, boxes
from alphacut.frame.dynamics.flow import time_nodes
from alphacut.frame.records.history import Accelerogram
from alphacut.frame.spectra.response_spectrum import checked_periods
from alphacut.frame.structures.model import StructureModel
from alphacut.fuzzy import FuzzyNumber
from alphacut.fuzzy.result import Nature


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class FloorSpectrum(Answer):
    """Floor spectra of a structure over the tolerances of its inputs.

    Args:
        damping: Damping ratio of the oscillators.
        outputs: Names of the accelerations of the floors.
        alpha: Levels, rising, shape (levels,).
        periods: Periods of the oscillators in s, as they were given, shape (P,).
        nominal: Floor spectra at the nominal inputs, in m/s², shape (outputs, P).
        bound: Upper bounds of the spectra in each cut, in m/s², shape (levels, outputs, P);
            infinite where none is known.
        attained: Largest value in each cut that some inputs are known to have, the same shape;
            -∞ where none is known.
        natures: Guarantee of the bounds of each output and period, nested sequences.
        suite: Names of the records over which all values are means; empty for one motion.
        unproved: Why some bounds are not guaranteed; empty if all are.
    """

    key = "floor_spectrum"
    title = "Which accelerations do oscillators on the floors have?"
    damping: float
    outputs: tuple[str, ...]
    alpha: Array
    periods: Array
    nominal: Array
    bound: Array
    attained: Array
    natures: tuple[tuple[Nature, ...], ...]
    unproved: str = ""
    suite: tuple[str, ...] = ()

    def table(self) -> Table:
        """Return a table of texts with a row for each output and period, at the lowest level.

        The columns are output with period, the bound, its guarantee, the attained value, and the
        value at the nominal inputs.
        """
        rows = []
        for k, name in enumerate(self.outputs):
            for p, period in enumerate(map(float, self.periods)):
                nature = self.natures[k][p]
                _, bound = rounded_ends(0.0, float(self.bound[0, k, p]), nature)
                attained = float(self.attained[0, k, p])
                row = {
                    "spectrum of": f"{name}, T = {period:.4g} s",
                    f"Sa at α = {self.alpha[0]:g}": "not bounded",
                    "nature": self.nature_text(nature),
                    "reached": "not known",
                    "nominal": engineering(float(self.nominal[k, p]), "m/s^2"),
                }
                if np.isfinite(bound):
                    row[f"Sa at α = {self.alpha[0]:g}"] = f"≤ {number_text(bound)} m/s^2"
                if np.isfinite(attained):
                    row["reached"] = engineering(attained, "m/s^2")
                rows.append(row)
        return table_of(rows)

    @property
    def largest_rows(self) -> list[int]:
        """Numbers of the rows of `table` with the largest bound of each output, from 0 on."""
        count = len(self.periods)
        return [k * count + int(self.bound[0, k].argmax()) for k in range(len(self.outputs))]

    def records(self) -> list[Record]:
        """Return a row for each output, level and period, in s and m/s²; None where unknown."""
        rows: list[Record] = []
        for k, name in enumerate(self.outputs):
            for j, level in enumerate(map(float, self.alpha)):
                for p, period in enumerate(map(float, self.periods)):
                    row: Record = {
                        "output": name,
                        "alpha": level,
                        "period [s]": period,
                        "nominal [m/s^2]": float(self.nominal[k, p]),
                        "attained [m/s^2]": known(self.attained[j, k, p]),
                        "bound [m/s^2]": known(self.bound[j, k, p]),
                        "nature": str(self.natures[k][p]),
                    }
                    rows.append(row)
        return rows

    def words(self) -> str:
        """Return sentences on the oscillators, the curves, and what is not proved."""
        unproved = f" Not all bounds are guaranteed: {self.unproved}." if self.unproved else ""
        what = "Largest"
        if self.suite:
            what = f"Mean over {len(self.suite)} records of the largest"
        return (
            f"{what} |ω² w| of an oscillator with the damping ratio {self.damping:.3g} and the"
            " relative displacement w that stands on the floor and is too light to move it, within"
            " the duration. Some structure of the cut has the attained value, and none has more"
            f" than a guaranteed bound.{unproved}"
        )


def floor_spectrum(
    structure: StructureModel,
    inputs: Mapping[str, FuzzyNumber | float],
    outputs: str | Sequence[str],
    periods: ArrayLike,
    damping: float = 0.05,
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
        damping: Damping ratio of the oscillators, from 0 to 0.999.
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
    ratio = checked_number("damping", damping, least=0, most=0.999)
    time_nodes(duration, step)  # refuses what is not whole steps, before these are divided
    cuts = boxes(inputs, alpha)
    motions = [(x,) if isinstance(x, Accelerogram) else tuple(x) for x in records]
    systems = [
        observed_accelerations(moved, names, inputs) for moved in moved_by(structure, motions)
    ]
    floor = FloorOscillators.of(systems[0], cuts, ratio, duration=duration, step=step, error=error)
    floors = [replace(floor, system=system) for system in systems]
    columns: list[FloorValues] = []
    with progress_reporter(progress) as report:
        for p, period in enumerate(map(float, shaped)):
            tick = nth_subprogress(report, p, len(shaped))
            of_records = [
                moved.values(period, nth_subprogress(tick, r, len(floors)))
                for r, moved in enumerate(floors)
            ]
            columns.append(mean_values(of_records, cuts))
    natures = [[column.natures[k] for column in columns] for k in range(len(names))]
    is_proved = all(nature is Nature.GUARANTEED for row in natures for nature in row)
    reason = floor.unproved or "branch and bound and the dual bound find none there"
    return FloorSpectrum(
        encloses=columns[0].encloses,
        damping=ratio,
        outputs=floor.system.outputs,
        alpha=cuts.alpha,
        periods=shaped,
        nominal=np.stack([column.nominal for column in columns], axis=-1),
        bound=np.stack([column.bound for column in columns], axis=-1),
        attained=np.stack([column.attained for column in columns], axis=-1),
        natures=tuple(map(tuple, natures)),
        unproved="" if is_proved else reason,
        suite=tuple(record_names(motions)) if motions else (),
    )
