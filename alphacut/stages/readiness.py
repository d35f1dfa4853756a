"""What a run reads and refuses before it computes: `check` passes what `run` takes."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import replace

from alphacut import frame
from alphacut.case.content import Content
from alphacut.case.structure import Structure
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
    if content.structure is None or content.envelope is None:
        return
    alpha, structure = content.envelope.alpha, _with_stand_ins(content, content.structure)
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


def _with_stand_ins(content: Content, structure: Structure) -> Structure:
    """The structure with numbers as fuzzy as those that stage modulus will compute."""
    if "modulus" not in content.stages:
        return structure
    numbers, is_crisp = dict(structure.numbers), content.modulus.alpha == (1.0,)
    is_fuzzy = content.image_cell is not None or "microstructure" in content.stages
    if not is_fuzzy:
        inputs = campaign_of(content).inputs.values()
        is_fuzzy = any(number.support.width > 0 for number in inputs)
    if "E" in numbers:
        numbers["E"] = _stand_in(numbers["E"], 0.01 if is_fuzzy and not is_crisp else 0.0)
    losses = [x for pair in content.cell.losses for x in pair if x] if content.cell else []
    is_fuzzy = is_fuzzy or any(x.support.width > 0 for x in losses)
    if content.has_material_damping and is_fuzzy and not is_crisp:
        ratios = {name for name in numbers if re.fullmatch(r"zeta\d*", name)}
        numbers |= {name: _stand_in(numbers[name], 0.1) for name in ratios}
    return replace(structure, numbers=numbers)


def _stand_in(number: FuzzyNumber, share: float) -> FuzzyNumber:
    """A number with the same modal value, fuzzy by a share of it."""
    modal = number.modal
    return Triangular((1 - share) * modal, modal, (1 + share) * modal) if share else Crisp(modal)


def cut_record_warnings(content: Content, structure: Structure) -> Iterator[str]:
    """Yields a warning if the structure's record goes on after the end of all motions."""
    linear = structure.linear
    if linear is None or linear.ground is None or content.envelope is None:
        return
    length = linear.ground.step * (len(linear.ground.acceleration) - 1)
    longest = max(task.duration for task in envelope.tasks(content.envelope, content.study))
    if length > longest * (1 + 1e-9):
        yield f"the record lasts {length:g} s, and the motion is computed for {longest:g} s"
