"""Matrices against the storey frame that has the same ones, and storeys of other columns."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import eigh, eigvals
from scipy.sparse import coo_array

from alphacut.frame import (
    Accelerogram,
    Exact,
    Force,
    History,
    LinearFlow,
    MatrixStructure,
    StoreyFrame,
    envelope,
    require_envelope,
)
from alphacut.frame.structures.matrix import Monomial, modal_energy_fractions
from alphacut.fuzzy import Interval
from tests.refused import refuses

MOTION = {"dampers": (0.1, 0.2), "damper_placement": "storey", "q0": (0.1, 0.0), "v0": (0.0, 0.4)}
HISTORIES = (History(0.3, [1.0, 1.6, 0.4], is_static=True), History.harmonic(1.3, 0.4, 0.35), None)
STOREY = StoreyFrame(
    (3.0, 2.0), (1.0, 1.2), 5.0, 1.0, **MOTION, outputs=("q2", "v1", "a2"),
    loads=[Force(2, 0.7, HISTORIES[0]), Force(1, 0.6, HISTORIES[1]), Force(2, 0.2, HISTORIES[2])],
)  # fmt: skip
TOP = 1.2**-3 * np.array([[1.0, -1.0], [-1.0, 1.0]])
MATRIX = MatrixStructure(
    {"E": 5.0, "m1": 3.0, "F2": 0.7},
    mass=[("m1", np.diag([1.0, 0.0])), (2.0, np.diag([0.0, 1.0]))],
    stiffness=[(lambda p: 24 * p["E"], coo_array(np.diag([1.0, 0.0]) + TOP))],
    observed={
        "q2": np.array([0.0, 1.0]),
        "v1": np.array([0.0, 0.0, 1.0, 0.0]),
        "a2": np.array([0.0, 0.0, 0.0, 0.0, 0.0, 1.0]),
    },
    damping=[(1.0, np.array([[0.3, -0.2], [-0.2, 0.2]]))],
    q0=np.array([0.1, 0.0]),
    v0=np.array([0.0, 0.4]),
    loads=[
        Force(np.array([0, 1.0]), "F2", HISTORIES[0]),
        Force(np.array([1.0, 0]), 0.6, HISTORIES[1]),
        Force(np.array([0, 0.1]), 2.0, HISTORIES[2]),
    ],
)


def test_matrices_and_storeys_give_the_same_trajectories_with_derivatives():
    names, point = ("E", "m1", "F2"), np.array([[5.2, 2.9, 0.8]])
    flows = [LinearFlow(system, names, 4, 0.1, Exact()) for system in (MATRIX, STOREY)]
    a, b = (flow.taylor(point) for flow in flows)
    for x, y in ((a.value, b.value), (a.first, b.first), (a.second, b.second)):
        assert np.abs(x - y).max() < 1e-11 * np.abs(y).max()


MASSES, LENGTHS = (10e3, 20e3, 5e3), (3.0, 4.0, 2.5)


def test_modes_are_those_of_the_chain_of_springs():
    """Released in the shape of a mode, the floors go on in it at its frequency."""
    columns = (4.0, 3.0, 1.0)
    k = [12 * c * 25e9 * 1e-5 / length**3 for c, length in zip(columns, LENGTHS, strict=True)]
    stiffness = np.array([[k[0] + k[1], -k[1], 0], [-k[1], k[1] + k[2], -k[2]], [0, -k[2], k[2]]])
    squared, shapes = eigh(stiffness, np.diag(MASSES))
    for omega, shape in zip(np.sqrt(squared), shapes.T, strict=True):
        start = {"q0": shape, "outputs": ("q1", "q2", "q3")}
        frame = StoreyFrame(MASSES, LENGTHS, 25e9, 1e-5, columns=columns, **start)
        flow = LinearFlow(frame, (), 1.0, 0.1, Exact())
        exact = np.cos(omega * flow.time)[:, None] * shape
        assert flow.values(np.zeros((1, 0)))[0] == pytest.approx(exact, abs=1e-10)


def test_factors_read_from_text_are_proved_as_names_and_numbers_are():
    one, k = Monomial.parse("1"), Monomial.parse("k")
    assert (one.simplest, k.simplest) == (1.0, "k")
    assert Monomial.parse("2*k").simplest == Monomial.parse("2*k")
    chain, eye = np.array([[2.0, -1.0], [-1.0, 1.0]]), np.eye(2)
    record = Accelerogram(0.02, np.sin(8 * np.arange(0, 1, 0.02)))
    dashpot = [(one, 0.5 * np.diag([1.0, 0.0]))]
    structure = MatrixStructure(
        {"k": 610.0}, [(one, eye)], [(k, chain)], {"q": eye[1]}, dashpot,
        ground=record, pattern=np.ones(2),
    )  # fmt: skip
    fuzzy = {"k": Interval(600, 620)}
    result = envelope(structure, fuzzy, duration=1.0, step=0.01, alpha=[0], progress=False)
    assert result.nature == "guaranteed"


def signed_structure(*, mass, stiffness):
    chain = np.array([[2.0, -1.0], [-1.0, 1.0]])
    return MatrixStructure(
        {"k": 1.0},
        mass=[(1.0, mass * np.eye(2))],
        stiffness=[("k", chain), (1.0, stiffness * chain)],
        observed={"q2": np.array([0.0, 1.0])},
    )


def test_a_matrix_of_the_other_sign_is_told_to_turn_it():
    with refuses("mass"):
        signed_structure(mass=-1.0, stiffness=0.0)
    with refuses("stiffness"):
        signed_structure(mass=1.0, stiffness=-3.0)
    assert signed_structure(mass=1.0, stiffness=-0.5).size == 2  # a weight takes some stiffness


def test_the_first_point_without_a_positive_mass_is_told():
    """The mass [[1, a], [a, 2]] is positive definite for a² < 2, at a = -1 and not at a = 2."""
    structure = MatrixStructure(
        {"a": 0.5, "b": 1.0},
        mass=[(1.0, np.diag([1.0, 2.0])), ("a", np.array([[0.0, 1.0], [1.0, 0.0]]))],
        stiffness=[("b", np.eye(2))],
        observed={"q": np.array([0.0, 1.0])},
        q0=np.array([0.1, 0.0]),
    )
    inputs = {"a": Interval(-1.0, 2.0), "b": Interval(1.0, 3.0)}
    with refuses("mass"):
        require_envelope(structure, inputs, duration=1.0, step=0.1)
    inputs["a"] = Interval(-1.0, 1.0)
    require_envelope(structure, inputs, duration=1.0, step=0.1)


@pytest.mark.parametrize(
    ("text", "value"),
    [("1", 1.0), ("2*a", 6.0), ("a^2*b**-1", 4.5), ("b/a^2", 2 / 9), ("1e-3 * a / b", 1.5e-3)],
)
def test_monomials_are_read(text, value):
    assert Monomial.parse(text)({"a": 3.0, "b": 2.0}) == pytest.approx(value)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "a+b",
        "a^b",
        "(a)",
        "a**",
        "__import__('os')",
        "a*",
        "a b",
        "1/0",
        "0^-1",
        "9^999",
        "1e999",
    ],
)
def test_other_expressions_are_refused(text):
    with refuses("factor"):
        Monomial.parse(text)


def test_a_lossless_ground_storey_damps_modes_by_their_energy_elsewhere():
    """Against complex modes, whose distance is of third order in the loss factor."""
    upper = np.array([[1.0, -1, 0], [-1, 2, -1], [0, -1, 1]]) * 4e6
    ground = np.diag([9e6, 0, 0])
    mass = np.diag([2e4, 1e4, 1e4, 0.0])
    upper, ground = (np.pad(x, (0, 1)) for x in (upper, ground))
    joined = np.zeros((4, 4))  # an unknown without mass on the roof
    joined[2:, 2:] = np.array([[1, -1], [-1, 1.0]]) * 1e6
    ground_of_it = np.diag([0, 0, 0, 2e5])
    structure = MatrixStructure(
        {"E": 1.0},
        mass=[(1.0, mass)],
        stiffness=[("E", upper), (1.0, ground), ("E", joined), (1.0, ground_of_it)],
        observed={"roof": np.eye(4)[2]},
    )
    shares, gaps = modal_energy_fractions(structure, [0, 2]), []
    for loss in (0.04, 0.02):
        stiffness = (upper + joined) * (1 + 1j * loss) + ground + ground_of_it
        a, b = np.ix_(range(3), range(3)), stiffness[3:, :3]
        condensed = stiffness[a] - b.T @ b / stiffness[3, 3]
        squared = np.sort(eigvals(condensed, mass[a]))
        exact = np.sin(np.angle(squared) / 2)
        gaps.append(abs(np.sin(np.arctan(loss * shares) / 2) / exact - 1).max())
    assert gaps[0] < 1e-3
    assert np.log2(gaps[0] / gaps[1]) == pytest.approx(2, abs=0.05)
