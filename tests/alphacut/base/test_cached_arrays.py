"""Arrays in the user's cache, of which any bit may be wrong."""

from pathlib import Path

import numpy as np
import pytest

from alphacut.base.user_cache import cached_arrays


@pytest.fixture
def cache(tmp_path, monkeypatch):
    monkeypatch.setenv("ALPHACUT_CACHE", str(tmp_path))
    return tmp_path / "meshes"


def test_arrays_are_made_anew_whatever_bit_of_their_file_is_wrong(cache, rng):
    values = rng.random(6)
    made = []

    def make():
        made.append(1)
        return [values, np.arange(3)]

    cached_arrays("meshes", b"x", make)
    (file,) = Path(cache).glob("*.npz")
    sound = file.read_bytes()
    cached_arrays("meshes", b"x", make)
    assert len(made) == 1
    directory = sound.index(b"PK\1\2")
    # All bits of the heads of an entry in both places, where the reader's errors are of many kinds,
    # and some of the others.
    places = [*range(30), *range(directory, directory + 46), *range(len(sound) - 22, len(sound))]
    places += list(rng.integers(len(sound), size=8))
    kinds = set()
    for place in places:
        for bit in range(8):
            damaged = bytearray(sound)
            damaged[place] ^= 1 << bit
            file.write_bytes(damaged)
            before = len(made)
            arrays = cached_arrays("meshes", b"x", make)
            assert all(map(np.array_equal, arrays, [values, np.arange(3)])), (place, bit)
            kinds.add(len(made) - before)
    assert kinds == {0, 1}  # some bits change nothing that is read
