"""Arrays of an unfinished computation: read by the same computation and by no other."""

import numpy as np
import pytest

from alphacut.io.kept_arrays import KeptArrays


def test_what_was_saved_is_there_for_the_same_key_alone(tmp_path):
    path = tmp_path / "envelope_all.partial.npz"
    first = KeptArrays(path, "abc")
    assert first.load("passes 0") is None
    first.save("passes 0", {"point": np.eye(3), "moved": np.array([2, 5])})
    first.save("guide 0", {"at": np.zeros((0, 2))})
    again = KeptArrays(path, "abc")
    assert np.array_equal(again.load("passes 0")["point"], np.eye(3))
    assert again.load("passes 0")["moved"].tolist() == [2, 5]
    assert again.load("guide 0")["at"].shape == (0, 2)
    assert KeptArrays(path, "abd").load("guide 0") is None
    assert KeptArrays(path, "abc", fresh=True).load("guide 0") is None
    again.done()
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("content", [b"", b"PK\x03\x04 broken", b"not a file of arrays"])
def test_a_broken_file_counts_as_none(tmp_path, content):
    path = tmp_path / "x.partial.npz"
    path.write_bytes(content)
    assert KeptArrays(path, "abc").load("guide 0") is None
