"""Limits under a response spectrum: drifts and forces, a floor of the base shear, P-Delta."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from alphacut.base.errors import checked_number, require, require_choice
from alphacut.base.number_text import engineering
from alphacut.frame.analyses.decision import Decision, decide
from alphacut.frame.analyses.limits import Limit
from alphacut.frame.analyses.peaks import Peak
from alphacut.frame.analyses.spectrum_response import SpectrumResponse
from alphacut.frame.boxes import boxes
from alphacut.frame.structures.storey import StoreyFrame
from alphacut.fuzzy import FuzzyNumber
from alphacut.fuzzy.result import Nature

NEGLIGIBLE_THETA = 0.1
"""θ up to which second-order effects need not be taken into account: EN 1998-1, 4.4.2.2(2)."""
AMPLIFIED_THETA = 0.2
"""θ up to which they may be approximated by the factor 1/(1 − θ): EN 1998-1, 4.4.2.2(3)."""
LARGEST_THETA = 0.3
"""θ that no storey may exceed: EN 1998-1, 4.4.2.2(4)."""
FLOOR_CLAUSE = "ASCE 7-22, 12.9.1.4.1"
"""Clause by which forces are multiplied if the modal base shear is below the static one."""


@dataclass(frozen=True, eq=False, repr=False)
class SpectrumChecks(Decision):
    """Verdicts on limits under a response spectrum.

    Args:
        notes: Sentences on what a code asks for besides.
    """

    key = "spectrum_checks"
    title = "Are limits kept under the response spectrum?"
    notes: tuple[str, ...] = ()

    def compared(self) -> dict[str, float | str]:
        """Return nothing: the limits may be those of a decision beside this."""
        return {}

    def words(self) -> str:
        """Return sentences that explain the verdicts, and what a code asks for besides."""
        text = (
            "A limit that no inputs exceed is proved. One that some inputs are known to exceed is"
            " refuted by these inputs. Undecided is a limit that lies between the largest known and"
            " the largest possible peak."
        )
        return " ".join([text, *self.notes])


def spectrum_checks(
    found: SpectrumResponse,
    limits: Sequence[Limit] = (),
    *,
    displacement_factor: float = 1.0,
    base_shear_floor: float | None = None,
    theta: Mapping[str, Peak] | None = None,
    largest_theta: float = LARGEST_THETA,
    input_units: Mapping[str, str] | None = None,
) -> SpectrumChecks:
    """Return whether limits are kept by the combined peaks of a response spectrum.

    Args:
        found: The combined peaks.
        limits: Limits of the magnitudes of its outputs.
        displacement_factor: Factor of displacements, drifts and rotations: the behaviour factor
            q_d of EN 1998-1, 4.3.4, or C_d/I_e of ASCE 7-22, 12.8.6, where the design spectrum is
            reduced.
        base_shear_floor: Base shear in N that the combined one must have at least, such as that of
            the equivalent lateral force procedure of ASCE 7-22, 12.9.1.4.1.
        theta: Sensitivity coefficients of storeys by name, as `drift_sensitivity` returns them.
        largest_theta: Limit of each: 0.1, 0.2 or 0.3 by EN 1998-1, 4.4.2.2.
        input_units: SI units by the name of the input, for the text that names inputs by which a
            limit is refuted.

    Raises:
        RefusedError: There is nothing to check, a limit is not one of a magnitude of an output, the
            base shear is no output, or a number is not positive.

    Example:
        >>> from alphacut.frame import Limit, StoreyFrame, eurocode8_spectrum
        >>> from alphacut.frame import spectrum_checks, spectrum_response
        >>> frame = StoreyFrame(masses=[5e4, 5e4], stiffness=[6e7, 4e7], outputs=("drift1",))
        >>> found = spectrum_response(frame, {"k1": 6e7}, eurocode8_spectrum(2.0, "B"), alpha=[0])
        >>> spectrum_checks(found, [Limit("drift1", 0.01)]).limits["drift1"].verdict
        'not exceeded'
    """
    checked_number("displacement_factor", displacement_factor, positive=True)
    checked_number("largest_theta", largest_theta, positive=True)
    peaks = dict(theta or {})
    asked = [*limits, *(Limit(name, largest_theta) for name in peaks)]
    units = dict(zip(found.outputs, found.units, strict=True))
    for limit in limits:
        require_choice("limits", limit.output, found.outputs)
        is_magnitude = limit.side == "" and not isinstance(limit.value, Sequence)
        require(is_magnitude, "limits", limit.text, "limits of magnitudes, as drift1 <= 30 mm")
        factor = 1.0
        if units[limit.output] in ("m", "rad"):
            factor = displacement_factor
        peaks[limit.output] = found.peak(limit.output, factor=factor)
    if base_shear_floor is not None:
        checked_number("base_shear_floor", base_shear_floor, positive=True)
        require_choice("base_shear_floor", "base_shear", found.outputs)
        floor = Limit("base_shear", base_shear_floor, largest=False)
        asked.append(floor)
        peaks[floor.peak] = found.peak("base_shear", "min")
    units |= dict.fromkeys(theta or (), "")
    decision = decide(peaks, asked, units=units, input_units=input_units)
    notes = []
    if displacement_factor != 1:
        what = "Displacements and drifts are those of the spectrum times"
        notes.append(f"{what} {displacement_factor:g}.")
    if base_shear_floor is not None:
        notes.append(_floor_words(peaks["min base_shear"], base_shear_floor))
    if theta:
        notes.append(_theta_words(theta))
    return SpectrumChecks(decision.alpha, decision.limits, tuple(notes))


def drift_sensitivity(
    frame: StoreyFrame,
    inputs: Mapping[str, FuzzyNumber | float],
    *,
    alpha: Sequence[float],
    displacement_factor: float = 1.0,
) -> dict[str, Peak]:
    """Return the interstorey drift sensitivity coefficients θ = P d/(V h) of storeys.

    P is the weight above, h the height of the storey, d its drift and V its shear (EN 1998-1,
    4.4.2.2(2)). Of a storey that is a spring V/d is its stiffness over the displacement factor,
    whatever the spectrum, so that the bounds are those of P over stiffness and height.

    Args:
        frame: The frame.
        inputs: Fuzzy parameters by name, in SI units.
        alpha: Levels, rising within [0, 1].
        displacement_factor: q_d of EN 1998-1, 4.3.4, by which design drifts exceed those under the
            design spectrum, which gives V.

    Returns:
        Guaranteed bounds by the names "theta1", "theta2" … from below, which are attained.

    Raises:
        RefusedError: The frame has no lengths.
    """
    require(bool(frame.lengths), "lengths", None, "heights of storeys, for θ = P d/(V h)")
    cuts = boxes(inputs, alpha)
    smallest = []
    largest = []
    for low, high in zip(cuts.lower, cuts.upper, strict=True):
        ends = {}
        exchanged = {}
        for i, name in enumerate(cuts.names):
            ends[name] = (float(low[i]), float(high[i]))
            exchanged[name] = (float(high[i]), float(low[i]))
        # The coefficient is monotonic in each parameter: with exchanged ends it is the smallest.
        smallest.append(frame.stability_coefficients(exchanged))
        largest.append(frame.stability_coefficients(ends))
    # The factors cover the rounding.
    lower = displacement_factor * np.array(smallest).T * (1 - 1e-13)
    upper = displacement_factor * np.array(largest).T * (1 + 1e-13)
    peaks = {}
    for z in range(frame.floors):
        peaks[f"theta{z + 1}"] = Peak(
            alpha=cuts.alpha,
            lower=lower[z],
            upper=upper[z],
            error=np.zeros(len(cuts.alpha)),
            reached=upper[z] * (1 - 1e-12),
            least_lower=lower[z],
            least_upper=lower[z] * (1 + 1e-12),
            nature=Nature.GUARANTEED,
        )
    return peaks


def _floor_words(peak: Peak, floor: float) -> str:
    """Return a sentence on the factor by which forces are multiplied up to a floor."""
    smallest = float(peak.proved[0])
    if not smallest > 0:
        return f"No factor of the forces is known that brings them to the floor ({FLOOR_CLAUSE})."
    if smallest >= floor:
        return f"Forces need no factor to reach the floor of the base shear ({FLOOR_CLAUSE})."
    factor = floor / smallest
    return (
        f"Forces are to be multiplied by V/V_t, at most {factor:.4g}, so that the base shear is"
        f" {engineering(floor, 'N')} ({FLOOR_CLAUSE})."
    )


def _theta_words(theta: Mapping[str, Peak]) -> str:
    """Return a sentence on what the second-order effects demand in the worst storey."""
    name, peak = max(theta.items(), key=lambda entry: float(entry[1].proved[0]))
    largest = float(peak.proved[0])
    what = "more than the 0.3 that is allowed (EN 1998-1, 4.4.2.2(4))"
    if largest <= NEGLIGIBLE_THETA:
        what = "second-order effects need not be considered (EN 1998-1, 4.4.2.2(2))"
    elif largest <= AMPLIFIED_THETA:
        factor = 1 / (1 - largest)
        what = f"effects times 1/(1 − θ), at most {factor:.3g} (EN 1998-1, 4.4.2.2(3))"
    elif largest <= LARGEST_THETA:
        what = "a second-order analysis is due (EN 1998-1, 4.4.2.2(3) and (4))"
    return f"The largest sensitivity coefficient is {name}, at most {largest:.3g}: {what}."
