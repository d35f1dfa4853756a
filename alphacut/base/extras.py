"""Libraries that pip installs with an extra of this project, such as ``alphacut[cases]``.

An import that fails because such a library is not installed says which extra brings it.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from alphacut.base.errors import RefusedError

EXTRAS = {
    "cases": (
        "PIL", "jinja2", "matplotlib", "netCDF4", "pandas", "pint", "pydantic", "pydantic_core",
        "sympy", "xarray",
    ),
    "cell": ("basix", "cffi", "dolfinx", "gmsh", "h5py", "meshio", "mpi4py", "petsc4py", "ufl"),
    "device": ("array_api_compat", "cupy"),
    "mapdl": ("ansys",),
    "nastran": ("pyyeti",),
    "obspy": ("obspy",),
    "particles": ("skimage",),
    "volumes": ("tifffile",),
}  # fmt: skip
"""Libraries of each extra, by the names under which they are imported."""


class MissingLibraryError(RefusedError, ModuleNotFoundError):
    """A library is not installed: `key` is its name, and `cure` says how to install it.

    It is a ModuleNotFoundError as well, so that a caller can try an import as usual.
    """


def install_command(library: str) -> str:
    """Return how to install a library: pip's command with its extra, or words if it has none.

    Args:
        library: Name under which the library is imported, such as "PIL".

    Example:
        >>> install_command("skimage")
        "pip install 'alphacut[particles]'"
    """
    for extra, libraries in EXTRAS.items():
        if library in libraries:
            return f"pip install 'alphacut[{extra}]'"
    return f"install {library}"


@contextmanager
def extra_named(place: str = "", alternative: str = "") -> Iterator[None]:
    """Name the extra that brings a library if an import in the block does not find the library.

    Args:
        place: File that needs the library, for the message; empty for none.
        alternative: What the user can do in place of an installation, such as "take cpu".

    Raises:
        MissingLibraryError: In place of a ModuleNotFoundError in the block.
    """
    try:
        yield
    except ModuleNotFoundError as error:
        if error.name is None:  # raised by a library itself, whose message says what it lacks
            raise
        library = error.name.partition(".")[0]
        cure = install_command(library)
        if alternative:
            cure = f"{cure}, or {alternative}"
        raise MissingLibraryError(library, None, "", cure, place) from None
