"""Peaks and probabilities of exceedance agree with each other and with answers found another way,
and stand in every result.
"""

import json
import re
from pathlib import Path

import numpy as np
import pytest
import xarray

from alphacut.case.limits import exceeded_limits
from alphacut.case.load import load
from alphacut.entry import main
from alphacut.fuzzy import Interval, Trapezoidal, Triangular
from alphacut.io.problem import BadInput
from alphacut.stages.readiness import ready
from alphacut.stages.vibration import exceedance as outcomes
from alphacut.stages.vibration.exceedance import shaped_like
from alphacut.stages.vibration.structure import structure

CASES = Path(__file__).parents[4] / "cases"
PAPER = CASES / "paper.toml"


def exceedance(case, handed):
    """The dataset of a case's probability."""
    return outcomes.exceedance(case, structure(case, handed))


SHORT = ["envelope.duration=1 s", "envelope.alpha=[0, 1]", "exceedance.output=q3"]


@pytest.mark.parametrize(
    "number",
    [Triangular(1, 2, 5), Interval(-1, 3), Trapezoidal(0, 1, 2, 4)],
    ids=lambda number: type(number).__name__,
)
def test_random_values_have_the_shape_of_the_membership(number):
    drawn = np.sort(shaped_like(number)(np.random.default_rng(5), 4000))
    grid = np.linspace(*number.support, 20001)
    area = np.cumsum(number.membership(grid))
    share = np.interp(drawn, grid, area / area[-1])
    assert len(drawn) == 4000
    # Kolmogorov–Smirnov, 0.1 %
    assert np.abs(share - (np.arange(4000) + 0.5) / 4000).max() < 1.95 / np.sqrt(4000)


@pytest.mark.parametrize(
    ("random", "told"),
    [
        ([], "nothing is random, so a probability is 0, 1 or undecided on each level; name inputs"),
        (["m2"], "m2 is an interval, drawn uniformly between its ends: an assumption"),
        (["m1"], ""),
    ],
)
def test_what_a_probability_rests_on_beside_the_case_is_said(random, told):
    masses = 'frame.masses=["[19, 20, 21] t", "[9, 11] t", "[4, 5, 6] t"]'
    given = f"exceedance.random={json.dumps(random)}"
    wide = [*SHORT, "exceedance.limit=0.1 m", given, masses]
    found = [one for one in ready(load(PAPER, wide)).warnings if "exceedance.random" in one]
    assert [one.removeprefix("exceedance.random: ")[: len(told)] for one in found] == (
        [told] if told else []
    )


def test_without_random_inputs_the_probability_is_what_the_peaks_say(capfd):
    arguments = [
        "envelope",
        str(PAPER),
        "--fuzzy",
        "E",
        "--duration",
        "1",
        "--alpha",
        "[0, 1]",
        "--method",
        "modal",
        "--json",
        "-",
    ]
    assert main(arguments) == 0
    peak = json.loads(capfd.readouterr()[0])["peak"]
    (_, _, least), (_, _, modal) = peak["lower"]
    most = peak["upper"][0][2]
    assert least <= modal < most
    for limit, wanted in (
        (0.9 * least, [1, 1]),
        (1.001 * most, [0, 0]),
        ((modal + most) / 2, [0, 1]),
    ):
        found = exceedance(
            load(PAPER, [*SHORT, "envelope.fuzzy=E", f"exceedance.limit={limit} m"]), None
        )
        assert found["exceedance"].sel(alpha=0).values.tolist() == wanted


def test_a_random_modulus_gives_the_share_found_by_quadrature():
    changes = [*SHORT, "envelope.fuzzy=E", "exceedance.random=E", "exceedance.samples=1000"]
    wanted = structure(load(PAPER), None)
    grid = np.linspace(*wanted.numbers["E"].support, 401)
    peak = np.abs(wanted.flow(("E",), 1.0, 0.01, "exact").values(grid[:, None])[:, :, 2]).max(1)
    weight = wanted.numbers["E"].membership(grid)
    limit = float(np.quantile(peak, 0.4))
    share = float(weight @ (peak > limit) / weight.sum())
    assert 0.1 < share < 0.9
    found = exceedance(load(PAPER, [*changes, f"exceedance.limit={limit} m"]), None)
    low, high = found["exceedance"].sel(alpha=0).values
    assert low == high == pytest.approx(share, abs=4 * np.sqrt(share * (1 - share) / 1000))


