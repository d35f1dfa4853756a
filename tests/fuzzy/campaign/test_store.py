"""The store: killed, shared, full or foreign, it loses nothing that was stored and repeats nothing."""

import os
import random
import resource
import signal
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

from alphacut.fuzzy import CampaignError, Interval, MonteCarlo, Store, Triangular, levels
from alphacut.fuzzy.campaign import call, spot_check
from alphacut.fuzzy.campaign.call import Sample
from alphacut.fuzzy.campaign.sample_store import Shelf
from alphacut.fuzzy.campaign.store import StoreError, canonical
from tests.fuzzy.general import propagate

INPUTS = {"a": Triangular(0.0, 0.3, 1.0), "b": Triangular(-1.0, 0.0, 2.0)}
IDENTITY = {"model": "sum", "mesh": 0.15}

SCRIPT = """
import os, sys, time
from alphacut.fuzzy import General, Triangular, propagate

store, log, workers, pause, result = sys.argv[1:]

def model(points):
    for point in points:  # every evaluation leaves a line, whatever happens afterwards
        os.write(handle(), f"{point['a']!r} {point['b']!r}\\n".encode())
        time.sleep(float(pause))
    return [{"y": point["a"] * point["b"] / 3, "z": [point["a"], point["b"]]} for point in points]

def handle():
    return os.open(log, os.O_WRONLY | os.O_APPEND | os.O_CREAT)

if __name__ == "__main__":
    inputs = {"a": Triangular(0.0, 0.3, 1.0), "b": Triangular(-1.0, 0.0, 2.0)}
    print("started", flush=True)
    found = propagate(model, inputs, General(), alpha=[k / 7 for k in range(8)], shared=("a",), workers=int(workers),
                      store=store, identity={"model": "script"}, spot_check=0)
    with open(result, "w") as file:
        file.write(found.values.array.tobytes().hex() + found.lower.tobytes().hex() + found.upper_at.tobytes().hex())
"""


def model(a, b):
    return {"sum": a + b, "pair": [a, b]}


