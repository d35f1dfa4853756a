"""Peaks over all directions from which two horizontal components of ground motion may come.

Both horizontal components are turned by an angle φ in the plane of their influence vectors ι₁ and
ι₂, from the first towards the second. What was a₁ along ι₁ and a₂ along ι₂ becomes

    a₁ cos φ − a₂ sin φ  along ι₁,    a₁ sin φ + a₂ cos φ  along ι₂.

The response of a linear structure at any time is r(φ) = r₀ + r_x cos φ + r_y sin φ, where r₀,
which is due to the start, to forces and to a third component, does not turn. With A = √(r_x² +
r_y²) and the angle ψ of (r_x, r_y) it is r₀ + A cos(φ − ψ), whose largest magnitude is |r₀| + A.
It is attained at ψ if r₀ ≥ 0, and else at ψ + π.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import cos, pi, sin
from typing import NamedTuple

import numpy as np

from alphacut.base.arrays import Array
from alphacut.base.errors import checked_number, require
from alphacut.base.number_text import Table, engineering, range_text
from alphacut.base.progress_bar import Progress, nth_subprogress
from alphacut.frame.analyses.answer import Answer, Record, known, table_of
from alphacut.frame.analyses.peaks import Peak, Peaks, close_peaks
from alphacut.frame.analyses.suites import largest_peaks
from alphacut.frame.boxes import ALPHA
from alphacut.frame.dynamics.nonlinear import make_flow
from alphacut.frame.structures.matrix import MatrixStructure
from alphacut.fuzzy import FuzzyNumber
from alphacut.fuzzy.result import Nature


class WorstCase(NamedTuple):
    """Angle in degrees, from 0 to 360, and time in s at which an attained peak occurs."""

    angle: float
    time: float


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class AnglePeaks(Answer):
    """Peaks over all angles by which two horizontal components of ground motion are turned.

    The angle turns the ground motion from the direction of the first component towards that of the
    second one.

    Args:
        alpha: Levels, shape (levels,).
        by_angle: Peaks by name under each of the directions that were bounded, by their angles in
            degrees.
        units: SI units of the outputs.
        peak: Bounds of the largest magnitude of each output over all angles and times.
        worst: Angle and time of the attained values on the lowest level; without the outputs of
            which no response is known.
    """

    key = "angles"
    title = "How far does it move, from whichever direction the ground motion comes?"
    alpha: Array
    by_angle: dict[float, Peaks]
    units: dict[str, str]
    peak: dict[str, Peak]
    worst: dict[str, WorstCase]

    def table(self) -> Table:
        """Return a table of texts with a row for each output.

        The columns are its name, the range of its peaks at the lowest level, the guarantee, the
        attained value, and its angle and time.
        """
        rows = []
        for name, peak in self.peak.items():
            unit = self.units[name]
            ends = range_text(float(peak.lower[0]), float(peak.upper[0]), peak.nature)
            row = {
                "peak of": name,
                f"at α = {self.alpha[0]:g}": f"{ends} {unit}",
                "nature": self.nature_text(peak.nature),
                "reached": "not known",
                "angle and time": "",
            }
            if name in self.worst:
                worst = self.worst[name]
                row["reached"] = engineering(float(peak.reached[0]), unit)
                row["angle and time"] = f"{worst.angle:.1f}°, {worst.time:.4g} s"
            rows.append(row)
        return table_of(rows)

    def records(self) -> list[Record]:
        """Return a row for each output, over all angles.

        The columns are its name and SI unit, the bound of the farthest peak and the attained value
        on the lowest level, angle in degrees and time of the latter, and the guarantee. Unknown
        numbers are None.
        """
        rows: list[Record] = []
        for name, peak in self.peak.items():
            worst = self.worst.get(name, WorstCase(np.nan, np.nan))
            row: Record = {
                "output": name,
                "unit": self.units[name],
                "farthest peak": known(peak.upper[0]),
                "peak reached": known(peak.reached[0]),
                "angle [deg]": known(worst.angle),
                "time [s]": known(worst.time),
                "nature": self.nature_text(peak.nature),
            }
            rows.append(row)
        return rows

    def words(self) -> str:
        """Return a sentence on what the angle is."""
        return (
            f"Peaks over all angles, bounded from {len(self.by_angle)} directions. The angle turns"
            " the horizontal ground motion from the first component's direction towards the second"
            " one's."
        )


def over_angles(
    structure: MatrixStructure,
    inputs: Mapping[str, FuzzyNumber],
    *,
    duration: float,
    step: float,
    alpha: Sequence[float] = ALPHA,
    names: Sequence[str] = (),
    directions: int = 12,
    progress: Progress | None = None,
) -> AnglePeaks:
    """Return bounds of peaks over all angles of incidence of the ground motion.

    The first two components of the ground motion, `ground` and the first one of `components`, are
    turned together; a third one, the forces and the start stay as they are.

    Args:
        structure: A structure whose ground moves in two components, or three.
        inputs: Fuzzy parameters by name, in SI units.
        duration: Length of the response, in s.
        step: Distance of the time nodes, in s.
        alpha: Levels, rising within [0, 1].
        names: Names of the outputs whose magnitudes are bounded; by default all.
        directions: Number K of directions on the half circle at which peaks are bounded. The bound
            of all angles is 1/cos(π/(2 K)) times the largest of theirs, 0.9 % above it for 12.
        progress: Called with the completed fraction.

    Returns:
        Bounds of the largest magnitude of each output over all angles, attained values with their
        angle, time and inputs, and the peaks at each direction.

    Raises:
        RefusedError: The structure has less than two components of ground motion, there is no such
            output, or an argument is out of range.
        FailedError: No bounds are found.
    """
    has_two = structure.ground is not None and len(structure.components) > 0
    allowed = "two or three, MatrixStructure(ground=x, components=[(y, north)])"
    require(has_two, "ground", "of one component at most", allowed)
    count = int(checked_number("directions", directions, least=2))
    names = tuple(names) or tuple(map(str, structure.outputs))
    for name in names:
        structure.require_quantity(name)
    # Without r₀ a turn by π changes the sign of the response alone, so that one half of the circle
    # is enough.
    still = _still(structure)
    half_circles = 1 if still.is_at_rest and not still.loads else 2
    angles = np.arange(half_circles * count) * pi / count
    by_angle: dict[float, Peaks] = {}
    for k, angle in enumerate(angles):
        by_angle[float(np.degrees(angle))] = close_peaks(
            turned(structure, angle),
            inputs,
            names,
            duration=duration,
            step=step,
            alpha=alpha,
            progress=nth_subprogress(progress, k, len(angles)),
        )
    peak: dict[str, Peak] = {}
    worst: dict[str, WorstCase] = {}
    for name, largest in largest_peaks(by_angle).items():
        peak[name] = _over_all(largest, spacing=pi / count)
        if peak[name].reached_at:
            observed = structure.with_outputs([name])
            peak[name], worst[name] = _refined(observed, peak[name], duration, step)
    return AnglePeaks(
        encloses=next(iter(peak.values())).encloses,
        alpha=np.array(alpha, float),
        by_angle=by_angle,
        units={name: structure.unit_of(name) for name in names},
        peak=peak,
        worst=worst,
    )


def turned(structure: MatrixStructure, angle: float) -> MatrixStructure:
    """Return a structure whose two horizontal components of ground motion are turned by an angle.

    Args:
        structure: A structure whose ground moves in two components or more, of which the first two
            are turned.
        angle: In rad, from the direction of the first towards that of the second component.
    """
    (second, influence), *others = structure.components
    first = structure.ground
    assert first is not None
    cosine = cos(angle)
    sine = sin(angle)
    along_first = cosine * first.samples - sine * second.samples
    along_second = sine * first.samples + cosine * second.samples
    return replace(
        structure,
        ground=replace(first, samples=along_first),
        components=[(replace(second, samples=along_second), influence), *others],
    )


def _still(structure: MatrixStructure) -> MatrixStructure:
    """Return a structure without its two horizontal components of ground motion."""
    return replace(structure, ground=None, components=structure.components[1:])


def _over_all(peak: Peak, *, spacing: float) -> Peak:
    """Return bounds of the largest magnitude of an output over all angles.

    For one set of inputs and one time let |r₀| + A be the largest magnitude of r₀ + A cos(φ − ψ)
    over φ (see the head of this file), attained at χ. The directions φ_k cover the circle, or half
    of it if r₀ = 0, so that one is no farther than half their spacing Δ from χ, modulo π if r₀ = 0.
    There the magnitude is at least

        |r(φ_k)| ≥ |r₀| + A cos(Δ/2) ≥ (|r₀| + A) cos(Δ/2).

    Hence |r₀| + A ≤ max_k |r(φ_k)| / cos(Δ/2).

    Args:
        peak: Largest peak of the magnitude over the directions φ_k.
        spacing: Δ, in rad.
    """
    # Attained values bound nothing, and stay those of the directions.
    if peak.nature is Nature.ATTAINED:
        return peak
    # The small number is far above the rounding of the cosine and of the products.
    factor = (1 + 1e-12) / cos(spacing / 2)
    # No peak at a direction lies above `upper` plus the error, which is 0 if it is guaranteed.
    return replace(
        peak,
        upper=factor * peak.upper,
        error=factor * peak.error,
        between_nodes=factor * peak.between_nodes,
    )


def _refined(
    structure: MatrixStructure, peak: Peak, duration: float, step: float
) -> tuple[Peak, WorstCase]:
    """Return a peak with the value that its inputs attain at the worst angle, and where.

    For one set of inputs and one time the largest magnitude over all angles is |r₀| + A, so that no
    angle needs to be searched for.

    Args:
        structure: The structure, of one output.
        peak: Peak over all angles, whose inputs `reached_at` are known.
        duration: Length of the response, in s.
        step: Distance of the time nodes, in s, at which the response is computed exactly.
    """
    names = tuple(peak.reached_at)
    point = np.array([[peak.reached_at[name] for name in names]])

    def response(at: MatrixStructure) -> Array:
        return make_flow(at, names, duration, step, "exact").values(point)[0, :, 0]

    fixed: Array = response(_still(structure))
    along_cosine = response(structure) - fixed
    along_sine = response(turned(structure, pi / 2)) - fixed
    magnitude = np.abs(fixed) + np.hypot(along_cosine, along_sine)
    k = int(magnitude.argmax())
    angle = np.degrees(np.arctan2(along_sine[k], along_cosine[k]))
    if fixed[k] < 0:
        angle += 180
    # The inputs belong to the lowest level alone.
    reached = peak.reached.copy()
    reached[0] = max(reached[0], magnitude[k])
    return replace(peak, reached=reached), WorstCase(float(angle % 360), float(k * step))
