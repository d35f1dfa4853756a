"""What is raised within a search of SciPy's reaches the caller at once, whatever the optimiser."""

from typing import get_args

import pytest
import scipy.optimize

from alphacut.fuzzy import Optimisation, Triangular, propagate
from alphacut.fuzzy.campaign.campaign import CampaignError
from alphacut.fuzzy.plans.alpha_cut_optimisation import Method

X = {"x": Triangular(0, 1, 2), "y": Triangular(0, 1, 3)}
METHODS = get_args(Method)


def bent(x: float, y: float) -> float:
    return x * y - x**2


class Raising:
    """Raises an error on its call of a number, and counts what is called."""

    def __init__(self, error: type[BaseException], at: int) -> None:
        self.error, self.at, self.calls = error, at, 0

    def __call__(self, x: float, y: float) -> float:
        self.calls += 1
        if self.calls == self.at:
            raise self.error("no convergence")
        return bent(x, y)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("at", [5, 19])
def test_a_failed_sample_of_any_optimiser_is_told(method, at):
    failing = Raising(ValueError, at)
    with pytest.raises(CampaignError, match="no convergence") as caught:
        propagate(failing, X, Optimisation(method, budget=100), alpha=[0, 1])
    assert [error for _, error in caught.value.failures] == ["ValueError: no convergence"]
    assert failing.calls <= at + 30  # the rest of the failed batch


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("at", [5, 18])
def test_an_interrupt_ends_any_optimiser_at_once_and_the_store_keeps_the_rest(method, at, tmp_path):
    stopped = Raising(KeyboardInterrupt, at)
    given = {"store": tmp_path / "s.db", "identity": {"v": 1}, "alpha": [0, 1]}
    plan = Optimisation(method, budget=100)
    with pytest.raises(KeyboardInterrupt, match=rf"^interrupted; .*{at - 1} samples"):
        propagate(stopped, X, plan, **given)
    assert stopped.calls == at
    assert propagate(bent, X, plan, spot_check=0, **given).reused == at - 1


@pytest.mark.parametrize("cause", [KeyboardInterrupt(), None])
def test_an_interrupt_between_two_evaluations_is_no_error_of_the_system(cause, monkeypatch):
    def interrupted(objective, bounds, maxfun):
        raise SystemError("returned a result with an exception set") from cause

    monkeypatch.setattr(scipy.optimize, "direct", interrupted)
    with pytest.raises(KeyboardInterrupt if cause else SystemError):
        propagate(bent, X, Optimisation("direct"))
