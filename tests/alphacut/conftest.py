"""Results that several tests look at."""

import pytest

from tests.alphacut.one_case import run


@pytest.fixture(scope="session")
def results(tmp_path_factory):
    """Folder of the results of a frame that asks every question; tests copy what they change."""
    return run(tmp_path_factory.mktemp("two-floors"))
