"""Sections on response spectra: the target of records, and the response-spectrum method."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field, ValidationInfo

from alphacut.base.errors import RefusedError, require, require_choice
from alphacut.case.limits import AnyLimit, QuestionSection
from alphacut.case.structure import Structure
from alphacut.case.types import ALPHA, Levels, Names, Quantity, Section, case_file, text
from alphacut.frame import TargetSpectrum, asce7_multi_period, eurocode8_spectrum, read_spectrum
from alphacut.frame.structures.linear import LinearSystem
from alphacut.frame.structures.storey import StoreyFrame


def _read_spectrum(value: object, info: ValidationInfo) -> TargetSpectrum:
    """Return the spectrum in a file that the case names."""
    return read_spectrum(case_file(value, info))


class CodeSpectrumSection(Section):
    """A spectrum of a code or from a file.

    A spectrum of EN 1998-1 has `ground_acceleration` and `ground_type`, the multi-period spectrum
    of ASCE 7-22 `values`, a spectrum of one's own `file`.
    """

    place: ClassVar[str]
    ground_acceleration: Annotated[float, Quantity("m/s^2", above=0)] | None = None
    """design ground acceleration a_g = γI a_gR, as "0.25 g", of EN 1998-1"""
    ground_type: str = ""
    """A to E, of EN 1998-1"""
    type: Literal[1, 2] = 1
    """type of the spectrum of EN 1998-1"""
    values: tuple[Annotated[float, Quantity("m/s^2", above=0)], ...] = ()
    """the site's 22 accelerations of ASCE 7-22, 11.4.5.1, from 0 to 10 s"""
    file: Annotated[TargetSpectrum, text(_read_spectrum)] | None = None
    """CSV file with the head period [s],acceleration [g]"""
    damping: Annotated[float, Quantity(minimum=0, below=1)] = 0.05
    """damping ratio of the spectrum; of [records.spectrum] that of the records' spectra, too"""

    @property
    def behaviour_factor(self) -> float | None:
        """Behaviour factor q of EN 1998-1 for its design spectrum; None for the elastic one."""
        return None

    @property
    def target(self) -> TargetSpectrum:
        """The spectrum.

        Raises:
            RefusedError: The ground type is unknown, or there are not 22 values.
        """
        if self.file is not None:
            return replace(self.file, damping=self.damping)
        if self.ground_acceleration is None:
            return replace(asce7_multi_period(np.array(self.values)), damping=self.damping)
        require_choice(f"{self.place}.ground_type", self.ground_type, "ABCDE")
        return eurocode8_spectrum(
            self.ground_acceleration,
            self.ground_type,
            spectrum_type=self.type,
            damping=self.damping,
            q=self.behaviour_factor,
        )

    def require_consistent(self) -> None:
        """Refuse none or several spectra, and one that is no spectrum."""
        super().require_consistent()
        stated = [x for x in ("ground_acceleration", "values", "file") if self.has_key(x)]
        allowed = "one of ground_acceleration, values and file"
        require(len(stated) > 0, f"{self.place}.ground_acceleration", None, allowed)
        require(len(stated) == 1, self.place, f"with {' and '.join(stated)}", allowed)
        if self.ground_acceleration is None:
            for name in ("ground_type", "type"):
                key, value = f"{self.place}.{name}", getattr(self, name)
                require(not self.has_key(name), key, value, "beside ground_acceleration")
        _ = self.target


class SpectrumSection(CodeSpectrumSection):
    """Target spectrum to which the records are scaled, of a code or from a file.

    The elastic spectrum of EN 1998-1 has `ground_acceleration` and `ground_type`, the multi-period
    spectrum of ASCE 7-22 `values`, a spectrum of one's own `file`.
    """

    place = "records.spectrum"
    fit: Literal["record", "suite", "period"] = "record"
    """a factor of each record or of the suite, by least squares; or the target's value at T1"""
    over: tuple[float, float] = (0.2, 2.0)
    """range of periods that are fitted, over T1"""


