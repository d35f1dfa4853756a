"""Versions that results state, of Debian's packages and of one wheel that holds several."""

import pytest

pytest.importorskip("alphacut.rve.fenicsx")

from alphacut.io.provenance import versions


def test_dolfinx_and_petsc4py_are_named_however_they_were_installed():
    import dolfinx
    import petsc4py

    assert versions()["fenics-dolfinx"].removesuffix(".0") in dolfinx.__version__
    assert versions()["petsc4py"] == petsc4py.__version__
