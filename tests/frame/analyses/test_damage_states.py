"""Damage states: fits against SciPy, ranges against exact motions, names and limits, Pelicun."""

import csv
import json
from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from alphacut.frame import Accelerogram, Fragility, Limit, StoreyFrame, fragility
from alphacut.frame.analyses.damage_states import fits_between, lognormal_fit
from alphacut.frame.analyses.fragility import CriticalMeasures
from alphacut.frame.analyses.incremental import Increments
from alphacut.fuzzy import Triangular
from alphacut.io.typed_json import from_document, to_document
from tests.frame.motions import exact_motions, random_points
from tests.refused import refuses

FRAME = StoreyFrame([2e4, 2e4], stiffness=[8e6, 6e6], damping_ratio=0.05)
INPUTS = {"k1": Triangular(7.2e6, 8e6, 8.8e6)}
TIMES = {"duration": 2.0, "step": 0.04, "alpha": (0, 1), "intensity": "PGA"}
STATES = {
    "slight": [Limit("drift1", 0.015), Limit("drift2", 0.012)],
    "moderate": [Limit("drift1", 0.03), Limit("drift2", 0.03)],
    "extensive": Limit("drift1", 0.06),
}


@pytest.fixture(scope="module")
def suite():
    noise = np.random.default_rng(7).normal(size=(4, 60))
    return [Accelerogram(0.02, (1 + k) * row, name=f"r{k}") for k, row in enumerate(noise)]


@pytest.fixture(scope="module")
def found(suite):
    return fragility(FRAME, INPUTS, suite, states=STATES, **TIMES)


def test_the_censored_fit_is_that_of_scipy(rng):
    for _ in range(10):
        measures = np.exp(rng.normal(0.3, rng.uniform(0.2, 0.6), rng.integers(5, 20)))
        largest = np.quantile(measures, rng.uniform(0.4, 0.9))
        observed = measures[measures <= largest]
        fit = lognormal_fit(np.where(measures <= largest, measures, np.inf), largest)
        right = np.full(len(measures) - len(observed), largest)
        censored = stats.CensoredData(uncensored=observed, right=right)
        dispersion, _, median = stats.lognorm.fit(censored, floc=0)
        assert fit.median == pytest.approx(median, rel=3e-3)
        assert fit.dispersion == pytest.approx(dispersion, rel=3e-3)
        # Censored records make the median larger than that of the others.
        assert fit.median > np.exp(np.log(observed).mean())
    assert np.isinf(lognormal_fit(np.array([1.0, np.inf]), 2.0)).all()
    assert np.isinf(lognormal_fit(np.array([1.0, 2.0, np.inf]))).all()
    crossings = np.array([[1.0, 1.3, 2.0, np.inf]])
    for ends, value in zip(
        fits_between(crossings, crossings, 2.2), lognormal_fit(crossings[0], 2.2), strict=True
    ):
        assert [ends.lower[0], ends.upper[0]] == pytest.approx([value] * 2)


def test_the_first_storey_decides_and_every_structure_lies_in_the_ranges(found, suite, rng):
    points = random_points(INPUTS, 40, rng)
    peaks = []  # a little below those between the nodes
    for record in suite:
        frame = replace(FRAME, ground=record, outputs=("drift1", "drift2"))
        peaks.append(np.abs(exact_motions(frame, points, INPUTS, 2.0, 0.002)).max(1))
    measures = np.array([np.abs(record.samples).max() for record in suite])
    rounding = 1 + 2e-3
    for state, limits in STATES.items():
        members = [limits] if isinstance(limits, Limit) else limits
        ratios = [np.array(peaks)[..., int(x.output[-1]) - 1] / x.value for x in members]
        crossing = measures / np.max(ratios, axis=0).T  # (structures, records)
        part = found.limits[state]
        assert part.words == state
        assert part.nature == "guaranteed"
        for ends, own in (
            (part.lognormal_median, np.exp(np.log(crossing).mean(1))),
            (part.dispersion, np.log(crossing).std(1, ddof=1)),
        ):
            assert (ends.lower[0] <= own).all()
            assert (own <= ends.upper[0] * rounding).all()
    assert found.table().head[-1] == "lognormal fit at the highest α"
    assert [row[0] for row in found.table().rows] == list(STATES)