def test_a_run_keeps_peaks_and_probability(tmp_path, capfd):
    changes = [
        'stages=["envelope"]',
        "exceedance.output=q3",
        "exceedance.limit=9 cm",
        "exceedance.random=E",
    ]
    arguments = ["run", str(PAPER), "--quick", "--no-figures", "--quiet", "--out", str(tmp_path)]
    assert main([*arguments, *(f"--set={change}" for change in changes)]) == 0, (
        capfd.readouterr().err
    )
    summary = json.loads((tmp_path / "summary.json").read_text(encoding="utf-8"))
    assert summary["exceedance"]["limit"] == pytest.approx(0.09)
    assert summary["exceedance"]["random"] == "E"
    told, more = outcomes.sentences(summary["exceedance"]), "the motion between them may add up to"
    assert re.search(rf"\(inner bounds, at nodes every [\d.]+ s: {more} [\d.e-]+, estimated", told)
    study = summary["envelopes"]["E-5s"]
    assert study["peak"]["q1"]["upper"][0] == pytest.approx(
        max(-study["min"]["q1"], study["max"]["q1"])
    )
    with xarray.open_dataset(tmp_path / "envelope_E-5s.nc") as stored:
        assert stored["peak"].dims == ("alpha", "bound", "output")
    assert main(["report", str(tmp_path), "--quiet"]) == 0
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "<h3>Peaks</h3>" in page
    assert "Probability that |q3| exceeds 90.00 mm" in page


@pytest.mark.parametrize(
    ("case", "changes", "pattern"),
    [
        ("paper", ["exceedance.output=q3", "exceedance.limit=20 N"], 'unit "N" is wrong'),
        ("paper", ["exceedance.output=q3", "exceedance.limit=-20 mm"], "out of range"),
        ("paper", ["exceedance.output=q4", "exceedance.limit=20 mm"], "no output q4"),
        (
            "paper",
            ["exceedance.output=q3", "exceedance.limit=20 mm", "exceedance.random=m9"],
            "no input m9",
        ),
        ("paper", ["exceedance.output=q3"], r"exceedance\.limit.*missing"),
        (
            "pendulum",
            ["exceedance.output=forse", "exceedance.limit=20 N"],
            "no output forse.*did you mean force",
        ),
        ("pendulum", ["exceedance.output=force", "exceedance.limit=20 m"], 'unit "m" is wrong'),
        ("tower", ["exceedance.output=q3", "exceedance.limit=20 mm"], "no output q3.*roof, drift"),
    ],
)
def test_a_limit_that_makes_no_sense_is_refused(case, changes, pattern):
    with pytest.raises(BadInput, match=pattern):
        load(CASES / f"{case}.toml", changes)


def test_a_pendulum_may_exceed_a_force():
    changes = [
        "envelope.duration=1 s",
        "envelope.fuzzy=m,d",
        "envelope.alpha=[0, 1]",
        "exceedance.output=force",
    ]
    random = ["exceedance.random=phi_0", "exceedance.samples=400"]
    wanted = structure(load(CASES / "pendulum.toml"), None)
    number, points = wanted.numbers["phi_0"], []
    grid = np.linspace(*number.support, 301)
    for m, d in ((0.95, 0.12), (1.05, 0.08)):  # the least and the greatest force
        points.append(
            np.abs(
                wanted.flow(("phi_0", "m", "d"), 1.0, 0.01).values(
                    np.c_[grid, np.full((301, 2), (m, d))]
                )[:, :, 0]
            ).max(1)
        )
    limit = float(np.quantile(points[0], 0.7))
    weight = number.membership(grid)
    least, most = (float(weight @ (peak > limit) / weight.sum()) for peak in points)
    found = exceedance(
        load(CASES / "pendulum.toml", [*changes, *random, f"exceedance.limit={limit} N"]), None
    )
    low, high = found["exceedance"].sel(alpha=0).values
    assert (low, high) == pytest.approx((least, most), abs=0.1)
    assert low < high
    assert found.attrs["random"] == "phi_0"


