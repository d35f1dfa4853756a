"""The signed plan: signs stated, proved or seen; what fails falls back."""

import numpy as np
import pytest

from alphacut.fuzzy import (
    Crisp,
    Extended,
    General,
    Interval,
    Known,
    Reduced,
    Signed,
    Triangular,
    propagate,
)
from alphacut.fuzzy.plans.monotonicity import Verification
from alphacut.fuzzy.samples.nature import Nature

PAPER = {
    "a2": Triangular(0.001, 0.1, 0.3145),
    "a4": Triangular(0.001, 0.1692, 0.9975),
    "E": Triangular(75e9, 80e9, 85e9),
}
SIGNS = {"a2": 1, "a4": -1, "E": 1}


def modulus(a2, a4, E):
    """Rises with a2 and E, falls with a4, curved: like the modulus of the cell."""
    return np.sqrt(1 + a2) * (E / 1e9) ** 0.2 / (1 + a4)


def with_derivatives(a2, a4, E):
    value = modulus(a2, a4, E)
    return {
        "E": value,
        "dE_da2": value / 2 / (1 + a2),
        "dE_da4": -value / (1 + a4),
        "dE_dE": 0.2 * value / E,
    }


def wavy(a2, a4, E):
    return modulus(a2, a4, E) + np.sin(8 * a2)


def test_225_33_and_9_runs_give_the_same_bounds():
    reference = propagate(modulus, PAPER, General())
    for plan, runs in ((Reduced(), 33), (Extended(), 33), (Signed(), 9)):
        result = propagate(modulus, PAPER, plan)
        assert result.runs == runs
        np.testing.assert_allclose(result.lower, reference.lower, rtol=1e-12)
        np.testing.assert_allclose(result.upper, reference.upper, rtol=1e-12)


def test_stated_signs_need_no_verification_and_guarantee():
    result = propagate(modulus, PAPER, Signed(), known=Known(SIGNS))
    assert (result.runs, result.verification_runs, result.nature) == (9, 0, Nature.GUARANTEED)


def test_seen_signs_are_counted_apart_and_stay_inner():
    result = propagate(modulus, PAPER, Signed())
    assert (result.runs, result.nature) == (9, Nature.INNER)
    assert 0 < result.verification_runs <= 25
    assert len(result.points) == result.runs + result.verification_runs


def test_derivatives_of_the_model_save_the_differences():
    derivatives = {"E": {"a2": "dE_da2", "a4": "dE_da4", "E": "dE_dE"}}
    result = propagate(with_derivatives, PAPER, Signed(), known=Known(derivatives=derivatives))
    assert (result.runs, result.verification_runs) == (9, 4)


def test_a_range_of_the_gradient_proves_the_signs_box_by_box():
    def ranges(lower, upper):  # x² − y: the slope by x changes sign at 0
        return {"y": (np.array([2 * lower[0], -1.0]), np.array([2 * upper[0], -1.0]))}

    inputs = {"x": Triangular(-0.5, 1.0, 2.0), "y": Triangular(0.0, 1.0, 2.0)}
    result = propagate(lambda x, y: x**2 - y, inputs, Signed(), known=Known(gradient_range=ranges))
    assert result.nature_of() == (
        Nature.INNER,
        Nature.INNER,
        Nature.GUARANTEED,
        Nature.GUARANTEED,
        Nature.GUARANTEED,
    )
    assert result.nature is Nature.INNER


def test_an_input_without_a_sign_gets_the_points_of_the_general_method():
    result = propagate(wavy, PAPER, Signed())
    general = propagate(wavy, PAPER, General())
    assert result.notes[0].startswith(
        "output y is not monotone in input a2, or not surely, up to α = "
    )
    assert 9 < result.runs < 60
    assert (result.lower <= general.lower + 1e-12).all()
    assert (result.upper >= general.upper - 1e-12).all()


def test_outputs_with_opposite_signs_are_both_served():
    result = propagate(
        lambda a, b: {"sum": a + b, "difference": a - b},
        {"a": Triangular(0, 1, 2), "b": Triangular(0, 1, 2)},
        Signed(),
    )
    np.testing.assert_allclose(result.bounds("sum")[1], [4, 3.5, 3, 2.5, 2])
    np.testing.assert_allclose(result.bounds("difference")[0], [-2, -1.5, -1, -0.5, 0], atol=1e-15)


def test_only_the_outputs_that_matter_cost_samples():
    def model(a, b):
        return {"sum": a + b, "wave": np.sin(9 * a)}

    inputs = {"a": Triangular(0, 1, 2), "b": Triangular(0, 1, 2)}
    assert propagate(model, inputs, Signed(outputs=("sum",))).runs == 9
    assert propagate(model, inputs, Signed()).runs > 9


