"""Structures refuse what has no meaning, by the argument, the value and what is allowed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import sympy

from alphacut.frame import (
    Accelerogram,
    Force,
    History,
    LagrangianFlow,
    LagrangianSystem,
    LinearFlow,
    MatrixStructure,
    Output,
    StoreyFrame,
    envelope,
    pendulum,
)
from alphacut.fuzzy import RefusedError

COLUMNS = StoreyFrame((2e4, 1e4), (3.0, 2.5), 25e9, 1e-4)
SPRINGS = StoreyFrame((2e4, 1e4), (3.0, 2.5), stiffness=(1e6, 1e6))


def matrices(**changes):
    unit = {"parameters": {"a": 1.0}, "observed": {"q": np.array([0.0, 1.0])}}
    unit |= {"mass": [("a", np.eye(2))], "stiffness": [("a", np.eye(2))]}
    return MatrixStructure(**unit | changes)


@pytest.mark.parametrize(
    ("frame", "changes", "message"),
    [
        (COLUMNS, {"masses": (2e4, -1.0)}, "masses is -1; allowed: positive"),
        (COLUMNS, {"masses": (2e4, "1 t")}, "masses is '1 t'; allowed: finite numbers"),
        (COLUMNS, {"modulus": None}, "modulus is missing; allowed: lengths, modulus and"),
        (COLUMNS, {"lengths": (3.0,)}, "lengths is a list of 1; allowed: 2, as masses has"),
        (COLUMNS, {"dampers": (5, -5)}, "dampers is -5; allowed: 0 or greater"),
        (COLUMNS, {"damping_ratio": 1.0}, "damping_ratio is 1; allowed: 0 or greater and below 1"),
        (COLUMNS, {"damping_ratio": (0.1,) * 3}, "damping_ratio is a list of 3; allowed: 2"),
        (COLUMNS, {"q0": (0.1, np.nan)}, "q0 is nan; allowed: finite numbers"),
        (COLUMNS, {"outputs": ("q3",)}, "output is q3; allowed: q, v, a, drift or shear"),
        (COLUMNS, {"outputs": ("q" + 5000 * "1",)}, "output is q1.*…; allowed: q, v, a, drift"),
        (COLUMNS, {"damper_placement": "roof"}, "damper_placement is roof; allowed: ground, storey"),
        (COLUMNS, {"stiffness": (1e6, 1e6)}, "modulus, second_moment.* either stiffness or what"),
        (SPRINGS, {"gravity": 500.0}, "storey 1 under P-Delta is 1e.06 N/m; .* it buckles"),
        (SPRINGS, {"gravity": 9.81, "lengths": ()}, "lengths is missing"),
        (SPRINGS, {"masses": None}, "masses is NoneType"),
        (SPRINGS, {"dampers": None}, "dampers is NoneType"),
        (SPRINGS, {"q0": [[0.1], [0.2, 0.3]]}, r"q0 is \[0.1\]; allowed: finite numbers"),
        (SPRINGS, {"v0": np.zeros((2, 2))}, r"v0 is of shape \(2, 2\); allowed: a list"),
        (SPRINGS, {"rayleigh": (0.1,)}, "rayleigh is a list of 1; allowed: two numbers"),
        (SPRINGS, {"outputs": 1}, "outputs is int; allowed: a list of names"),
    ],
)  # fmt: skip
def test_a_storey_frame_refuses(frame, changes, message):
    with pytest.raises(RefusedError, match=message):
        replace(frame, **changes)


EYE = np.eye(2)
MATRICES = MatrixStructure({"m": 1.0, "k": 2.0}, [("m", EYE)], [("k", EYE)], {"q": EYE[0]})


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"mass": []}, "mass is missing; allowed: one entry"),
        ({"mass": [EYE]}, "term of mass is ndarray; allowed: pairs"),
        ({"mass": [("M", EYE)]}, "factor of mass is .*; allowed: m, k"),
        ({"mass": [(lambda p: "x", EYE)]}, "factor of mass is .x.; allowed: arithmetic"),
        ({"mass": [(1.0, -EYE)]}, "mass is not positive definite"),
        ({"stiffness": [("k", np.triu(np.ones((2, 2))))]}, r"not symmetric: \[0, 1\] is 1"),
        ({"stiffness": [("k", np.ones((2, 3)))]}, r"array of stiffness is of shape \(2, 3\)"),
        ({"q0": np.ones(3)}, "q0 is of shape"),
        ({"observed": {"q": np.ones(3)}}, "observed: q is of shape"),
        (
            {"ratios": [0.1, 0.2, 0.3]},
            "ratios is 3 damping ratios; allowed: one for all modes, or 2",
        ),
        ({"ratios": [1.0]}, "ratios is .*, 0 or greater"),
        ({"ratios": [None]}, "ratios is .*, 0 or greater"),
        ({"row_factors": 2.0}, "row_factors is float; allowed: a dict by name"),
        ({"mass": [("m", 1.0)]}, r"array of mass is of shape \(\); allowed: a square array"),
        ({"mass": [("m", [[1.0, 0.0], [1.0]])]}, "array of mass is of uneven rows"),
        ({"parameters": {"m": "1 kg", "k": 2.0}}, "parameter m is '1 kg'"),
        ({"parameters": {"m": 1.0, "k": 2.0, "k 3": 1.0}}, "name of a parameter is 'k 3'"),
        (
            {"observed": {"a": np.eye(6)[4]}, "row_factors": {"a": "m"}},
            "observed: a is accelerations times a factor; allowed: accelerations as they are",
        ),
        (
            {"observed": {"a": np.eye(6)[5]}, "mass": [("m", np.diag([1.0, 0.0]))]},
            r"observed: a is accelerations of unknowns \[1\]; allowed: .* that have mass",
        ),
        ({"observed": {"roof drift": EYE[0]}}, "name of an output is 'roof drift'; allowed: names"),
        ({"observed": {"=q": EYE[0]}}, "name of an output is '=q'"),
        (
            {"observed": {Output("q", "m\x1b[2J"): EYE[0]}},
            "unit of q is 'm.x1b.2J'; allowed: units",
        ),
    ],
)
def test_a_structure_from_matrices_refuses(changes, message):
    with pytest.raises(RefusedError, match=message):
        replace(MATRICES, **changes)


SYSTEM = {
    "coordinates": 1,
    "parameters": {"m": 1.0},
    "lagrangian": lambda q, v, p: p["m"] * v[0] ** 2 / 2 - q[0] ** 2,
    "initial": lambda p: ([1.0], [0.0]),
    "observed": {"q": lambda q, v, p: q[0]},
}
ROUGH = {**SYSTEM, "lagrangian": lambda q, v, p: p["m"] * v[0] ** 2 - sympy.Abs(q[0])}
ONE = np.ones((1, 1))
FLOATING = replace(MATRICES, stiffness=[(1.0, EYE - EYE[::-1])], ratios=(0.1,))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"parameters": {}}, "parameters is"),
        ({"lagrangian": lambda q, v, p: p["x"]}, r"KeyError\('x'\); allowed: functions of m"),
        ({"lagrangian": lambda q, v, p: v[1] ** 2}, "IndexError"),
        ({"lagrangian": lambda q, v, p: v[0] ** 3}, "quadratic in v"),
        ({"lagrangian": lambda q, v, p: q[0] ** 2}, "singular; allowed: inertia"),
        ({"lagrangian": lambda q, v, p: np.sin(q[0])}, "TypeError.*functions of m and the coord"),
        ({"initial": lambda p: ([1.0, 2.0], [0.0])}, "allowed: 1 by coordinate"),
        ({"force": lambda q, v, p: 3.0}, "force is TypeError"),
    ],
)
def test_a_lagrangian_system_refuses(changes, message):
    with pytest.raises(RefusedError, match=message):
        LagrangianSystem(**{**SYSTEM, **changes})


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: LinearFlow(COLUMNS, ("m3",), 1.0, 0.1), "parameter is m3; allowed: E, I, m1"),
        (lambda: LinearFlow(COLUMNS, ("E",), 1.0, 0.3), "whole steps of 0.3 s"),
        (lambda: LinearFlow(COLUMNS, ("E",), 1.0, -0.1), "step is -0.1; .* greater than 0"),
        (lambda: LagrangianFlow(pendulum(), ("x",), 1.0, 0.1), "parameter is x; allowed: m, l"),
        (
            lambda: envelope(pendulum(), {"l": 1.0}, duration=1, step=0.1, integrator="euler"),
            "integrator is euler",
        ),
        (
            lambda: LagrangianFlow(LagrangianSystem(**ROUGH), ("m",), 1.0, 0.1).values(ONE),
            "function of the lagrangian is sign; allowed: reciprocal",
        ),
        (lambda: COLUMNS.group("zeta"), "parameter is zeta; allowed: m, l, c, d"),
        (
            lambda: LinearFlow(FLOATING, ("m",), 1.0, 0.1).values(ONE),
            "squared frequency is .* of the largest; allowed: more than 1e-12",
        ),
        (lambda: pendulum(length=-1.0), "length is -1.0; allowed: finite numbers greater"),
        (lambda: Accelerogram(0.0, np.ones(3)), "accelerogram is 3 samples every 0 s"),
        (lambda: replace(COLUMNS, loads=[Force(4, 1.0, None)]), "floor is 4"),
        (lambda: replace(COLUMNS, loads=[Force(1, np.nan, None)]), "amplitude"),
        (lambda: replace(COLUMNS, loads=[History.constant()]), "loads is list"),
        (lambda: replace(COLUMNS, loads=Force(1, 1.0, None)), "loads is Force; .* brackets"),
        (lambda: StoreyFrame(masses=30e3, stiffness=[1e6]), "masses is float; .* brackets"),
        (lambda: StoreyFrame(masses=[30e3], stiffness=1e6), "stiffness is float; .* brackets"),
        (lambda: matrices(mass=np.eye(2)), "term of mass is ndarray"),
        (lambda: matrices(parameters=["a"]), "parameters is list; allowed: a dict by name"),
        (lambda: matrices(observed=[0, 1]), "observed is list; allowed: a dict by name"),
        (lambda: matrices(ratios=0.05), "ratios is float; allowed: a list .* brackets"),
        (lambda: History(0.1, np.ones(1)), "history is 1 samples"),
        (lambda: History.harmonic(-1.0), "frequency"),
        (lambda: History.constant(-1.0), "start"),
    ],
)
def test_motions_and_loads_refuse_names_and_numbers_without_meaning(call, message):
    with pytest.raises(RefusedError, match=message):
        call()
