"""Results that several tests look at."""

import pytest


@pytest.fixture(scope="session")
def results(two_floors):
    """Folder of the results of a frame that asks every question; tests copy what they change."""
    return two_floors
