"""A cached kernel is compiled again where a helper or constant of another file has changed."""

import ast
import importlib
import inspect
import json
import os
import re
import shutil
import subprocess
import sys
from collections import namedtuple
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from threading import Barrier, BrokenBarrierError

import numpy as np
import pytest

from alphacut.base import kernels
from tests.environment.house import PACKAGES, files_in, tree

FILES = {
    "__init__.py": "",
    "fuzzy/units.py": "FACTOR = 2.0\n",
    "fuzzy/helper.py": """
from alphacut.base.kernels import compiled
from alphacut.fuzzy.units import FACTOR

@compiled
def scaled(x):
    return FACTOR * x
""",
    "fuzzy/caller.py": """
from alphacut.base.kernels import compiled
from alphacut.fuzzy.helper import scaled

@compiled
def shifted(x):
    return scaled(x) + 1.0
""",
}
CALLS = """
import json, os, sys
from pathlib import Path
for folder, files in json.load(sys.stdin):
    for name, text in files.items():
        file = Path(folder, "alphacut", name)
        file.write_text(text)
        os.utime(file, (1e9, 1e9))  # times and sizes of changed files are as before
    for name in [name for name in sys.modules if name.startswith("alphacut")]:
        del sys.modules[name]
    sys.path[0] = folder
    from alphacut.fuzzy.caller import shifted
    print(shifted(3.0), sum(shifted.stats.cache_hits.values()))
"""
NEW_HELPER = {"fuzzy/helper.py": FILES["fuzzy/helper.py"].replace("*", "-")}
NEW_CONSTANT = {"fuzzy/units.py": "FACTOR = 5.0\n"}


def results(cache: Path, *calls: tuple[Path, dict[str, str]]) -> list[tuple[float, float]]:
    """Results and cache hits of the caller in checkouts, some of whose files are changed before."""
    for folder, _ in calls:
        for package in ("base", "fuzzy"):
            (folder / "alphacut" / package).mkdir(parents=True, exist_ok=True)
        for file in Path(inspect.getfile(kernels)).parent.glob("*.py"):
            shutil.copy(file, folder / "alphacut/base")
    told = subprocess.run(
        [sys.executable, "-Bc", CALLS],
        env=os.environ | {"ALPHACUT_CACHE": str(cache)},
        input=json.dumps([(str(folder), FILES | changed) for folder, changed in calls]),
        capture_output=True,
        text=True,
        check=False,
    )
    assert not told.stderr
    rows = (line.split() for line in told.stdout.splitlines())
    return [(float(value), float(hits)) for value, hits in rows]


@pytest.mark.parametrize("is_shared", [True, False])
def test_a_changed_helper_or_constant_changes_the_result(tmp_path: Path, is_shared: bool) -> None:
    """In the folder that checkouts share, and in a checkout's own."""
    cache = tmp_path / "cache"
    if not is_shared:
        cache.touch()  # a file, where no folder can be made
    one, two = tmp_path / "checkout1", tmp_path / "checkout2"
    calls = (one, {}), (one, {}), (one, NEW_HELPER), (one, NEW_CONSTANT), (one, {}), (two, {})
    expected = [(7, 0), (7, 1), (0, 0), (16, 0), (7, is_shared), (7, is_shared)]
    assert results(cache, *calls) == expected


def damages(content: bytes) -> list[bytes]:
    """What may be left of a file: nothing, its first half, all but its end, one byte changed."""
    middle = len(content) // 2
    flipped = bytes([content[middle] ^ 0xFF])
    return [b"", content[:middle], content[:-1], content[:middle] + flipped + content[middle + 1 :]]


