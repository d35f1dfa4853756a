"""The search of the modal model: it ends when it has converged, and says what is left."""

import numpy as np
import pytest

from alphacut.frame import Exact, LinearFlow, StoreyFrame
from alphacut.frame.boxes import boxes
from alphacut.frame.modal import newton, search
from alphacut.frame.modal.fitting import fit_modes
from alphacut.frame.modal.model import ModalModel
from alphacut.frame.modal.optima import Optima, problems
from alphacut.frame.modal.starting_points import trajectories
from alphacut.fuzzy import Triangular

RIDGED = StoreyFrame(
    (2e3, 1e3, 500.0),
    (2.5, 2.7, 2.7),
    24.7561e9,
    1e-6,
    (50, 50, 50),
    "storey",
    (0.01, 0.03, 0.08),
    (0, -0.5, -0.5),
)
"""Dampers between the floors: late bounds lie on long ridges, where Newton's method is slow."""
INPUTS = {"E": Triangular(22.7626e9, 24.7561e9, 25.8312e9)} | {
    f"m{i + 1}": Triangular(0.95 * m, m, 1.05 * m) for i, m in enumerate(RIDGED.masses)
}
SMALL = 1e-9


def ridges(start: float) -> tuple[ModalModel, Optima]:
    cuts = boxes(INPUTS, (0,))
    model = fit_modes(LinearFlow(RIDGED, cuts.names, 30, 0.25, Exact()), cuts)
    optima = problems(np.arange(len(model.time)), 3, 4)
    optima.point[:] = start
    optima.value[:] = optima.side * model.value_at(optima.point, optima.node, optima.output)
    return model, optima


def refined(start: float) -> Optima:
    model, optima = ridges(start)
    newton.refine(model, optima, np.arange(len(optima.value)), -np.ones(4), np.ones(4), SMALL)
    return optima


def test_newton_ends_when_it_has_converged_and_not_after_a_count(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    settled = refined(0.3)
    assert settled.left.max() <= SMALL
    monkeypatch.setattr(newton, "ITERATIONS", 10)
    hasty = refined(0.3)
    assert (settled.value - hasty.value).max() > 1e-5  # ten steps are too few here
    assert hasty.left[settled.value > hasty.value + 1e-5].min() > SMALL  # and it is said
    monkeypatch.setattr(newton, "ITERATIONS", 3000)
    assert np.abs(refined(0.3).value - settled.value).max() < 10 * SMALL


def test_independent_passes_find_the_basins_that_a_search_has_missed() -> None:
    cuts = boxes(
        {
            "E": Triangular(0.7 * 24.7561e9, 24.7561e9, 1.3 * 24.7561e9),
            **{f"m{k}": Triangular(0.7 * m, m, 1.3 * m) for k, m in ((1, 2e3), (3, 500.0))},
        },
        (0,),
    )
    model = fit_modes(LinearFlow(RIDGED, cuts.names, 12, 0.25, Exact()), cuts, tolerance=1e-3)
    lower, upper = -np.ones(3), np.ones(3)
    dense = trajectories(model, np.random.default_rng(5).uniform(-1, 1, (8000, 3)))
    top = np.stack([-dense.min(0), dense.max(0)], -1)
    alone = search.ModalSearch(8, 1, passes=0).run(model, lower, upper)
    judged = search.ModalSearch(8, 1, passes=20).run(model, lower, upper)
    assert (top - alone[0]).max() > 1e-3  # the search on its own misses basins
    assert alone[3].max() == 0
    assert (top - judged[0]).max() < 1e-5
    once = search.ModalSearch(8, 1, passes=1).run(model, lower, upper)
    assert once[3].max() > 1e-3  # a pass that still gains says so
    assert once[3].max() == pytest.approx((once[0] - alone[0]).max())


def test_trajectories_of_a_search_stay_within_what_is_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    model, asked = ridges(0.0)[0], []
    monkeypatch.setattr(search, "MOST", 200 * 3 * len(model.time))

    def watched(model: ModalModel, points: np.ndarray, *nodes: np.ndarray) -> np.ndarray:
        asked.append(len(points))
        return trajectories(model, points, *nodes)

    monkeypatch.setattr(search, "trajectories", watched)
    search.ModalSearch(passes=0).run(model, -np.ones(4), np.ones(4))
    assert len(asked) == 1
    assert 100 <= asked[0] <= 200  # where 512 and a grid were asked
