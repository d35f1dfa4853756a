"""A frame whose storeys are alike but not equal: against storeys given one by one."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest

from alphacut.frame import Exact, LinearFlow, StoreyFrame, envelope
from alphacut.frame.structures.field_frame import FieldFrame
from alphacut.fuzzy import Triangular
from alphacut.fuzzy.field import FuzzyField

PLAIN = StoreyFrame(
    [2e3, 1.5e3, 1e3],
    [3.0, 3.0, 3.0],
    2.5e10,
    1e-6,
    rayleigh=(0.1, 1e-3),
    v0=[0.2, 0.3, 0.5],
    outputs=("q3", "base_shear", "a1"),
)
TIME = {"duration": 2.0, "step": 0.02}


def field_frame(length: float, name: str = "c", share: float = 1.0) -> FieldFrame:
    own = {entry.name: getattr(PLAIN, entry.name) for entry in fields(PLAIN)}
    centre, half = (2.0, 0.3) if name == "c" else (1.5e3, 200.0)
    field = FuzzyField(name, (1.5, 4.5, 7.5), centre, half, length, share)
    return FieldFrame(**own, field=field)


@pytest.mark.parametrize("name", ["c", "m"])
def test_a_motion_is_that_of_the_storeys_values(name: str) -> None:
    frame, rng = field_frame(5.0, name), np.random.default_rng()
    assert frame.group(name) == frame.field.names
    assert not {f"{name}1", f"{name}2"} & set(frame.parameters)
    points = rng.uniform(-1, 1, (5, 3))
    values = frame.field.centre + frame.field.half_width * points @ frame.field.free_shapes.T
    one = LinearFlow(frame, frame.field.names, *TIME.values(), Exact())
    names = tuple(f"{name}{z}" for z in (1, 2, 3))
    other = LinearFlow(PLAIN, names, *TIME.values(), Exact())
    np.testing.assert_allclose(one.values(points), other.values(values), rtol=1e-9, atol=1e-12)
    jet = one.taylor(points)
    step = 1e-5 * np.eye(3)[0]
    moved = (one.values(points + step) - one.values(points - step)) / 2e-5
    np.testing.assert_allclose(jet.first[0], moved, rtol=1e-4, atol=1e-6 * np.abs(moved).max())


def test_the_theory_names_the_box_and_the_places_that_frames_take() -> None:
    page = (Path(__file__).parents[3] / "docs" / "theory.md").read_text(encoding="utf-8")
    told = " ".join(page.partition("A fuzzy field gives")[2].partition("\n## ")[0].split())
    assert "the middle of a storey, or the height of a floor where masses are a field" in told
    assert r"In a frame (`[field]`, `FieldFrame`) the $\xi_k$ vary freely, in the box" in told
    field = field_frame(5.0, share=0.5).field
    np.testing.assert_allclose(np.abs(field.free_shapes).sum(1), 1)  # however few directions


def test_each_storey_keeps_its_interval_and_neighbours_are_alike() -> None:
    rng = np.random.default_rng()
    for length in 10 ** rng.uniform(-1, 3, 20):
        field = field_frame(length).field
        corners = np.array(np.meshgrid(*[[-1.0, 1.0]] * len(field.names))).reshape(3, -1).T
        values = field.centre + field.half_width * corners @ field.free_shapes.T
        np.testing.assert_allclose(values.min(0), field.centre - field.half_width)
        np.testing.assert_allclose(values.max(0), field.centre + field.half_width)
        reached = float(np.abs(np.diff(values, axis=1)).max())
        assert reached == pytest.approx(field.apart)
    near, far = (field_frame(length).field for length in (50.0, 2.0))
    assert near.apart < far.apart


def test_a_long_field_is_one_factor_on_all_stiffnesses() -> None:
    frame = field_frame(1e9, share=0.99)
    assert frame.field.names == ("c_1",)
    own = envelope(frame, {"c_1": Triangular(-1, 0, 1)}, **TIME, method="modal", certify=1e-4)
    modulus = Triangular(0.85 * 2.5e10, 2.5e10, 1.15 * 2.5e10)
    other = envelope(PLAIN, {"E": modulus}, **TIME, method="modal", certify=1e-4)
    assert own.nature == other.nature == "guaranteed"
    scale = np.abs(other.upper).max((0, 1))
    assert (np.abs(own.upper - other.upper).max((0, 1)) < 1e-3 * scale).all()
    assert (np.abs(own.lower - other.lower).max((0, 1)) < 1e-3 * scale).all()


def test_a_proved_envelope_holds_all_storeys_that_are_alike() -> None:
    frame, rng = field_frame(5.0), np.random.default_rng()
    inputs = dict.fromkeys(frame.field.names, Triangular(-1, 0, 1))
    found = envelope(frame, inputs, **TIME, alpha=(0.0,), method="modal", certify=1e-4)
    assert found.nature == "guaranteed"
    flow = LinearFlow(frame, frame.field.names, *TIME.values(), Exact())
    motion = flow.values(np.vstack([rng.uniform(-1, 1, (500, 3)), rng.choice([-1, 1], (50, 3))]))
    assert (motion <= found.upper[0] + 1e-9).all()
    assert (motion >= found.lower[0] - 1e-9).all()


@pytest.mark.parametrize(
    ("field", "pattern"),
    [
        (FuzzyField("l", (1, 2, 3), 2.0, 0.3, 5.0), "named c or m"),
        (FuzzyField("c", (1, 2), 2.0, 0.3, 5.0), "one for each floor"),
        (FuzzyField("c", (1, 2, 3), 2.0, 2.0, 5.0), "must be positive"),
    ],
)
def test_fields_that_make_no_sense(field: FuzzyField, pattern: str) -> None:
    own = {entry.name: getattr(PLAIN, entry.name) for entry in fields(PLAIN)}
    with pytest.raises(ValueError, match=pattern):
        FieldFrame(**own, field=field)
