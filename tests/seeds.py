"""Every test that draws from the fixture `rng`, with many seeds each.

    ./enter python -m tests.seeds 200                            # all, with 200 seeds each
    ./enter python -m tests.seeds 200 tests/frame/spectra        # those of one folder
    ./enter python -m tests.seeds 200 --seconds 60 --not-slow    # no more than a minute each
    ./enter python -m tests.seeds 200 --shared    # the parameters of a test share its seeds

Each file of tests has one process, in which its tests run again with one seed after the other; as
many run at once as there are cores. A line for each test says how many seeds it got, and which ones
failed; SEED=… repeats one of these. This module is also the plugin of pytest that does so within a
process.
"""

from __future__ import annotations

import argparse
import os
import re
import secrets
import subprocess
import sys
from collections import defaultdict
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]


class Repetition:
    """Repeats tests with further seeds, and counts.

    Args:
        seeds: Seeds of each test.
        seconds: Processor time in s after which a test gets no further seed.
        is_shared: Whether each seed goes to one of a test's parameters, in turn, not to all.
    """

    def __init__(self, seeds: range, seconds: float, is_shared: bool) -> None:
        self.seeds = seeds
        self.seconds = seconds
        self.is_shared = is_shared
        self.spent: dict[str, float] = defaultdict(float)  # processor s by the name of a test
        self.passed: dict[str, int] = defaultdict(int)
        self.failed: dict[str, list[int]] = defaultdict(list)  # seeds

    def pytest_generate_tests(self, metafunc):
        """Give the fixture `rng` one seed after the other."""
        if "rng" in metafunc.fixturenames:
            metafunc.parametrize("rng", self.seeds, ids=lambda seed: f"SEED={seed}", indirect=True)

    def pytest_collection_modifyitems(self, items):
        """Leave out tests that draw nothing."""
        items[:] = [item for item in items if "rng" in item.fixturenames]
        if self.is_shared:
            names: dict[str, list[str]] = defaultdict(list)  # with parameters, by that without
            for item in items:
                of_test = names[item.nodeid.split("[")[0]]
                if _name(item) not in of_test:
                    of_test.append(_name(item))
            items[:] = [
                item for item in items
                if (item.callspec.params["rng"] - self.seeds.start)
                % len(of_test := names[item.nodeid.split("[")[0]]) == of_test.index(_name(item))
            ]  # fmt: skip

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item):
        """Count the time of a test, or leave it out if its earlier seeds took too long."""
        name = _name(item)
        if self.spent[name] > self.seconds:
            item.add_marker(pytest.mark.skip("no time for further seeds"))
        begin = _processor_time()
        result = yield
        self.spent[name] += _processor_time() - begin
        return result

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_makereport(self, item):
        """Count whether a test has passed, and note the seed if not."""
        report = yield
        name = _name(item)
        if report.failed:
            self.failed[name].append(item.callspec.params["rng"])
        elif report.when == "call" and report.passed:
            self.passed[name] += 1
        return report

    def pytest_terminal_summary(self, terminalreporter):
        """Write a line for each test."""
        for name, seconds in self.spent.items():
            failed = sorted(set(self.failed[name]))
            count = self.passed[name] + len(failed)
            line = f"{count:4d} seeds, {len(failed)} failed, {seconds:6.1f} s: {name}"
            terminalreporter.write_line(" ".join([line, *(f"SEED={seed}" for seed in failed)]))


def _name(item: pytest.Item) -> str:
    """Return the name of a test without its seed."""
    return re.sub(r"\[SEED=\d+\]|-SEED=\d+|(?<=\[)SEED=\d+-", "", item.nodeid)


def _processor_time() -> float:
    """Return the processor time in s of this process and of those that it has waited for."""
    times = os.times()
    return times.user + times.system + times.children_user + times.children_system


def pytest_configure(config: pytest.Config) -> None:
    """Register the repetition that the environment describes."""
    first, count, seconds, is_shared = os.environ["ALPHACUT_SEEDS"].split()
    seeds = range(int(first), int(first) + int(count))
    config.pluginmanager.register(Repetition(seeds, float(seconds), is_shared == "True"))


def main() -> int:
    """Run the tests in the files or folders of the command line; return 1 if one fails."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("count", type=int, help="number of seeds for each test")
    parser.add_argument("places", nargs="*", type=Path, default=[ROOT / "tests"])
    parser.add_argument(
        "--seconds", type=float, default=1e9, help="longest processor time for a test"
    )
    parser.add_argument("--first", type=int, help="first seed (else a random one)")
    parser.add_argument("--shared", action="store_true", help="give each seed to one parameter")
    parser.add_argument("--not-slow", action="store_true", help="without tests that are slow")
    options = parser.parse_args()
    first = secrets.randbelow(10**9) if options.first is None else options.first
    print(f"seeds from {first} on", flush=True)
    numbers = f"{first} {options.count} {options.seconds} {options.shared}"
    environment = os.environ | {"ALPHACUT_SEEDS": numbers}
    words = [sys.executable, "-m", "pytest", "-q", "-p", "tests.seeds", "--tb=short", "--no-header"]
    words += ["-o", "console_output_style=none", "--show-capture=no"]
    if options.not_slow:
        words += ["-m", "not slow"]
    files = set()
    for place in options.places:
        files.update([place] if place.is_file() else place.rglob("test_*.py"))
    drawing = [file for file in sorted(files) if "rng" in file.read_text(encoding="utf-8")]

    def run(file: Path) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [*words, str(file)], cwd=ROOT, env=environment, check=False, capture_output=True,
            text=True,
        )  # fmt: skip

    status = 0
    with ThreadPoolExecutor(len(os.sched_getaffinity(0))) as pool:
        for done in pool.map(run, drawing):
            print(done.stdout + done.stderr, end="", flush=True)
            if done.returncode not in (pytest.ExitCode.OK, pytest.ExitCode.NO_TESTS_COLLECTED):
                status = 1
    return status


if __name__ == "__main__":
    sys.exit(main())
