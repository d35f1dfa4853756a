"""Cases: one set of numbers however a case is run, and envelopes of a case said otherwise."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import combinations, product, zip_longest
from pathlib import Path
from typing import Any

import xarray as xr

from alphacut.case.load import load
from alphacut.case.motion import EnvelopeSection
from alphacut.fuzzy.refused import FailedError
from benchmarks.relations.relation import Chance, Relation
from benchmarks.relations.stated import Stated

ROOT = Path(__file__).parents[2]
FREE = {"seconds", "command", "versions", "figures"}
"""Keys of a summary that may differ from run to run."""
WAYS: dict[str, tuple[str, ...]] = {
    "workers": ("1", "2", "5"),
    "start": ("plain", "mpi") if shutil.which("mpirun") else ("plain",),
    "assertions": ("on", "off"),
    "hash seed": ("0", "1", "271828"),
    "threads": ("1", "3"),
    "folder": (str(ROOT), tempfile.gettempdir()),
    "locale": ("C", "C.UTF-8", "de_DE.UTF-8"),
    "figures": ("no", "yes"),
    "killed": ("no", "yes"),
}
"""Ways to run a case by factor; the first of each is the plain one."""
PLAIN = {factor: values[0] for factor, values in WAYS.items()}
QUICK = {
    "paper": ("modulus.method=series", "envelope.alpha=[0, 1]", "envelope.step=0.02 s"),
    "concrete": ("modulus.method=series", "microstructure.packing.packings=5"),
    "building": ("envelope.duration=4 s", "envelope.alpha=[0, 1]"),
    "paper-literal": ("envelope.alpha=[0, 1]", "envelope.duration=5 ms"),
}
"""Changes of the shipped cases that make them quick, by name."""
LANGUAGES = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS")


def command(case: Path, changes: tuple[str, ...], out: Path, way: Mapping[str, str]) -> list[str]:
    """The command that runs a case in a way, its results in a folder."""
    python = [sys.executable, *(["-O"] if way["assertions"] == "off" else [])]
    if way["start"] == "mpi":
        python = [*["mpirun", "--allow-run-as-root", "--oversubscribe", "-n", "2"], *python]
        python += ["-m", "mpi4py.futures"]
    options = [f"--out={out}", f"--workers={way['workers']}", "--quiet"]
    options += [f"--set={change}" for change in changes]
    options += ["--no-figures"] if way["figures"] == "no" else []
    return [*python, "-m", "alphacut", "run", str(case.resolve()), *options]


def surroundings(way: Mapping[str, str]) -> dict[str, str]:
    """Variables of the environment of a way."""
    threads = dict.fromkeys(LANGUAGES, way["threads"])
    others = {"PYTHONHASHSEED": way["hash seed"], "LC_ALL": way["locale"], "PYTHONPATH": str(ROOT)}
    return {**os.environ, **threads, **others}


def killed_after(seconds: float, words: list[str], given: Mapping[str, Any]) -> bool:
    """Starts a command and kills it with its workers; whether it was still running."""
    started = subprocess.Popen(words, stderr=subprocess.DEVNULL, **given)
    with suppress(subprocess.TimeoutExpired):
        started.wait(seconds)
    was_running = started.poll() is None
    with suppress(ProcessLookupError):
        os.killpg(started.pid, signal.SIGKILL)
    started.wait()
    return was_running


@dataclass(frozen=True, eq=False)
class CaseRun:
    """A case with changes, and the way that it is run.

    Args:
        case: The case file.
        changes: Changes of keys, as of `--set`.
        way: Value of each factor of `WAYS`.
        moment: Share of the plain run's time after which a killed run is killed.
    """

    case: Path
    changes: tuple[str, ...] = ()
    way: Mapping[str, str] = field(default_factory=lambda: PLAIN)
    moment: float = 0.5

    def run(self, out: Path, seconds: float = 10.0) -> dict[str, Any]:
        """The summary of a run with results in a folder.

        Args:
            out: The folder.
            seconds: What the plain run took.

        Raises:
            FailedError: The run ends with an error.
        """
        words = command(self.case, self.changes, out, self.way)
        given: dict[str, Any] = {"cwd": self.way["folder"], "env": surroundings(self.way)}
        given["start_new_session"] = True
        if self.way["killed"] == "yes":
            killed_after(self.moment * seconds, words, given)
        done = subprocess.run(words, capture_output=True, text=True, check=False, **given)
        if done.returncode:
            raise FailedError(f"exit status {done.returncode}: {done.stderr.strip()[-300:]}")
        summary: dict[str, Any] = json.loads((out / "summary.json").read_text(encoding="utf-8"))
        return summary

    def stated(self) -> Stated:
        """Statements of all envelopes; outputs are named with their study."""
        with tempfile.TemporaryDirectory() as folder:
            self.run(Path(folder))
            parts = []
            for path in sorted(Path(folder).glob("envelope_*.nc")):
                data = Stated.of_dataset(xr.load_dataset(path)).data
                names = [f"{path.stem.partition('_')[2]} {name}" for name in data.output.values]
                parts.append(data.assign_coords(output=names))
        return Stated(xr.concat(parts, "output", join="outer"))


def numbers(value: Any, path: str = "") -> list[str]:
    """Places and digits of a summary in their order, without what may differ from run to run."""
    if isinstance(value, dict):
        parts = [(f"{path}.{key}", part) for key, part in value.items() if key not in FREE]
    elif isinstance(value, list):
        parts = [(f"{path}[{place}]", part) for place, part in enumerate(value)]
    else:
        return [f"{path[1:]}: {value!r:.60}"]
    return [line for place, part in parts for line in numbers(part, place)]


def differences(one: list[str], two: list[str]) -> list[str]:
    """What two summaries' numbers differ in."""
    return [f"{x} against {y}" for x, y in zip_longest(one, two) if x != y]


