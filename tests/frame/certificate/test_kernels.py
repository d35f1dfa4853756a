"""The compiled kernel against its NumPy twin, and the trees that both examine."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from alphacut.frame import Accelerogram, Exact, LinearFlow, StoreyFrame
from alphacut.frame.boxes import boxes
from alphacut.frame.certificate import branch_and_bound, kernel
from alphacut.frame.certificate.branch_and_bound import BranchAndBound, Enclosed
from alphacut.frame.certificate.frontier import Frontier
from alphacut.frame.certificate.numpy_kernel import examine
from alphacut.frame.modal.fitting import fit_modes
from alphacut.frame.modal.model import ModalModel
from alphacut.frame.modal.optima import problems
from alphacut.frame.modal.search import ModalSearch
from alphacut.fuzzy import Interval

PULSE = Accelerogram(0.13, np.array([0.0, 3.0, -2.0, 2.0]))
FRAME = StoreyFrame(
    (20e3, 10e3),
    (2.5, 2.7),
    24e9,
    1e-6,
    (500, 300),
    q0=(0.01, 0.03),
    v0=(0.0, -0.5),
)
INPUTS = {
    "E": Interval(22e9, 26e9),
    "m1": Interval(19e3, 21e3),
    "m2": Interval(9e3, 11e3),
    "q2_0": Interval(0.02, 0.04),
}


def take(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Let the branch and bound use one of the kernels."""
    if name == "numpy":
        monkeypatch.setattr(branch_and_bound, "examination", lambda: ("NumPy", examine))
    elif kernel.examination()[0] != "C":
        pytest.skip("no compiler")


def model(ground: Accelerogram | None, names: tuple[str, ...]) -> ModalModel:
    inputs = {name: INPUTS[name] for name in names}
    flow = LinearFlow(replace(FRAME, ground=ground), names, 10.0, 0.1, Exact())
    return fit_modes(flow, boxes(inputs, (0,)), tolerance=1e-5)


def enclosed(found: ModalModel, *, workers: int = 1, budget: float = 4000) -> Enclosed:
    """Bounds from poor first points, so that boxes improve them too."""
    d = len(found.boxes.names)
    optima = problems(np.arange(len(found.time)), len(found.outputs), d)
    optima.value[:] = optima.side * found.value_at(optima.point, optima.node, optima.output)
    return BranchAndBound(1e-6, budget).run(found, -np.ones(d), np.ones(d), optima, workers=workers)


@pytest.mark.parametrize("ground", [None, PULSE])
@pytest.mark.parametrize("names", [("E",), ("E", "m1"), tuple(INPUTS)])
def test_both_kernels_prove_the_same(ground, names, monkeypatch) -> None:
    found = model(ground, names)
    take("c", monkeypatch)
    compiled = enclosed(found)
    take("numpy", monkeypatch)
    plain = enclosed(found)
    peak = np.abs(plain.proved).max()
    assert np.abs(compiled.proved - plain.proved).max() <= 1e-13 * peak
    assert abs(compiled.boxes - plain.boxes) <= 1e-3 * plain.boxes
    searched = ModalSearch().run(found, -np.ones(len(names)), np.ones(len(names)))[0].ravel()
    assert (searched <= plain.proved).all()
    assert (plain.proved - searched).max() <= 1.01e-6


@pytest.mark.parametrize("name", ["c", "numpy"])
def test_threads_change_no_bit(name, monkeypatch) -> None:
    take(name, monkeypatch)
    monkeypatch.setattr(branch_and_bound, "PIECE", 500)
    found = model(None, ("E", "m1"))
    one, two = enclosed(found), enclosed(found, workers=2)
    assert (one.proved == two.proved).all()
    assert one.boxes == two.boxes


@pytest.mark.parametrize("ground", [None, PULSE])
def test_items_of_both_kernels_agree_code_by_code(ground, monkeypatch) -> None:
    """On boxes of all kinds: whole, halved, on faces of the domain."""
    take("c", monkeypatch)
    compiled, seen = kernel.examination()[1], []

    def both(piece, given):
        rounded = replace(given.remainder, margin=given.remainder.margin + 1e-3)
        given = replace(given, remainder=rounded)
        one, two = compiled(piece, given), examine(piece, given)
        seen.append((one, two))
        return two

    monkeypatch.setattr(branch_and_bound, "examination", lambda: ("both", both))
    enclosed(model(ground, tuple(INPUTS)), budget=200)
    codes = [np.concatenate([pair[k][0] for pair in seen]) for k in (0, 1)]
    values = [np.concatenate([pair[k][1] for pair in seen]) for k in (0, 1)]
    assert (codes[0] != codes[1]).mean() < 1e-3
    assert np.abs(values[0] - values[1]).max() <= 1e-13 * np.abs(values[0]).max()
    assert {0, 1, 2, 3, 4} <= set(codes[0].tolist())
    assert (codes[0] >= 16).any()


def test_both_kernels_close_items_at_the_same_bounds(monkeypatch) -> None:
    """Whatever the best so far is, so that every term of the bounds decides some items."""
    take("c", monkeypatch)
    compiled, found, pairs = kernel.examination()[1], model(None, ("E", "m1")), []

    def both(piece, given):
        for share in np.linspace(0, 1.5, 101) if len(pairs) < 600 else ():
            moved = replace(given, best=given.best + share * np.abs(given.best).max())
            pairs.append((compiled(piece, moved)[0], examine(piece, moved)[0]))
        return examine(piece, given)

    monkeypatch.setattr(branch_and_bound, "examination", lambda: ("both", both))
    enclosed(found, budget=200)
    one, two = (np.concatenate([pair[k] for pair in pairs]) for k in (0, 1))
    assert len(one) > 1.5e5
    assert (one != two).sum() <= 1


def test_children_cover_their_parent_and_no_more() -> None:
    lower, upper = np.array([-1.0, 0.0]), np.array([1.0, 3.0])
    root = Frontier.whole(2, np.arange(3))
    centre, radius, edges = root.geometry(lower, upper)
    assert (centre == [[0, 1.5]]).all()
    assert (radius == [[1, 1.5]]).all()
    assert edges.all()
    # problem 0 is closed, 1 halved along the second axis, 2 confined to the upper face of the first
    fresh = root.children(np.array([0, 2, 16 + 2]))
    centre, radius, edges = fresh.geometry(lower, upper)
    found = {
        (*c, *r): fresh.problem[fresh.box == k].tolist()
        for k, (c, r) in enumerate(zip(centre.tolist(), radius.tolist(), strict=True))
    }
    assert found == {
        (1.0, 1.5, 0.0, 1.5): [2],
        (0.0, 0.75, 1.0, 0.75): [1],
        (0.0, 2.25, 1.0, 0.75): [1],
    }
    low = int(np.flatnonzero(centre[:, 1] == 0.75)[0])
    assert edges[low].tolist() == [[True, True], [True, False]]
