"""What a campaign costs besides its model."""

import pytest

from benchmarks.fuzzy import overhead as fuzzy_overhead


def test_overhead_is_small_and_memory_does_not_grow(tmp_path):
    fuzzy_overhead.measure(500, tmp_path / "s.db")
    row = fuzzy_overhead.measure(5_000, tmp_path / "s.db")
    assert row.milliseconds < 2
    assert row.after - row.before < 10


@pytest.mark.slow
def test_a_hundred_thousand_samples(tmp_path):
    fuzzy_overhead.measure(1_000, tmp_path / "s.db")
    row = fuzzy_overhead.measure(100_000, tmp_path / "s.db")
    assert row.milliseconds < 2
    assert row.after - row.before < 25  # their numbers alone, three copies, take 7 MB
