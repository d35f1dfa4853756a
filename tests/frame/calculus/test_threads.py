"""Threads of a search or a proof."""

from __future__ import annotations

import os
from multiprocessing import get_context

import pytest

from alphacut.frame.calculus.threads import MOST, each, threads


@pytest.mark.parametrize("cores", [1, 3, 4 * MOST])
def test_every_part_is_answered_in_order_on_any_number_of_cores(
    monkeypatch: pytest.MonkeyPatch, cores: int
) -> None:
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: range(cores))
    assert threads() == min(cores, MOST)
    assert each(lambda part: 2 * part, iter(range(50))) == list(range(0, 100, 2))


def test_a_worker_leaves_the_other_cores_to_its_siblings() -> None:
    with get_context("spawn").Pool(1) as pool:
        assert pool.apply(threads) == 1
