"""The response-spectrum method with its options: peaks, checks, and errors under records."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, ClassVar, Literal, cast

import numpy as np

from alphacut.base.errors import require
from alphacut.base.progress_bar import Progress
from alphacut.base.quantity import Quantity
from alphacut.frame.analyses.answer import Answer
from alphacut.frame.analyses.limits import Limit
from alphacut.frame.analyses.question import Asked, Question
from alphacut.frame.analyses.spectrum_accuracy import accuracy_of
from alphacut.frame.analyses.spectrum_checks import (
    LARGEST_THETA,
    SpectrumChecks,
    drift_sensitivity,
    spectrum_checks,
)
from alphacut.frame.analyses.spectrum_response import SpectrumResponse, spectrum_response
from alphacut.frame.boxes import ALPHA
from alphacut.frame.modes.spectral_modes import spectral_modes
from alphacut.frame.spectra.code_spectrum import CodeSpectrum
from alphacut.frame.spectra.modal_combination import Combination
from alphacut.frame.structures.linear import LinearSystem, has_matrices
from alphacut.frame.structures.model import StructureModel
from alphacut.frame.structures.storey import StoreyFrame, yields


@dataclass(frozen=True, kw_only=True)
class SpectrumQuestion(CodeSpectrum, Question):
    """Peaks by the response-spectrum method, and checks of them.

    A spectrum of EN 1998-1 has `ground_acceleration` and `ground_type`, and `q` if it is the design
    spectrum; the multi-period spectrum of ASCE 7-22 has `values`, a spectrum of one's own `file`.

    Args:
        fuzzy: inputs that are fuzzy, as of [envelope]
        alpha: α-levels
        q: behaviour factor of the design spectrum of EN 1998-1, 3.2.2.5; without it the elastic one
        combination: how the peaks of modes are combined
        modes: number of the lowest modes; all if left out
        own_ratios: whether CQC takes the damping ratio of each mode in place of that of the
            spectrum
        limits: limits of combined peaks, 'drift <= 0.5 %', 'base_shear <= 900 kN'
        displacement_factor: factor of displacements in the checks: q_d of EN 1998-1, 4.3.4, or
            C_d/I_e of ASCE 7-22; q if left out, and 1 without q
        base_shear_floor: least base shear, as that of ASCE 7-22, 12.9.1.4.1
        theta: largest θ = P d/(V h) of a storey, by EN 1998-1, 4.4.2.2: 0.1, 0.2 or 0.3
    """

    needs_magnitudes = True
    records: ClassVar[Literal["refused", "allowed", "needed"]] = "allowed"
    of_learned_set = False
    fuzzy: tuple[str, ...]
    alpha: tuple[float, ...] = ALPHA
    q: Annotated[float, Quantity(minimum=1)] | None = None
    combination: Literal["CQC", "SRSS"] = "CQC"
    modes: Annotated[int, Quantity(minimum=1, is_integer=True)] | None = None
    own_ratios: bool = False
    limits: tuple[Limit, ...] = ()
    displacement_factor: Annotated[float, Quantity(above=0)] | None = None
    base_shear_floor: Annotated[float, Quantity("N", above=0)] | None = None
    theta: Annotated[float, Quantity(above=0, maximum=1)] | None = None

    def __post_init__(self) -> None:
        """Refuse what a spectrum does, and a behaviour factor beside another one than EN 1998-1."""
        super().__post_init__()
        is_of_code = self.ground_acceleration is not None or self.q is None
        require(is_of_code, "q", self.q, "beside ground_acceleration")

    @property
    def behaviour_factor(self) -> float | None:
        """The behaviour factor q."""
        return self.q

    @property
    def factor_of_displacements(self) -> float:
        """Factor of displacements and drifts in the checks."""
        return self.displacement_factor or self.q or 1.0

    def observed(self, model: StructureModel) -> LinearSystem:
        """Return the model with the outputs that a spectrum gives: its own, and what is checked.

        Velocities and accelerations of the structure are left out.
        """
        names = [x for x in model.outputs if model.unit_of(x) not in ("m/s", "m/s^2")]
        names += [limit.output for limit in self.limits]
        if self.base_shear_floor is not None:
            names.append("base_shear")
        allowed = "outputs of displacements or forces"
        require(bool(names), "response_spectrum", "without outputs", allowed)
        return cast("LinearSystem", model).with_outputs(tuple(dict.fromkeys(names)))

    def require(self, model: StructureModel, components: int) -> None:
        """Refuse a structure and records that the method cannot take."""
        allowed = "records of one component, beside [response_spectrum]"
        require(components < 2, "records.files", "of several components", allowed)
        is_linear = has_matrices(model) and not yields(model)
        require(is_linear, "response_spectrum", "of another structure", "linear structures")
        self.observed(model)
        has_heights = isinstance(model, StoreyFrame) and bool(model.lengths)
        allowed = "beside [frame] with lengths of its storeys"
        require(has_heights or self.theta is None, "theta", self.theta, allowed)

    def require_computable(self, asked: Asked) -> None:
        """Refuse a structure whose nominal peaks the method does not give.

        These are outputs of velocities or accelerations, and periods outside the spectrum.
        """
        method = Combination(self.target, self.combination, self.modes, self.own_ratios)
        no_parameters = np.zeros((1, 0))  # one set of them
        method.combined(spectral_modes(self.observed(asked.model), (), no_parameters))

    def answer(self, asked: Asked, progress: Progress) -> SpectrumResponse:
        """Return the combined peaks."""
        return spectrum_response(
            self.observed(asked.model),
            asked.inputs,
            self.target,
            combination=self.combination,
            modes=self.modes,
            own_ratios=self.own_ratios,
            alpha=asked.alpha,
        )

    def further(self, asked: Asked, found: Answer) -> dict[str, Callable[[Progress], Answer]]:
        """Return the checks, if there are some, and beside records the errors under each."""
        of_peaks = cast("SpectrumResponse", found)
        computed: dict[str, Callable[[Progress], Answer]] = {}
        if self.limits or self.base_shear_floor or self.theta:
            computed["spectrum_checks"] = lambda _: self._checks(asked, of_peaks)
        if asked.records:
            model = self.observed(asked.model)
            computed["spectrum_accuracy"] = lambda progress: accuracy_of(
                model, of_peaks, asked.records, step=asked.step, progress=progress
            )
        return computed

    def _checks(self, asked: Asked, found: SpectrumResponse) -> SpectrumChecks:
        """Return the verdicts on the limits, and on θ if it is limited."""
        factor = self.factor_of_displacements
        theta = {}
        if self.theta is not None:
            frame = cast("StoreyFrame", asked.model)
            theta = drift_sensitivity(
                frame, asked.inputs, alpha=asked.alpha, displacement_factor=factor
            )
        return spectrum_checks(
            found,
            self.limits,
            displacement_factor=factor,
            base_shear_floor=self.base_shear_floor,
            theta=theta,
            largest_theta=self.theta or LARGEST_THETA,
            input_units=asked.input_units,
        )
