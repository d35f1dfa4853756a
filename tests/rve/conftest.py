"""Gmsh itself, with which tests write and read meshes."""

import pytest


@pytest.fixture
def gmsh():
    """Gmsh with an empty model, open until the end of the test: no model may mesh meanwhile."""
    module = pytest.importorskip("gmsh")
    module.initialize()
    module.option.setNumber("General.Terminal", 0)
    yield module
    module.finalize()