class ResponseSpectrumSection(QuestionSection, CodeSpectrumSection):
    """Peaks by the response-spectrum method, and checks of them.

    A spectrum of EN 1998-1 has `ground_acceleration` and `ground_type`, and `q` if it is the design
    spectrum; the multi-period spectrum of ASCE 7-22 has `values`, a spectrum of one's own `file`.
    """

    key = place = "response_spectrum"
    needs_magnitudes = True
    records = "allowed"

    fuzzy: Names
    """inputs that are fuzzy, as of [envelope]"""
    alpha: Levels = Field(default=ALPHA, description="α-levels")
    q: Annotated[float, Quantity(minimum=1)] | None = None
    """behaviour factor of the design spectrum of EN 1998-1, 3.2.2.5; without it the elastic one"""
    combination: Literal["CQC", "SRSS"] = "CQC"
    """how the peaks of modes are combined"""
    modes: Annotated[int, Quantity(minimum=1, is_integer=True)] | None = None
    """number of the lowest modes; all if left out"""
    own_ratios: bool = False
    """whether CQC takes the damping ratio of each mode in place of that of the spectrum"""
    limits: tuple[AnyLimit, ...] = ()
    """limits of combined peaks, 'drift <= 0.5 %', 'base_shear <= 900 kN'"""
    displacement_factor: Annotated[float, Quantity(above=0)] | None = None
    """factor of displacements in the checks: q_d of EN 1998-1, 4.3.4, or C_d/I_e of ASCE 7-22; q
    if left out, and 1 without q"""
    base_shear_floor: Annotated[float, Quantity("N", above=0)] | None = None
    """least base shear, as that of ASCE 7-22, 12.9.1.4.1"""
    theta: Annotated[float, Quantity(above=0, maximum=1)] | None = None
    """largest θ = P d/(V h) of a storey, by EN 1998-1, 4.4.2.2: 0.1, 0.2 or 0.3"""

    @property
    def behaviour_factor(self) -> float | None:
        """The behaviour factor q."""
        return self.q

    @property
    def factor_of_displacements(self) -> float:
        """Factor of displacements and drifts in the checks."""
        return self.displacement_factor or self.q or 1.0

    @property
    def has_checks(self) -> bool:
        """Whether there is anything to check."""
        return bool(self.limits or self.base_shear_floor or self.theta)

    def require_consistent(self) -> None:
        """Refuse a behaviour factor beside another spectrum than that of EN 1998-1."""
        super().require_consistent()
        is_of_code = self.ground_acceleration is not None or self.q is None
        require(is_of_code, "response_spectrum.q", self.q, "beside ground_acceleration")

    def outputs_of(self, structure: Structure) -> tuple[str, ...]:
        """Return the outputs that a spectrum gives: those of the structure, and what is checked.

        Velocities and accelerations of the structure are left out.
        """
        names = [x for x in structure.outputs if structure.unit(x) not in ("m/s", "m/s^2")]
        names += [limit.output for limit in self.with_storeys(structure).limits]
        if self.base_shear_floor is not None:
            names.append("base_shear")
        return tuple(dict.fromkeys(names))

    def observed_model(self, structure: Structure) -> LinearSystem:
        """Return the linear model with the outputs that a spectrum gives.

        Raises:
            RefusedError: The structure is not linear.
        """
        model = structure.model
        if not isinstance(model, LinearSystem):
            raise RefusedError("response_spectrum", "of a system that is not linear", "[frame]")
        return model.with_outputs(self.outputs_of(structure))

    def require_computable(self, structure: Structure, fuzzy: Sequence[str]) -> None:
        """Refuse a structure whose nominal peaks the method does not give.

        Raises:
            RefusedError: An output takes velocities or accelerations, or a period lies outside the
                range of the spectrum.
        """
        # take time to import
        from alphacut.frame.modes.spectral_modes import spectral_modes
        from alphacut.frame.spectra.modal_combination import Combination

        method = Combination(self.target, self.combination, self.modes, own_ratios=self.own_ratios)
        no_parameters = np.zeros((1, 0))  # one set of them
        model = self.observed_model(structure)
        try:
            method.combined(spectral_modes(model, (), no_parameters))
        except RefusedError as error:
            key = f"response_spectrum: {error.key}"
            raise RefusedError(key, error.value, error.allowed, error.cure) from None

    def require_answerable(self, structure: Structure, components: int) -> None:
        """Refuse inputs, outputs and limits that the structure does not have.

        Raises:
            RefusedError: One of them does not fit; nothing is observed that a spectrum gives; or θ
                is limited and the structure is no frame with the lengths of its storeys.
        """
        section = self.with_storeys(structure)
        if section.limits:
            section.limits_of(structure)
        outputs = self.outputs_of(structure)
        allowed = "outputs of displacements or forces"
        require(bool(outputs), "response_spectrum", "without outputs", allowed)
        structure.require_quantities("response_spectrum.limits", list(outputs))
        model = structure.model
        has_heights = isinstance(model, StoreyFrame) and bool(model.lengths)
        allowed = "beside [frame] with lengths of its storeys"
        require(has_heights or self.theta is None, "response_spectrum.theta", self.theta, allowed)
