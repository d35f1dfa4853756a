"""Fields that are kept for the same systems solved again, and for no others."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

from alphacut.rve.image.fields.conjugate_gradient import ConjugateGradient
from alphacut.rve.image.fields.system import System

LOAD = np.random.default_rng(3).normal(size=(1, 1, 2, 4, 4))


@dataclass(frozen=True)
class Times:
    factor: float

    def apply(self, fields):
        return self.factor * fields


class Other(Times):
    pass


def system(factor=2.0, kind=Times, **changes):
    """factor · fields = load."""
    origin = (np.array([factor]),)
    ones = np.ones((1, 1)), np.ones(1)
    made = System(kind(factor), Times(1.0), LOAD.copy(), *ones, origin=origin)
    return replace(made, **changes)


@pytest.mark.parametrize(
    ("solver", "other"),
    [
        ({}, {"factor": 3.0}),
        ({}, {"kind": Other}),
        ({}, {"load": 2 * LOAD}),
        ({}, {"scale": 1e-9 * np.ones((1, 1))}),
        ({}, {"least": 0.5 * np.ones(1)}),
        ({}, {"start": 0.1 * LOAD}),
        ({"accuracy": 1e-7}, {}),
        ({"iterations": 3}, {}),
    ],
)
def test_fields_are_kept_for_an_equal_system_and_solver_alone(tmp_path, monkeypatch, solver, other):
    solve, asked = ConjugateGradient.solve, []

    def counted(solver, system):
        asked.append(system)
        return solve(solver, system)

    monkeypatch.setattr(ConjugateGradient, "solve", counted)
    keeping = ConjugateGradient(kept=tmp_path / "kept")
    first = keeping.found(system())
    again = keeping.found(system())
    assert len(asked) == 1
    np.testing.assert_array_equal(first.fields, again.fields)
    assert first.iterations == again.iterations
    replace(keeping, **solver).found(system(**other))
    assert len(asked) == 2


def test_fields_that_cannot_be_kept_are_found_all_the_same(tmp_path):
    (tmp_path / "kept").write_text("a file in the folder's place", encoding="utf-8")
    found = ConjugateGradient(kept=tmp_path / "kept").found(system())
    np.testing.assert_allclose(found.fields, LOAD / 2, rtol=1e-2)
    assert (tmp_path / "kept").is_file()
