"""What a run reads and refuses before it computes: `check` passes what `run` takes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from alphacut import frame
from alphacut.case.content import Content
from alphacut.case.structure import LOSS_STAND_IN, STAND_IN, Structure
from alphacut.fuzzy import Crisp, FuzzyNumber, Triangular
from alphacut.questions.all import questions_of
from alphacut.questions.question import Motion
from alphacut.stages import envelope, identify, image, suite
from alphacut.stages.cell import model_of
from alphacut.stages.meshed import require_mesh
from alphacut.stages.modulus import CellCampaign, require_levels
from alphacut.stochastic.sections import Simulated


def require_runnable(content: Content) -> None:
    """Builds everything that the stages of a case read, and the first steps of its motions.

    Raises:
        RefusedError: A stage would refuse a file, a model or a value.
    """
    stages = content.stages
    if "microstructure" in stages and content.microstructure is not None:
        study = content.microstructure.study(spheres=content.has_spheres)
        if not isinstance(study.source, Simulated):
            study.source.read()
    if "modulus" in stages:
        _require_material(content)
    if "envelope" in stages:
        _require_motion(content)


def _require_material(content: Content) -> None:
    """Builds the model of the cell, and the samples it is asked for, or judges its image."""
    if "envelope" in content.stages and not content.has_own_modulus:
        require_levels(content.modulus.alpha, "modulus.alpha")
    if content.meshed is not None:
        require_mesh(content.mesh, *content.meshed_cell)
    if content.picture is not None:
        image.study_of(content.picture)
    elif "microstructure" not in content.stages:
        _ = campaign_of(content).propagation
    elif content.round is not None:
        model_of(content.round, content.mesh, content.modulus)


def campaign_of(content: Content, petsc: Mapping[str, str] | None = None) -> CellCampaign:
    """Samples of a cell that is no image, by a solver with options of PETSc."""
    radius, cell = content.round_cell if content.meshed is None else content.meshed_cell
    sections = radius, cell, content.mesh, content.modulus
    return CellCampaign(*sections, petsc or {}, content.stated_fraction)


def _require_motion(content: Content) -> None:
    """Requires an admissible motion of each study, and what questions ask of the structure."""
    if content.structure_section is None or content.envelope is None:
        return
    number, alpha = _modulus(content), content.envelope.alpha
    structure = content.structure_of(number, _loss(content, number))
    if content.identify is not None:
        identify.require_learnable(content.identify, structure, alpha)
    if content.records is not None:
        records = suite.suite(content.records, content.envelope, structure)
        structure = suite.with_record(structure, records[0])
    for task in envelope.tasks(content.envelope, content.study):
        frame.require_envelope(**task.arguments(structure))
    (task,) = envelope.tasks(content.envelope, ())
    motion = Motion(structure, task.fuzzy, alpha, task.duration, task.section.step)
    for question in questions_of(content.questions):
        question.require_answerable(motion)


def _modulus(content: Content) -> FuzzyNumber | None:
    """A modulus that stands in for that of a stage, fuzzy where that will be."""
    if "modulus" not in content.stages:
        return None
    value = STAND_IN.modal
    is_fuzzy = content.picture is not None or "microstructure" in content.stages
    if not is_fuzzy:
        inputs = campaign_of(content).inputs.values()
        is_fuzzy = any(number.support.width > 0 for number in inputs)
    crisp = content.modulus.alpha == (1.0,) or not is_fuzzy
    return Crisp(value) if crisp else Triangular(0.99 * value, value, 1.01 * value)


def _loss(content: Content, modulus: FuzzyNumber | None) -> FuzzyNumber:
    """A loss factor that stands in for that of a stage, fuzzy where that will be."""
    losses = [x for pair in content.cell.losses for x in pair if x] if content.cell else []
    widths = [x.support.width for x in (*losses, modulus) if x is not None]
    value = LOSS_STAND_IN.modal
    is_fuzzy = any(widths) and content.modulus.alpha != (1.0,)
    return Triangular(0.9 * value, value, 1.1 * value) if is_fuzzy else LOSS_STAND_IN


def cut_record_warnings(content: Content, structure: Structure) -> Iterator[str]:
    """Sentences on a record that goes on after the end of a motion."""
    linear = structure.linear
    if linear is None or linear.ground is None or content.envelope is None:
        return
    lasts = linear.ground.step * (len(linear.ground.acceleration) - 1)
    longest = max(task.duration for task in envelope.tasks(content.envelope, content.study))
    if lasts > longest * (1 + 1e-9):
        yield f"the record lasts {lasts:g} s, and the motion is computed for {longest:g} s"
