"""What the stages of a case need: read and built before any of their work."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from alphacut.base.errors import FailedError, RefusedError, require
from alphacut.case.content import Content
from alphacut.case.material import ThetaSection
from alphacut.case.motion import EnvelopeSection
from alphacut.case.structure import Structure
from alphacut.stages.cell import CellProblem, require_levels
from alphacut.stages.foreseen import possible_materials, structure_as_computed

if TYPE_CHECKING:
    from alphacut.frame.analyses.suites import ScaledRecord
    from alphacut.rve.image.study import ImagePhase, ImageStudy

# Stages are imported where a case has them: all of them take .1 s.


class Built(NamedTuple):
    """What was read to see that a case can run.

    Args:
        image: Study of the image that stage modulus takes; None where it takes none.
        records: Records of a suite as they move the structure; empty without a suite.
    """

    image: ImageStudy[ImagePhase] | None
    records: tuple[ScaledRecord, ...]


def require_runnable(content: Content) -> Built:
    """Read and build all that the stages of a case need, so that `check` refuses it too.

    Raises:
        RefusedError: A file is not read, or what a stage needs does not fit.
        FailedError: What a stage needs cannot be built.
    """
    study_of_image = None
    records: tuple[ScaledRecord, ...] = ()
    if "microstructure" in content.stages and content.microstructure is not None:
        content.microstructure.require_readable(spheres=content.has_spheres)
    if "modulus" in content.stages:
        study_of_image = _require_material(content)
    if "envelope" in content.stages:
        records = _require_motion(content)
    for section in content.asked_alone:
        assert content.structure is not None  # as the case was checked for
        section.require_computable(content.structure, ())
    return Built(study_of_image, records)


def _require_material(content: Content) -> ImageStudy[ImagePhase] | None:
    """Refuse a cell, mesh or image that stage modulus cannot take.

    Returns:
        The study of the image, which was read for that; None for another cell.

    Raises:
        RefusedError: The cell, its mesh or its image does not fit the method; the α-levels make no
            fuzzy modulus for a structure; or a structure would get its modulus from an image with
            pores or rigid phases, of which one bound may be missing.
    """
    has_motion = "envelope" in content.stages
    if has_motion and not content.has_stated_modulus:
        require_levels(content.modulus.alpha, "modulus.alpha")
    if content.image_cell is not None:
        fits = all(content.image_cell.is_solid) or not has_motion
        cure = "give a pore a small modulus, a rigid phase a large one, or take stage modulus alone"
        require(fits, "cell.modulus", "0 or rigid", "both bounds of E, for a frame", cure)
        from alphacut.stages.image import study_of

        study = study_of(content.image_cell)
        study.require_solid(content.modulus.alpha)
        return study
    if "microstructure" not in content.stages:
        problem = CellProblem.of(content)
        problem.require_mesh()
        problem.model()
    elif (particle := content.particle_cell) is not None:
        # Its radius is not known yet. The model does not depend on it: building it shows whether
        # its library is there and its resolution allowed.
        CellProblem(ThetaSection(), particle, content.mesh, content.modulus).model()
    return None


def _require_motion(content: Content) -> tuple[ScaledRecord, ...]:
    """Refuse a case whose identification, envelopes or questions cannot be computed.

    If the material is not known before a stage has run, two extremes of what it may be are tried,
    and the case is refused only if neither works.

    Returns:
        The records of a suite as they move the structure; empty without a suite.

    Raises:
        RefusedError: All materials are refused; it is the error of the first one.
        FailedError: The same, if the computation cannot be built with the first one.
    """
    if content.structure is None or content.envelope is None:
        return ()
    # A wrong stand-in must not refuse a right case: one extreme that works is enough.
    errors: list[RefusedError | FailedError] = []
    for material in possible_materials(content):
        try:
            structure = structure_as_computed(content, material)
            return _require_motion_of(content, content.envelope, structure)
        except (RefusedError, FailedError) as error:
            errors.append(error)
    raise errors[0]


def _require_motion_of(
    content: Content, section: EnvelopeSection, structure: Structure
) -> tuple[ScaledRecord, ...]:
    """Refuse identification, envelopes or tolerances that cannot be computed for a structure.

    Args:
        content: The case.
        section: Its section [envelope].
        structure: The structure, with the numbers fuzzy that will be so in the run. Of a suite the
            first record alone moves it here.

    Returns:
        The records of a suite as they move the structure; empty without a suite.

    Raises:
        RefusedError: An input, output, record, method or tolerance does not fit the structure.
        FailedError: The method cannot be set up for it.
    """
    from alphacut.frame import require_envelope
    from alphacut.stages.envelope import tasks

    records: tuple[ScaledRecord, ...] = ()
    if content.identify is not None:
        from alphacut.stages.identify import require_learnable

        require_learnable(content.identify, structure, section.alpha)
    if content.records is not None:
        from alphacut.stages.suite import moved_by, suite_records

        records = suite_records(content.records, section, structure)
        structure = moved_by(structure, records[0])  # which stands for all
    for task in tasks(section, content.study):
        require_envelope(**task.arguments(structure))
    for question in content.asked().values():
        question.require_computable(structure, section.fuzzy)
    return records
