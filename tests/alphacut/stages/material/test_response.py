"""The random and fuzzy stress: exact where the answer is known, consistent with itself, and in
every place where results go.
"""

from pathlib import Path

import numpy as np
import pytest
import xarray

from alphacut.case.load import load
from alphacut.io.problem import BadInput
from alphacut.stages.material import response
from alphacut.stochastic import TruncatedNormal

PAPER = Path(__file__).parents[4] / "cases" / "paper.toml"
CRISP = [
    "radius.a2=0.1",
    "radius.a4=0.1692",
    "inclusion_modulus=[75, 80, 85] GPa",
    "modulus.alpha=[0, 1]",
]


def known():
    """A modulus whose stress is E (1 + θ/10) / 200 at E = 75, 80, 85 GPa."""
    moduli, theta = np.array([75e9, 80e9, 85e9]), np.linspace(-3, 3, 61)
    curves = moduli[:, None] * (1 + theta / 10) / 200
    data = {
        "curve11": (("sample", "theta"), curves),
        "point": (("sample", "parameter"), moduli[:, None]),
    }
    data["s11_sample"] = ("sample", moduli / 200)
    return xarray.Dataset(
        data, {"theta": theta, "alpha": [0.0, 1.0], "parameter": ["inclusion_modulus"]}
    )


def test_quantiles_and_exceedance_of_a_known_response():
    found = response.dataset(load(PAPER, [*CRISP, "response.limit=0.41 GPa"]), known())
    law = TruncatedNormal(-3, 3)
    for probability in (0.05, 0.5, 0.95):
        exact = np.array([75e9, 85e9]) * (1 + law.quantile(probability) / 10) / 200
        assert found["quantile"].sel(alpha=0, probability=probability).values == pytest.approx(
            exact, rel=1e-4
        )
    exact = 1 - law.cdf(10 * (0.41e9 * 200 / np.array([75e9, 85e9]) - 1))
    assert found["exceedance"].sel(alpha=0).values == pytest.approx(exact, abs=6e-4)
    assert found["quantile"].sel(alpha=1, probability=0.5).values == pytest.approx(
        [0.4e9] * 2, rel=1e-6
    )
    assert found["quantile_at"].sel(alpha=0, probability=0.95, bound="upper").item() == 85e9
    assert found.attrs["mean_deviation"] < 1e-6


@pytest.mark.parametrize(
    ("change", "pattern"),
    [
        ("response.quantiles=[0.5, 0.05]", "not in rising order"),
        ("response.quantiles=[0, 0.5]", "out of range"),
        ("response.limit=0.6 m", "unit"),
        ("response.quantity=s22", "no such choice"),
        ("modulus.value=24 GPa", "samples of stage modulus"),
    ],
)
def test_a_response_that_cannot_be_had_is_refused(change, pattern):
    with pytest.raises(BadInput, match=pattern):
        load(PAPER, [change])
