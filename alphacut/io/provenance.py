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
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from types import FunctionType

import numpy as np
from pydantic import BaseModel

from alphacut.base.kept_files import digest_of
from alphacut.io.files import INSIDE

FORMAT = 4
"""Format of a folder of results. 4: a manifest of files by name, JSON beside NetCDF files."""
NESTED = ("stochastic", "rve", "fuzzy", "frame")
"""Packages that are linked into alphacut and have folders of their own."""


def version_of(distribution: str) -> str:
    """Return the version of an installed distribution; empty if it is not there."""
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
    """Return the versions of alphacut, of Python and of the libraries that are installed."""
    of_cell = "fenics-dolfinx", "fenics-basix", "petsc4py", "mpi4py", "gmsh"
    names = {"alphacut": own_version(), "python": platform.python_version()}
    for library in (*of_cell, "numpy", "scipy", "xarray"):
        if found := version_of(library):
            names[library] = found
    if wheel := version_of("dolfinx-solver-real"):  # which holds both without their own metadata
        import petsc4py

        names |= {"fenics-dolfinx": wheel, "petsc4py": petsc4py.__version__}
    return names


@cache
def source_digest(packages: tuple[str, ...]) -> str:
    """Return the SHA-256 of all Python files of some of this project's packages, in hexadecimal.

    The packages that are linked into alphacut are no part of it.
    """
    root = Path(__file__).resolve().parents[1]
    digest = hashlib.sha256()
    for package in packages:
        folder = root if package == "alphacut" else (root / package).resolve()
        files = {file.relative_to(folder).as_posix(): file for file in folder.rglob("*.py")}
        for name in sorted(files):
            if package != "alphacut" or name.partition("/")[0] not in NESTED:
                digest.update(name.encode() + files[name].read_bytes())
    return digest.hexdigest()


def fingerprint(inputs: object, packages: Sequence[str]) -> str:
    """Return the digest of everything that a result depends on.

    Args:
        inputs: Models, dataclasses, arrays, numbers and texts, or nestings of these.
        packages: Packages of this project whose source counts; versions of libraries count always.
    """
    content = [inputs, source_digest(tuple(packages)), versions(), FORMAT]
    return digest_of(json.dumps(content, sort_keys=True, default=_canonical).encode())


def _canonical(value: object) -> object:
    """Return what stands for an object in the text of a fingerprint, the same in all processes."""
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
    """Return a command of this program with some words, as it is typed here."""
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

    Args:
        case_text: Content of the case file.
        key: Fingerprint of the result.
    """
    return {
        "format_version": FORMAT,
        "created_by": f"alphacut {own_version()}",
        "command": command_line(),
        "versions": versions(),
        "case": case_text,
        "fingerprint": key,
    }
