"""Files of published packages, which `make benchmarks` installs for their data alone."""

from __future__ import annotations

from pathlib import Path

PACKAGES = Path(__file__).parents[2] / "build" / "public"


class MissingPackageError(Exception):
    """A file of a package is wanted that is not there."""


def package_file(path: str) -> Path:
    """A file of an installed package, by its place below site-packages.

    Raises:
        MissingPackageError: The package is not there: `make benchmarks` installs it.
    """
    found = PACKAGES / path
    if not found.is_file():
        raise MissingPackageError(f"{path} is not in build/public: run `make benchmarks`")
    return found