def pairwise(chance: Chance, ways: Mapping[str, tuple[str, ...]] = WAYS) -> list[dict[str, str]]:
    """Ways to run that hold every pair of values of two factors, few of them.

    Each is the best of 30 drawn at random by the number of new pairs in it.
    """
    missing = {
        ((a, x), (b, y)) for a, b in combinations(ways, 2) for x, y in product(ways[a], ways[b])
    }
    rows = []
    while missing:
        drawn = [{key: str(chance.choice(values)) for key, values in ways.items()}]
        for _ in range(30):
            (a, x), (b, y) = min(missing)
            more = {key: str(chance.choice(values)) for key, values in ways.items()}
            drawn.append(more | {a: x, b: y})
        best = max(drawn, key=lambda row: len(missing & set(combinations(row.items(), 2))))
        missing -= set(combinations(best.items(), 2))
        rows.append(best)
    return rows


def ways_checked(
    plain: CaseRun, rows: list[dict[str, str]], chance: Chance
) -> Iterator[tuple[str, list[str]]]:
    """Ways in words with the differences of their summaries from the plain run's."""
    with tempfile.TemporaryDirectory() as folder:
        begun = time.monotonic()
        expected = numbers(plain.run(Path(folder, "plain")))
        seconds = time.monotonic() - begun
        for number, row in enumerate(rows):
            other = replace(plain, way=row, moment=float(chance.uniform(0.1, 0.9)))
            name = ", ".join(f"{key} {x}" for key, x in row.items() if x != PLAIN[key])
            try:
                found = numbers(other.run(Path(folder, str(number)), seconds))
                yield name, differences(expected, found)
            except FailedError as error:
                yield name, [str(error)]


def _changed(
    key: str, value: Callable[[EnvelopeSection], str], case: CaseRun, _: Chance
) -> CaseRun:
    """The case with one key of [envelope] changed."""
    section = load(case.case, case.changes).content.envelope
    assert section is not None
    others = [change for change in case.changes if not change.startswith(f"envelope.{key}=")]
    return replace(case, changes=(*others, f"envelope.{key}={value(section)}"))


CHANGES: dict[str, tuple[str, Callable[[EnvelopeSection], str]]] = {
    "inputs in another order": ("fuzzy", lambda x: json.dumps([*x.fuzzy][::-1])),
    "one level": ("alpha", lambda x: f"[{x.alpha[0]}]"),
    "half the duration": ("duration", lambda x: f"{x.duration / 2} s"),
    "half the step": ("step", lambda x: f"{x.step / 2} s"),
}
RELATIONS = tuple(Relation(name, partial(_changed, *change)) for name, change in CHANGES.items())
"""Relations of envelopes of cases."""
