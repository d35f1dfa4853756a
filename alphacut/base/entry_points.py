"""Classes that other distributions register by the entry points of their metadata."""

from __future__ import annotations

from functools import cache


@cache
def registered(group: str) -> dict[str, str]:
    """Return the places "module:name" that installed distributions register, by their names.

    The metadata of all distributions take time to read. They are read only where no entry of the
    project has the name that is asked for.

    Args:
        group: Name of the group, such as "alphacut.structures".
    """
    from importlib.metadata import entry_points  # takes time to import

    return {entry.name: entry.value for entry in entry_points(group=group)}
