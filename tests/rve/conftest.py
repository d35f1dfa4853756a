"""Gmsh itself, with which tests write and read meshes."""

from pkgutil import resolve_name

import numpy as np
import pytest


@pytest.fixture
def gmsh():
    """Gmsh with an empty model, open until the end of the test: no model may mesh meanwhile."""
    module = pytest.importorskip("gmsh")
    module.initialize()
    module.option.setNumber("General.Terminal", 0)
    yield module
    module.finalize()


@pytest.fixture
def read_here(monkeypatch):
    """Meshes are read in this process: the start of another takes longer than all else."""
    gmsh = pytest.importorskip("gmsh")

    def read(reader, path, **_):
        found = resolve_name(reader)(path)
        gmsh.finalize()
        return {name: np.array(numbers) for name, numbers in found.items()}

    monkeypatch.setattr("alphacut.base.apart.read_apart", read)
