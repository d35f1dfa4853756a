"""Origin of a result: versions, command, case, fingerprint."""

from __future__ import annotations

import hashlib
import json
import os
import platform
import shlex
import sys
import tomllib
from collections.abc import Sequence
from dataclasses import fields, is_dataclass
from functools import cache
from pathlib import Path
from types import FunctionType

import numpy as np

from alphacut.base.kept_files import digest_of
from alphacut.base.seen_folders import INSIDE

FORMAT = 5
"""Format of a folder of results. 5: arrays are in the classic format of NetCDF, no longer in HDF5,
whose files may refer to other files; 4: a manifest of files by name, JSON beside NetCDF files."""
NESTED = ("stochastic", "rve", "fuzzy", "frame")
"""Packages that are linked into alphacut and have folders of their own."""


def version_of(distribution: str) -> str:
    """Return the version of an installed distribution; empty if it is not there."""
    from importlib.metadata import PackageNotFoundError, version  # takes time to import

    try:
        return version(distribution)
    except PackageNotFoundError:
        return ""


@cache
def own_version() -> str:
    """Return the version of alphacut: of its installation, else in pyproject.toml beside it."""
    project = Path(__file__).resolve().parents[2] / "pyproject.toml"
    return version_of("alphacut") or str(tomllib.loads(project.read_text())["project"]["version"])


@cache
def versions() -> dict[str, str]:
    """Return the versions of alphacut, of Python and of the libraries that results depend on.

    They are given by the names of the distributions, such as "fenics-dolfinx"; libraries that are
    not installed are left out.
    """
    # A result is computed anew if one of these changes; others, as of figures, change no number.
    of_cell = "fenics-dolfinx", "fenics-basix", "petsc4py", "mpi4py", "gmsh"
    names = {"alphacut": own_version(), "python": platform.python_version()}
    for library in (*of_cell, "numpy", "scipy", "xarray"):
        if found := version_of(library):
            names[library] = found
    # The distribution dolfinx-solver-real holds DOLFINx and petsc4py without their own metadata.
    if wheel := version_of("dolfinx-solver-real"):
        import petsc4py

        names |= {"fenics-dolfinx": wheel, "petsc4py": petsc4py.__version__}
    return names


@cache
def source_digest(packages: tuple[str, ...]) -> str:
    """Return the SHA-256 of all Python files of some of this project's packages, in hexadecimal.

    It covers the files' names and contents. The result is kept for the process.

    Args:
        packages: Names of packages in their order, such as "fuzzy". "alphacut" is the thin layer
            alone: stochastic, rve, fuzzy and frame, which are linked into it, are packages of
            their own here. A name without a folder adds nothing.
    """
    # Results must be computed anew when the code changes, also between two versions of it. All
    # files count, since which function a result has met is not known.
    root = Path(__file__).resolve().parents[1]
    digest = hashlib.sha256()
    for package in packages:
        folder = root if package == "alphacut" else (root / package).resolve()
        files = {file.relative_to(folder).as_posix(): file for file in folder.rglob("*.py")}
        for name in sorted(files):
            # In an installation the four packages, whose names are in NESTED, are folders of
            # alphacut and no links.
            if package != "alphacut" or name.partition("/")[0] not in NESTED:
                digest.update(name.encode() + files[name].read_bytes())
    return digest.hexdigest()


def fingerprint(inputs: object, packages: Sequence[str]) -> str:
    """Return the SHA-256, in hexadecimal, of everything that a result depends on.

    Equal inputs have equal fingerprints in all processes. The versions of Python and the libraries
    and the format of result files count always.

    Args:
        inputs: Pydantic models, dataclasses, arrays, numbers and texts, or lists, tuples and
            dictionaries of these. Of a path only the file's name counts, and of a function its
            full name.
        packages: Packages of this project whose source counts, such as "fuzzy".
    """
    # JSON with sorted keys is one text for equal inputs; pickles and hashes differ by process.
    content = [inputs, source_digest(tuple(packages)), versions(), FORMAT]
    return digest_of(json.dumps(content, sort_keys=True, default=_canonical).encode())


def _canonical(value: object) -> object:
    """Return what stands for an object in the JSON text of a fingerprint.

    It must be the same in all processes and different for objects that give different results:

    - a Pydantic model or a dataclass: the name of the class, and the fields by name. Fields are not
      converted here: the caller, `json.dumps`, asks again for each;
    - an array: its shape, type and a digest of its bytes;
    - a function: its full name;
    - a path: the name of the file, without the folder;
    - any other object: its text.
    """
    from pydantic import BaseModel  # not above: entry.py must run to say that it is missing

    if isinstance(value, BaseModel):
        return [type(value).__name__, {x: getattr(value, x) for x in type(value).model_fields}]
    if is_dataclass(value) and not isinstance(value, type):
        return [type(value).__name__, {x.name: getattr(value, x.name) for x in fields(value)}]
    if isinstance(value, np.ndarray):
        return [value.shape, str(value.dtype), digest_of(value.tobytes())]
    if isinstance(value, FunctionType):  # its source is part of the fingerprint elsewhere
        return f"{value.__module__}.{value.__qualname__}"
    return value.name if isinstance(value, Path) else str(value)


def command_to_paste(*words: object) -> str:
    """Return a command of this program with some words, quoted for a shell, as it is typed here."""
    program = "./enter python -m alphacut" if os.environ.get(INSIDE) else "alphacut"
    return f"{program} {shlex.join(str(word) for word in words)}"


def command_line() -> str:
    """Return the command line of this process as it would be typed, without the program's path."""
    program = Path(sys.argv[0])
    name = program.name
    if name == "__main__.py":
        name = f"python -m {program.parent.name}"
    return f"{name} {shlex.join(sys.argv[1:])}".strip()


def build_provenance(case_text: str, key: str) -> dict[str, object]:
    """Return the origin of a result, which its JSON file states.

    It has the format of the file, the version of this program, the command line of this process,
    the versions of libraries, the case and the fingerprint, all as numbers and texts by name.

    Args:
        case_text: Content of the case file.
        key: Fingerprint of the result: a digest of everything that it depends on.
    """
    return {
        "format_version": FORMAT,
        "created_by": f"alphacut {own_version()}",
        "command": command_line(),
        "versions": versions(),
        "case": case_text,
        "fingerprint": key,
    }
