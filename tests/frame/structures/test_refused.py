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
from tests.refused import refuses

COLUMNS = StoreyFrame((2e4, 1e4), (3.0, 2.5), 25e9, 1e-4)
SPRINGS = StoreyFrame((2e4, 1e4), (3.0, 2.5), stiffness=(1e6, 1e6))


def matrices(**changes):
    unit = {"parameters": {"a": 1.0}, "observed": {"q": np.array([0.0, 1.0])}}
    unit |= {"mass": [("a", np.eye(2))], "stiffness": [("a", np.eye(2))]}
    return MatrixStructure(**unit | changes)


@pytest.mark.parametrize(
    ("frame", "changes", "key"),
    [
        (COLUMNS, {"masses": (2e4, -1.0)}, "masses"),
        (COLUMNS, {"masses": (2e4, "1 t")}, "masses"),
        (COLUMNS, {"modulus": None}, "modulus"),
        (COLUMNS, {"lengths": (3.0,)}, "lengths"),
        (COLUMNS, {"dampers": (5, -5)}, "dampers"),
        (COLUMNS, {"damping_ratio": 1.0}, "damping_ratio"),
        (COLUMNS, {"damping_ratio": (0.1,) * 3}, "damping_ratio"),
        (COLUMNS, {"q0": (0.1, np.nan)}, "q0"),
        (COLUMNS, {"outputs": ("q3",)}, "output"),
        (COLUMNS, {"outputs": ("q" + 5000 * "1",)}, "output"),
        (COLUMNS, {"damper_placement": "roof"}, "damper_placement"),
        (COLUMNS, {"stiffness": (1e6, 1e6)}, "modulus, second_moment, columns"),
        (SPRINGS, {"gravity": 500.0}, "stiffness of storey 1 under P-Delta"),
        (SPRINGS, {"gravity": 9.81, "lengths": ()}, "lengths"),
        (SPRINGS, {"masses": None}, "masses"),
        (SPRINGS, {"dampers": None}, "dampers"),
        (SPRINGS, {"q0": [[0.1], [0.2, 0.3]]}, "q0"),
        (SPRINGS, {"v0": np.zeros((2, 2))}, "v0"),
        (SPRINGS, {"rayleigh": (0.1,)}, "rayleigh"),
        (SPRINGS, {"outputs": 1}, "outputs"),
    ],
)  # fmt: skip
def test_a_storey_frame_refuses(frame, changes, key):
    with refuses(key):
        replace(frame, **changes)


EYE = np.eye(2)
MATRICES = MatrixStructure({"m": 1.0, "k": 2.0}, [("m", EYE)], [("k", EYE)], {"q": EYE[0]})


