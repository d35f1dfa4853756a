"""Models refuse options out of range by one line."""

import math
from pathlib import Path

import numpy as np
import pytest
from scipy import stats

from alphacut import rve
from alphacut.rve import SpheresModel
from alphacut.stochastic import HermiteMap, TruncatedNormal
from tests.refused import refuses

MESHES = Path(__file__).parents[2] / "meshes"
WRONG = [
    (rve.SeriesModel, {"points": 1}, "number of points of the rule in θ"),
    (rve.SeriesModel, {"accuracy": 1e-15}, "the accuracy of the series"),
    (SpheresModel, {"points": 1}, "number of points of the rule in θ"),
    (SpheresModel, {"accuracy": 1e-12}, "the accuracy of the series"),
    (SpheresModel, {"accuracy": np.nan}, "the accuracy of the series"),
    ("SlicesModel", {"points": 1}, "number of points of the rule in θ"),
    ("SlicesModel", {"mesh_size": 2}, "the mesh size"),
    ("PrismModel", {"mesh_size": 0.0}, "the mesh size"),
    ("PrismModel", {"layers": 0}, "the number of layers"),
    ("PrismModel", {"layers": 2.5}, "the number of layers"),
    ("PrismModel", {"layers": "2"}, "the number of layers"),
    ("PrismModel", {"mesh_size": "0.5"}, "the mesh size"),
    ("PrismModel", {"petsc": "-ksp_type cg"}, "petsc"),
    ("PrismModel", {"petsc": {"-rve_ksp_type": "cg"}}, "petsc"),
    ("PrismModel", {"modulus_range": 8e10}, "modulus_range"),
    ("PrismModel", {"modulus_range": (1e9,)}, "modulus_range"),
    ("PrismModel", {"outline": 0.5}, "outline"),
    ("PrismModel", {"outline": lambda _: 1.0}, "outline"),
    ("PrismModel", {"outline": lambda a: 1 + 0.1 * math.cos(a)}, "outline"),
    ("SlicesModel", {"points": "5"}, "number of points of the rule in θ"),
    ("SlicesModel", {"outline": lambda _: 1.0}, "outline"),
    (rve.SeriesModel, {"accuracy": "1e-6"}, "the accuracy of the series"),
    (rve.SeriesModel, {"points": 2.5}, "number of points of the rule in θ"),
    ("MeshModel", {"file": "a.msh", "petsc": []}, "petsc"),
]


@pytest.mark.parametrize(("model", "options", "key"), WRONG)
def test_an_option_out_of_range_is_refused(model, options, key):
    if isinstance(model, str):
        pytest.importorskip("alphacut.rve.fenicsx")
        model = getattr(rve, model)
    with refuses(key):
        model(**options)


@pytest.mark.parametrize("law", ["normal", stats.norm(), stats.norm, 3, None, {}])
def test_what_is_no_law_is_refused_with_one(law):
    pytest.importorskip("alphacut.rve.fenicsx")
    phases = {"matrix": rve.Phase(20e9), "inclusion": rve.Phase(80e9)}
    meshed = rve.MeshModel(MESHES / "paper-coarse.msh")
    level_set = rve.LevelSetModel(lambda x, y, _: np.hypot(x, y) - 0.5, 1.0, 1)
    for model in (meshed, level_set):
        with refuses("law of θ"):
            model.solve(law, phases)
    with refuses("law of θ"):
        HermiteMap(0.2, 0.1, 0.8, 0.1, law)


@pytest.mark.parametrize(
    ("function", "key"),
    [
        (lambda x, y, _: math.hypot(x, y) - 0.5, "level set"),
        (lambda x: x, "level set"),
        (lambda *_: 0.5, "level set"),
        (lambda *_: None, "level set"),
        (0.5, "level set"),
    ],
)
def test_a_level_set_that_takes_no_arrays_is_refused(function, key):
    pytest.importorskip("alphacut.rve.fenicsx")
    phases = {"matrix": rve.Phase(20e9), "inclusion": rve.Phase(80e9)}
    with refuses(key):
        rve.LevelSetModel(function, 1.0, 1).solve(TruncatedNormal(-3, 3), phases)


def test_minres_is_told_the_norm_that_it_takes_and_takes_it():
    pytest.importorskip("alphacut.rve.fenicsx")
    from petsc4py import PETSc

    radius, phases = HermiteMap(0.2, 0.1, 0.8, 0.1), (rve.Phase(20e9), [rve.Phase(80e9)])
    options = {"mesh_size": 1.0, "layers": 1, "estimate": False}
    minres = {"ksp_type": "minres"}
    if PETSc.Sys.getVersion() < (3, 25):  # which takes the norm that is set by default
        with refuses("PETSc"):
            rve.PrismModel(**options, petsc=minres).solve(radius, *phases)
        minres["ksp_norm_type"] = "preconditioned"
    [result] = rve.PrismModel(**options, petsc=minres).solve(radius, *phases)
    [right] = rve.PrismModel(**options).solve(radius, *phases)
    assert result.modulus == pytest.approx(right.modulus, rel=1e-6)


def test_swapped_arguments_are_told_their_order():
    pytest.importorskip("alphacut.rve.fenicsx")
    radius, soft, hard = HermiteMap(0.2, 0.1, 0.8, 0.1), rve.Phase(20e9), rve.Phase(80e9)
    model = rve.PrismModel(1.0, 1)
    for method in (model.solve, model.fields):
        for arguments in ((soft, radius, [hard]), (radius, [hard], soft), (radius, soft, hard)):
            with refuses("parts of the cell"):
                method(*arguments)
