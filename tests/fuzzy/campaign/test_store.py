"""A store survives kills and damage: resumed to the bit, or one line and what is lost anew."""

import os
import random
import signal
import sqlite3
import subprocess
import sys
import time
import warnings
from contextlib import closing

import numpy as np
import pytest

from alphacut.fuzzy import FailedError, General, RefusedError, Store, Triangular, propagate
from tests.refused import refuses

INPUTS = {"a": Triangular(0.0, 0.3, 1.0), "b": Triangular(-1.0, 0.0, 2.0)}
IDENTITY = {"model": "product", "mesh": 0.15}
calls = []


def model(a, b):
    calls.append((a, b))
    return {"y": a * b + a / 3, "z": [a, np.exp(b)]}


def run(store, function=model, **options):
    calls.clear()
    options = {"identity": IDENTITY, "progress": False} | options
    return propagate(function, INPUTS, General(), store=store, **options)


def bits(result):
    return b"".join(x.tobytes() for x in (result.lower, result.upper, result.samples.values.array))


def test_a_second_run_takes_every_sample_from_the_store(tmp_path):
    path = tmp_path / "deep" / "s.db"
    first = run(path)
    assert (first.evaluations, len(calls)) == (55, 55)
    second = run(path)
    assert (second.evaluations, len(calls)) == (55, 0)
    assert bits(second) == bits(first)
    run(path, identity={"model": "product", "mesh": 0.1})
    assert len(calls) == 55
    with Store(path) as store:
        run(store, identity=IDENTITY)
    assert not calls


def test_failed_samples_are_run_again(tmp_path):
    def broken(a, b):
        if a == 1.0:
            raise ArithmeticError
        return model(a, b)

    with pytest.raises(FailedError):
        run(tmp_path / "s.db", broken)
    run(tmp_path / "s.db")
    assert {a for a, _ in calls} == {1.0}


def test_a_full_disk_is_told_in_one_line_and_what_is_stored_stays(tmp_path):
    path = tmp_path / "s.db"
    run(path)
    with Store(path) as store:
        pages = store._connection.execute("pragma page_count").fetchone()[0]
        store._connection.execute(f"pragma max_page_count = {pages}")
        with pytest.raises(FailedError, match="is full") as failed:
            run(store, identity={"model": "another"})
    assert "what is stored stays" in failed.value.cure
    run(path)
    assert not calls


def flip(data, chance):
    for _ in range(chance.choice([1, 1, 1, 20])):
        data[chance.randrange(len(data))] ^= 1 << chance.randrange(8)


def truncate(data, chance):
    del data[chance.randrange(len(data)) :]


def overwrite(data, chance):
    start = chance.randrange(len(data))
    size = len(data[start : start + chance.choice([16, 512, 4096])])
    data[start : start + size] = chance.choice([bytes(size), chance.randbytes(size)])


def lose_or_insert(data, chance):
    start = chance.randrange(len(data))
    data[start : start + chance.randint(0, 900)] = chance.randbytes(chance.randint(0, 300))


DAMAGES = [flip, flip, truncate, overwrite, lose_or_insert]


@pytest.mark.parametrize("first", [0, pytest.param(None, marks=pytest.mark.slow)])
def test_no_damage_is_silently_wrong(tmp_path, rng, first):
    """The same bits, or one line, and lost samples run anew; a free seed in the slow test."""
    first = int(rng.integers(1, 10**9)) if first is None else first
    path, seeds = tmp_path / "s.db", range(first, first + (200 if first else 30))
    reference = bits(run(path))
    content, outcomes = path.read_bytes(), dict.fromkeys(("untouched", "mended", "refused"), 0)
    for seed in seeds:
        chance, data = random.Random(seed), bytearray(content)
        kind = chance.choice(DAMAGES)
        kind(data, chance)
        path.write_bytes(data)
        with warnings.catch_warnings(record=True) as lines:
            warnings.simplefilter("always")
            try:
                result = run(path)
            except RefusedError:  # its first bytes are another file's
                path.unlink()
                result, kind = run(path), None
        assert bits(result) == reference, (seed, kind)
        told = [str(line.message) for line in lines if "was damaged" in str(line.message)]
        assert all("\n" not in line for line in told)
        assert told or not calls or kind is None or not data, (seed, kind, len(calls))
        run(path)
        assert not calls, (seed, kind)
        outcomes["refused" if kind is None else "mended" if told else "untouched"] += 1
    assert outcomes["mended"] > len(seeds) / 6
    assert outcomes["refused"] < len(seeds) / 3