@pytest.mark.parametrize(
    ("changes", "key"),
    [
        ({"stiffness": []}, "stiffness"),
        ({"mass": [EYE]}, "term of mass"),
        ({"mass": [("M", EYE)]}, "factor of mass"),
        ({"mass": [(lambda p: "x", EYE)]}, "factor of mass"),
        ({"mass": [(1.0, -EYE)]}, "mass"),
        ({"stiffness": [("k", np.triu(np.ones((2, 2))))]}, "array of stiffness"),
        ({"stiffness": [("k", np.ones((2, 3)))]}, "array of stiffness"),
        ({"q0": np.ones(3)}, "q0"),
        ({"observed": {"q": np.ones(3)}}, "observed: q"),
        (
            {"ratios": [0.1, 0.2, 0.3]},
            "ratios",
        ),
        ({"ratios": [1.0]}, "ratios"),
        ({"ratios": [None]}, "ratios"),
        ({"row_factors": 2.0}, "row_factors"),
        ({"mass": [("m", 1.0)]}, "array of mass"),
        ({"mass": [("m", [[1.0, 0.0], [1.0]])]}, "array of mass"),
        ({"parameters": {"m": "1 kg", "k": 2.0}}, "parameter m"),
        ({"parameters": {"m": 1.0, "k": 2.0, "k 3": 1.0}}, "name of a parameter"),
        (
            {"observed": {"a": np.eye(6)[4]}, "row_factors": {"a": "m"}},
            "observed: a",
        ),
        (
            {"observed": {"a": np.eye(6)[5]}, "mass": [("m", np.diag([1.0, 0.0]))]},
            "observed: a",
        ),
        ({"observed": {"roof drift": EYE[0]}}, "name of an output"),
        ({"observed": {"=q": EYE[0]}}, "name of an output"),
        (
            {"observed": {Output("q", "m\x1b[2J"): EYE[0]}},
            "unit of q",
        ),
    ],
)
def test_a_structure_from_matrices_refuses(changes, key):
    with refuses(key):
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
    ("changes", "key"),
    [
        ({"parameters": {}}, "parameters"),
        ({"lagrangian": lambda q, v, p: p["x"]}, "lagrangian"),
        ({"lagrangian": lambda q, v, p: v[1] ** 2}, "lagrangian"),
        ({"lagrangian": lambda q, v, p: v[0] ** 3}, "lagrangian"),
        ({"lagrangian": lambda q, v, p: q[0] ** 2}, "mass of the lagrangian"),
        ({"lagrangian": lambda q, v, p: np.sin(q[0])}, "lagrangian"),
        ({"initial": lambda p: ([1.0, 2.0], [0.0])}, "initial"),
        ({"force": lambda q, v, p: 3.0}, "force"),
    ],
)
def test_a_lagrangian_system_refuses(changes, key):
    with refuses(key):
        LagrangianSystem(**{**SYSTEM, **changes})


@pytest.mark.parametrize(
    ("call", "key"),
    [
        (lambda: LinearFlow(COLUMNS, ("m3",), 1.0, 0.1), "parameter"),
        (lambda: LinearFlow(COLUMNS, ("E",), 1.0, 0.3), "duration"),
        (lambda: LinearFlow(COLUMNS, ("E",), 1.0, -0.1), "step"),
        (lambda: LagrangianFlow(pendulum(), ("x",), 1.0, 0.1), "parameter"),
        (
            lambda: envelope(pendulum(), {"l": 1.0}, duration=1, step=0.1, integrator="euler"),
            "integrator",
        ),
        (
            lambda: LagrangianFlow(LagrangianSystem(**ROUGH), ("m",), 1.0, 0.1).values(ONE),
            "function of the lagrangian",
        ),
        (lambda: COLUMNS.group("zeta"), "parameter"),
        (
            lambda: LinearFlow(FLOATING, ("m",), 1.0, 0.1).values(ONE),
            "stiffness",
        ),
        (lambda: pendulum(length=-1.0), "length"),
        (lambda: Accelerogram(0.0, np.ones(3)), "accelerogram"),
        (lambda: replace(COLUMNS, loads=[Force(4, 1.0, None)]), "floor"),
        (lambda: replace(COLUMNS, loads=[Force(1, np.nan, None)]), "amplitude"),
        (lambda: replace(COLUMNS, loads=[History.constant()]), "loads"),
        (lambda: replace(COLUMNS, loads=Force(1, 1.0, None)), "loads"),
        (lambda: StoreyFrame(masses=30e3, stiffness=[1e6]), "masses"),
        (lambda: StoreyFrame(masses=[30e3], stiffness=1e6), "stiffness"),
        (lambda: matrices(mass=np.eye(2)), "term of mass"),
        (lambda: matrices(parameters=["a"]), "parameters"),
        (lambda: matrices(observed=[0, 1]), "observed"),
        (lambda: matrices(ratios=0.05), "ratios"),
        (lambda: History(0.1, np.ones(1)), "history"),
        (lambda: History.harmonic(-1.0), "frequency"),
        (lambda: History.constant(-1.0), "start"),
    ],
)
def test_motions_and_loads_refuse_names_and_numbers_without_meaning(call, key):
    with refuses(key):
        call()
