"""A damaged store: nothing silently wrong, no traceback, and a repair loses what was lost."""

import os
import random
from contextlib import closing

import numpy as np
import pytest

from alphacut.entry import main
from alphacut.fuzzy import Store, Triangular
from alphacut.fuzzy.campaign.records import HEAD, MARK
from alphacut.fuzzy.campaign.sample_store import Shelf
from alphacut.fuzzy.campaign.store import StoreError
from tests.fuzzy.general import propagate

INPUTS = {"a": Triangular(0.0, 0.3, 1.0), "b": Triangular(-1.0, 0.0, 2.0)}
IDENTITY = {"model": "product", "mesh": 0.15}
calls = []


def model(a, b):
    calls.append((a, b))
    return {"y": a * b + a / 3, "z": [a, np.exp(b)]}


def run(store):
    calls.clear()
    return propagate(model, INPUTS, store=store, identity=IDENTITY, spot_check=0)


def flip(data, chance):
    data[chance.randrange(len(data))] ^= 1 << chance.randrange(8)


def flips(data, chance):
    for _ in range(chance.randint(2, 20)):
        flip(data, chance)


def truncate(data, chance):
    del data[chance.randrange(len(data)) :]


def zero(data, chance):
    start, size = chance.randrange(len(data)), chance.choice([16, 512, 4096])
    data[start : start + size] = bytes(len(data[start : start + size]))


def overwrite(data, chance):
    start, size = chance.randrange(len(data)), chance.choice([16, 512, 4096])
    data[start : start + size] = chance.randbytes(len(data[start : start + size]))


def repeat(data, chance):
    """A block of the file where another one was."""
    start, size = chance.randrange(len(data)), chance.choice([64, 512, 4096])
    source = chance.randrange(len(data))
    part = data[source : source + len(data[start : start + size])]
    data[start : start + len(part)] = part


def lose(data, chance):
    start = chance.randrange(len(data))
    del data[start : start + chance.randint(1, 900)]


def insert(data, chance):
    start = chance.randrange(len(data))
    data[start:start] = chance.randbytes(chance.randint(1, 300))


DAMAGES = [flip, flip, flips, truncate, zero, overwrite, repeat, lose, insert]


def readable(content):
    """Samples whose records are untouched: those of the whole file that are still in it."""
    return sum(record in content for record in RECORDS)


RECORDS = []


def refusal(path):
    """What a campaign says that does not start; empty if it could."""
    try:
        with Store(path) as store, closing(Shelf(store, IDENTITY, ["a", "b"])):
            return ""
    except (StoreError, ValueError) as error:
        return str(error)


def check_damages(folder, seeds):
    path = folder / "s.db"
    reference = run(path)
    content = path.read_bytes()
    RECORDS[:] = [MARK + part for part in content.split(MARK)[1:] if b'"layout"' in part]
    assert len(RECORDS) == 55
    for seed in seeds:
        chance = random.Random(seed)
        data = bytearray(content)
        kind = chance.choice(DAMAGES)
        kind(data, chance)
        path.write_bytes(data)
        survived = readable(bytes(data))
        message = refusal(path)
        if "no store of samples" in message:  # nothing in the file is a record
            assert not survived
            continue
        if message:
            assert "damaged at" in message, (seed, kind)
            assert "repair" in message
            with Store(path) as store:
                store.repair()
        found = run(path)
        assert found.values.array.tobytes() == reference.values.array.tobytes(), (seed, kind)
        assert found.reused == survived, (seed, kind)
        assert len(calls) == 55 - survived, (seed, kind)
        assert run(path).reused == 55


def test_sixty_random_damages(tmp_path):
    check_damages(tmp_path, range(60))


@pytest.mark.slow
def test_a_thousand_random_damages(tmp_path):
    start = int(os.environ.get("SEED", "1000"))
    check_damages(tmp_path, range(start, start + 1000))


def test_a_damaged_sample_is_named_with_what_to_do(tmp_path, capfd):
    path = tmp_path / "my s.db"
    run(path)
    data = bytearray(path.read_bytes())
    place = data.find(b'{"a":0.3,"b":0.0}')
    data[place + 60] ^= 4
    path.write_bytes(data)
    message = (
        r"s.db is damaged at 1 places, the first at byte \d+; among what is lost: the sample"
        r" a = 0.3, b = 0.0: run `python -m alphacut repair '.*my s.db'`"
    )
    with pytest.raises(StoreError, match=message):
        run(path)
    with pytest.raises(StoreError, match=message), Store(path) as store:
        store.models()
    assert main(["repair", str(path)]) == 0
    assert "55 records are whole" in capfd.readouterr().out  # 54 samples and the model's identity
    assert (run(path).reused, calls) == (54, [(0.3, 0.0)])


def test_what_is_damaged_while_a_campaign_runs_is_seen(tmp_path):
    run(tmp_path / "s.db")
    with Store(tmp_path / "s.db") as store, closing(Shelf(store, IDENTITY, ["a", "b"])) as shelf:
        data = bytearray((tmp_path / "s.db").read_bytes())
        data[data.rfind(MARK) + HEAD + 30] ^= 1
        (tmp_path / "s.db").write_bytes(data)
        keys = [f'{{"a":{point["a"]!r},"b":{point["b"]!r}}}' for point in shelf.points()]
        with pytest.raises(StoreError, match="damaged at 1 places"):
            shelf.stored(keys)


def test_the_torn_end_of_a_killed_write_is_dropped_in_silence(tmp_path):
    path = tmp_path / "s.db"
    run(path)
    data = path.read_bytes()
    for cut in (1, 7, 20, 40, 100):
        path.write_bytes(data[:-cut])
        assert run(path).reused == 54
        assert path.read_bytes().count(MARK) == 56
        assert run(path).reused == 55
    for left in (0, 1, 4, 5, 7, 8, 9, 40):
        path.write_bytes(data[:left])
        assert run(path).reused == 0
        assert run(path).reused == 55


def test_only_a_store_is_repaired(tmp_path, capfd):
    (tmp_path / "text").write_text("something else" * 99)
    for name, message in (("text", "is no store of samples"), ("none", "there is no such file")):
        assert main(["repair", str(tmp_path / name)]) == 2
        assert message in capfd.readouterr().err
    assert (tmp_path / "text").read_text() == "something else" * 99
