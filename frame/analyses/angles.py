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

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from math import cos, pi, sin
from typing import Any, NamedTuple

import numpy as np

from alphacut.base.arrays import Array
from alphacut.base.errors import RefusedError, checked_number
from alphacut.base.number_text import engineering, range_text
from alphacut.base.progress_bar import Progress, nth_subprogress
from alphacut.frame.analyses.answer import Answer, Row
from alphacut.frame.analyses.peaks import Peak, WorstCase, close_peaks, largest_peaks
from alphacut.frame.boxes import ALPHA
from alphacut.frame.dynamics.nonlinear import make_flow
from alphacut.frame.records.history import Accelerogram
from alphacut.frame.structures.matrix import MatrixStructure
from alphacut.frame.structures.model import StructureModel
from alphacut.fuzzy import FuzzyNumber
from alphacut.fuzzy.result import Nature

GAP = 0.01
"""Distance of the bound over all angles from the attained value, as a fraction of this value, at
which no further direction is bounded (tuned)."""
GAIN = 2e-3
"""Fraction of the bound that further directions must promise (tuned: each costs a proof)."""
FURTHER = 12
"""Number of further directions of an output at most (tuned: frames in plan take one to five)."""
TURN = (
    "The angle turns the horizontal ground motion from the first component's direction towards the"
    " second one's."
)
"""Sentence on what an angle of incidence is."""
COARSE_ERROR = 0.02
"""Error of the peaks that is aimed at in the first directions (tuned: it costs a fifth of 0.5 %,
and matters little in directions far from the worst one)."""
CLOSE_ERROR = 3e-3
"""Error that is aimed at in further directions (tuned: it leaves most of the gap to what peaks may
rise between time nodes and between directions)."""


class AngleBounds(NamedTuple):
    """Bounds of peaks at some directions, by angle in degrees and name, and over all angles."""

    by_angle: dict[float, dict[str, Peak]]
    peak: dict[str, Peak]


class AngleResponse(NamedTuple):
    """The terms of the response r₀ + r_x cos φ + r_y sin φ, each (structures, times, outputs).

    Args:
        fixed: r₀, which does not turn with the ground motion.
        along_cosine: r_x.
        along_sine: r_y.
    """

    fixed: Array
    along_cosine: Array
    along_sine: Array

    @property
    def magnitudes(self) -> Array:
        """Largest magnitudes over all angles, |r₀| + √(r_x² + r_y²)."""
        return np.asarray(np.abs(self.fixed) + np.hypot(self.along_cosine, self.along_sine))

    @property
    def angles(self) -> Array:
        """Angles at which the largest magnitudes occur, in degrees from 0 to 360."""
        angles = np.arctan2(self.along_sine, self.along_cosine) + np.where(self.fixed < 0, pi, 0.0)
        return np.asarray(np.degrees(angles) % 360)


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
        peak: Bounds of the largest magnitude of each output over all angles and times; `worst` of
            each is the angle and the time of the attained value on the lowest level, None if no
            response is known.
    """

    key = "angles"
    title = "How far does it move, from whichever direction the ground motion comes?"
    alpha: Array
    by_angle: dict[float, dict[str, Peak]]
    units: dict[str, str]
    peak: dict[str, Peak]

    def text_rows(self) -> Iterator[Row]:
        """Yield a row for each output.

        The columns are its name, the range of its peaks at the lowest level, the guarantee, the
        attained value, and its angle and time.
        """
        for name, peak in self.peak.items():
            unit = self.units[name]
            ends = range_text(float(peak.lower[0]), float(peak.upper[0]), peak.nature)
            row: dict[str, str | Nature] = {
                "peak of": name,
                f"at α = {self.alpha[0]:g}": f"{ends} {unit}",
                "nature": peak.nature,
                "reached": "not known",
                "angle and time": "",
            }
            if (worst := peak.worst) is not None:
                row["reached"] = engineering(float(peak.reached[0]), unit)
                row["angle and time"] = f"{worst.angle:.1f}°, {worst.time:.4g} s"
            yield row

    def number_rows(self) -> Iterator[Row]:
        """Yield a row for each output, over all angles.

        The columns are its name and SI unit, the bound of the farthest peak and the attained value
        on the lowest level, angle in degrees and time of the latter, and the guarantee.
        """
        for name, peak in self.peak.items():
            worst = peak.worst or WorstCase(np.nan, np.nan)
            yield {
                "output": name,
                "unit": self.units[name],
                "farthest peak": peak.upper[0],
                "peak reached": peak.reached[0],
                "angle [deg]": worst.angle,
                "time [s]": worst.time,
                "nature": peak.nature,
            }

    def words(self) -> str:
        """Return a sentence on what the angle is."""
        return f"Peaks over all angles, bounded from {len(self.by_angle)} directions. {TURN}"


def over_angles(
    structure: MatrixStructure,
    inputs: Mapping[str, FuzzyNumber],
    *,
    duration: float,
    step: float,
    alpha: Sequence[float] = ALPHA,
    names: Sequence[str] = (),
    directions: int = 4,
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
        directions: Number of directions on the half circle at which all peaks are bounded first.
            Each output has further directions where it moves farthest, until its bound is 1 %
            above the attained value, or more of them would not narrow it.
        progress: Called with the completed fraction.

    Returns:
        Bounds of the largest magnitude of each output over all angles, attained values with their
        angle, time and inputs, and the peaks at each direction.

    Raises:
        RefusedError: The structure has less than two components of ground motion, there is no such
            output, or an argument is out of range.
        FailedError: No bounds are found.
    """
    names = tuple(names) or tuple(map(str, structure.outputs))
    found = angle_peaks(
        structure,
        inputs,
        names,
        duration=duration,
        step=step,
        alpha=alpha,
        directions=directions,
        progress=progress,
    )
    return AnglePeaks(
        encloses=next(iter(found.peak.values())).encloses,
        alpha=np.array(alpha, float),
        by_angle=found.by_angle,
        units={name: structure.unit_of(name) for name in names},
        peak=found.peak,
    )


