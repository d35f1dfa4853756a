"""What all tests share: random numbers whose seed a failure tells, and shipped cases run once."""

import fcntl
import gc
import hashlib
import io
import json
import os
import secrets
from contextlib import redirect_stderr, redirect_stdout
from fnmatch import fnmatchcase
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).parents[1]


def pytest_addoption(parser):
    """Adds --quick, for `make quick`."""
    parser.addoption("--quick", action="store_true", help="no slow test, no other process, no run")


def pytest_collection_modifyitems(config, items):
    """Leaves out, with --quick, slow tests and those of modules that start processes."""
    if config.getoption("--quick"):
        runs = {"shipped_run", "two_floors"}
        items[:] = [
            item
            for item in items
            if not item.get_closest_marker("slow")
            and not runs & set(item.fixturenames)
            and not hasattr(item.module, "subprocess")
        ]


def pytest_collection():
    """Collects no garbage while tests are collected, who all stay."""
    gc.disable()


def pytest_collection_finish():
    """Spares the garbage collector the objects that stay."""
    gc.freeze()
    gc.enable()


@pytest.fixture(scope="session", autouse=True)
def columns():
    """Lets each row of an answer fail that has other columns than tests/columns.json lists."""
    from alphacut.frame.analyses.answer import Answer

    known = json.loads((ROOT / "tests/columns.json").read_text(encoding="utf-8"))
    stated = Answer._stated

    def of_known_columns(self, row):
        heads = known.get(type(self).__name__, ["*"])
        found = "|".join(row)
        assert any(fnmatchcase(found, head) for head in heads), found
        return stated(self, row)

    Answer._stated = of_known_columns


@pytest.fixture
def rng(request):
    """Random numbers; the seed is printed, and given by SEED, or by `tests.seeds`."""
    seed = getattr(request, "param", None)
    if seed is None:
        seed = int(os.environ.get("SEED", secrets.randbelow(10**9)))
    print(f"SEED={seed}")
    return np.random.default_rng(seed)


@pytest.fixture(scope="session")
def shipped_run(tmp_path_factory, worker_id):
    """A function (case, changes) to the folder of a shipped case's results, run once a session.

    Processes of one session share the folders, which tests only read.
    """
    base = tmp_path_factory.getbasetemp()
    place = (base if worker_id == "master" else base.parent) / "shipped"
    place.mkdir(exist_ok=True)

    def run(case, changes=()):
        name = f"{case}-{digest(tuple(changes))}"
        folder, lock = place / name, place / f"{name}.lock"
        with lock.open("w") as handle:
            fcntl.flock(handle, fcntl.LOCK_EX)
            if not (folder / "summary.json").is_file():
                words = ["run", f"{ROOT}/cases/{case}.toml", f"--out={folder}", "--no-figures"]
                told = io.StringIO()
                from alphacut import main

                with redirect_stdout(told), redirect_stderr(told):
                    status = main([*words, *(f"--set={change}" for change in changes)])
                assert status == 0, told.getvalue()
                lines = told.getvalue().splitlines()
                (folder / "told.json").write_text(json.dumps(lines), encoding="utf-8")
        return folder

    return run


@pytest.fixture(scope="session")
def two_floors(tmp_path_factory):
    """Folder of the results, with figures, of a frame of two floors that asks every question."""
    from tests.alphacut.small import two_floors_run

    return two_floors_run(tmp_path_factory.mktemp("two-floors"))


def digest(key):
    """A name that is the same in every process."""
    return hashlib.sha256(repr(key).encode()).hexdigest()[:12]
