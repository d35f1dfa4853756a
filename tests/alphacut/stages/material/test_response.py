"""The random and fuzzy stress: exact where the answer is known, consistent with itself, and in
every place where results go.
"""

import json
from pathlib import Path

import numpy as np
import pytest
import xarray

from alphacut.case.load import load
from alphacut.entry import main
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


def test_the_modulus_command_prints_a_response_that_agrees_with_itself(capfd):
    assert main(["modulus", str(PAPER), "--method", "series", "--json", "-"]) == 0
    answer = json.loads(capfd.readouterr()[0])
    found = answer["response"]
    assert found["mean_deviation"] < 1e-4
    for side in ("lower", "upper"):
        assert found["mean_GPa"][side] == pytest.approx(answer["s11_GPa"][side], rel=1e-4)
    limit, box = found["exceedance"], found["p_box"]
    assert limit["limit_GPa"] == 0.6
    assert (
        0 < limit["lower"][0] < limit["lower"][-1] == limit["upper"][-1] < limit["upper"][0] < 0.2
    )
    # the p-box at the limit is the exceedance's complement
    for level in range(len(found["alpha"])):
        for side, other in (("lower", "upper"), ("upper", "lower")):
            below = np.interp(0.6, box["stress_GPa"], box[side][level])
            assert 1 - below == pytest.approx(limit[other][level], abs=5e-3)
    for entry in found["quantiles"]:
        assert entry["GPa"]["lower"] == sorted(entry["GPa"]["lower"])
        assert entry["GPa"]["upper"] == sorted(entry["GPa"]["upper"], reverse=True)


def test_a_run_keeps_it_in_file_summary_report_and_figure(tmp_path, capfd):
    out = ["--out", str(tmp_path), "--quiet"]
    assert (
        main(
            [
                "run",
                str(PAPER),
                "--quick",
                "--set",
                "modulus.method=series",
                "--set",
                'stages=["modulus"]',
                *out,
            ]
        )
        == 0
    )
    summary = json.loads((tmp_path / "summary.json").read_text(encoding="utf-8"))
    assert [entry["probability"] for entry in summary["response"]["quantiles"]] == [0.05, 0.5, 0.95]
    assert "figures/response.svg" in summary["figures"]
    with xarray.open_dataset(tmp_path / "response.nc") as stored:
        assert stored["cdf"].dims == ("alpha", "bound", "stress")
        assert {"fingerprint", "format_version"} <= set(stored.attrs)
    assert main(["report", str(tmp_path), "--quiet"]) == 0
    assert "probability of more than 0.6 GPa" in (tmp_path / "report.html").read_text(
        encoding="utf-8"
    )


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
