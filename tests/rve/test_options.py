"""Models refuse options out of range by one line."""

import math
from pathlib import Path

import numpy as np
import pytest
from scipy import stats

from alphacut import rve
from alphacut.fuzzy import RefusedError
from alphacut.rve import SpheresModel
from alphacut.stochastic import HermiteMap, TruncatedNormal

MESHES = Path(__file__).parents[2] / "meshes"
POINTS, ACCURACY = (
    "is 1; allowed: 2 or more",
    r"the accuracy of the series is .*; allowed: values in",
)
WRONG = [
    (rve.SeriesModel, {"points": 1}, POINTS),
    (rve.SeriesModel, {"accuracy": 1e-15}, ACCURACY),
    (SpheresModel, {"points": 1}, POINTS),
    (SpheresModel, {"accuracy": 1e-12}, ACCURACY),
    (SpheresModel, {"accuracy": np.nan}, ACCURACY),
    ("SlicesModel", {"points": 1}, POINTS),
    ("SlicesModel", {"mesh_size": 2}, "the mesh size is 2; allowed"),
    ("PrismModel", {"mesh_size": 0.0}, r"the mesh size is 0; allowed: values in \(0, 1\]"),
    ("PrismModel", {"layers": 0}, "the number of layers is 0; allowed: 1 or more"),
    ("PrismModel", {"layers": 2.5}, "the number of layers is 2.5; allowed: a whole number"),
    ("PrismModel", {"layers": "2"}, "the number of layers is '2'; allowed: a whole number"),
    ("PrismModel", {"mesh_size": "0.5"}, "the mesh size is '0.5'; allowed: values in"),
    ("PrismModel", {"petsc": "-ksp_type cg"}, r'petsc is .*; write {"ksp_type": "cg"}'),
    ("PrismModel", {"petsc": {"-rve_ksp_type": "cg"}}, r'petsc is .*; write "ksp_type"'),
    ("PrismModel", {"modulus_range": 8e10}, "modulus_range is .*; allowed: a list"),
    ("PrismModel", {"modulus_range": (1e9,)}, "modulus_range is .*; allowed: least and greatest"),
    ("PrismModel", {"outline": 0.5}, "outline is 0.5; allowed: a function of an array"),
    ("PrismModel", {"outline": lambda _: 1.0}, r"outline is .* shape \(\) .*; .* np.full_like"),
    ("PrismModel", {"outline": lambda a: 1 + 0.1 * math.cos(a)}, "outline is .* NumPy's functions"),
    ("SlicesModel", {"points": "5"}, "points of the rule in θ is '5'; allowed: 2 or more"),
    ("SlicesModel", {"outline": lambda _: 1.0}, r"outline is .* shape \(\)"),
    (rve.SeriesModel, {"accuracy": "1e-6"}, ACCURACY),
    (rve.SeriesModel, {"points": 2.5}, "is 2.5; allowed: 2 or more"),
    ("MeshModel", {"file": "a.msh", "petsc": []}, r"petsc is \[\]; allowed: a dict of options"),
]


@pytest.mark.parametrize(("model", "options", "message"), WRONG)
def test_an_option_out_of_range_is_refused(model, options, message):
    if isinstance(model, str):
        pytest.importorskip("alphacut.rve.fenicsx")
        model = getattr(rve, model)
    with pytest.raises(RefusedError, match=message):
        model(**options)


@pytest.mark.parametrize("law", ["normal", stats.norm(), stats.norm, 3, None, {}])
def test_what_is_no_law_is_refused_with_one(law):
    pytest.importorskip("alphacut.rve.fenicsx")
    phases = {"matrix": rve.Phase(20e9), "inclusion": rve.Phase(80e9)}
    meshed = rve.MeshModel(MESHES / "paper-coarse.msh")
    level_set = rve.LevelSetModel(lambda x, y, _: np.hypot(x, y) - 0.5, 1.0, 1)
    for model in (meshed, level_set):
        with pytest.raises(RefusedError, match=r"law of θ is .* TruncatedNormal\(-3, 3\)"):
            model.solve(law, phases)
    with pytest.raises(RefusedError, match=r"law of θ is .* TruncatedNormal\(-3, 3\)"):
        HermiteMap(0.2, 0.1, 0.8, 0.1, law)


@pytest.mark.parametrize(
    ("function", "words"),
    [
        (lambda x, y, _: math.hypot(x, y) - 0.5, "raises TypeError: .* NumPy's functions"),
        (lambda x: x, "takes 1 positional argument"),
        (lambda *_: 0.5, r"shape \(\) at points"),
        (lambda *_: None, r"shape \(\) at points"),
        (0.5, "level set is 0.5; allowed: a function"),
    ],
)
def test_a_level_set_that_takes_no_arrays_is_refused(function, words):
    pytest.importorskip("alphacut.rve.fenicsx")
    phases = {"matrix": rve.Phase(20e9), "inclusion": rve.Phase(80e9)}
    with pytest.raises(RefusedError, match=words):
        rve.LevelSetModel(function, 1.0, 1).solve(TruncatedNormal(-3, 3), phases)


def test_minres_is_told_the_norm_that_it_takes_and_takes_it():
    pytest.importorskip("alphacut.rve.fenicsx")
    from petsc4py import PETSc

    radius, phases = HermiteMap(0.2, 0.1, 0.8, 0.1), (rve.Phase(20e9), [rve.Phase(80e9)])
    options = {"mesh_size": 1.0, "layers": 1, "estimate": False}
    minres = {"ksp_type": "minres"}
    if PETSc.Sys.getVersion() < (3, 25):  # which takes the norm that is set by default
        with pytest.raises(RefusedError, match="say -rve_ksp_norm_type preconditioned"):
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
            with pytest.raises(RefusedError, match=r"write solve\(radius, Phase"):
                method(*arguments)