def start(folder, *, workers=1, pause=0.001, result="result"):
    script = folder / "script.py"
    script.write_text(SCRIPT)
    arguments = [
        str(folder / "store.db"),
        str(folder / "log"),
        str(workers),
        str(pause),
        str(folder / result),
    ]
    return subprocess.Popen(
        [sys.executable, str(script), *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def evaluated(folder):
    log = folder / "log"
    return log.read_text().split("\n")[:-1] if log.exists() else []


def stored(folder):
    """Points that another process finds in the store, as the log spells them."""
    if not (folder / "store.db").exists():
        return set()
    with (
        Store(folder / "store.db") as store,
        closing(Shelf(store, {"model": "script"}, ["a", "b"])) as shelf,
    ):
        return {f"{point['a']!r} {point['b']!r}" for point in shelf.points()}


def undisturbed(folder):
    folder.mkdir()
    process = start(folder, pause=0)
    assert process.wait() == 0, process.stderr.read()
    return (folder / "result").read_text()


def kill_and_resume(folder, *, kills, workers, seed):
    """Kill the campaign at random moments; each time, see that the store reads and that nothing
    stored is run again.
    """
    chance = random.Random(seed)
    folder.mkdir()
    cut_short = 0
    while cut_short < kills:
        before, done = len(evaluated(folder)), stored(folder)
        process = start(folder, workers=workers, pause=0.004)
        process.stdout.readline()
        time.sleep(chance.uniform(0, 0.35 if workers == 1 else 0.8))
        process.send_signal(signal.SIGKILL)
        process.wait()
        time.sleep(0.05)  # for workers to see that they are alone
        assert not done & set(evaluated(folder)[before:])
        assert stored(folder) >= done
        cut_short += 1
        if (folder / "result").exists():  # it was faster than the kill: begin anew
            for name in ("store.db", "log", "result"):
                (folder / name).unlink(missing_ok=True)
    before, done = len(evaluated(folder)), stored(folder)
    process = start(folder, workers=workers, pause=0)
    assert process.wait() == 0, process.stderr.read()
    assert not done & set(evaluated(folder)[before:])
    return (folder / "result").read_text()


@pytest.mark.parametrize("workers", [1, 2])
def test_a_killed_campaign_resumes_bit_for_bit(tmp_path, workers):
    reference = undisturbed(tmp_path / "whole")
    assert kill_and_resume(tmp_path / "cut", kills=4, workers=workers, seed=workers) == reference


@pytest.mark.slow
@pytest.mark.parametrize("workers", [1, 2])
def test_fifty_kills(tmp_path, workers):
    reference = undisturbed(tmp_path / "whole")
    seed = int(os.environ.get("SEED", "50")) + workers
    assert kill_and_resume(tmp_path / "cut", kills=50, workers=workers, seed=seed) == reference


def test_a_killed_campaign_leaves_no_orphans(tmp_path):
    process = start(tmp_path, workers=2, pause=0.05)
    process.stdout.readline()
    deadline = time.monotonic() + 20
    while len(evaluated(tmp_path)) < 4 and time.monotonic() < deadline:
        time.sleep(0.02)
    process.kill()
    process.wait()
    while len(relatives(tmp_path)) > 0 and time.monotonic() < deadline:
        time.sleep(0.05)
    assert relatives(tmp_path) == []


def relatives(folder):
    """Processes whose command line or open files name the folder."""
    found = []
    for path in Path("/proc").glob("[0-9]*/fd/*"):
        try:
            if str(folder) in os.readlink(path):
                found.append(path.parts[2])
        except OSError:
            pass
    return found


def test_two_campaigns_at_once_share_the_work(tmp_path):
    reference = undisturbed(tmp_path / "whole")
    (tmp_path / "both").mkdir()
    processes = [start(tmp_path / "both", pause=0.003, result=f"result{i}") for i in range(2)]
    assert [process.wait() for process in processes] == [0, 0]
    assert [(tmp_path / "both" / f"result{i}").read_text() for i in range(2)] == [
        reference,
        reference,
    ]
    lines = evaluated(tmp_path / "both")
    assert len(lines) == len(set(lines)) == 204


def test_two_campaigns_in_threads_share_the_work(tmp_path):
    calls = []

    def slow(a, b):
        calls.append((a, b))
        time.sleep(0.002)
        return model(a, b)

    def run(_):
        return propagate(slow, INPUTS, store=tmp_path / "s.db", identity=IDENTITY).values.array

    with ThreadPoolExecutor(2) as executor:
        one, other = executor.map(run, range(2))
    assert (one == other).all()
    assert len(calls) == len(set(calls)) == 55


def test_more_levels_and_a_wider_support_reuse_what_is_there(tmp_path):
    store = tmp_path / "s.db"
    first = propagate(model, INPUTS, store=store, identity=IDENTITY)
    assert (first.runs, first.reused, first.calls) == (55, 0, 55)
    again = propagate(model, INPUTS, store=store, identity=IDENTITY, spot_check=0)
    assert (again.reused, again.calls) == (55, 0)
    assert (again.values.array == first.values.array).all()
    finer = propagate(model, INPUTS, alpha=levels(8), store=store, identity=IDENTITY)
    assert finer.reused > 10
    wider = propagate(
        model, INPUTS | {"b": Triangular(-2.0, 0.0, 2.0)}, store=store, identity=IDENTITY
    )
    assert 0 < wider.reused < wider.runs
    other = propagate(model, INPUTS, store=store, identity=IDENTITY | {"mesh": 0.08})
    assert other.reused == 0
    turned = propagate(
        model,
        dict(reversed(INPUTS.items())),
        store=store,
        identity=dict(reversed(IDENTITY.items())),
    )
    assert turned.reused == 55


def test_failed_samples_are_recorded_and_tried_again(tmp_path):
    def fragile(a, b):
        if a > 0.9:
            raise RuntimeError("no convergence")
        return model(a, b)

    with pytest.raises(CampaignError, match="5 of 55 samples failed"):
        propagate(fragile, INPUTS, store=tmp_path / "s.db", identity=IDENTITY)
    with Store(tmp_path / "s.db") as store:
        assert store.models()[0][:3] == (IDENTITY, 50, 5)
    mended = propagate(model, INPUTS, store=tmp_path / "s.db", identity=IDENTITY, spot_check=0)
    assert (mended.reused, mended.calls) == (50, 5)
    assert propagate(model, INPUTS, store=tmp_path / "s.db", identity=IDENTITY).reused == 55


def test_store_gives_the_bits_back(tmp_path):
    values = np.random.default_rng(3).standard_normal(7) * 10.0 ** np.arange(-150, 200, 50)
    first = propagate(
        lambda a: {"v": values * (a + 0.1)},
        {"a": Interval(0, 1 / 3)},
        store=tmp_path / "s.db",
        identity={"v": 1},
    )
    second = propagate(
        lambda a: 1 / 0,
        {"a": Interval(0, 1 / 3)},
        store=tmp_path / "s.db",
        identity={"v": 1},
        spot_check=0,
    )
    assert (first.values.array == second.values.array).all()


def test_a_full_disk_stops_the_campaign_and_spoils_nothing(tmp_path):
    def wide(a):
        return np.full(2000, a)

    kept = {"alpha": levels(40), "store": tmp_path / "s.db", "identity": IDENTITY}
    room = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (300_000, room[1]))  # the same error as a full disk
    try:
        with pytest.raises(
            StoreError, match=r"s.db cannot be used \(.*\): free some space and run"
        ):
            propagate(wide, {"a": Interval(0, 1)}, **kept)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, room)
    with Store(tmp_path / "s.db") as store:
        there = store.models()[0].samples
    assert there == 18  # of 16 kB each
    resumed = propagate(wide, {"a": Interval(0, 1)}, **kept)
    assert resumed.reused == there
    assert resumed.values.array.shape == (resumed.runs, 2000)


