"""Response-spectrum method: peaks of a linear structure's modes under a spectrum, combined."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from alphacut.base.arrays import Array
from alphacut.base.errors import FailedError, RefusedError, checked_number, require_choice
from alphacut.base.number_text import Table, engineering, percent_text, range_text
from alphacut.frame.analyses.answer import Answer, Row, table_of
from alphacut.frame.analyses.peaks import Peak
from alphacut.frame.bounds.spectrum_bounds import combined_bounds
from alphacut.frame.boxes import ALPHA, Boxes, boxes
from alphacut.frame.calculus.unproved import UnprovedError
from alphacut.frame.modes.spectral_modes import spectral_modes
from alphacut.frame.spectra.modal_combination import COMBINATIONS, Combination, SpectralModes
from alphacut.frame.spectra.target import TargetSpectrum
from alphacut.frame.structures.linear import LinearSystem
from alphacut.frame.structures.model import Dynamics, StructureModel
from alphacut.fuzzy import FuzzyNumber
from alphacut.fuzzy.result import Nature
from alphacut.fuzzy.sets.boxes import corners, quasi_random_points

MASS_FRACTION = 0.9
"""Fraction of the mass that EN 1998-1, 4.3.3.3.1(3), and ASCE 7 ask the modes to move."""
SAMPLES = 200
"""Points inside of each cut at which peaks are computed (tuned)."""
CORNER_INPUTS = 8
"""Most inputs for which all corners of a cut are tried."""


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class SpectrumResponse(Answer):
    """Combined peaks of a structure under a response spectrum.

    Args:
        method: Spectrum, rule of combination, number of modes.
        alpha: Levels, rising, shape (levels,).
        modes: The modes at the nominal inputs (S = 1).
        outputs: Names of the outputs.
        units: SI unit of each output.
        nominal: Combined peaks at the nominal inputs, shape (outputs,).
        nominal_inputs: The nominal inputs by name, in SI units.
        attained: The smallest and the largest combined peak of each cut that some inputs have,
            shape (levels, outputs, 2).
        attained_at: The inputs that have them on the lowest level, in SI units, shape
            (outputs, 2, inputs).
        proved: Guaranteed bounds of the combined peaks of each cut, the same shape; 0 and ∞ where
            none are found.
        unproved: Why some bounds are not found; empty if all are.
    """

    key = "response_spectrum"
    title = "Which peaks does the response spectrum give?"
    method: Combination
    alpha: Array
    modes: SpectralModes
    outputs: tuple[str, ...]
    units: tuple[str, ...]
    nominal: Array
    nominal_inputs: dict[str, float]
    attained: Array
    attained_at: Array
    proved: Array
    unproved: str = ""

    @property
    def modal_peaks(self) -> dict[str, Array]:
        """Peaks of each output by its modes at the nominal inputs, with their signs, (modes,)."""
        peaks = self.modes.peaks(self.method.spectrum(self.modes.periods))[0]
        return dict(zip(self.outputs, peaks.T, strict=True))

    def peak(self, output: str, side: Literal["", "min"] = "", factor: float = 1.0) -> Peak:
        """Return the range of a combined peak as limits of outputs take it.

        Args:
            output: Name of the output.
            side: "" if the peak must not be too large, "min" if it must not be too small.
            factor: What the peak is multiplied by.

        Raises:
            ValueError: There is no such output.
        """
        k = self.outputs.index(output)
        proved = factor * self.proved[:, k].T
        attained = factor * self.attained[:, k].T
        near, far = (1, 0) if side else (0, 1)
        farthest_at = self.attained_at[k, far].tolist()
        is_proved = bool(np.isfinite(proved).all())
        ends = proved if is_proved else attained
        return Peak(
            alpha=self.alpha,
            lower=ends[0],
            upper=ends[1],
            error=np.zeros(len(self.alpha)),
            reached=attained[far],
            least_lower=proved[near],
            least_upper=attained[near],
            nature=Nature.GUARANTEED if is_proved else Nature.ATTAINED,
            side=side,
            reached_at=dict(zip(self.nominal_inputs, farthest_at, strict=True)),
        )

    @property
    def sufficient_modes(self) -> int | None:
        """Number of the lowest modes that move 90 % of the mass at the nominal inputs, if any do.

        The mass is that which moves with the ground.
        """
        sums = np.cumsum(self.modes.mass_fractions[0])
        # Rounding of a sum that is the whole mass must not be what decides.
        sufficient = np.flatnonzero(sums >= MASS_FRACTION - 1e-9)
        return int(sufficient[0]) + 1 if len(sufficient) else None

    def mode_table(self) -> Table:
        """Return a table of texts with a row for each mode at the nominal inputs.

        The columns are its number, period, damping ratio, fraction of the mass that moves with the
        ground, the sum of these fractions up to it, and the peak of each output by this mode alone.
        """
        modes = self.modes
        sums = np.cumsum(modes.mass_fractions[0])
        rows = []
        for k, period in enumerate(modes.periods[0]):
            row = {
                "mode": str(k + 1),
                "T": engineering(float(period), "s"),
                "ζ": percent_text(float(modes.ratios[0, k]), 2),
                "mass": percent_text(float(modes.mass_fractions[0, k])),
                "sum": percent_text(float(sums[k])),
            }
            for (name, peaks), unit in zip(self.modal_peaks.items(), self.units, strict=True):
                row[name] = engineering(float(peaks[k]), unit)
            rows.append(row)
        return table_of(rows)

    def text_rows(self) -> Iterator[Row]:
        """Yield a row for each output.

        The columns are the output, the range of its combined peak at the lowest level, the
        guarantee of this range, its attained part, and the combined peak at the nominal inputs.
        """
        for k, (name, unit) in enumerate(zip(self.outputs, self.units, strict=True)):
            low, high = self.attained[0, k].tolist()
            reached = range_text(low, high, Nature.ATTAINED)
            text = reached
            nature = Nature.ATTAINED
            if np.isfinite(self.proved[0, k, 1]):
                low, high = self.proved[0, k].tolist()
                nature = Nature.GUARANTEED
                text = range_text(low, high, nature)
            yield {
                "peak of": name,
                f"at α = {self.alpha[0]:g}": f"{text} {unit}",
                "nature": nature,
                "reached": f"{reached} {unit}",
                "nominal": engineering(float(self.nominal[k]), unit),
            }

    def number_rows(self) -> Iterator[Row]:
        """Yield a row for each output and level, with guaranteed bounds and attained values.

        Upper bounds that are not found are infinite.
        """
        for k, (name, unit) in enumerate(zip(self.outputs, self.units, strict=True)):
            for j, level in enumerate(self.alpha):
                yield {
                    "output": name,
                    "unit": unit,
                    "alpha": level,
                    "nominal": self.nominal[k],
                    "guaranteed lower": self.proved[j, k, 0],
                    "guaranteed upper": self.proved[j, k, 1],
                    "attained lower": self.attained[j, k, 0],
                    "attained upper": self.attained[j, k, 1],
                }

    @property
    def cautions(self) -> list[str]:
        """Sentences on what makes the peaks too small at the nominal inputs; none if nothing does.

        Modes that move less than 5 % of the mass are not judged by their damping.
        """
        modes = self.modes
        spectrum = self.method.spectrum
        found = []
        ratios = modes.ratios[0][modes.mass_fractions[0] > 0.05]
        least = float(ratios.min(initial=np.inf))
        if not spectrum.minimum and least < spectrum.damping * (1 - 1e-6):
            found.append(
                f"The spectrum is that of a damping ratio of {percent_text(spectrum.damping)}, and"
                f" a mode has {percent_text(least)}: peaks of this structure are larger"
            )
        if self.sufficient_modes is None:
            total = percent_text(float(modes.mass_fractions[0].sum()))
            found.append(f"The modes move {total} of the mass, less than the 90 % of codes")
        return found

    def words(self) -> str:
        """Return sentences on spectrum, combination, and how much mass the modes move."""
        method = self.method
        total = percent_text(float(self.modes.mass_fractions[0].sum()))
        count = self.modes.omega.shape[1]
        needed = self.sufficient_modes
        unproved = ""
        if self.unproved:
            unproved = f" Not all ranges are proved: {self.unproved}."
        enough = f"the first {needed} of them 90 %" if needed else "less than the 90 % of codes"
        return (
            f"Peaks of {count} modes by the {method.spectrum}, combined by {method.rule}"
            f" ({COMBINATIONS[method.rule]}). The modes move {total} of the mass,"
            f" {enough} (at the most plausible inputs). A combined peak is an estimate of the"
            " peak under an earthquake of this spectrum; its range is that over the"
            f" inputs.{unproved}"
        )


def spectrum_response(
    structure: StructureModel,
    inputs: Mapping[str, FuzzyNumber | float],
    spectrum: TargetSpectrum,
    *,
    combination: str = "CQC",
    modes: int | None = None,
    own_ratios: bool = False,
    alpha: Sequence[float] = ALPHA,
) -> SpectrumResponse:
    """Return the peaks of a structure's outputs by the response-spectrum method.

    Mode k with period T_k and shape φ_k gives an output the peak Γ_k r·φ_k Sa(T_k)/ω_k², r the row
    of the output and Γ_k = φᵀMι/φᵀMφ. The peaks of all modes are combined by SRSS or CQC.

    Args:
        structure: A linear structure. Its own base excitation and loads are not used.
        inputs: Fuzzy parameters by name, in SI units; a number is a crisp one.
        spectrum: Pseudo-acceleration over the period; that of a record is `record_spectrum`.
        combination: "CQC" or "SRSS".
        modes: Number of the lowest modes that are combined; all unless given.
        own_ratios: Whether CQC takes the damping ratio of each mode of the structure; else that
            of the spectrum is taken for all modes.
        alpha: Levels, rising within [0, 1].

    Returns:
        Modes and combined peaks at the nominal inputs; over each cut the smallest and largest
        combined peaks at corners and at points inside, and guaranteed bounds of all, whether modes
        meet in the cut or not.

    Raises:
        RefusedError: An argument is not as said, the structure is not linear, an output takes
            velocities or accelerations, a period lies outside the range of the spectrum, or the
            structure may drift.
        FailedError: An attained value contradicts the proof, which is wrong.

    Example:
        >>> from alphacut.frame import StoreyFrame, eurocode8_spectrum, spectrum_response
        >>> frame = StoreyFrame(masses=[5e4, 5e4], stiffness=[6e7, 4e7], outputs=("base_shear",))
        >>> found = spectrum_response(frame, {"k1": 6e7}, eurocode8_spectrum(2.0, "B"), alpha=[1])
        >>> found.nominal.round(-2).tolist(), found.sufficient_modes
        ([543300.0], 1)
    """
    require_choice("combination", combination, COMBINATIONS)
    if not isinstance(structure, LinearSystem) or structure.dynamics is not Dynamics.LINEAR:
        cure = "take elastic() of a frame whose columns yield"
        raise RefusedError("structure", "one that is not linear", "a linear structure", cure)
    if modes is not None:
        checked_number("modes", modes, positive=True, whole=True)
    method = Combination(spectrum, combination, modes, own_ratios)
    cuts = boxes(inputs, alpha)
    nominal_modes = spectral_modes(structure, cuts.names, cuts.nominal[np.newaxis], modes)
    attained, attained_at = _attained(structure, cuts, method)
    proved, unproved = _proved(structure, cuts, method, attained)
    return SpectrumResponse(
        method=method,
        alpha=cuts.alpha,
        modes=nominal_modes,
        outputs=tuple(map(str, structure.outputs)),
        units=tuple(structure.unit_of(name) for name in structure.outputs),
        nominal=method.combined(nominal_modes)[0],
        nominal_inputs=dict(zip(cuts.names, map(float, cuts.nominal), strict=True)),
        attained=attained,
        attained_at=attained_at,
        proved=proved,
        unproved=unproved,
    )


def _attained(structure: LinearSystem, cuts: Boxes, method: Combination) -> tuple[Array, Array]:
    """Return the smallest and largest combined peaks found in each cut, and where.

    They are those at the nominal inputs, at corners of the cut and at points inside. What a
    narrower cut attains is attained in the wider ones, too.

    Returns:
        The peaks, shape (levels, outputs, 2), and the inputs that have those of the lowest level,
        shape (outputs, 2, inputs).
    """
    d = len(cuts.names)
    inside = quasi_random_points(d, SAMPLES)
    ends = np.round(inside)  # some corners
    if d <= CORNER_INPUTS:
        ends = corners(np.zeros(d), np.ones(d))
    fractions = np.vstack([inside, ends])
    points = []
    peaks = []
    for low, high in zip(cuts.lower, cuts.upper, strict=True):
        in_cut = np.clip(low + (high - low) * fractions, low, high)
        points.append(np.vstack([cuts.nominal, in_cut]))
        at_points = spectral_modes(structure, cuts.names, points[-1], method.modes)
        peaks.append(method.combined(at_points))
    # Those of a level are over its own points and those of all higher levels.
    smallest = np.minimum.accumulate([x.min(axis=0) for x in peaks[::-1]])[::-1]
    largest = np.maximum.accumulate([x.max(axis=0) for x in peaks[::-1]])[::-1]
    everywhere = np.vstack(peaks)
    first = [everywhere.argmin(axis=0), everywhere.argmax(axis=0)]
    at = np.vstack(points)[np.stack(first, axis=-1)]
    return np.stack([smallest, largest], axis=-1), at


def _proved(
    structure: LinearSystem, cuts: Boxes, method: Combination, attained: Array
) -> tuple[Array, str]:
    """Return guaranteed bounds of the combined peaks of each cut, and why some are missing.

    Args:
        structure: The structure.
        cuts: The cuts.
        method: Spectrum and combination.
        attained: Smallest and largest attained combined peaks, shape (levels, outputs, 2).

    Returns:
        Bounds of the same shape, 0 and ∞ where none are found; and the reason, or an empty text.
    """
    proved = np.full(attained.shape, [0.0, np.inf])
    reason = ""
    for j, ends in enumerate(zip(cuts.lower, cuts.upper, strict=True)):
        try:
            proved[j] = combined_bounds(structure, cuts.names, ends, method, attained[j])
        except UnprovedError as error:
            reason = str(error)
    # Bounds of a cut hold in the narrower ones, too.
    proved[..., 0] = np.maximum.accumulate(proved[..., 0])
    proved[..., 1] = np.minimum.accumulate(proved[..., 1])
    # Attained values are rounded, by far less than the factors.
    is_within = proved * [1 - 1e-9, 1 + 1e-9] * [1, -1] <= attained * [1, -1] + 1e-300
    if not is_within.all():
        raise FailedError(
            "an attained combined peak lies outside guaranteed bounds, which are wrong"
        )
    return proved, reason