def test_a_sample_beyond_the_corners_refutes_the_signs():
    hidden = Verification(probes=4, margin=0.0, step=1e-6)
    result = propagate(
        lambda x: x + 3 * np.exp(-(((x - 1.0) / 0.1) ** 2)),
        {"x": Triangular(0, 1, 2)},
        Signed(verification=hidden),
    )
    assert "the monotonicity seen at the probes does not hold" in " ".join(result.notes)
    assert "9 runs and 6 more that tested monotonicity" in str(result)
    mixed = propagate(
        lambda x, y: x + 3 * np.exp(-(((x - 1.0) / 0.1) ** 2)) + y,
        {"x": Triangular(0, 1, 2), "y": Triangular(0, 1, 2)},
        Signed(verification=hidden),
        known=Known({"y": 1}),
    )
    assert "what was stated or the monotonicity seen at the probes does" in " ".join(mixed.notes)
    free = propagate(lambda x: np.sin(x), {"x": Interval(0, 2)})
    assert "more that looked for what they missed" in str(free)
    assert result.upper.max() >= 4 - 1e-9
    stated = propagate(
        lambda x: 1 - x**2, {"x": Triangular(-1, 0.1, 2)}, Signed(), known=Known({"x": -1})
    )
    assert stated.nature is Nature.INNER
    assert "the signs do not hold" in stated.notes[0]


def test_crisp_inputs_need_no_sign():
    result = propagate(
        lambda a, b: a * np.sin(50 * b),
        {"a": Triangular(1, 2, 3), "b": Crisp(0.02)},
        Signed(),
        known=Known({"a": 1}),
    )
    assert result.nature is Nature.GUARANTEED


def test_wrong_statements_are_refused_by_name():
    with pytest.raises(
        ValueError, match="what is known of the model names a3; the fuzzy inputs are a2, a4, E"
    ):
        propagate(modulus, PAPER, Signed(), known=Known({"a3": 1}))
    with pytest.raises(ValueError, match="sign of a2 is 2; it must be 1"):
        propagate(modulus, PAPER, Signed(), known=Known({"a2": 2}))
    with pytest.raises(ValueError, match="margin >= 0 and a step"):
        Verification(step=0.0)
    with pytest.raises(ValueError, match="no output F; there are y"):
        propagate(modulus, PAPER, Signed(outputs=("F",)))


WRONG = {"x": Triangular(-1, 0.3, 2), "y": Interval(0.5, 1.5)}


@pytest.mark.parametrize("plan", [Signed(), Reduced(), Extended(), General()])
def test_signs_that_the_corners_contradict_prove_nothing(plan):
    result = propagate(lambda x, y: -x * y, WRONG, plan, known=Known({"x": 1, "y": 1}))
    assert result.nature is Nature.INNER
    assert "samples contradict the signs stated of output y: it falls from" in result.notes[-1]


def test_a_wrong_range_of_the_gradient_proves_nothing():
    def ranges(lower, upper):
        return {"y": (np.array([0.5, 0.5]), np.array([1.5, 1.5]))}

    result = propagate(lambda x, y: -x * y, WRONG, Signed(), known=Known(gradient_range=ranges))
    assert result.nature is Nature.INNER
    assert "the signs do not hold" in result.notes[0]


@pytest.mark.parametrize("seed", range(20))
@pytest.mark.parametrize("plan", [Signed(), Extended()])
def test_round_off_contradicts_no_sign(plan, seed):
    x, y = np.sort(np.random.default_rng(seed).random((2, 3)))
    inputs = {"x": Triangular(*(1e-12 * (1 + x))), "y": Triangular(*(1e12 * (1 + y)))}
    result = propagate(
        lambda x, y: x * y, inputs, plan, known=Known({"x": 1, "y": 1}), alpha=np.linspace(0, 1, 8)
    )
    assert (result.nature, result.notes) == (Nature.GUARANTEED, ())


def test_a_slope_that_nearly_vanishes_is_no_sign():
    inputs = {"x": Interval(0.0, 1.0)}

    def model(x):
        return (x + 0.01) ** 2  # slopes from 0.02 to 2.02: the least is 1 % of their range

    told = [
        propagate(model, inputs, Signed(verification=Verification(margin=margin)), alpha=[0]).notes
        for margin in (0.05, 0.0)
    ]
    assert "not monotone in input x, or not surely" in told[0][0]
    assert not told[1]
