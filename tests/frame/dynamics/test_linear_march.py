"""The compiled march of linear structures against its NumPy twin and against long doubles."""

from __future__ import annotations

from collections.abc import Callable
from itertools import product

import numpy as np
import pytest

from alphacut.frame import INTEGRATORS, Accelerogram, LinearFlow, StoreyFrame
from alphacut.frame.calculus.c_library import c_library
from alphacut.frame.calculus.jet import Jet
from alphacut.frame.dynamics import transfer_powers
from alphacut.frame.dynamics.integrators import StepMap
from alphacut.frame.structures.linear import evaluate
from tests.frame.compiler import compiled

FULL = [(1, 1), (2, 9), (3, 4), (6, 3), (8, 8), (9, 2), (16, 1), (19, 17)]
"""Numbers of states and outputs: with constants in the code and without, whole vectors and not."""


def random_jet(rng: np.random.Generator, d: int, *shape: int) -> Jet:
    """All derivatives differ from zero."""
    second = rng.standard_normal((d, d, *shape))
    return Jet(
        rng.standard_normal(shape), rng.standard_normal((d, *shape)), second + second.swapaxes(0, 1)
    )


def random_motion(
    rng: np.random.Generator, states: int, outputs: int, d: int
) -> tuple[StepMap, Jet, Jet]:
    """A step that lets states live, a start and rows, at three sets of parameters."""
    transfer = random_jet(rng, d, 3, states, states)
    transfer = transfer * (0.95 / np.abs(np.linalg.eigvals(transfer.value)).max())
    load, start = random_jet(rng, d, 3, states, 3), random_jet(rng, d, 3, states, 1)
    return StepMap(transfer, load), start, random_jet(rng, d, 3, outputs, states)


def random_frame(rng: np.random.Generator, *, shaken: bool) -> StoreyFrame:
    n = int(rng.integers(2, 9))
    ground = Accelerogram(float(rng.choice([0.02, 0.033])), rng.standard_normal(60))
    named = ("q1", f"v{n}", "shear2", "a1", "drift2", f"q{n}")
    return StoreyFrame(
        rng.uniform(1e3, 1e4, n),
        rng.uniform(2.3, 3.2, n),
        25e9,
        1e-5,
        rng.uniform(0, 3e3, n) * rng.integers(2),
        str(rng.choice(["ground", "storey"])),
        rng.uniform(-0.01, 0.01, n),
        rng.uniform(-0.1, 0.1, n),
        outputs=named[: int(rng.integers(1, 7))],
        ground=ground if shaken else None,
    )


def alike(fast: Jet, slow: Jet, axes: tuple[int, ...] = (-2,)) -> bool:
    """Whether jets agree, V = (S, T, m), every derivative to a share of its peak over `axes`."""
    return all(
        (np.abs(a - b).max(axes) <= 1e-12 * np.abs(b).max(axes)).all()
        for a, b in zip(
            (fast.value, fast.first, fast.second),
            (slow.value, slow.first, slow.second),
            strict=True,
        )
    )


def twins(monkeypatch: pytest.MonkeyPatch, march: Callable[[], Jet]) -> tuple[Jet, Jet]:
    """The same march in compiled code and without."""
    if c_library(transfer_powers.SOURCE, transfer_powers.FUSED) is None:
        pytest.fail("no compiler in the project's own environment")
    fast = march()
    with monkeypatch.context() as patch:
        patch.setattr(transfer_powers, "c_library", lambda *_: None)
        return fast, march()


