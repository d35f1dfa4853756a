"""The fuzzy stiffness from Python: its numbers are those of the case that it stands for."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

from alphacut import main
from alphacut.fuzzy import Interval, Reduced, Signed, Triangular, from_data
from alphacut.rve import (
    Phase,
    SeriesModel,
    SpheresModel,
    VoigtPhase,
    constants,
    fuzzy_stiffness,
    loss_factors,
    reference_bounds,
)
from alphacut.rve.models import MODELS, ModelEntry
from alphacut.stochastic import FractionMap, HermiteMap
from tests.alphacut.small import CELL, summary_of_run, written
from tests.refused import refuses

RADIUS = HermiteMap(a1=0.1337, a2=0.1, a3=0.8663, a4=0.1692)
PHASES = Phase(20e9, 0.3), Phase(80e9, 0.3)
INPUTS = {
    "a2": Triangular(0.001, 0.1, 0.3145),
    "a4": Triangular(0.001, 0.1692, 0.9975),
    "inclusion_modulus": Triangular(75e9, 80e9, 85e9),
}


def test_signs_that_mechanics_proves_guarantee_e_alone():
    stiffness = fuzzy_stiffness(
        SeriesModel(), RADIUS, PHASES, INPUTS, Signed(outputs=("E",)), alpha=[0, 1], progress=False
    )
    assert stiffness.guarantee == "guaranteed"
    assert stiffness.bounds.nature_of("nu") == "attained"
    # the extremes are at corners: E rises with a2 and the modulus and falls with a4
    corners = []
    for a2, a4, modulus in ((0.001, 0.9975, 75e9), (0.3145, 0.001, 85e9)):
        radius = replace(RADIUS, a2=a2, a4=a4)
        [cell] = SeriesModel().solve(radius, PHASES[0], [Phase(modulus, 0.3)])
        corners.append(cell.modulus)
    assert stiffness.cuts("E")[0] == pytest.approx(corners, rel=1e-12)
    assert tuple(stiffness.modulus.support) == pytest.approx(corners, rel=1e-12)


def test_loss_factors_follow_from_the_phases_or_the_inputs():
    """With equal losses of both phases those of the cell are equal, whatever the geometry."""
    lossy = [Phase(20e9, 0.3, loss=0.02), Phase(80e9, 0.2, loss=0.02)]
    [cell] = SeriesModel().solve(RADIUS, lossy[0], lossy[1:])
    assert loss_factors(cell).values["E"] == pytest.approx(0.02, rel=1e-9)
    loss = Interval(0.01, 0.03)
    inputs = {"matrix_loss": loss, "inclusion_loss": loss}
    stiffness = fuzzy_stiffness(
        SeriesModel(), RADIUS, PHASES, inputs, Reduced(), alpha=[0, 1], progress=False
    )
    assert stiffness.losses.cuts["E"][0] == pytest.approx([0.01, 0.03], rel=1e-9)


def test_spheres_of_a_fraction_lie_between_the_reference_bounds():
    phases = [Phase(20e9, 0.3), Phase(80e9, 0.2)]
    from alphacut.stochastic import SPHERES

    [cell] = SpheresModel().solve(FractionMap(0.2, SPHERES), phases[0], phases[1:])
    assert cell.fractions == pytest.approx([0.8, 0.2], rel=1e-12)
    lower, upper = reference_bounds(phases, fractions=cell.fractions, space=True).young
    assert lower < constants(cell).values["E"] < upper


@pytest.mark.parametrize(
    ("phases", "name"),
    [
        (PHASES, "a5"),
        (PHASES, "matrix_density"),
        ((PHASES[0], VoigtPhase(((3e9, 1e9, 0), (1e9, 3e9, 0), (0, 0, 1e9)))), "inclusion_modulus"),
    ],
)
def test_an_input_that_is_no_parameter_is_refused(phases, name):
    with refuses("input"):
        fuzzy_stiffness(SeriesModel(), RADIUS, phases, {name: Interval(1, 2)}, progress=False)


@pytest.mark.parametrize("value", ["1", None, np.nan])
def test_an_input_that_is_no_number_is_refused_by_its_name(value):
    with refuses("a2"):
        fuzzy_stiffness(SeriesModel(), RADIUS, PHASES, {"a2": value}, progress=False)


def test_measured_inputs_are_taken_on_levels_that_their_values_decide():
    loss = from_data([0.01, 0.015, 0.02, 0.03], "median")
    modulus = from_data([19e9, 19.5e9, 20.5e9, 21e9], "median")
    inputs = {"matrix_loss": loss, "inclusion_loss": loss, "matrix_modulus": modulus}
    stiffness = fuzzy_stiffness(
        SeriesModel(), RADIUS, PHASES, inputs, alpha=[0.5, 1], progress=False
    )
    assert stiffness.losses.cuts["E"][0] == pytest.approx(loss.cut(0.5), rel=1e-9)
    assert stiffness.bounds.inputs["matrix_modulus"].cut(0.5) == modulus.cut(0.5)


def test_spheres_keep_hill_s_average_whatever_average_of_a_plane_is_asked_for():
    stiffness = fuzzy_stiffness(
        SpheresModel(),
        RADIUS,
        PHASES,
        {"a2": 0.1},
        Reduced(),
        average="axes",
        alpha=[1],
        progress=False,
    )
    assert stiffness.average == "Hill's isotropic average"


def test_an_average_of_another_name_is_refused_before_samples_are_solved():
    with refuses("average"):
        fuzzy_stiffness(SeriesModel(), RADIUS, PHASES, INPUTS, average="voigt", progress=False)


@pytest.mark.parametrize("loss", [-0.1, Triangular(-0.01, 0.0, 0.05)])
def test_a_loss_factor_that_may_be_negative_is_refused(loss):
    with refuses("matrix_loss"):
        fuzzy_stiffness(SeriesModel(), RADIUS, PHASES, {"matrix_loss": loss}, progress=False)


@dataclass(frozen=True)
class MixtureModel(SeriesModel):
    """A model that is only for this test: the series by another name, with half its modulus."""

    name = "mixture"
    is_exact = False

    def solve(self, radius_map, matrix, inclusions):
        softer = [replace(x, modulus=x.modulus / 2) for x in inclusions]
        return super().solve(radius_map, replace(matrix, modulus=matrix.modulus / 2), softer)


def test_a_new_model_takes_its_class_and_one_entry(tmp_path, monkeypatch):
    entry = ModelEntry("mixture", "", frozenset({"cylinders"}), needs_isotropy=True)
    monkeypatch.setattr(
        ModelEntry, "load", lambda x, load=ModelEntry.load: MixtureModel if x is entry else load(x)
    )
    MODELS.append(entry)
    try:
        case = written(tmp_path, CELL)
        found = [
            summary_of_run(case, "--set", f"modulus.method={name}")["modulus"]
            for name in ("series", "mixture")
        ]
    finally:
        MODELS.remove(entry)
    series, mixture = (np.array(x["E_GPa"]["lower"]) for x in found)
    assert mixture == pytest.approx(series / 2, rel=1e-9)
    assert found[1]["method"] == "mixture"
    assert main(["check", str(case), "--set", "modulus.method=mixture"]) == 2