def limit_of(case):
    """The one limit."""
    (limit,) = exceeded_limits(case).values()
    return limit


@pytest.mark.parametrize(("limit", "meters"), [("1 %", 0.04), ("0.5 %", 0.02), ("20 mm", 0.02)])
def test_a_drift_may_be_limited_by_a_share_of_the_storey_height(limit, meters):
    case = load(CASES / "building.toml", ["exceedance.output=drift1", f"exceedance.limit={limit}"])
    assert limit_of(case) == pytest.approx(meters)
    assert limit_of(
        load(CASES / "building.toml", ["exceedance.output=drift2", "exceedance.limit=1 %"])
    ) == pytest.approx(0.032)
    assert limit_of(
        load(CASES / "tower.toml", ["exceedance.output=drift", "exceedance.limit=1 %"])
    ) == pytest.approx(0.03)


@pytest.mark.parametrize("output", ["q8", "shear3", "drift9"])
def test_a_share_limits_nothing_else_than_a_drift(output):
    with pytest.raises(BadInput, match=r"exceedance\.(limit|output)"):
        load(CASES / "building.toml", [f"exceedance.output={output}", "exceedance.limit=1 %"])


def test_the_limited_output_need_not_be_observed_besides():
    changes = [*SHORT[:2], "envelope.fuzzy=E", "exceedance.output=drift2", "exceedance.limit=1 %"]
    bare, observed = (
        exceedance(load(PAPER, [*changes, *more]), None)
        for more in ((), ["frame.outputs=q1,q2,q3,drift2"])
    )
    assert bare["curve"].equals(observed["curve"])
    assert 0 < float(bare["limit"][0]) < float(bare["limit"][-1])


def test_the_probability_over_the_limit_falls_from_one_to_zero_and_meets_the_limit_s():
    changes = [*SHORT, "envelope.fuzzy=E,m3", "exceedance.random=E"]
    found = exceedance(load(PAPER, [*changes, "exceedance.limit=0.19 m"]), None)
    curve = found["curve"].transpose("alpha", "bound", "limit").values
    assert (curve[:, :, 0] == 1).all()
    assert (curve[:, :, -1] == 0).all()
    assert (np.diff(curve, axis=2) <= 0).all()
    assert (curve[0, 0] <= curve[1, 0]).all()
    assert (curve[0, 1] >= curve[1, 1]).all()
    for index in (60, 100, 140):
        limit = float(found["limit"][index]) + 1e-12
        there = exceedance(load(PAPER, [*changes, f"exceedance.limit={limit!r} m"]), None)[
            "exceedance"
        ].transpose("alpha", "bound")
        assert there.values == pytest.approx(curve[:, :, index])


SIX = """
schema = 1
title = "Three storeys"
about = "Several limits at once"
stages = ["envelope"]
[frame]
masses = ["20 t", "20 t", "15 t"]
stiffness = ["[28, 30, 32] MN/m", "25 MN/m ± 5 %", "18 MN/m"]
lengths = "3 m"
damping_ratio = "3 %"
displacements = ["5 mm", "8 mm", "10 mm"]
velocities = "0 m/s"
outputs = ["q3"]
[envelope]
fuzzy = ["k"]
alpha = [0, 1]
duration = "0.2 s"
step = "0.02 s"
[exceedance]
samples = 20
limits = LIMITS
"""


