"""What a run reads and refuses before it computes: `check` passes what `run` takes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from alphacut import frame
from alphacut.case.content import Content
from alphacut.case.structure import LOSS_STAND_IN, STAND_IN, Structure
from alphacut.fuzzy import Crisp, FuzzyNumber, Triangular
from alphacut.questions.all import questions_of
from alphacut.questions.question import FuzzyResponse
from alphacut.stages import envelope, identify, image, suite
from alphacut.stages.cell import model_of
from alphacut.stages.meshed import require_mesh
from alphacut.stages.modulus import CellCampaign, require_levels
from alphacut.stochastic.sections import Simulated


def require_runnable(content: Content) -> None:
    """Reads and builds all that the stages of a case need, so that `check` refuses it too."""
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
    """Requires a mesh, an image or a model of the cell that stage modulus can use."""
    if "envelope" in content.stages and not content.has_stated_modulus:
        require_levels(content.modulus.alpha, "modulus.alpha")
    if content.mesh_cell is not None:
        require_mesh(content.mesh, *content.law_and_phases)
    if content.image_cell is not None:
        image.image_study(content.image_cell)
    elif "microstructure" not in content.stages:
        _ = campaign_of(content).propagation  # builds the model and the plan
    elif content.particle_cell is not None:
        model_of(content.particle_cell, content.mesh, content.modulus)


def campaign_of(content: Content, petsc: Mapping[str, str] | None = None) -> CellCampaign:
    """Samples of a cell that is no image, by a solver with options of PETSc."""
    sections = *content.random_cell, content.mesh, content.modulus
    return CellCampaign(*sections, petsc or {}, content.stated_fraction)


def _require_motion(content: Content) -> None:
    """Requires that identification, each study's envelope and each question can be computed."""
    if content.structure_section is None or content.envelope is None:
        return
    modulus, alpha = _stand_in_modulus(content), content.envelope.alpha
    structure = content.structure_of(modulus, _stand_in_loss(content, modulus))
    if content.identify is not None:
        identify.require_learnable(content.identify, structure, alpha)
    if content.records is not None:
        records = suite.suite_records(content.records, content.envelope, structure)
        structure = suite.with_record(structure, records[0])  # which stands for all
    for task in envelope.tasks(content.envelope, content.study):
        frame.require_envelope(**task.arguments(structure))
    (own_task,) = envelope.tasks(content.envelope, ())  # of [envelope], which questions refer to
    response = FuzzyResponse(
        structure, own_task.fuzzy, alpha, own_task.duration, own_task.section.step
    )
    for question in questions_of(content.questions):
        question.require_answerable(response)


def _stand_in_modulus(content: Content) -> FuzzyNumber | None:
    """Young's modulus that stands in for the one of stage modulus, fuzzy where that will be."""
    if "modulus" not in content.stages:
        return None
    value = STAND_IN.modal
    is_fuzzy = content.image_cell is not None or "microstructure" in content.stages
    if not is_fuzzy:
        inputs = campaign_of(content).inputs.values()
        is_fuzzy = any(number.support.width > 0 for number in inputs)
    crisp = content.modulus.alpha == (1.0,) or not is_fuzzy
    return Crisp(value) if crisp else Triangular(0.99 * value, value, 1.01 * value)


def _stand_in_loss(content: Content, modulus: FuzzyNumber | None) -> FuzzyNumber:
    """Loss factor that stands in for the one of stage modulus, fuzzy where that will be."""
    losses = [x for pair in content.cell.losses for x in pair if x] if content.cell else []
    widths = [x.support.width for x in (*losses, modulus) if x is not None]
    value = LOSS_STAND_IN.modal
    is_fuzzy = any(widths) and content.modulus.alpha != (1.0,)
    return Triangular(0.9 * value, value, 1.1 * value) if is_fuzzy else LOSS_STAND_IN


def cut_record_warnings(content: Content, structure: Structure) -> Iterator[str]:
    """Yields a warning if the structure's record goes on after the end of all motions."""
    linear = structure.linear
    if linear is None or linear.ground is None or content.envelope is None:
        return
    length = linear.ground.step * (len(linear.ground.acceleration) - 1)
    longest = max(task.duration for task in envelope.tasks(content.envelope, content.study))
    if length > longest * (1 + 1e-9):
        yield f"the record lasts {length:g} s, and the motion is computed for {longest:g} s"
