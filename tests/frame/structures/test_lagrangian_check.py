"""Functions of a Lagrangian system that cannot be meant: each is refused in one line."""

from __future__ import annotations

import math
import re
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from alphacut.frame import LagrangianSystem
from alphacut.frame.structures import matrix

GIVEN: dict[str, Any] = {
    "coordinates": 1,
    "parameters": {"m": 1.0, "k": 2.0},
    "lagrangian": lambda q, v, p: p["m"] * v[0] ** 2 / 2 - p["k"] * q[0] ** 2 / 2,
    "initial": lambda p: ([0.1], [0.0]),
    "observed": {"x": lambda q, v, p: q[0]},
}


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (
            {"lagrangian": lambda q, v, p: p["M"] * v[0] ** 2},
            "lagrangian: there is no parameter 'M'; known are m, k",
        ),
        (
            {"lagrangian": lambda q, v, p: v[1] ** 2},
            "lagrangian: asks for a coordinate beyond the 1",
        ),
        (
            {"lagrangian": lambda q, v, p: v[0] ** 2 - abs(q[0])},
            "lagrangian: Abs is not allowed; use arithmetic and the smooth sin, cos and exp of alpha",
        ),
        (
            {"lagrangian": lambda q, v, p: v[0] ** 2 - np.cos(q[0])},
            "cannot be called with symbols .*; use arithmetic and the smooth sin, cos and exp of alpha",
        ),
        (
            {"lagrangian": lambda q, v, p: v[0] ** 2 - math.cos(q[0])},
            "cannot be called with symbols .*; use arithmetic and the smooth sin, cos and exp of alpha",
        ),
        (
            {"lagrangian": lambda q, v, p: v[0] ** 2 - (1 if q[0] > 0 else 0)},
            "cannot be called with symbols",
        ),
        ({"lagrangian": lambda q, v, p: "v0 +"}, "lagrangian: .* is no expression"),
        ({"lagrangian": lambda q, v, p: -(q[0] ** 2)}, "lagrangian: the mass matrix is singular"),
        (
            {"coordinates": 2},
            "initial: q0: .* is not allowed; it must be a list of 2|mass matrix is singular",
        ),
        (
            {"initial": lambda p: ([0.1, 1.0], [0.0])},
            r"initial: q0: \[0.1, 1.0\] is not allowed; it must be a list of 1, one for each",
        ),
        ({"initial": lambda p: [0.1]}, "initial: .* two lists"),
        ({"initial": lambda p: ([p["x0"]], [0.0])}, "initial: there is no parameter 'x0'"),
        ({"force": lambda q, v, p: -v[0]}, "force: -v0 is not allowed; it must be a list of 1"),
        ({"force": lambda q, v, p: [-v[0], 0]}, "force: .* it must be a list of 1"),
        (
            {"observed": {"x": lambda q, v, p: q[1]}},
            "observed: x: asks for a coordinate beyond the 1",
        ),
        ({"observed": {}}, "observed: {} is not allowed"),
        (
            {"parameters": {"m": "1 kg", "k": 2.0}},
            "parameter m: '1 kg' is not allowed; it must be a number, in SI units",
        ),
        ({"coordinates": 0}, "coordinates: 0 is not allowed"),
    ],
)
def test_functions_that_cannot_be_meant(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        LagrangianSystem(**{**GIVEN, **changes})


@pytest.mark.parametrize("file", ["lagrangian_check.py", "lagrangian.py", "matrix.py"])
def test_functions_named_in_hints_can_be_imported(file: str) -> None:
    text = Path(matrix.__file__).with_name(file).read_text(encoding="utf-8")
    named = re.findall(r"of `?(alphacut[.a-z]+[a-z])", text)
    assert named
    assert all(callable(import_module(one).exp) for one in named)
    assert "frame.jet" not in text
