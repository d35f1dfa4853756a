"""Fixtures of the tests of commands."""

import pytest


@pytest.fixture(autouse=True)
def no_work_is_timed(monkeypatch, request):
    """Let `check` time no parts of a run's work, but in the tests that are about it."""
    if "foresee" not in request.node.path.name:
        name = "alphacut.commands.check.foreseen_stages"
        monkeypatch.setattr(name, lambda content, petsc: ([], ""))
