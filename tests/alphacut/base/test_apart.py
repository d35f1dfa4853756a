"""Readers that run apart: their arrays come back, and what happens to them is one line."""

import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

from alphacut.base.apart import read_apart
from alphacut.fuzzy import RefusedError

READERS = """
import os, signal, time

def arrays(path, factor):
    import numpy as np
    assert not [name for name in os.environ if name.startswith("OMPI_")]
    return {"numbers": factor * np.arange(3.0), "texts": np.array([path.name])}

def whole_numbers(path):
    import sys
    from array import array
    assert "numpy" not in sys.modules
    return {"numbers": array("q", [1, -2]), "none": array("d")}

def refuses(path):
    from alphacut.base.errors import RefusedError
    raise RefusedError("count", "three", "two", "take one away")

def raises(path):
    raise ValueError("no such section\\nat all")

def crashes(path):
    os.kill(os.getpid(), signal.SIGSEGV)

def exhausts(path):
    import numpy as np
    return {"zeros": np.ones((1 << 33,), np.int8)}

def hangs(path):
    while True:
        pass

def waits(path):
    open(path, "w").write(str(os.getpid()))
    time.sleep(60)
"""


@pytest.fixture
def read(tmp_path, monkeypatch):
    (tmp_path / "readers_apart.py").write_text(READERS)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr("alphacut.base.apart.MIN_SECONDS", 1)
    path = tmp_path / "a file"
    path.write_text("content")
    return lambda name, **options: read_apart(
        f"readers_apart:{name}", path, library="Library", options=options
    )


def test_arrays_and_texts_come_back_from_a_process_without_variables_of_mpi(read, monkeypatch):
    monkeypatch.setenv("OMPI_COMM_WORLD_RANK", "0")
    found = read("arrays", factor=0.1)
    assert np.array_equal(found["numbers"], 0.1 * np.arange(3.0))
    assert found["texts"].tolist() == ["a file"]


def test_arrays_of_python_come_back_from_a_process_without_numpy(read):
    found = read("whole_numbers")
    assert found["numbers"].tolist() == [1, -2]
    assert len(found["none"]) == 0


def test_a_refusal_comes_back_with_its_parts(read):
    with pytest.raises(RefusedError) as caught:
        read("refuses")
    refused = caught.value
    assert (refused.value, refused.allowed, refused.cure) == ("three", "two", "take one away")


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("raises", "no such section at all"),
        ("crashes", "Library ended by signal 11"),
        ("exhausts", "the memory that its size allows"),
        ("hangs", "Library (ended by signal|took more than)"),
        ("waits", "Library took more than 4 s"),
    ],
)
def test_what_happens_to_a_reader_is_one_line(read, name, words):
    with pytest.raises(RefusedError, match=words) as caught:
        read(name)
    assert "\n" not in str(caught.value)
    assert "a file" in str(caught.value)


@pytest.mark.skipif(sys.platform != "linux", reason="ends with its parent on Linux alone")
def test_a_reader_ends_with_the_process_that_started_it(read, tmp_path):
    program = (
        "import sys; from pathlib import Path; from alphacut.base.apart import read_apart\n"
        f"sys.path.insert(0, {str(tmp_path)!r})\n"
        f"read_apart('readers_apart:waits', Path({str(tmp_path / 'pid')!r}), library='L')"
    )
    (tmp_path / "pid").write_text("")
    with subprocess.Popen([sys.executable, "-c", program]) as parent:
        deadline = time.monotonic() + 60
        while not (told := (tmp_path / "pid").read_text()):
            assert time.monotonic() < deadline
            time.sleep(0.05)
        parent.kill()
    for _ in range(100):
        try:
            os.kill(int(told), 0)
        except ProcessLookupError:
            return
        time.sleep(0.05)
    os.kill(int(told), signal.SIGKILL)
    pytest.fail("the reader goes on alone")