def test_interrupting_keeps_what_is_done(tmp_path):
    done = []

    def interrupted(a, b):
        if len(done) == 20:
            raise KeyboardInterrupt
        done.append(a)
        return model(a, b)

    with pytest.raises(KeyboardInterrupt):
        propagate(interrupted, INPUTS, store=tmp_path / "s.db", identity=IDENTITY)
    assert propagate(model, INPUTS, store=tmp_path / "s.db", identity=IDENTITY).reused == 20


def test_a_folder_is_no_store(tmp_path):
    with pytest.raises(ValueError, match="is a folder; give the store a file in it"):
        Store(tmp_path)


def test_foreign_and_future_files_are_refused(tmp_path):
    (tmp_path / "text").write_text("no store at all, but long enough to be read as one" * 20)
    with pytest.raises(ValueError, match="text is no store of samples"):
        Store(tmp_path / "text")
    (tmp_path / "old").write_bytes(b"SQLite format 3\0" * 300)
    with pytest.raises(ValueError, match="old is no store of samples"):
        Store(tmp_path / "old")
    (tmp_path / "future").write_bytes(b"\xffcut\x63\0\r\n" + b"x" * 80)
    with pytest.raises(ValueError, match="has format 99, this program writes 2"):
        Store(tmp_path / "future")
    with pytest.raises(StoreError, match="cannot be used"):
        Store(tmp_path / "text" / "below")
    closed = Store(tmp_path / "s.db")
    closed.close()
    with pytest.raises(ValueError, match="is closed; open it anew"):
        closed.models()
    assert (tmp_path / "s.db").stat().st_size == 0


def test_identity_is_needed_and_must_be_plain(tmp_path):
    with pytest.raises(ValueError, match="store comes without an identity"):
        propagate(model, INPUTS, store=tmp_path / "s.db")
    with pytest.raises(
        ValueError, match=r"with an empty identity; say .*, as identity=\{'version'"
    ):
        propagate(model, INPUTS, store=tmp_path / "s.db", identity={})
    assert not (tmp_path / "s.db").exists()
    with pytest.raises(ValueError, match="holds what JSON does not"):
        propagate(model, INPUTS, store=tmp_path / "s.db", identity={"mesh": object()})
    assert canonical({"b": 1, "a": [1.5]}) == canonical({"a": [1.5], "b": 1})


def test_a_model_that_changed_its_outputs_needs_another_identity(tmp_path):
    propagate(model, INPUTS, alpha=[1.0], store=tmp_path / "s.db", identity=IDENTITY)
    with pytest.raises(ValueError, match="a model that changed needs another identity"):
        propagate(
            lambda a, b: {"other": a},
            INPUTS,
            alpha=[0.0],
            store=tmp_path / "s.db",
            identity=IDENTITY,
        )


def test_overhead_per_sample_is_under_two_milliseconds(tmp_path):
    result = propagate(
        lambda a, b: a, INPUTS, alpha=levels(17), store=tmp_path / "s.db", identity=IDENTITY
    )
    assert result.runs > 1500
    assert result.seconds / result.runs < 2e-3


