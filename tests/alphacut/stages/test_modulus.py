"""Guaranteed cuts of E are tested by the same model at another accuracy."""

from dataclasses import replace

import pytest

from alphacut.case.content import load
from alphacut.fuzzy.refused import FailedError
from alphacut.fuzzy.result import Nature
from alphacut.stages.campaign import PLANS, CellCampaign
from tests.alphacut.small import CELL, written

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
    campaign = CellCampaign.of(load(written(tmp_path, CELL), changes).content)
    cuts = campaign.propagation(
        campaign.inputs, PLANS["signed"], knowledge=campaign.knowledge, progress=False
    )
    assert cuts.nature_of("E") is Nature.GUARANTEED
    campaign.require_consistent(cuts)
    for factor in (0.98, 1.02):
        wrong = replace(cuts, lower=factor * cuts.lower, upper=factor * cuts.upper, inner=None)
        with pytest.raises(FailedError, match=r"the proof is wrong: E of a cell inside a cut"):
            campaign.require_consistent(wrong)
