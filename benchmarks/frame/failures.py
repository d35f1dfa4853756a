"""Failures of the Graph Follower over time, width and number of parameters.

The paper's frame, third floor. The supports of all fuzzy parameters have the same half width, a
share of their modal values (of the largest initial displacement or velocity where the modal value
is smaller). Errors are against dense, polished references. Run `python -m benchmarks.frame.failures
--help`.
"""

from __future__ import annotations

import argparse
import csv
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from alphacut.frame import Exact, LinearFlow, envelope
from alphacut.frame.boxes import UnitFlow, boxes
from alphacut.frame.calculus.jet import Array
from alphacut.fuzzy import Triangular
from benchmarks.frame.envelopes import FRAME
from benchmarks.frame.references.polished_search import true_envelope

RESULTS = Path(__file__).parents[1] / "results"
THIRD = replace(FRAME, outputs=("q3",))
NAMES = ("E", *(name for group in ("m", "l", "d", "q0", "v0") for name in FRAME.group(group)))
METHODS = {"faithful": "graph-follower", "improved": "improved-graph-follower"}
WIDTHS = (0.02, 0.05, 0.1, 0.2, 0.3, 0.5)
COUNTS = (1, 2, 4, 8, 16)
OVER_TIME = [(4, width) for width in WIDTHS]
OVER_COUNT = [(count, width) for count in COUNTS for width in WIDTHS[:-1]]
TOLERANCE = 1e-3
BUDGET = 1500
STEP = 0.05


def inputs(count: int, width: float) -> dict[str, Triangular]:
    """The first `count` of the sixteen parameters, all of half width `width`."""
    found = {}
    for name in NAMES[:count]:
        middle = THIRD.parameters[name]
        group = [x for other, x in THIRD.parameters.items() if other[0] == name[0] in "qv"]
        half = width * max(map(abs, [middle, *group]))
        found[name] = Triangular(middle - half, middle, middle + half)
    return found


def errors(
    count: int, width: float, *, duration: float, every: float
) -> dict[str, tuple[Array, int]]:
    """Per method: the error at the nodes 0, every, … (m), shape (T,), and the graphs computed."""
    fuzzy = inputs(count, width)
    cuts = boxes(fuzzy, (0,))
    flow = UnitFlow(LinearFlow(THIRD, cuts.names, duration, every, Exact()), cuts)
    truth = true_envelope(flow, samples=2**12, candidates=min(8, 2**count), promising=0.05)
    found = {}
    for name, method in METHODS.items():
        made = envelope(
            THIRD,
            fuzzy,
            duration=duration,
            step=STEP,
            alpha=(0,),
            method=method,
            integrator="exact",
            tolerance=TOLERANCE,
            budget=BUDGET,
        )
        found[name] = (truth.errors(made).max((1, 2)), made.trajectories)
    return found


def measured(
    cases: Sequence[tuple[int, float]], *, duration: float, every: float
) -> Iterator[dict[str, Any]]:
    """One row per case, method and node."""
    for count, width in cases:
        for name, (wrong, graphs) in errors(count, width, duration=duration, every=every).items():
            print(
                f"{duration:g} s, {count:2d} parameters ±{width:.0%}, {name}: {graphs} graphs,"
                f" error {wrong.max():.1e} m",
                flush=True,
            )
            for k, error in enumerate(wrong):
                yield {
                    "method": name,
                    "parameters": count,
                    "half_width": width,
                    "time_s": k * every,
                    "error_m": error,
                    "graphs": graphs,
                }


def draw(over_time: list[dict[str, Any]], over_count: list[dict[str, Any]], path: Path) -> None:
    """Maps of the error over time, width and number of parameters, per method."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt
    from matplotlib.colors import LogNorm

    figure, axes = plt.subplots(
        len(METHODS), 2, figsize=(10, 6.4), layout="constrained", width_ratios=(1.5, 1)
    )
    colours = LogNorm(1e-5, 1e-1)
    for row, name in zip(axes, METHODS, strict=True):
        for axis, rows, key in ((row[0], over_time, "time_s"), (row[1], over_count, "parameters")):
            across, widths, table = _table([r for r in rows if r["method"] == name], key)
            picture = axis.imshow(
                table,
                cmap="cividis",
                norm=colours,
                aspect="auto",
                origin="lower",
                interpolation="nearest",
            )
            axis.set_yticks(range(len(widths)), [f"±{width:.0%}" for width in widths])
            shown = range(0, len(across), max(1, len(across) // 6))
            axis.set_xticks(shown, [f"{across[k]:g}" for k in shown])
        row[0].set_ylabel(f"{name}\nhalf width of the supports")
        for k, i in np.ndindex(*table.shape):
            shade = "white" if colours(table[k, i]) < 0.55 else "black"
            axis.text(
                i, k, _millimetres(table[k, i]), ha="center", va="center", fontsize=8, color=shade
            )
    axes[-1, 0].set_xlabel("time, s (four parameters)")
    axes[-1, 1].set_xlabel("number of parameters (largest error, mm)")
    figure.colorbar(picture, ax=axes, label="envelope error of the third floor, m", extend="both")
    figure.savefig(path.with_suffix(".png"), dpi=150)
    plt.close(figure)


def _millimetres(error: float) -> str:
    return (
        "< 0.01"
        if error < 1e-5
        else (
            f"{1e3 * error:.{1 if error < 9.5e-3 else 0}f}"
            if error >= 9.5e-4
            else f"{1e3 * error:.2f}"
        )
    )


def _table(rows: list[dict[str, Any]], key: str) -> tuple[list[float], list[float], Array]:
    """Largest error for values of `key` and of the width, shape (widths, values)."""
    across, widths = sorted({row[key] for row in rows}), sorted({row["half_width"] for row in rows})
    table = np.zeros((len(widths), len(across)))
    for row in rows:
        place = widths.index(row["half_width"]), across.index(row[key])
        table[place] = max(table[place], row["error_m"])
    return across, widths, np.maximum(table, 1e-9)


def main() -> None:
    """Measures, prints, writes."""
    argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    ).parse_args()
    RESULTS.mkdir(exist_ok=True)
    over_time = list(measured(OVER_TIME, duration=30.0, every=1.0))
    over_count = list(measured(OVER_COUNT, duration=15.0, every=1.0))
    with (RESULTS / "frame_failures.csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, ["duration_s", *over_time[0]], lineterminator="\n")
        writer.writeheader()
        writer.writerows(
            {"duration_s": duration, **row}
            for duration, rows in ((30, over_time), (15, over_count))
            for row in rows
        )
    draw(over_time, over_count, RESULTS / "frame_failures.png")


if __name__ == "__main__":
    main()