def test_what_waits_to_be_written_does_not_grow_with_the_store(tmp_path, monkeypatch):
    waiting = []
    write = Shelf.write
    monkeypatch.setattr(
        Shelf,
        "write",
        lambda self, *, now=False: (waiting.append(len(self._gathered)), write(self, now=now)),
    )
    monkeypatch.setattr("alphacut.fuzzy.campaign.sample_store._PAUSE", 1e9)
    propagate(
        lambda a: a,
        {"a": Interval(0, 1)},
        MonteCarlo(3000),
        alpha=[0.0],
        store=tmp_path / "s.db",
        identity={"model": "a"},
    )
    assert 900 < max(waiting) <= 1000


def test_a_sample_that_took_long_is_written_at_once(tmp_path):
    with Store(tmp_path / "s.db") as store:
        shelf = Shelf(store, IDENTITY, ["a"])
        for count, seconds in ((1, 5.0), (2, 5.0), (2, 1e-6)):
            shelf.gather(f'{{"a":{count}{seconds}}}', Sample((("y", ()),), np.ones(1), seconds))
            shelf.write()
            assert store.models()[0].samples == count
        shelf.close()
        assert store.models()[0].samples == 3


def test_key_is_exact_and_free_of_order(tmp_path):
    with Store(tmp_path / "s.db") as store:
        one, other = Shelf(store, {}, ["b", "a"]), Shelf(store, {}, ["a", "b"])
        assert (
            one.key(np.array([0.1, -0.0])) == other.key(np.array([0.0, 0.1])) == '{"a":0.0,"b":0.1}'
        )
        assert one.key(np.array([0.1, 1.0])) != one.key(np.array([np.nextafter(0.1, 1), 1.0]))
        one.close()
        other.close()


def test_a_store_where_nothing_may_be_written_says_so(tmp_path):
    (tmp_path / "text").write_text("x")
    for place in (tmp_path / "text" / "below", "/proc/none/s.db"):
        with pytest.raises(
            StoreError,
            match=r"cannot be used \(.*\): it cannot be written there: give another path",
        ):
            Store(place)


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        (
            lambda a, b: {"sum": a + b + 1e-3, "pair": [a, b]},
            r"holds sum = 0.3 at a = 0.3, b = 0 where the function gives 0.301; a function",
        ),
        (
            lambda a, b: {"new": a + b, "pair": [a, b]},
            r"holds the outputs sum, pair\[0\], pair\[1\], the function gives new, pair\[0\]",
        ),
        (
            lambda a, b: 1 / 0,
            r"holds a sample at a = 0.3, b = 0 where the function now fails \(ZeroDivisionError",
        ),
    ],
)
def test_a_spot_check_of_the_modal_point_finds_a_function_that_changed(tmp_path, changed, message):
    run = {"inputs": INPUTS, "store": tmp_path / "s.db", "identity": IDENTITY}
    propagate(model, **run)
    same = propagate(lambda a, b: {"pair": [a, b], "sum": a + b}, **run, spot_check=1e-9)
    assert (same.calls, same.reused) == (1, 55)
    with pytest.raises(ValueError, match=message):
        propagate(changed, **run)
    assert propagate(changed, **run, spot_check=0).calls == 0
    with pytest.raises(ValueError, match="spot check has a share of 2"):
        propagate(model, **run, spot_check=2)


def test_random_spot_checks_keep_to_their_share_of_the_time(tmp_path, monkeypatch):
    now = [0.0]
    for timed in (call, spot_check):
        monkeypatch.setattr(timed, "perf_counter", lambda: now[0])

    def slow(a, b):
        now[0] += 0.004
        return a + b

    run = {"inputs": INPUTS, "store": tmp_path / "s.db", "identity": IDENTITY}
    propagate(slow, **run)
    again = propagate(slow, **run, spot_check=0.2)
    assert again.calls == 11  # a fifth of 55
    changed = propagate(lambda a, b: slow(a, b), **run)
    assert 1 <= changed.calls <= 4


def test_a_spot_check_sees_small_outputs_beside_large_ones(tmp_path):
    run = {"inputs": INPUTS, "store": tmp_path / "s.db", "identity": IDENTITY}
    propagate(lambda a, b: {"E": 24e9 + a, "nu": 0.2, "residual": 1e-13 * a}, **run)
    propagate(lambda a, b: {"E": 24e9 + a, "nu": 0.2, "residual": 2e-13 * a}, **run)
    with pytest.raises(ValueError, match=r"holds nu = 0.2 .* the function gives 0.21"):
        propagate(lambda a, b: {"E": 24e9 + a, "nu": 0.21, "residual": 0.0}, **run)
