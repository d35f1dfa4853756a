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
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from itertools import combinations, product
from pathlib import Path
from typing import Any

import xarray as xr

from alphacut.case.load import load
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
        python = ["mpirun", "--allow-run-as-root", "--oversubscribe", "-n", "2", *python]
        python += ["-m", "mpi4py.futures"]
    sets = [f"--set={change}" for change in changes]
    figures = ["--no-figures"] if way["figures"] == "no" else []
    options = [f"--out={out}", f"--workers={way['workers']}", "--quiet", *figures, *sets]
    return [*python, "-m", "alphacut", "run", str(case.resolve()), *options]


def surroundings(way: Mapping[str, str]) -> dict[str, str]:
    """Variables of the environment of a way."""
    own = dict.fromkeys(LANGUAGES, way["threads"])
    own |= {"PYTHONHASHSEED": way["hash seed"], "LC_ALL": way["locale"], "PYTHONPATH": str(ROOT)}
    return {**os.environ, **own}


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
        words, own = command(self.case, self.changes, out, self.way), surroundings(self.way)
        given: dict[str, Any] = {"cwd": self.way["folder"], "env": own, "start_new_session": True}
        if self.way["killed"] == "yes":
            first = subprocess.Popen(words, stderr=subprocess.DEVNULL, **given)
            with suppress(subprocess.TimeoutExpired):
                first.wait(self.moment * seconds)
            with suppress(ProcessLookupError):
                os.killpg(first.pid, signal.SIGKILL)
            first.wait()
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


def numbers(value: Any) -> Any:
    """A summary without what may differ from run to run."""
    if isinstance(value, dict):
        return {key: numbers(x) for key, x in value.items() if key not in FREE}
    return [numbers(x) for x in value] if isinstance(value, list) else value


def differences(one: Any, two: Any, path: str = "") -> Iterator[str]:
    """Places at which two summaries differ."""
    if isinstance(one, dict) and isinstance(two, dict) and [*one] == [*two]:
        for key in one:
            yield from differences(one[key], two[key], f"{path}.{key}" if path else key)
    elif isinstance(one, list) and isinstance(two, list) and len(one) == len(two):
        for place, pair in enumerate(zip(one, two, strict=True)):
            yield from differences(*pair, f"{path}[{place}]")
    elif repr(one) != repr(two):
        yield f"{path}: {one!r:.60} against {two!r:.60}"


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
        first = numbers(plain.run(Path(folder, "plain")))
        seconds = time.monotonic() - begun
        for number, row in enumerate(rows):
            other = replace(plain, way=row, moment=float(chance.uniform(0.1, 0.9)))
            name = ", ".join(f"{key} {x}" for key, x in row.items() if x != PLAIN[key])
            try:
                second = numbers(other.run(Path(folder, str(number)), seconds))
                yield name, list(differences(first, second))
            except FailedError as error:
                yield name, [str(error)]


def _changed(key: str, value: Any) -> Any:
    """A relation's function: the case with one key of [envelope] changed, None without one."""

    def said(of: CaseRun, chance: Chance) -> CaseRun | None:
        section = load(of.case, of.changes).content.envelope
        if section is None or (found := value(section)) is None:
            return None
        others = [change for change in of.changes if not change.startswith(f"{key}=")]
        return replace(of, changes=(*others, f"{key}={found}"))

    return said


RELATIONS = (
    Relation(
        "inputs in another order",
        _changed(
            "envelope.fuzzy", lambda x: json.dumps([*x.fuzzy][::-1]) if len(x.fuzzy) > 1 else None
        ),
    ),
    Relation("one level", _changed("envelope.alpha", lambda x: f"[{x.alpha[0]}]")),
    Relation("half the duration", _changed("envelope.duration", lambda x: f"{x.duration / 2} s")),
    Relation("half the step", _changed("envelope.step", lambda x: f"{x.step / 2} s")),
)
"""Relations of envelopes of cases."""
