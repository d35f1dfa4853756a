"""Line about a library that is not installed: which, and how to get it."""

EXTRAS = {"skimage": "particles", "gmsh": "mesh", "meshio": "mesh", "h5py": "mesh"}


def missing(error: ImportError) -> str:
    """Message for an import that failed, with its cure."""
    library = (error.name or "").partition(".")[0]
    if library in EXTRAS:
        cure = f"pip install '.[{EXTRAS[library]}]' in a checkout, or run inside ./enter"
    else:
        cure = (
            "DOLFINx and its libraries are in no Python index: run inside ./enter of a checkout, or"
            " install Debian 13's python3-dolfinx or conda-forge's fenics-dolfinx"
        )
    return f"{error}; {cure}"
