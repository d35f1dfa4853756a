"""E of a cell: guaranteed cuts against another accuracy, spheres within the bounds of their fraction."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from alphacut.case.content import load
from alphacut.fuzzy import FailedError, Nature
from alphacut.rve.fuzzy_cell import CellSamples, FuzzyCell, require_consistent
from alphacut.stages.cell import CellProblem, require_bounds
from alphacut.stages.modulus import solved
from tests.alphacut.case.test_load import fraction_case
from tests.alphacut.small import CELL, told_by, written
from tests.refused import refuses

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
    words = ["--set=modulus.plan=signed", "--set=cell.inclusion_poisson=0.3"]
    table = told_by("modulus", written(tmp_path, CELL), f"--out={tmp_path}/out", *words).partition(
        "\nmaterial "
    )[2]
    rows = (re.split(" {2,}", line) for line in table.splitlines())
    natures = {row[0]: row[-1] for row in rows if row[-1] in [*Nature]}
    assert natures.pop("E, GPa (isotropic)") == "guaranteed"
    assert natures.keys() > {"ν", "E_T, GPa"}
    assert set(natures.values()) == {"attained"}


def spheres(folder: Path, fraction: float):
    path = folder / "case.toml"
    path.write_text(fraction_case("spheres", fraction))
    return load(path).content


@pytest.mark.parametrize("fraction", [0.1, 0.5])
def test_spheres_of_one_size_hold_the_fraction_and_lie_within_its_bounds(tmp_path, fraction):
    problem = CellProblem.of(spheres(tmp_path, fraction))
    modulus, bounds = problem.solve().modulus, problem.references()
    assert bounds["fraction"] == pytest.approx(fraction, rel=1e-12)
    require_bounds((modulus / 1e9,) * 2, bounds, problem.cell.particles)


@pytest.mark.parametrize(
    ("fraction", "low", "modulus"), [(0.5, 33.333333, 30.466), (0.4, 30.0, 28.30)]
)
def test_a_modulus_outside_the_bounds_of_the_stated_fraction_is_refused(
    tmp_path, fraction, low, modulus
):
    """Both moduli are those of maps that had lost a fifth of the spheres."""
    problem = replace(CellProblem.of(spheres(tmp_path, 0.3)), stated_fraction=fraction)
    bounds = problem.references()
    ends = np.array(bounds["hashin_shtrikman_E_GPa"])
    assert ends[0] == pytest.approx(low, rel=1e-7)
    with refuses("E of spheres"):
        require_bounds((modulus, modulus), bounds, "spheres")
    for inside in ends * [0.9951, 1.0049]:
        require_bounds((inside, inside), bounds, "spheres")
    for outside in ends * [0.9949, 1.0051]:
        with refuses("E of spheres"):
            require_bounds((outside, outside), bounds, "spheres")
