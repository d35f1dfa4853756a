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
from itertools import zip_longest
from pathlib import Path
from typing import Any

import xarray as xr

from alphacut.base.errors import FailedError
from alphacut.case.content import load
from alphacut.case.motion import EnvelopeSection
from benchmarks.relations.relation import Chance, Kind, Problem, Relation
from benchmarks.relations.stated import of_dataset

ROOT = Path(__file__).parents[2]
FREE = {"seconds", "command", "versions", "figures"}
"""Keys of a summary that may differ from run to run."""
Way = Mapping[str, str]
"""Value of each factor of `WAYS`."""
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
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS")


def problem(case: Path) -> Problem:
    """A case file and the changes of its keys, as of `--set`."""
    return {"case": case, "changes": QUICK.get(case.stem, ())}


def start(case: Problem, out: Path, way: Way = PLAIN) -> subprocess.Popen[str]:
    """Starts a run of a case in a way, with its results in a folder."""
    python = [sys.executable, *(["-O"] if way["assertions"] == "off" else [])]
    if way["start"] == "mpi":
        python = [*["mpirun", "--allow-run-as-root", "--oversubscribe", "-n", "2"], *python]
        python += ["-m", "mpi4py.futures"]
    options = [f"--out={out}", f"--workers={way['workers']}", "--quiet"]
    options += [f"--set={change}" for change in case["changes"]]
    options += ["--no-figures"] if way["figures"] == "no" else []
    others = {"PYTHONHASHSEED": way["hash seed"], "LC_ALL": way["locale"], "PYTHONPATH": str(ROOT)}
    return subprocess.Popen(
        [*python, "-m", "alphacut", "run", str(case["case"].resolve()), *options],
        cwd=way["folder"],
        env={**os.environ, **dict.fromkeys(THREADS, way["threads"]), **others},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )


def kill_after(started: subprocess.Popen[str], out: Path, seconds: float) -> None:
    """Kills a run with its workers if it has not ended after so many seconds."""
    with suppress(subprocess.TimeoutExpired):
        started.communicate(timeout=seconds)
        return
    with suppress(ProcessLookupError):
        os.killpg(started.pid, signal.SIGKILL)
    # ranks of mpirun have process groups of their own
    subprocess.run(["pkill", "-KILL", "-f", "--", f"--out={out} "], check=False)
    started.communicate()


def summary_of(started: subprocess.Popen[str], out: Path) -> dict[str, Any]:
    """The summary of a run, when it has ended.

    Raises:
        FailedError: The run ends with an error.
    """
    said = started.communicate()[1]
    if started.returncode:
        raise FailedError(f"exit status {started.returncode}: {said.strip()[-300:]}")
    summary: dict[str, Any] = json.loads((out / "summary.json").read_text(encoding="utf-8"))
    return summary


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


def random_ways(chance: Chance, count: int) -> list[dict[str, str]]:
    """Ways to run a case, each factor drawn at random."""
    return [{x: str(chance.choice(WAYS[x])) for x in WAYS} for _ in range(count)]


def ways_checked(
    case: Problem, rows: list[dict[str, str]], chance: Chance
) -> Iterator[tuple[str, list[str]]]:
    """Ways in words with the differences of their summaries from the plain run's."""
    with tempfile.TemporaryDirectory() as folder:
        begun, out = time.monotonic(), Path(folder, "plain")
        expected = numbers(summary_of(start(case, out), out))
        seconds = time.monotonic() - begun
        for number, row in enumerate(rows):
            out = Path(folder, str(number))
            if row["killed"] == "yes":
                kill_after(start(case, out, row), out, float(chance.uniform(0.1, 0.9)) * seconds)
            name = ", ".join(f"{key} {x}" for key, x in row.items() if x != PLAIN[key])
            try:
                found = numbers(summary_of(start(case, out, row), out))
                yield name, differences(expected, found)
            except FailedError as error:
                yield name, [str(error)]


def stated(case: Problem) -> xr.Dataset:
    """Statement of all envelopes; outputs are named with their study."""
    with tempfile.TemporaryDirectory() as folder:
        summary_of(start(case, Path(folder)), Path(folder))
        parts = []
        for path in sorted(Path(folder).glob("envelope_*.nc")):
            data = of_dataset(xr.load_dataset(path))
            names = [f"{path.stem.partition('_')[2]} {name}" for name in data.output.values]
            parts.append(data.assign_coords(output=names))
    return xr.concat(parts, "output", join="outer")


def of_envelope(name: str, key: str, value: Callable[[EnvelopeSection], str]) -> Relation:
    """The case with one key of [envelope] changed."""

    def changed(case: Problem, chance: Chance) -> Problem:
        section = load(case["case"], case["changes"]).content.envelope
        assert section is not None
        others = [x for x in case["changes"] if not x.startswith(f"envelope.{key}=")]
        return {"changes": (*others, f"envelope.{key}={value(section)}")}

    return Relation(name, changed)


ENVELOPES = Kind(
    problem,  # type: ignore[arg-type]
    stated,
    (
        of_envelope("inputs in another order", "fuzzy", lambda x: json.dumps([*x.fuzzy][::-1])),
        of_envelope("one level", "alpha", lambda x: f"[{x.alpha[0]}]"),
        of_envelope("half the duration", "duration", lambda x: f"{x.duration / 2} s"),
        of_envelope("half the step", "step", lambda x: f"{x.step / 2} s"),
    ),
)
"""Envelopes of cases, which are not drawn but named."""