def angle_peaks(
    structure: StructureModel,
    inputs: Mapping[str, FuzzyNumber],
    names: Sequence[str],
    *,
    duration: float,
    step: float,
    alpha: Sequence[float],
    directions: int = 4,
    progress: Progress | bool | None = None,
) -> AngleBounds:
    """Return bounds of peaks at directions of the ground motion, and over all angles.

    Arguments and errors are those of `over_angles`, of which this is the computation.
    """
    if not isinstance(structure, MatrixStructure) or len(structure.accelerograms) < 2:
        allowed = "two or three, MatrixStructure(ground=x, components=[(y, north)])"
        raise RefusedError("ground", "of one component at most", allowed)
    count = int(checked_number("directions", directions, least=2))
    for name in names:
        structure.require_quantity(name)
    # Without r₀ a turn by π changes the sign of the response alone, so that one half of the circle
    # is enough.
    still = _still(structure)
    circle = pi if still.is_at_rest and not still.loads else 2 * pi
    angles = np.arange(round(circle / pi) * count) * pi / count
    n_pieces = len(angles) + len(names)
    by_angle: dict[float, dict[str, Peak]] = {}
    motion: dict[str, Any] = {"duration": duration, "step": step, "alpha": alpha}
    motion["dual_first"] = True  # each direction is a proof

    def bounded(angle: float, names: Sequence[str], **options: Any) -> dict[str, Peak]:
        """Bound peaks at an angle in rad, and add them to `by_angle`."""
        turned_structure = turned(structure, angle)
        peaks = close_peaks(turned_structure, inputs, names, **motion, **options)
        by_angle.setdefault(float(np.degrees(angle)), {}).update(peaks)
        return peaks

    def tick(k: int) -> Progress | bool | None:
        return progress if isinstance(progress, bool) else nth_subprogress(progress, k, n_pieces)

    for k, angle in enumerate(map(float, angles)):
        bounded(angle, names, error=COARSE_ERROR, progress=tick(k))
    peak: dict[str, Peak] = {}
    for k, name in enumerate(names, start=len(angles)):
        observed = structure.with_outputs([name])
        at_angles = {
            angle: by_angle[float(np.degrees(angle))][name] for angle in map(float, angles)
        }
        close: dict[float, Peak] = {}
        for _ in range(FURTHER + 1):
            farthest = _over_all(at_angles | close, circle)
            peak[name] = _refined(observed, farthest.peak, duration, step)
            largest = max((float(x.proved[0]) for x in close.values()), default=0.0)
            enough = max((1 + GAP) * float(peak[name].reached[0]), (1 + GAIN) * largest)
            if peak[name].proved[0] <= enough or not np.isfinite(peak[name].proved[0]):
                break
            found = bounded(farthest.angle, [name], error=CLOSE_ERROR, progress=tick(k))
            close[farthest.angle] = found[name]
    return AngleBounds(by_angle, peak)


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
    assert second is not None
    first, second = turned_components(first, second, angle)
    return replace(structure, ground=first, components=[(second, influence), *others])


def turned_components(
    first: Accelerogram, second: Accelerogram, angle: float
) -> tuple[Accelerogram, Accelerogram]:
    """Return two horizontal components of a ground motion that is turned by an angle.

    Args:
        first: Acceleration along the first direction.
        second: Acceleration along the second direction, at the same times.
        angle: In rad, from the first towards the second direction.
    """
    cosine = cos(angle)
    sine = sin(angle)
    along_first = cosine * first.samples - sine * second.samples
    along_second = sine * first.samples + cosine * second.samples
    return replace(first, samples=along_first), replace(second, samples=along_second)


