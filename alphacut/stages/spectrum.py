"""Stage response_spectrum: peaks by the response-spectrum method, checks, errors under records."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

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
from alphacut.stages.store import Stage, StageContext, StageResult


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
        section.observed_model(structure),
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
        model = section.observed_model(structure)
        return StageResult(accuracy_of(model, found, records, step=step, progress=context.tick))

    inputs = [section, structure.model, structure.numbers, records, step]
    packages = ("fuzzy", "frame")
    return Stage(SpectrumAccuracy.key, inputs, packages, SpectrumAccuracy, compute)