def test_damaged_files_of_the_cache_are_removed_and_made_anew(tmp_path: Path) -> None:
    """Neither this run nor the next one ends with an error; the next finds the code again.

    Kernels with several constants have files of their own, of which each is damaged in one way.
    """
    checkout, endings = tmp_path / "checkout", (".nbi", ".nbc")
    factors = range(len(endings) * len(damages(b"content")))
    kernels_of = [(checkout, {"fuzzy/units.py": f"FACTOR = {k}.0\n"}) for k in factors]
    calls = [call for call in kernels_of for _ in ("first", "again")]
    expected = [(3 * k + 1, is_found) for k in factors for is_found in (False, True)]
    assert results(tmp_path / "cache", *calls) == expected
    folders = sorted(tmp_path.glob("cache/kernels/alphacut.fuzzy.caller-*"))
    damaged = {}
    for k, folder in zip(factors, folders, strict=True):
        (file,) = folder.glob(f"*{endings[k % 2]}")
        damaged[file] = damages(file.read_bytes())[k // 2]
        file.write_bytes(damaged[file])
    assert results(tmp_path / "cache", *calls) == expected
    for file, content in damaged.items():
        assert content not in [x.read_bytes() for x in file.parent.iterdir()]


def test_code_is_neither_taken_from_other_users_nor_kept_for_ever(tmp_path: Path) -> None:
    cache = tmp_path / "kernels"
    old = cache / "old"
    old.mkdir(parents=True)
    os.utime(old, (1e9, 1e9))
    cache.chmod(0o777)
    assert results(tmp_path, (tmp_path / "checkout1", {})) == [(7, 0)]
    assert [*cache.iterdir()] == [old]
    cache.chmod(0o700)
    assert results(tmp_path, (tmp_path / "checkout2", {})) == [(7, 0)]
    names = {folder.name.partition("-")[0] for folder in cache.iterdir()}
    assert names == {"alphacut.fuzzy.helper", "alphacut.fuzzy.caller"}


def test_what_kernels_read_from_other_files_is_in_their_digests() -> None:
    """A constant that a kernel imports stands in the file that it is imported from."""
    importlib.import_module("alphacut.frame.methods.yielding_proof")
    found = 0
    for module in map(sys.modules.get, kernels.with_kernels):
        assert module is not None
        read = {
            name
            for x in vars(module).values()
            if hasattr(x, "py_func") and x.__module__ == module.__name__
            for name in x.py_func.__code__.co_names
        }
        tree = ast.parse(inspect.getsource(module))
        for line in (x for x in ast.walk(tree) if isinstance(x, ast.ImportFrom)):
            for name in read & {x.name for x in line.names}:
                if line.module.startswith("alphacut"):
                    source = inspect.getsource(importlib.import_module(line.module))
                    assert re.search(
                        rf"^((def|class) {name}\(|(\w+, )*{name}(, \w+)* = )", source, re.M
                    ), name
                    found += 1
    assert found


def named_in(node: ast.AST | None) -> set[str]:
    """Names that a part of a syntax tree reads."""
    return {x.id for x in ast.walk(node or ast.Pass()) if isinstance(x, ast.Name)}


def test_kernels_that_python_calls_return_numbers_or_tuples_of_numbers() -> None:
    """Numba runs Python code to make a named tuple or an array.

    There the handler of a signal may raise an exception. Numba returns it if the result is an
    array, but not out of a tuple: then the process ends by SIGSEGV, or with a SystemError.
    """
    named_tuples = set()
    returned: dict[str, set[str]] = {}
    called = set()
    for module in map(tree, files_in(*PACKAGES)):
        decorators = {"compiled"}
        of_kernels = []
        for node in module.body:
            if isinstance(node, ast.ClassDef) and "NamedTuple" in set().union(
                *map(named_in, node.bases)
            ):
                named_tuples.add(node.name)
            if isinstance(node, ast.Assign) and "kernel" in named_in(node.value):
                decorators |= {x.id for x in node.targets if isinstance(x, ast.Name)}
            if isinstance(node, ast.FunctionDef) and decorators & set().union(
                *map(named_in, node.decorator_list)
            ):
                of_kernels.append(node)
                # Kernels of several files may have one name.
                returned.setdefault(node.name, set()).update(named_in(node.returns))
                for line in ast.walk(node):
                    if isinstance(line, ast.Return) and isinstance(line.value, ast.Call):
                        returned[node.name] |= named_in(line.value.func)
        for node in module.body:
            if node not in of_kernels:
                called |= named_in(node)
    of_python = called & set(returned)
    assert {"examine", "_march"} <= of_python
    not_allowed = named_tuples | {"Array", "Ints", "Mask"}
    wrong = {name: returned[name] & not_allowed for name in of_python}
    assert {name: kinds for name, kinds in wrong.items() if kinds} == {}


def test_threads_bring_a_new_type_of_argument_one_after_the_other(monkeypatch) -> None:
    """Debian's Numba ends the process where two threads bring the same new type at once."""
    met = Barrier(2)

    def call(*arguments: object) -> bool:
        """Return whether another thread is within this call, too."""
        try:
            met.wait(0.3)
        except BrokenBarrierError:
            met.reset()
            return False
        return True

    kernel = kernels.compiled(lambda: None)
    monkeypatch.setattr(kernel, "_created", call)
    pair = namedtuple("pair", "x y")(np.zeros(2), 1)
    with ThreadPoolExecutor(2) as pool:
        assert list(pool.map(kernel, [pair] * 2)) == [False, False]
        assert list(pool.map(kernel, [pair] * 2)) == [True, True]
        assert list(pool.map(kernel, [True, np.zeros(1)])) == [True, True]
