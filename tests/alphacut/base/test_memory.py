"""The memory that a process may still take."""

import os
import resource

import pytest

from alphacut.base import memory
from alphacut.frame import read_matrix, read_modes, read_record
from alphacut.stochastic import read_particles
from tests.refused import refuses


def test_a_limit_of_the_process_is_one_of_its_memory(monkeypatch):
    free = memory.free_memory()
    assert 1e6 < free < 1e14
    limits = resource.getrlimit(resource.RLIMIT_AS)
    monkeypatch.setattr(resource, "getrlimit", lambda _: (10**3, limits[1]))
    assert memory.free_memory() == 0
    with refuses("k.npy"):
        memory.require_free_memory("k.npy", 2e6, "an array")
    memory.require_free_memory("k.npy", 1e6, "an array")  # of so little it is not asked


READERS = {
    "matrix.mtx": read_matrix,
    "matrix.csv": read_matrix,
    "record.csv": read_record,
    "modes.uff": lambda path: read_modes(path, floors={"1.x": 1}),
    "circles.csv": lambda path: read_particles(path, size=(0.1, 0.1)),
}


@pytest.mark.parametrize("name", READERS)
def test_texts_larger_than_memory_and_pipes_are_refused_before_they_are_read(
    tmp_path, monkeypatch, name
):
    path = tmp_path / name
    path.write_text("1,2\n" * 10_000)
    monkeypatch.setattr(memory, "free_memory", lambda: 1e4)
    with refuses(name):
        READERS[name](path)
    path.unlink()
    os.mkfifo(path)
    with refuses(name):
        READERS[name](path)