def test_a_row_that_was_changed_is_not_believed(tmp_path):
    path = tmp_path / "s.db"
    run(path)
    with Store(path) as store, store._connection as connection:
        row = connection.execute("select rowid, outputs from sample limit 1").fetchone()
        changed = np.frombuffer(row[1], "<f8") * (1 + 1e-15)
        update = "update sample set outputs = ? where rowid = ?"
        connection.execute(update, (changed.tobytes(), row[0]))
    with pytest.warns(UserWarning, match="54 samples are intact, the others are evaluated anew"):
        run(path)
    assert len(calls) == 1
    assert (tmp_path / "s.db.damaged").exists()
    run(path)
    assert not calls


SCRIPT = """
import sys, time
from alphacut.fuzzy import General, Triangular, propagate

def model(a, b):
    time.sleep(0.01)
    return {"y": a * b + a / 3, "z": [a, b * b]}

if __name__ == "__main__":
    inputs = {"a": Triangular(0.0, 0.3, 1.0), "b": Triangular(-1.0, 0.0, 2.0)}
    store = sys.argv[1] if len(sys.argv) > 2 else None
    found = propagate(model, inputs, General(), store=store, identity={"v": 1}, workers=int(sys.argv[-1]))
    print(found.samples.values.array.tobytes().hex())
"""


@pytest.mark.parametrize(
    ("kills", "workers"),
    [(1, 1), *(pytest.param(20, workers, marks=pytest.mark.slow) for workers in (1, 2))],
)
def test_kills_leave_a_store_that_resumes(tmp_path, rng, kills, workers):
    """A campaign that is killed at random times goes on to the same bits."""
    script, path = tmp_path / "script.py", tmp_path / "s.db"
    script.write_text(SCRIPT)
    options = {"capture_output": True, "text": True, "check": True}
    command = [sys.executable, "-W", "error", script, path, str(workers)]
    for _ in range(kills):
        campaign = subprocess.Popen(command, stdout=subprocess.DEVNULL, start_new_session=True)
        time.sleep(rng.uniform(0.3, 0.9))
        os.killpg(campaign.pid, signal.SIGKILL)
        campaign.wait()
    whole = subprocess.run([sys.executable, script, "1"], **options)
    assert subprocess.run(command, **options).stdout == whole.stdout


def database_of_another_program(path):
    with closing(sqlite3.connect(path)) as base:
        base.execute("create table book (title text)")
        base.commit()


def link(path):
    run(path.with_name("real.db"))
    path.symlink_to(path.with_name("real.db"))


def journal_that_is_a_link(path):
    run(path)
    path.with_name(f"{path.name}-journal").symlink_to("/dev/null")


def text(path):
    path.write_text("something else" * 99)


FOREIGN = (text, os.mkfifo, os.mkdir, link, database_of_another_program, journal_that_is_a_link)


@pytest.mark.parametrize("made", FOREIGN, ids=lambda made: made.__name__)
def test_what_is_nobodys_store_is_refused_and_not_touched(tmp_path, made):
    path = tmp_path / "s.db"
    made(path)

    def state():
        files = sorted(tmp_path.iterdir())
        facts = ((x, x.lstat()) for x in files)
        attributes = [(x.name, y.st_mode, y.st_ino, y.st_mtime_ns) for x, y in facts]
        return attributes, [x.read_bytes() for x in files if x.is_file()]

    before = state()
    with refuses("store"):
        run(path)
    assert state() == before