@pytest.mark.parametrize("alpha", [(0,), (0, 0.5), (0, 1)])
def test_the_row_of_a_structure_is_that_of_the_nominal_one(suite, alpha):
    """The ends of a cut belong to different structures, whose common scatter would be none's."""
    found = fragility(FRAME, INPUTS, suite, states=STATES, **TIMES | {"alpha": alpha})
    row = found.pelicun()[0]
    for number, (state, limits) in enumerate(STATES.items(), 1):
        members = [limits] if isinstance(limits, Limit) else limits
        exact = []
        for record in suite:
            frame = replace(FRAME, ground=record, outputs=tuple(x.output for x in members))
            motion = exact_motions(frame, np.array([[8e6]]), INPUTS, 2.0, 0.002)
            peak = np.abs(motion).max(axis=(0, 1))
            ratio = max(peak / [limit.value for limit in members])
            exact.append(np.abs(record.samples).max() / ratio)
        critical = found.nominal.get(state, found.limits[state].critical)
        low, high = critical.low[-1], critical.high[-1]
        assert (low <= exact).all()
        assert (exact <= high * (1 + 2e-3)).all()  # between the nodes the peak is a little larger
        # Measures within a factor of the exact ones have deviations that differ by its logarithm.
        radii = np.log(high * (1 + 2e-3) / low) / 2
        allowed = np.linalg.norm(radii) / np.sqrt(len(suite) - 1)
        deviation = np.log(exact).std(ddof=1)
        assert allowed < 0.25 * deviation
        assert row[f"LS{number}-Theta_1"] == pytest.approx(deviation, rel=0, abs=allowed)


def test_a_frame_that_yields_comes_into_a_state_at_its_first_crossing():
    measure = np.array([1.0, 2.0, 3.0, 4.0, 5.0])
    # One structure exceeds at 2 and again at 4, another at 3 and not at 4, all at 3 and 5.
    greatest = np.array([[0.5, 1.5, 1.5, 2.0, 3.0]])
    least = np.array([[0.4, 0.9, 1.2, 0.8, 1.5]])
    never = np.full((1, 5), 0.9)
    records = [
        Increments(measure, {"slight": np.stack(pair)})
        for pair in ((greatest, least), (never, never))
    ]
    critical = CriticalMeasures.from_demands(records, "slight")
    low, high = critical.first_crossings
    assert low.tolist() == [[1.0, np.inf]]
    assert high.tolist() == [[3.0, np.inf]]
    assert critical.high.tolist() == [[5.0, np.inf]]  # the last non-exceedance is at 4
    assert critical.largest == 5.0


@pytest.mark.parametrize(
    ("states", "key"),
    [
        ({"a": Limit("drift1", 0.02), "b": Limit("drift1", 0.02)}, "limits"),
        ({"a": Limit("drift1", 0.02), "b": Limit("drift1", 0.01)}, "states"),
        ({"a": Limit("drift1", 0.02), "A ": Limit("drift1", 0.03)}, "states"),
        ({"drift1": Limit("drift1", 0.02)}, "states"),
        ({"a<=b": Limit("drift1", 0.02)}, "states"),
        ({"a": Limit("sway", 0.02)}, "output"),
        ({"a": []}, "limits"),
    ],
)
def test_states_that_do_not_rise_and_names_twice_are_refused(states, key, suite):
    with refuses(key):
        fragility(FRAME, INPUTS, suite[:1], states=states, **TIMES)


def test_the_table_of_pelicun_has_its_columns_and_the_fits_in_g(found, tmp_path):
    found.to_pelicun(tmp_path / "pelicun.csv", "frame")
    with (tmp_path / "pelicun.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    head = ["ID", "Incomplete", "Demand-Type", "Demand-Unit", "Demand-Offset", "Demand-Directional"]
    limit_states = [f"LS{k}-{x}" for k in (1, 2, 3) for x in ("Family", "Theta_0", "Theta_1")]
    assert list(rows[0]) == head + limit_states
    assert [row["ID"] for row in rows] == ["frame", "frame.weakest", "frame.strongest"]
    assert {row["Demand-Type"] for row in rows} == {"Peak Ground Acceleration"}
    for number, state in enumerate(STATES, 1):
        medians = [float(row[f"LS{number}-Theta_0"]) * 9.80665 for row in rows]
        ends = found.limits[state].lognormal_median
        assert medians[1:] == pytest.approx([ends.lower[0], ends.upper[0]])
        assert ends.lower[1] <= medians[0] <= ends.upper[1]
    document = json.loads(json.dumps(to_document(found)))
    assert from_document(Fragility, document).pelicun() == found.pelicun()  # of a report
    with refuses("component"):
        found.pelicun("my-frame")
    with refuses("Pelicun's table"):
        replace(found, measure="scale").pelicun()
