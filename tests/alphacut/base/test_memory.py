"""The memory that a process may still take."""

import resource

import pytest

from alphacut.base.errors import RefusedError
from alphacut.base.memory import free_memory, require_free_memory


def test_a_limit_of_the_process_is_one_of_its_memory(monkeypatch):
    free = free_memory()
    assert 1e6 < free < 1e14
    limits = resource.getrlimit(resource.RLIMIT_AS)
    monkeypatch.setattr(resource, "getrlimit", lambda _: (10**3, limits[1]))
    assert free_memory() == 0
    with pytest.raises(RefusedError, match="an array, which takes 2e-09 GB"):
        require_free_memory("k.npy", 2.0, "an array")
