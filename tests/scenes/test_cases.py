"""Every shipped case, run end to end, has its golden numbers to within the declared errors."""

import json
import math
from pathlib import Path

import numpy as np
import pytest
import xarray

from tests.alphacut.small import summary_of

GOLDEN = json.loads((Path(__file__).parent / "golden.json").read_text(encoding="utf-8"))
SERIES, LEVELS = ("modulus.method=series",), ("modulus.alpha=[0, 1]", "shares=false")
SHORT = ("envelope.duration=1 s", "envelope.step=0.02 s", "envelope.alpha=[0]")
SHORT_BUILDING = (
    *SHORT,
    "envelope.fuzzy=['E', 'm8', 'l1']",
    "envelope.tolerance=2 mm",
    "probability.samples=10",
)
QUICK = {  # case: changes that make it quick, and the results that it then has
    "porous": (LEVELS, {"modulus"}),
    "pendulum": (("envelope.alpha=[0]", "shares=false"), {"envelopes"}),
    "laboratory-frame": ((), {"envelopes", "decision", "update"}),
    "paper": (("stages=['modulus']", *SERIES, *LEVELS), {"modulus"}),
    "paper-3d": (("stages=['modulus']", *LEVELS), {"modulus"}),
    "building": (SHORT_BUILDING, {"modulus"}),
    "isolation": (("envelope.duration=3 s",), {"decision"}),
}
WHOLE = (
    "paper",
    "paper-3d",
    "paper-literal",
    "building",
    "composite",
    "concrete",
    "tomogram",
    "yielding",
    "isolation",
)
UNDECLARED = 0.02  # share of the peak by which attained bounds without an error may differ
STRENGTH = {"inner": 0, "attained": 0, "searched": 0, "estimated": 1, "guaranteed": 2}


def as_sure(new, old):
    """Whether a result's nature is no weaker than it was."""
    first, second = (STRENGTH[one["nature"].replace(",", " ").split()[0]] for one in (new, old))
    assert first >= second, (new["nature"], old["nature"])


def same_decision(new, old):
    """Whether the degrees to which limits are passed are bounded as closely and as surely."""
    for name, one in old["limits"].items():
        as_sure(new["limits"][name], one)
        for degree in ("possibility", "necessity"):
            (least, most), (low, high) = new["limits"][name][degree], one[degree]
            assert low - 1e-9 <= least <= most <= high + 1e-9, (name, degree)


def same_modulus(new, old):
    """Whether the cuts of E agree to within both errors on each level of the new ones."""
    assert len(new["alpha"]) >= 2
    rows = [old["alpha"].index(level) for level in new["alpha"]]
    as_sure(new, old)
    errors = [sum(x["error"].values()) for x in (new, old)]
    nominal = sum(errors)  # at α = 1
    share = 2 * nominal + 1e-9  # small particles, of which α = 0 has more, are coarser
    for side in ("lower", "upper"):
        ends = [old["E_GPa"][side][row] for row in rows]
        assert new["E_GPa"][side] == pytest.approx(ends, rel=share)


def same_envelope(new, old):
    """Whether least and greatest values of each output agree to within both errors."""
    assert set(old["min"]) <= set(new["min"])
    as_sure(new, old)
    for output, low in old["min"].items():
        peak = max(abs(low), abs(old["max"][output]))
        errors = [study.get("error", {}).get(output) for study in (new, old)]
        declared = [error for error in errors if error is not None and math.isfinite(error)]
        allowed = sum(declared) + 1e-6 * peak if declared else UNDECLARED * peak
        assert new["min"][output] == pytest.approx(low, abs=allowed), output
        assert new["max"][output] == pytest.approx(old["max"][output], abs=allowed), output


def overlapping_cuts(new, old):
    """Whether two proofs of one quantity overlap, the new one at most half as wide again."""
    (new_low, new_high), (old_low, old_high) = (
        [np.array(x["E_GPa"][side]) for side in ("lower", "upper")] for x in (new, old)
    )
    assert (new_low <= old_high).all()
    assert (old_low <= new_high).all()
    assert (new_high - new_low <= 1.5 * (old_high - old_low)).all()


