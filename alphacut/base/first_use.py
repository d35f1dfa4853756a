"""Names of a package that are imported when they are first asked for."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from importlib import import_module
from typing import Any, NamedTuple


class ModuleHooks(NamedTuple):
    """The two functions of a module that Python calls for names it does not hold (PEP 562)."""

    getattr: Callable[[str], Any]
    """Returns a name, or raises an AttributeError if the package has no such name."""
    dir: Callable[[], list[str]]
    """Lists the names of the package, sorted, for ``dir``, ``help`` and tab completion."""


def at_first_use(package: str, modules: Mapping[str, str]) -> ModuleHooks:
    """Return the functions ``__getattr__`` and ``__dir__`` of a package.

    ``__getattr__`` imports a name when it is first asked for. ``__dir__`` lists such names without
    importing them.

    Args:
        package: Full name of the package, ``__name__``.
        modules: Module within the package of each name that is imported at its first use.
    """

    def attribute(name: str) -> Any:
        """Return a name of the package that Python has not found in it."""
        if name in modules:
            return getattr(import_module(f"{package}.{modules[name]}"), name)
        raise AttributeError(f"module {package!r} has no attribute {name!r}")

    def names() -> list[str]:
        """Return the names that the package holds, or imports at their first use."""
        return sorted({*vars(sys.modules[package]), *modules})

    return ModuleHooks(attribute, names)
