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
PACKAGES: tuple[str, ...] = ("fenics-dolfinx", "fenics-basix", "petsc4py", "mpi4py", "gmsh")
PACKAGES += ("numpy", "scipy", "xarray")
NESTED = ("stochastic", "rve", "fuzzy", "frame")  # packages in folders of their own


def version_of(distribution: str) -> str:
    """Version of an installed distribution; empty if it is not there."""
    try:
        return version(distribution)
    except PackageNotFoundError:
        return ""


@cache
def own_version() -> str:
    """Version of alphacut: from its installation, else from pyproject.toml beside it."""
    project = Path(__file__).resolve().parents[2] / "pyproject.toml"
    return version_of("alphacut") or str(tomllib.loads(project.read_text())["project"]["version"])


@cache
def versions() -> dict[str, str]:
    """Versions of alphacut, Python and of the packages that are installed."""
    names = {"alphacut": own_version(), "python": platform.python_version()}
    names |= {name: version for name in PACKAGES if (version := version_of(name))}
    if wheel := version_of("dolfinx-solver-real"):  # which holds both without their own metadata
        import petsc4py

        names |= {"fenics-dolfinx": wheel, "petsc4py": petsc4py.__version__}
    return names


@cache
def source_digest(packages: tuple[str, ...]) -> str:
    """SHA-256 of all Python files of some of this project's packages, in hexadecimal digits."""
    root, digest = Path(__file__).resolve().parents[1], hashlib.sha256()
    for package in packages:
        folder = root if package == "alphacut" else (root / package).resolve()
        names = {file.relative_to(folder).as_posix(): file for file in folder.rglob("*.py")}
        for name in sorted(names):
            # the packages linked into alphacut are not part of it
            if package != "alphacut" or name.partition("/")[0] not in NESTED:
                digest.update(name.encode() + names[name].read_bytes())
    return digest.hexdigest()


def fingerprint(inputs: object, packages: Sequence[str]) -> str:
    """Digest of everything that a result depends on: inputs, source, library versions."""
    content = [inputs, source_digest(tuple(packages)), versions(), FORMAT]
    return digest_of(json.dumps(content, sort_keys=True, default=_canonical).encode())


def _canonical(value: object) -> object:
    """What stands for an object in the text of a fingerprint, and is the same in every process."""
    if isinstance(value, BaseModel):
        return [type(value).__name__, {x: getattr(value, x) for x in type(value).model_fields}]
    if is_dataclass(value) and not isinstance(value, type):
        values = {field.name: getattr(value, field.name) for field in fields(value)}
        return [type(value).__name__, values]
    if isinstance(value, np.ndarray):
        return [value.shape, str(value.dtype), digest_of(value.tobytes())]
    if isinstance(value, FunctionType):  # its source is part of the fingerprint elsewhere
        return f"{value.__module__}.{value.__qualname__}"
    return value.name if isinstance(value, Path) else str(value)


def command_to_paste(*words: object) -> str:
    """This program here, ``./enter python -m alphacut`` or ``alphacut``, and words to paste."""
    program = "./enter python -m alphacut" if os.environ.get(INSIDE) else "alphacut"
    return f"{program} {shlex.join(map(str, words))}"


def command_line() -> str:
    """Command line of this process as it would be typed, without the program's path."""
    program = Path(sys.argv[0])
    name = f"python -m {program.parent.name}" if program.name == "__main__.py" else program.name
    return f"{name} {shlex.join(sys.argv[1:])}".strip()


def build_provenance(case_text: str, key: str) -> dict[str, object]:
    """Origin of a result, which its JSON file states, from the case file and the fingerprint."""
    return {
        "format_version": FORMAT,
        "created_by": f"alphacut {own_version()}",
        "command": command_line(),
        "versions": versions(),
        "case": case_text,
        "fingerprint": key,
    }