def test_several_limits_in_one_run_are_what_each_is_alone(tmp_path, capfd):
    path = tmp_path / "six.toml"
    limits = {"drift1": "0.2 %", "drift2": "4 mm", "a3": "0.4 g", "base_shear": "1 kN"}
    told = [f"{name} <= {limit}" for name, limit in limits.items()]
    path.write_text(SIX.replace("LIMITS", json.dumps(told)), encoding="utf-8")
    out = tmp_path / "out"
    arguments = ["run", str(path), "--quiet", "--out", str(out)]
    assert main([*arguments, "--set", "exceedance.random=k1", "--no-figures"]) == 0
    events = json.loads((out / "summary.json").read_text(encoding="utf-8"))["exceedance"]["events"]
    assert [event["output"] for event in events] == [*limits, "any of them"]
    wanted = structure(load(path), None)
    for event, (name, limit) in zip(events, limits.items(), strict=False):
        keys = [f'{x}="{y}"' for x, y in (("output", name), ("limit", limit))]
        alone = path.with_name("alone.toml")
        rest = "\n".join([*keys, 'random = ["k1"]'])
        alone.write_text(SIX.replace("limits = LIMITS", rest), encoding="utf-8")
        found = outcomes.exceedance(load(alone), wanted)["exceedance"].transpose("alpha", "bound")
        assert np.array([event["lower"], event["upper"]]).T.tolist() == found.values.tolist()
    top = np.array([[event["lower"], event["upper"]] for event in events])
    assert (top[-1] >= top[:-1].max(0) - 1e-12).all()
    assert (top[-1] <= top[:-1].sum(0) + 1e-12).all()
    assert main(["report", str(out), "--quiet", "--csv", str(out / "csv")]) == 0
    page = (out / "report.html").read_text(encoding="utf-8")
    assert "Probability that any of them is exceeded" in page
    assert "event,alpha" in (out / "csv" / "exceedance.csv").read_text(encoding="utf-8")
    assert main(["tolerances", str(path), "--set", 'exceedance.limits=["drift1 <= 0.2 %"]']) == 0


def test_what_all_probabilities_are_worth_is_told_once():
    both = {"alpha": [0.0], "lower": [0.1], "upper": [0.2], "unit": "m", "samples": 20}
    one = {**both, "step": 0.01, "limit": 1.0, "random": "E", "deviation": 0.1}
    each = [one | {"output": f"q{k}", "between_nodes": k / 100} for k in (1, 2)]
    told = outcomes.sentences({"events": each})
    assert told.count("draws") == told.count("inner") == told.count("every 0.01 s") == 1
    assert "[0.1, 0.2] at α = 0 (between nodes up to 0.02 more, scatter 0.1)\n" in told
    assert "\nthese are inner bounds at nodes every 0.01 s, from 20 random draws at each" in told


def test_a_probability_between_zero_and_one_is_called_undecided():
    words = {"output": "q1", "limit": 0.1, "unit": "m", "random": "", "alpha": [0.0, 1.0]}
    told = outcomes.sentences({**words, "lower": [0.0, 0.0], "upper": [1.0, 0.4]})
    assert "undecided, [0, 1] at α = 0, [0, 0.4] at α = 1" in told


@pytest.mark.parametrize(
    ("limits", "pattern"),
    [
        ('["drift1 40 mm"]', "is no limit"),
        ('["drift4 <= 40 mm"]', "there is no output drift4"),
        (
            '["drift1 <= 40 mm", "drift1 <= 50 mm"]',
            "drift1 has two limits; allowed: one for each output; [decision] takes several",
        ),
        ('["a1 <= 40 mm"]', "unit"),
        ('["a1 <= 1 g"]\noutput = "a1"', "there are limits besides"),
        ("[]", "exceedance.output: missing: the output"),
    ],
)
def test_limits_that_make_no_sense_are_refused(limits, pattern, tmp_path, capfd):
    path = tmp_path / "six.toml"
    path.write_text(SIX.replace("LIMITS", limits), encoding="utf-8")
    assert main(["check", str(path)]) == 2
    err = capfd.readouterr().err
    assert pattern in err
    assert "Traceback" not in err
