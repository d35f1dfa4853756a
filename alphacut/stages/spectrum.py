"""Stage response_spectrum: peaks by the response-spectrum method, checks, errors under records."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np

from alphacut.base.errors import RefusedError
from alphacut.case.spectrum import ResponseSpectrumSection
from alphacut.case.structure import Structure
from alphacut.frame import (
    Limit,
    SpectrumAccuracy,
    SpectrumChecks,
    SpectrumResponse,
    StoreyFrame,
    drift_sensitivity,
    spectrum_checks,
    spectrum_response,
)
from alphacut.frame.analyses.spectrum_accuracy import accuracy_of
from alphacut.frame.analyses.suites import ScaledRecord
from alphacut.frame.modes.spectral_modes import spectral_modes
from alphacut.frame.spectra.modal_combination import Combination
from alphacut.frame.structures.linear import LinearSystem
from alphacut.stages.store import Stage, StageContext, StageResult


def observed_model(section: ResponseSpectrumSection, structure: Structure) -> LinearSystem:
    """Return the linear model with the outputs that a spectrum gives.

    Raises:
        RefusedError: The structure is not linear.
    """
    model = structure.model
    if not isinstance(model, LinearSystem):
        raise RefusedError("response_spectrum", "of a system that is not linear", "[frame]")
    return model.with_outputs(section.outputs_of(structure))


def require_possible(section: ResponseSpectrumSection, structure: Structure) -> None:
    """Refuse a structure whose nominal peaks the method does not give.

    Raises:
        RefusedError: An output takes velocities or accelerations, or a period lies outside the
            range of the spectrum.
    """
    method = Combination(
        section.target, section.combination, section.modes, own_ratios=section.own_ratios
    )
    no_parameters = np.zeros((1, 0))  # one set of them
    model = observed_model(section, structure)
    try:
        method.combined(spectral_modes(model, (), no_parameters))
    except RefusedError as error:
        key = f"response_spectrum: {error.key}"
        raise RefusedError(key, error.value, error.allowed, error.cure) from None


def stage(section: ResponseSpectrumSection, structure: Structure) -> Stage[SpectrumResponse]:
    """Return the stage that computes the combined peaks of a structure."""
    inputs = [section, structure.model, structure.numbers]
    compute = partial(_response, section, structure)
    return Stage(SpectrumResponse.key, inputs, ("fuzzy", "frame"), SpectrumResponse, compute)


def _response(
    section: ResponseSpectrumSection, structure: Structure, _: StageContext
) -> StageResult[SpectrumResponse]:
    """Compute the combined peaks of a structure."""
    found = spectrum_response(
        observed_model(section, structure),
        structure.inputs(section.fuzzy),
        section.target,
        combination=section.combination,
        modes=section.modes,
        own_ratios=section.own_ratios,
        alpha=section.alpha,
    )
    return StageResult(found)


def checks_of(
    section: ResponseSpectrumSection, structure: Structure, found: SpectrumResponse
) -> SpectrumChecks:
    """Return the verdicts on the limits of a section, which has some."""
    theta = {}
    largest_theta = 0.3
    model = structure.model
    if section.theta is not None:
        assert isinstance(model, StoreyFrame)  # as the case was checked for
        largest_theta = section.theta
        theta = drift_sensitivity(
            model,
            structure.inputs(section.fuzzy),
            alpha=section.alpha,
            displacement_factor=section.factor_of_displacements,
        )
    limits: tuple[Limit, ...] = ()
    if section.limits:
        limits = section.with_storeys(structure).limits_of(structure)
    return spectrum_checks(
        found,
        limits,
        displacement_factor=section.factor_of_displacements,
        base_shear_floor=section.base_shear_floor,
        theta=theta,
        largest_theta=largest_theta,
        input_units={name: structure.input_unit(name) for name in found.nominal_inputs},
    )


def accuracy_stage(
    section: ResponseSpectrumSection,
    structure: Structure,
    found: SpectrumResponse,
    records: Sequence[ScaledRecord],
    step: float,
) -> Stage[SpectrumAccuracy]:
    """Return the stage that compares the method with the peaks under records.

    Args:
        section: The section.
        structure: The structure.
        found: Its combined peaks.
        records: Records of one component.
        step: Time step in s.
    """

    def compute(context: StageContext) -> StageResult[SpectrumAccuracy]:
        """Compare the peaks under each record, reporting progress."""
        model = observed_model(section, structure)
        return StageResult(accuracy_of(model, found, records, step=step, progress=context.tick))

    inputs = [section, structure.model, structure.numbers, records, step]
    packages = ("fuzzy", "frame")
    return Stage(SpectrumAccuracy.key, inputs, packages, SpectrumAccuracy, compute)