def attained_within_proved(folder):
    """Whether in each kept envelope the true bounds, error and all, lie within what is proved."""
    for path in folder.glob("envelope*.nc"):
        data = xarray.load_dataset(path)
        proved = data.attrs["nature"] == "guaranteed"
        inner = (data.inner_lower, data.inner_upper) if proved else (data.lower, data.upper)
        spare = 0 * data.error if proved else data.error
        outer = ("lower", "upper") if proved else ("proved_lower", "proved_upper")
        for side, value, name in zip((-1, 1), inner, outer, strict=True):
            if name in data:
                beyond = side * (value - data[name]) - spare
                assert float(beyond.max()) <= 1e-9 * float(abs(data.upper).max()), (path.name, name)
        assert (data.lower <= data.upper).all(), path.name


def same_envelopes(new, old):
    """Whether every study is there, with the same ends."""
    for study, ends in old.items():
        same_envelope(new[study], ends)


def same_microstructure(new, old):
    """Whether the map of radii is the same."""
    for key in ("a1", "a2", "a3", "a4", "mean_r_n"):
        assert new[key] == pytest.approx(old[key], rel=1e-9)


def same_inputs(new, old):
    """Whether the identified ranges of the inputs are the same."""
    for name, ends in old["inputs"].items():
        for side in ("lower", "upper"):
            assert new["inputs"][name][side] == pytest.approx(ends[side], rel=1e-6), name
    assert new["held_out"]
    assert all(mode["inside"] for mode in new["held_out"])


def same_tolerances(new, old):
    """Whether the scale that keeps the limits, and the supports there, are the same."""
    as_sure(new, old)
    for key in ("kept", "passed"):
        assert new[key] == pytest.approx(old[key], rel=1e-3), key
    for name, support in old["supports"].items():
        assert new["supports"][name]["kept"] == pytest.approx(support["kept"], rel=1e-3), name


def same_probability(new, old):
    """Whether the intervals of the probabilities of each event overlap."""
    for name, event in old["events"].items():
        ends, before = new["events"][name]["interval"], event["interval"]
        assert (np.array(ends["lower"]) <= before["upper"]).all(), name
        assert (np.array(ends["upper"]) >= before["lower"]).all(), name


def same_shares(new, old):
    """Whether the inputs take the same shares of each width."""
    for quantity, shares in old.items():
        assert new[quantity] == pytest.approx(shares, abs=0.01), quantity


PARTS = {
    "modulus": same_modulus,
    "decision": same_decision,
    "envelopes": same_envelopes,
    "image": lambda new, old: overlapping_cuts(new, old["cuts"]),
    "microstructure": same_microstructure,
    "update": same_inputs,
    "tolerances": same_tolerances,
    "probability": same_probability,
    "shares": same_shares,
}


def compare(new, old, parts):
    """Compare the named parts of both summaries, each of which must be there."""
    for name in parts:
        PARTS[name](new[name], old[name])


@pytest.mark.parametrize("case", QUICK)
def test_a_case_has_its_golden_numbers(case, shipped_run):
    changes, parts = QUICK[case]
    folder = shipped_run(case, changes)
    compare(summary_of(folder), GOLDEN[case], parts)
    attained_within_proved(folder)


@pytest.mark.slow
@pytest.mark.parametrize("case", WHOLE)
def test_a_whole_case_has_its_golden_numbers(case, shipped_run):
    parts, folder = GOLDEN[case].keys() & PARTS.keys(), shipped_run(case)
    assert parts
    compare(summary_of(folder), GOLDEN[case], parts)
    attained_within_proved(folder)


def test_answers_have_their_golden_numbers(two_floors):
    summary = summary_of(two_floors)
    golden = GOLDEN["two-floors"]
    assert golden.keys() == {"decision", "probability", "tolerances", "shares"}
    compare(summary, golden, golden)


@pytest.mark.parametrize("factor", [0.999, 1.001])
def test_a_wrong_modulus_would_be_seen(factor):
    old = GOLDEN["paper"]["modulus"]
    ends = {side: [factor * value for value in old["E_GPa"][side]] for side in old["E_GPa"]}
    with pytest.raises(AssertionError):
        same_modulus({**old, "E_GPa": ends}, old)
