"""Cost of a campaign besides its model: time per sample and memory.

Writes benchmarks/results/fuzzy_overhead.csv and .png. The store is written with `synchronous =
FULL`, so the time holds for this disk.
"""

from __future__ import annotations

import argparse
import csv
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from time import perf_counter

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from alphacut.fuzzy import Interval, propagate
from alphacut.fuzzy.samples.design import Design
from alphacut.fuzzy.samples.model import Model
from alphacut.fuzzy.samples.result import FuzzyResult
from alphacut.fuzzy.sets.boxes import Domain


@dataclass(frozen=True)
class Row:
    """Campaign: samples, time per sample in ms, memory in MB."""

    samples: int
    where: str
    milliseconds: float
    before: float
    after: float
    data: float


@dataclass(frozen=True)
class Points:
    """A plan of so many random points."""

    count: int
    stepwise: bool = False

    def run(self, model: Model, domain: Domain) -> FuzzyResult:
        """Evaluate them."""
        points = np.random.default_rng(0).random((self.count, len(domain.names)))
        return Design.from_samples(domain, points).bounds(model(points), plan="points")


def nothing(a: float, b: float) -> float:
    """The model that costs nothing."""
    return a


def resident() -> float:
    """Memory that this process holds now, in MB."""
    fields = dict(line.split(":", 1) for line in Path("/proc/self/status").read_text().splitlines())
    return int(fields["VmRSS"].split()[0]) / 1024


def measure(samples: int, store: Path | None) -> Row:
    """Run one campaign."""
    inputs = {"a": Interval(0, 1), "b": Interval(0, 1)}
    identity = {"benchmark": "overhead", "samples": samples}
    before, start = resident(), perf_counter()
    propagate(nothing, inputs, Points(samples), alpha=[0.0], store=store, identity=identity)
    milliseconds, data = (
        1e3 * (perf_counter() - start) / samples,
        8 * samples * (len(inputs) + 1) / 2**20,
    )
    return Row(samples, "store" if store else "no store", milliseconds, before, resident(), data)


def draw(rows: Sequence[Row], path: Path) -> None:
    """Time per sample and memory over the number of samples."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.5, 3.0), layout="constrained")
    time, memory = figure.subplots(1, 2)
    for where, colour in (("store", "#0072B2"), ("no store", "#D55E00")):
        chosen = [row for row in rows if row.where == where]
        samples = [row.samples for row in chosen]
        time.plot(samples, [row.milliseconds for row in chosen], "o-", color=colour, label=where)
        memory.plot(
            samples, [row.after - row.before for row in chosen], "o-", color=colour, label=where
        )
    memory.plot(
        samples, [row.data for row in chosen], ":", color="#999999", label="points and outputs"
    )
    time.axhline(2, color="#999999", linestyle=":", label="2 ms")
    time.set(xscale="log", yscale="log", xlabel="samples", ylabel="overhead per sample in ms")
    memory.set(xscale="log", xlabel="samples", ylabel="memory taken in MB")
    time.legend(frameon=False)
    memory.legend(frameon=False)
    figure.savefig(path, dpi=150)


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure, write the table and the picture."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--out",
        type=Path,
        default=Path(__file__).parents[1] / "results",
        help="folder for fuzzy_overhead.csv and .png",
    )
    parser.add_argument(
        "--samples",
        type=int,
        nargs="+",
        default=[1_000, 10_000, 100_000],
        help="samples of each campaign",
    )
    options = parser.parse_args(arguments)
    options.out.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=options.out) as folder:
        rows = [
            measure(samples, store)
            for store in (None, Path(folder) / "samples.db")
            for samples in options.samples
        ]
    with (options.out / "fuzzy_overhead.csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, [*Row.__dataclass_fields__])
        writer.writeheader()
        writer.writerows(asdict(row) for row in rows)
    draw(rows, options.out / "fuzzy_overhead.png")
    for row in rows:
        memory = f"{row.before:.0f} to {row.after:.0f} MB (points and outputs: {row.data:.1f})"
        print(
            f"{row.samples:8} samples, {row.where:8}: {row.milliseconds:.3f} ms per sample,"
            f" {memory}"
        )


if __name__ == "__main__":
    main()
