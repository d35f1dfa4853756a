"""Values on lines against values at each of their points."""

from __future__ import annotations

import numpy as np
import pytest

from alphacut.frame import Accelerogram, Exact, LinearFlow, StoreyFrame
from alphacut.frame.boxes import boxes
from alphacut.frame.calculus import threads
from alphacut.frame.modal.fitting import fit_modes
from alphacut.frame.modal.model import ModalModel
from alphacut.frame.modal.optima import Optima, problems
from alphacut.frame.modal.probes import _pointwise, along
from alphacut.fuzzy import Triangular

RECORD = Accelerogram(0.02, np.random.default_rng(3).normal(size=60))


def model(count: int, ground: Accelerogram | None, state: float) -> ModalModel:
    storeys = (state,) * count
    frame = StoreyFrame(
        (1e3,) * count,
        (3.0,) * count,
        25e9,
        2e-5,
        (50.0,) * count,
        "storey",
        storeys,
        ground=ground,
        outputs=("q1", "drift2"),
    )
    cuts = boxes({f"m{i + 1}": Triangular(970.0, 1e3, 1030.0) for i in range(count)}, (0,))
    flow = LinearFlow(frame, cuts.names, 1.5, 0.05, Exact())
    return fit_modes(flow, cuts, tolerance=1e-3 if count > 6 else 1e-9)


def lines(given: ModalModel, seed: int) -> tuple[Optima, np.ndarray, np.ndarray]:
    rng, d = np.random.default_rng(seed), len(given.boxes.names)
    found = problems(np.arange(len(given.time)), 2, d)
    found.point[:] = rng.uniform(-1, 1, found.point.shape)
    axes = rng.permuted(np.tile(np.arange(d), (len(found.value), 1)), axis=1)[:, :2]
    return found, axes, rng.uniform(-1, 1, (len(found.value), 2, 5))


@pytest.mark.parametrize("count", [3, 8])
@pytest.mark.parametrize(("ground", "state"), [(None, 0.01), (RECORD, 0.0), (RECORD, 0.01)])
def test_values_on_lines_are_those_of_their_points(
    count: int, ground: Accelerogram | None, state: float
) -> None:
    given = model(count, ground, state)
    assert (given.degree <= 2) == (count == 8)
    at, axes, moved = lines(given, count)
    found, wanted = along(given, at, axes, moved), _pointwise(given, at, axes, moved)
    assert np.abs(found - wanted).max() < 1e-11 * np.abs(wanted).max()


def test_threads_keep_the_order_and_change_no_bit(monkeypatch: pytest.MonkeyPatch) -> None:
    given = model(8, None, 0.01)
    at, axes, moved = lines(given, 1)
    monkeypatch.setattr("alphacut.frame.modal.probes.PIECE", 50)
    several = []
    for count in (1, 2, 5):
        monkeypatch.setattr(threads, "threads", lambda count=count: count)
        assert threads.each(lambda x: x * x, range(9)) == [x * x for x in range(9)]
        several.append(along(given, at, axes, moved))
    assert all((found == several[0]).all() for found in several)
