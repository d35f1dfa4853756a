"""Names of a package that are imported when they are first asked for."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from importlib import import_module
from typing import Any


def at_first_use(package: str, modules: Mapping[str, str]) -> Callable[[str], Any]:
    """Return the function ``__getattr__`` of a package, which imports some of its names (PEP 562).

    Args:
        package: Full name of the package, ``__name__``.
        modules: Module within the package of each name that is imported at its first use.

    Returns:
        Function of a name. It raises an AttributeError if the package has no such name.
    """

    def attribute(name: str) -> Any:
        """Return a name of the package that Python has not found in it."""
        if name in modules:
            return getattr(import_module(f"{package}.{modules[name]}"), name)
        raise AttributeError(f"module {package!r} has no attribute {name!r}")

    return attribute
