"""The exception that carries all problems of an input, and words on how to mend one."""

from __future__ import annotations

import os
from collections.abc import Iterable
from difflib import get_close_matches

from alphacut.fuzzy.refused import RefusedError


class BadInput(Exception):  # noqa: N818 - it names the input, not the program, as the culprit
    """An input that cannot be used; `problems` are all that is wrong with it."""

    def __init__(self, problems: Iterable[RefusedError]) -> None:
        self.problems = tuple(problems)
        super().__init__("\n".join(map(str, self.problems)))


def nearest(name: str, names: Iterable[str]) -> str:
    """The known name that comes nearest to `name`; empty if none comes near."""
    folded = {option.lower(): option for option in names}
    close = get_close_matches(name.lower().replace("-", "_"), folded, n=1, cutoff=0.6)
    return folded[close[0]] if close else ""


def suggestion(name: str, names: Iterable[str]) -> str:
    """Words on the known name that comes nearest; empty if none comes near."""
    return f"did you mean {close}?" if (close := nearest(name, names)) else ""


INSIDE = "ALPHACUT_INSIDE"
"""Variable that ./enter sets."""
ELEMENTS = ("dolfinx", "petsc4py", "mpi4py", "basix", "ufl", "cffi", "gmsh", "meshio", "h5py")
EXTRAS = {"skimage": "particles", **dict.fromkeys(ELEMENTS, "cell")}


def missing(error: ImportError) -> str:
    """Message for an import that failed, with its cure."""
    library = (error.name or "").partition(".")[0]
    cure = f"pip install '.[{EXTRAS[library]}]'" if library in EXTRAS else f"install {library}"
    return f"{error}; {cure}" + ("" if os.environ.get(INSIDE) else ", or run inside ./enter")
