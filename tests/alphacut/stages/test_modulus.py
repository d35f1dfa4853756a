"""Guaranteed cuts of E are tested by the same model at another accuracy."""

from dataclasses import replace

import pytest

from alphacut.case.content import load
from alphacut.fuzzy import FailedError, Nature
from alphacut.io.typed_json import from_document
from alphacut.report.results import material
from alphacut.rve.fuzzy_cell import CellSamples, FuzzyCell, require_consistent
from alphacut.stages.cell import CellProblem
from alphacut.stages.modulus import solved
from alphacut.stages.summary import Parts
from tests.alphacut.small import CELL, summary_of_run, written

MODELS = {
    "series": (),
    "slices": ("modulus.method=slices", "mesh.size=0.9"),
    "spheres": ("cell.particles=spheres", "modulus.tolerance=1e-4"),
}


@pytest.mark.parametrize(
    "model", [pytest.param(x, marks=[pytest.mark.slow] * (x == "slices")) for x in MODELS]
)
def test_cuts_agree_with_a_coarser_model_and_narrower_ones_do_not(tmp_path, model):
    if model == "slices":
        pytest.importorskip("alphacut.rve.fenicsx")
    changes = ("modulus.plan=signed", "cell.inclusion_poisson=0.3", *MODELS[model])
    problem = CellProblem.of(load(written(tmp_path, CELL), changes).content)
    bounds = solved(problem, progress=False).bounds  # which require it of themselves
    assert bounds.nature_of("E") is Nature.GUARANTEED
    cell = FuzzyCell.of(problem.nominal_radius, problem.nominal_phases, problem.inputs)
    coarse = CellSamples(problem.model().coarser(), cell, average=problem.average, loss_cuts=None)
    require_consistent(bounds, coarse, error=0.0)
    for factor in (0.98, 1.02):
        ends = {"lower": factor * bounds.lower, "upper": factor * bounds.upper}
        wrong = replace(bounds, **ends, inner=None)
        with pytest.raises(FailedError, match=r"the proof is wrong: E of a cell inside a cut"):
            require_consistent(wrong, coarse, error=0.0)


def test_only_e_whose_signs_are_proved_is_called_guaranteed(tmp_path):
    changes = ("--set", "modulus.plan=signed", "--set", "cell.inclusion_poisson=0.3")
    modulus = summary_of_run(written(tmp_path, CELL), *changes)["modulus"]
    head, rows = material(from_document(Parts, {"modulus": modulus}))
    natures = {row[0]: row[head.index("nature")] for row in rows}
    assert natures.pop("E, GPa (isotropic)") == "guaranteed"
    assert natures == {"ν": "attained", "E_T, GPa": "attained"}