def angle_response(
    structure: MatrixStructure,
    names: Sequence[str],
    points: Array,
    *,
    duration: float,
    step: float,
) -> AngleResponse:
    """Return exact responses to ground motion from any angle, at the time nodes.

    Args:
        structure: A structure whose ground moves in two components or more, of which the first two
            are turned.
        names: Names of its d parameters that are not nominal.
        points: Their values at S parameter sets in SI units, shape (S, d).
        duration: Length of the response, in s.
        step: Distance of the time nodes, in s.
    """

    def response(at: MatrixStructure) -> Array:
        return make_flow(at, names, duration, step, "exact").values(points)

    fixed: Array = response(_still(structure))
    return AngleResponse(
        fixed=fixed,
        along_cosine=response(structure) - fixed,
        along_sine=response(turned(structure, pi / 2)) - fixed,
    )


def _still(structure: MatrixStructure) -> MatrixStructure:
    """Return a structure without its two horizontal components of ground motion."""
    return replace(structure, ground=None, components=structure.components[1:])


class _Farthest(NamedTuple):
    """Bounds of a peak over all angles, and the angle in rad at which the bound is largest."""

    peak: Peak
    angle: float


def _over_all(at_angles: Mapping[float, Peak], circle: float) -> _Farthest:
    """Return bounds of the largest magnitude of an output over all angles.

    For one set of inputs and one time let |r₀| + A be the largest magnitude of r₀ + A cos(φ − ψ)
    over φ (see the head of this file), attained at χ. Let χ lie between the neighbours φ₁ and
    φ₂ = φ₁ + Δ, at χ = φ₁ + t. With u(φ) the unit vector of direction φ,

        u(χ) = c₁ u(φ₁) + c₂ u(φ₂),    c₁ = sin(Δ − t)/sin Δ ≥ 0,    c₂ = sin t/sin Δ ≥ 0.

    Hence A = Σ c_j A cos(φ_j − χ), and as c₁ + c₂ ≥ 1 (the triangle of the three vectors),
    |r₀| + A ≤ Σ c_j (|r₀| + A cos(φ_j − χ)) ≤ Σ c_j h_j, where h_j bounds the magnitudes at φ_j.
    Over t the sum h₁ cos t + (h₂ − h₁ cos Δ)/sin Δ · sin t is largest where its derivative is zero,
    or at an end of [0, Δ].

    Args:
        at_angles: Peak of the magnitude under each of some directions, by their angles in rad. They
            are less than π apart.
        circle: 2π; or π if r₀ = 0, where a turn by π changes the sign of the response alone.
    """
    angles = np.array(sorted(at_angles))
    largest = largest_peaks({angle: {"": peak} for angle, peak in at_angles.items()})[""]
    # Attained values bound nothing, and stay those of the directions.
    if largest.nature is Nature.ATTAINED:
        return _Farthest(largest, 0.0)
    # No peak at a direction lies above `upper` plus the error, which is 0 if it is guaranteed.
    bounds = np.array([at_angles[angle].proved for angle in angles])  # (directions, levels)
    spacing = np.append(angles[1:], angles[0] + circle)[:, np.newaxis] - angles[:, np.newaxis]
    slopes = (np.roll(bounds, -1, axis=0) - bounds * np.cos(spacing)) / np.sin(spacing)
    turns = np.clip(np.arctan2(slopes, bounds), 0.0, spacing)
    # The small number is far above the rounding of the products and their sum.
    farthest = (1 + 1e-12) * (bounds * np.cos(turns) + slopes * np.sin(turns))
    k = farthest[:, 0].argmax()
    over_all = farthest.max(axis=0)
    upper = over_all
    if largest.nature is not Nature.GUARANTEED:
        upper = over_all - largest.error
    peak = replace(largest, upper=upper)
    return _Farthest(peak, float((angles[k] + turns[k, 0]) % circle))


def _refined(structure: MatrixStructure, peak: Peak, duration: float, step: float) -> Peak:
    """Return a peak with the value that its inputs attain at the worst angle, and where.

    For one set of inputs and one time the largest magnitude over all angles is |r₀| + A, so that no
    angle needs to be searched for.

    Args:
        structure: The structure, of one output.
        peak: Peak over all angles. If its inputs `reached_at` are not known, it is returned itself.
        duration: Length of the response, in s.
        step: Distance of the time nodes, in s, at which the response is computed exactly.
    """
    if not peak.reached_at:
        return peak
    point = np.array([list(peak.reached_at.values())])
    response = angle_response(
        structure, tuple(peak.reached_at), point, duration=duration, step=step
    )
    magnitudes = response.magnitudes[0, :, 0]
    k = int(magnitudes.argmax())
    # The inputs belong to the lowest level alone.
    reached = peak.reached.copy()
    reached[0] = max(reached[0], magnitudes[k])
    worst = WorstCase(float(response.angles[0, k, 0]), float(k * step))
    return replace(peak, reached=reached, worst=worst)
