"""Inputs of an envelope that mean nothing: each is refused in one line that says what, the value,
what is allowed and the cure.
"""

from __future__ import annotations

import warnings
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.sparse import csr_array

from alphacut.frame import Accelerogram, MatrixStructure, StoreyFrame, envelope, pendulum, record
from alphacut.frame.methods.named import METHODS, options_of
from alphacut.frame.structures.linear import frequencies
from alphacut.fuzzy import Interval, Triangular

FRAME = StoreyFrame((2e4, 1e4), (3.0, 3.0), 25e9, 1e-6, q0=(0.0, 0.01), damping_ratio=0.02)
E = {"E": Triangular(24e9, 25e9, 26e9)}
EYE = np.eye(2)
GIVEN: dict[str, Any] = {
    "parameters": {"m": 1.0, "k": 10.0, "z": 0.02},
    "mass": [("m", EYE)],
    "stiffness": [("k", np.diag([1.0, 2.0]))],
    "observed": {"x": np.array([1.0, 0.0])},
    "ratios": ["z"],
}


def computed(inputs: Any = E, model: Any = FRAME, **changes: Any) -> Any:
    return envelope(model, inputs, **{"duration": 1.0, "step": 0.1, "alpha": (0,), **changes})


@pytest.mark.parametrize(
    ("inputs", "message"),
    [
        (
            {"E": Triangular(-1e9, 25e9, 26e9)},
            r"parameter E: its support \[-1e\+09, 2.6e\+10\] must be positive; narrow it",
        ),
        ({"m1": Interval(0, 2e4)}, "m1: its support .* must be positive"),
        ({"d2": Interval(-1, 2e4)}, r"d2: its support \[-1, 20000\] must be 0 or greater"),
        ({"rayleigh_mass": -0.1}, "rayleigh_mass: .* must be 0 or greater"),
        ({"zeta": Interval(0.1, 1.2)}, "zeta: .* below 1, the critical damping"),
        ({"E": "25 GPa"}, "the input 'E' is '25 GPa'; it must be a number or a fuzzy number"),
        (
            {"m": Interval(1e4, 2e4)},
            r"'m' is unknown; known are E, .*; it is short for m1, m2: .*frame.group\('m'\)",
        ),
        ({"q0": Interval(0, 1)}, "short for q1_0, q2_0"),
        (
            {"E": Triangular(24, 25, 26)},
            r"E: its support \[24, 26\] is of another size than .* 2.5e\+10; give both in SI",
        ),
        ({"m2": Interval(9e6, 11e6)}, "m2: its support .* is of another size"),
        ({"x": Interval(0, 1)}, "'x' is unknown; known are E, I, .*zeta$"),
        ([1], "the inputs are a list; they must map names"),
    ],
)
def test_fuzzy_parameters_without_a_meaning(inputs: Any, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        computed(inputs)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"duration": "5 s"}, "duration: '5 s' is not allowed; it must be a number, in s"),
        ({"step": None}, "step: None is not allowed"),
        ({"alpha": (1, 0)}, r"alpha: \[1.0, 0.0\] must rise within \[0, 1\]"),
        ({"alpha": 0.5}, "alpha: 0.5 is not allowed; it must be a list"),
        ({"alpha": (0, 2)}, "must rise"),
        (
            {"method": "modal", "order": 2},
            "'order' is unknown to the method modal; it takes tolerance, budget, seed, certify",
        ),
        (
            {"method": "vertex", "samples": 5},
            "'samples' is unknown to the method vertex; it takes none",
        ),
        (
            {"method": "auto", "certify": 1e-3},
            "to the method auto; it takes tolerance, exclude, budget",
        ),
        (
            {"smaples": 5},
            ("unknown to the method auto; it takes tolerance, exclude, budget"),
        ),
        (
            {"method": "auto", "exclude": "modal"},
            r"exclude: 'modal' is not allowed; it must be a list of names, as \['modal'\]",
        ),
        (
            {"method": "monte-carlo", "samples": 0},
            "option samples: 0 is not allowed; it must be a whole number, 1 or greater",
        ),
        ({"method": "monte-carlo", "samples": 2.5}, "samples: 2.5 is not allowed"),
        ({"integrator": 5}, "integrator: 5 is none; take an integrator such as"),
        ({"model": 5}, "model: 5 is no structure; take a StoreyFrame"),
        ({"tolerance": "1 mm"}, "option tolerance: '1 mm' is not allowed; it must be a number"),
    ],
)
def test_arguments_without_a_meaning(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        computed(**changes)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"modulus": "25 GPa"}, "modulus: '25 GPa' is not allowed; it must be a number, in Pa"),
        ({"masses": 5.0}, "masses: 5.0 is not allowed; it must be a list of numbers, in kg"),
        ({"masses": (2e4, "1 t")}, "masses: '1 t' is not allowed"),
        ({"q0": (0.0, np.nan)}, "q0: nan is not allowed; every value must be finite"),
        ({"damping_ratio": "2 %"}, "damping_ratio: '2 %' is not allowed"),
    ],
)
def test_frames_without_a_meaning(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        StoreyFrame(
            **{
                "masses": (2e4, 1e4),
                "lengths": (3.0, 3.0),
                "modulus": 25e9,
                "second_moment": 1e-6,
                **changes,
            }
        )


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"q0": np.array([1.0, np.nan])}, "q0: nan is not allowed; every value must be finite"),
        (
            {"mass": [("m", np.array([[1.0, 0.5], [0.0, 1.0]]))]},
            "mass: an array is not symmetric, by 0.5",
        ),
        (
            {"stiffness": [("k", np.array([[np.inf, 0.0], [0.0, 1.0]]))]},
            "stiffness: inf is not allowed",
        ),
        ({"mass": ("m", EYE)}, r"mass: str is no term; give a list of pairs \(factor, array\)"),
        ({"mass": [EYE]}, "mass: ndarray is no term"),
        (
            {"stiffness": EYE},
            r"stiffness: ndarray is no list of terms; give pairs .* \[\(1.0, array\)\]",
        ),
        ({"mass": csr_array(EYE)}, "mass: csr_array is no list of terms"),
        ({"mass": [(csr_array(EYE), 1.0)]}, "mass: factor csr_array is not allowed"),
        ({"mass": [("m", 1.0)]}, r"mass: an array has shape \(\); all must be \(2, 2\)"),
        ({"observed": EYE}, "observed by name, as {'q1': row}"),
        ({"stiffness": [("x", EYE)]}, "stiffness: factor 'x' is no parameter; known are m, k, z"),
        ({"stiffness": [(np.nan, EYE)]}, "stiffness: factor nan is not allowed"),
        (
            {"stiffness": [(lambda p: p["x"], EYE)]},
            "stiffness: a factor asks for 'x', which is no parameter; known are m, k, z",
        ),
        (
            {"stiffness": [(lambda p: np.sqrt(p["k"]), EYE)]},
            r"cannot take parameters with derivatives .*p\['k'\] \*\* 0.5",
        ),
        ({"stiffness": [(lambda p: "k", EYE)]}, "a factor gives a str; it must give one number"),
        ({"ratios": 0.02}, r"ratios: 0.02 is not allowed; it must be a list, as \[0.02\]"),
        ({"parameters": {"m": "1 kg", "k": 10.0, "z": 0.02}}, "parameter m: '1 kg' is not allowed"),
    ],
)
def test_matrices_without_a_meaning(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        MatrixStructure(**{**GIVEN, **changes})


def test_a_support_must_keep_the_mass_matrix_and_the_ratios() -> None:
    model = MatrixStructure(**GIVEN)
    with pytest.raises(
        ValueError, match=r"mass: the matrix is not positive definite at m = -0.1; narrow"
    ):
        computed({"m": Interval(-0.1, 1)}, model)
    with pytest.raises(ValueError, match=r"z: its support .* below 1"):
        computed({"z": Interval(0, 1)}, model)


def test_a_plain_number_is_a_crisp_input() -> None:
    found = computed({"E": 25e9, "m1": Interval(1.9e4, 2.1e4)}, method="modal")
    alone = computed({"m1": Interval(1.9e4, 2.1e4)}, method="modal")
    assert found.parameters == ("E", "m1")
    assert np.abs(found.upper - alone.upper).max() < 1e-6
    assert computed({"E": 25e9}, method="modal").upper == pytest.approx(
        computed({"E": 25e9}, method="modal").lower, abs=1e-12
    )


def test_a_record_is_of_an_output_that_there_is_and_of_any_system() -> None:
    with pytest.raises(
        ValueError, match="output: 5 is not allowed; it must be from 0 to 1, for q1, q2"
    ):
        record(FRAME, E, duration=1.0, step=0.1, output=5)
    found = record(pendulum(), {"m": Interval(0.9, 1.1)}, duration=0.5, step=0.05, tolerance=0.1)
    assert (found.upper >= found.lower).all()


@pytest.mark.parametrize("method", METHODS)
def test_every_method_names_its_options(method: str) -> None:
    names = options_of(method)
    assert ("tolerance" in names) == (
        method in ("auto", "modal", "graph-follower", "improved-graph-follower")
    )


@pytest.mark.parametrize("wrong", [{"modulus": 25.0}, {"lengths": (3000.0, 3000.0)}])
def test_a_frame_in_other_units_hardly_moves_and_is_warned_of(wrong: dict[str, Any]) -> None:
    """Its bounds would be narrow and guaranteed, and say nothing of the structure meant."""
    told = r"the longest natural period is \d.* s beside a duration of 1 s: .* check the units"
    value = wrong.get("modulus", FRAME.modulus)
    inputs = {"E": Triangular(0.96 * value, value, 1.04 * value)}
    with pytest.warns(UserWarning, match=told) as seen:
        computed(inputs, replace(FRAME, **wrong))
    assert len(seen) == 1
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        computed()


def test_masses_in_tonnes_swing_between_nodes_and_are_warned_of() -> None:
    told = (
        r"longest natural period is 0\.\d* s beside a step of .* s: most peaks fall between nodes"
    )
    with pytest.warns(UserWarning, match=told) as seen:
        computed(model=replace(FRAME, masses=tuple(m / 1e3 for m in FRAME.masses)))
    assert len(seen) == 1


def test_a_record_slower_than_the_structure_is_warned_of() -> None:
    slow = replace(FRAME, ground=Accelerogram(20.0, np.array([0.0, 1.0, -1.0])))
    told = "the record has a value every 20 s and the longest natural period is"
    with pytest.warns(UserWarning, match=told) as seen:
        computed(model=slow)
    assert len(seen) == 1


@pytest.mark.parametrize("spans", [5, 20, 60])
def test_a_motion_much_shorter_than_a_swing_is_warned_of(spans: float) -> None:
    """A frame in t and GPa swings a thousand times slower than the one meant."""
    period = 2 * np.pi / frequencies(FRAME)[0]
    with warnings.catch_warnings(record=True) as seen:
        warnings.simplefilter("always")
        computed(duration=period / spans, step=period / spans / 10)
    told = [
        one for one in seen if "the structure hardly moves; check the units" in str(one.message)
    ]
    assert len(told) == (spans > 10)