@compiled
@pytest.mark.parametrize(("method", "shaken"), product(INTEGRATORS, [False, True]))
def test_structures_move_as_in_numpy(
    monkeypatch: pytest.MonkeyPatch, method: str, shaken: bool
) -> None:
    for d in range(7):
        rng = np.random.default_rng([d, shaken])
        system = random_frame(rng, shaken=shaken)
        names = tuple(rng.permutation(["E", "m1", "d2", "l1", "q1_0", "v2_0"])[:d].tolist())
        flow = LinearFlow(system, names, 1.2, 0.005, INTEGRATORS[method])
        modal = np.array([[system.parameters[name] for name in names]])
        points = modal * rng.uniform(0.9, 1.1, (3, d))
        fast, slow = twins(monkeypatch, lambda flow=flow, at=points: flow.taylor(at))
        assert alike(fast, slow)
        assert np.abs(flow.values(points) - slow.value).max() <= 1e-12 * np.abs(slow.value).max()


@compiled
@pytest.mark.parametrize("d", [0, 1, 2, 5])
@pytest.mark.parametrize(("states", "outputs"), FULL)
@pytest.mark.parametrize("loaded", [False, True])
def test_full_jets_of_any_size_agree(
    monkeypatch: pytest.MonkeyPatch, d: int, states: int, outputs: int, loaded: bool
) -> None:
    rng = np.random.default_rng([d, states, outputs])
    step, start, rows = random_motion(rng, states, outputs, d)
    for count in (1, 2, 40):
        load = rng.standard_normal((count - 1, 3)) if loaded else None
        fast, slow = twins(
            monkeypatch,
            lambda count=count, load=load: transfer_powers.trajectory(
                step, start, rows, load=load, count=count
            ),
        )
        assert fast.second.shape == slow.second.shape == (d, d, 3, count, outputs)
        assert alike(fast, slow, (-3, -2, -1))


@compiled
def test_parts_that_are_zero_at_some_sets_alone_are_not_left_out(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    step, start, rows = random_motion(np.random.default_rng(8), 4, 2, 3)
    for jet in (step.transfer, step.load, rows):
        jet.first[0, 0], jet.first[1, 1], jet.second[:, :, 2] = 0, 0, 0
    load = np.random.default_rng(9).standard_normal((29, 3))

    def march() -> Jet:
        return transfer_powers.trajectory(step, start, rows, load=load, count=30)

    fast, slow = twins(monkeypatch, march)
    assert alike(fast, slow)
    for s in range(3):
        one = transfer_powers.trajectory(
            StepMap(step.transfer[s : s + 1], step.load[s : s + 1]),
            start[s : s + 1],
            rows[s : s + 1],
            load=load,
            count=30,
        )
        assert np.array_equal(one.second[:, :, 0], fast.second[:, :, s])


@compiled
@pytest.mark.parametrize("damper", [0.0, 60.0])
def test_rounding_hardly_grows_over_many_steps(
    monkeypatch: pytest.MonkeyPatch, damper: float
) -> None:
    system = StoreyFrame((9e3, 6e3), (2.5, 3.0), 25e9, 1e-5, (damper,) * 2, q0=(0.01, -0.004))
    flow = LinearFlow(system, ("E",), 300, 0.01)
    matrices, _ = evaluate(system, (), np.zeros((1, 0)), derivatives=False)
    T = flow.integrator.step_map(matrices, flow.step).transfer.value[0].astype(np.longdouble)
    x = np.array([*system.q0, 0, 0], np.longdouble)
    true = np.empty((30_001, 2))
    for k in range(len(true)):
        true[k] = x[:2]
        x = T @ x
    fast, slow = twins(monkeypatch, lambda: flow.taylor(np.array([[25e9]])))
    errors = [np.abs(jet.value[0] - true).max() / np.abs(true).max() for jet in (fast, slow)]
    assert errors[0] < 1e-13
    assert errors[1] < 1e-11


@compiled
def test_numpy_marches_where_the_code_finds_no_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    step, start, rows = random_motion(np.random.default_rng(2), 4, 2, 2)

    def march() -> Jet:
        return transfer_powers.trajectory(step, start, rows, load=None, count=20)

    _, slow = twins(monkeypatch, march)

    class Library:
        @staticmethod
        def linear_march(*_: object) -> int:
            return 0

    monkeypatch.setattr(transfer_powers, "c_library", lambda *_: Library())
    assert np.array_equal(march().second, slow.second)
