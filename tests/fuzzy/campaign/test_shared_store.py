"""A store on a file system of several machines, and stores put together."""

import subprocess
import sys
from pathlib import Path

import pytest

from alphacut.fuzzy import General, Reduced, Triangular
from alphacut.fuzzy.campaign import sample_locks, sample_store
from alphacut.fuzzy.campaign.store import StoreError
from tests.fuzzy.general import propagate

INPUTS = {"a": Triangular(0.0, 0.3, 1.0), "b": Triangular(-1.0, 0.0, 2.0)}
IDENTITY = {"model": "sum", "mesh": 0.15}


def model(a, b):
    return {"sum": a + b, "pair": [a, b]}


MOUNTS = """\
22 1 0:1 / / rw shared:1 - ext4 /dev/sda rw
23 22 0:2 / /home rw shared:2 master:1 - nfs4 server:/home rw
24 23 0:3 / /home/scratch rw - ext4 /dev/sdb rw
25 22 0:4 / /data rw - fuse.glusterfs server:/data rw
"""


@pytest.mark.parametrize(
    ("path", "kind"),
    [
        ("/home/a/s.db", "nfs4"),
        ("/home/scratch/s.db", ""),
        ("/data/s.db", "fuse.glusterfs"),
        ("/homes/s.db", ""),
    ],
)
def test_network_file_systems_are_seen(tmp_path, monkeypatch, path, kind):
    (tmp_path / "mounts").write_text(MOUNTS)
    monkeypatch.setattr(sample_locks, "_MOUNTS", tmp_path / "mounts")
    assert sample_locks.network_kind(Path(path)) == kind


def test_one_campaign_at_a_time_on_a_network_file_system(tmp_path, monkeypatch):
    monkeypatch.setattr(sample_store, "network_kind", lambda path: "nfs4")
    reference = propagate(model, INPUTS, store=tmp_path / "s.db", identity=IDENTITY)
    holder = (
        "import fcntl, sys; file = open(sys.argv[1], 'r+b'); fcntl.lockf(file, fcntl.LOCK_EX, 1,"
        f" {sample_locks._ALONE}); print(flush=True); sys.stdin.read()"
    )
    command = [sys.executable, "-c", holder, str(tmp_path / "s.db.claims")]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as other:
        other.stdout.readline()
        with pytest.raises(StoreError, match=r"on a network file system \(nfs4\) and in use"):
            propagate(model, INPUTS, store=tmp_path / "s.db", identity={"another": 1})
        other.communicate()
    again = propagate(model, INPUTS, store=tmp_path / "s.db", identity=IDENTITY)
    assert again.reused == reference.runs


def test_stores_put_end_to_end_are_one_store(tmp_path):
    for name, half in (("one", General()), ("two", Reduced())):
        propagate(model, INPUTS, half, store=tmp_path / name, identity=IDENTITY)
    (tmp_path / "all").write_bytes(
        (tmp_path / "one").read_bytes() + (tmp_path / "two").read_bytes()
    )
    for plan in (General(), Reduced()):
        found = propagate(
            model, INPUTS, plan, store=tmp_path / "all", identity=IDENTITY, spot_check=0
        )
        assert found.reused == found.runs
