"""Cases changed at random: accepted, or refused in one line for each problem, nothing written."""

import shutil
from pathlib import Path

import numpy as np
import pytest

from alphacut.entry import main
from tests.alphacut.case.mutated import CASES, Mutation, mutation, torn_table

TABLES = {"building": "building.record.csv", "laboratory-frame": "laboratory-frame.modes.csv"}


@pytest.fixture(scope="module")
def data(tmp_path_factory):
    """A folder with what the shipped cases read."""
    folder = tmp_path_factory.mktemp("cases") / "cases"
    shutil.copytree(CASES, folder, ignore=shutil.ignore_patterns("*.toml"))
    return folder


def judged(changed: Mutation, folder: Path, capfd) -> str:
    """What is wrong with how the program took a case; empty when nothing is."""
    before = sorted(folder.iterdir())
    path = folder / "mutated.toml"
    path.write_text(changed.text, encoding="utf-8")
    try:
        status = main(["check", str(path)])
    except BaseException as error:
        return f"{type(error).__name__}: {error}"
    finally:
        path.unlink()
    said = capfd.readouterr().err
    if sorted(folder.iterdir()) != before:
        return "left a file"
    if status == 0:
        return "accepted" if changed.wrong else ""
    lines = [line for line in said.splitlines() if line]
    if status != 2 or not lines or "Traceback" in said:
        return f"status {status}, {said!r}"
    long = [line for line in lines if len(line) > 600]
    return f"a line of {len(long[0])} characters" if long else ""


def complaints(seed: int, count: int, folder: Path, capfd) -> list[str]:
    rng = np.random.default_rng(seed)
    found = []
    for _ in range(count):
        changed = mutation(rng)
        if wrong := judged(changed, folder, capfd):
            found.append(f"seed {seed}: {changed.words}: {wrong}")
    return found


def table_complaints(seed: int, count: int, folder: Path, capfd) -> list[str]:
    rng = np.random.default_rng(seed)
    found = []
    for _ in range(count):
        name = str(rng.choice(list(TABLES)))
        table = folder / TABLES[name]
        whole = table.read_text(encoding="utf-8")
        text = (CASES / f"{name}.toml").read_text(encoding="utf-8")
        table.write_text(torn_table(whole, rng), encoding="utf-8")
        try:
            wrong = judged(Mutation(name, text, False), folder, capfd)
        finally:
            changed = table.read_text(encoding="utf-8")
            table.write_text(whole, encoding="utf-8")
        if wrong:
            line = next(
                (
                    a
                    for a, b in zip(changed.splitlines(), whole.splitlines(), strict=False)
                    if a != b
                ),
                "",
            )
            found.append(f"seed {seed}: {name}, {line!r}: {wrong}")
    return found


def test_mutated_tables_are_taken_or_refused_in_clear_lines(data, capfd):
    seed = int(np.random.SeedSequence().entropy % 2**32)
    assert not table_complaints(seed, 8, data, capfd)


def test_mutated_cases_are_taken_or_refused_in_clear_lines(data, capfd):
    seed = int(np.random.SeedSequence().entropy % 2**32)
    assert not complaints(seed, 12, data, capfd)


@pytest.mark.slow
def test_three_hundred_mutated_cases(data, capfd):
    seed = int(np.random.SeedSequence().entropy % 2**32)
    assert not complaints(seed, 300, data, capfd)
    assert not table_complaints(seed, 100, data, capfd)
