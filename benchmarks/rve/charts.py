"""Two charts of the cell, made from scratch in one run on one core: `make charts`.

1. Error of E against time, for every way to it.
2. Time and iterations of the named solvers of the product-space system, over its size and over the
   contrast of the phases.

Points that would take longer than the cap are drawn hollow at the cap. CSV and figures go to
benchmarks/results/.
"""

from __future__ import annotations

import argparse
import csv
import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from time import perf_counter, process_time
from typing import Any

from alphacut.rve.cell import Phase
from benchmarks.rve.methods import MATRIX, PAPER_MAP, Run, exact_modulus, families, measure

RESULTS = Path(__file__).parents[1] / "results"
RECOMMENDED = ("auto", "tolerance 1e-06")
COLOURS = {
    "auto": "black",
    "series": "#0b6e4f",
    "table, kept": "#1b9e77",
    "table, made": "#66c2a5",
    "slices, order 2": "#c6dbef",
    "slices, order 3": "#6baed6",
    "slices, order 4": "#2171b5",
    "dolfinx_mpc, order 2": "#dadaeb",
    "dolfinx_mpc, order 3": "#9e9ac8",
    "prism": "#d94801",
    "prism, MUMPS": "#fd8d3c",
    "prism, CG + GAMG": "#fdbe85",
    "prism, interface ignored": "#a63603",
    "Monte Carlo over θ": "#969696",
}


@dataclass(frozen=True)
class SolverRun:
    """One solver on one product-space system: set-up and both loads.

    `seconds` is processor time: the wall time of these stages by the share of the processor that
        the whole call had.
    """

    solver: str
    mesh_size: float
    layers: int
    contrast: float
    unknowns: int
    seconds: float
    iterations: int
    capped: bool = False


def accuracy_runs(*, cap: float, small: bool = False) -> list[Run]:
    """All points of the first chart."""
    exact, runs = exact_modulus(), []
    for family in families(small=small):
        for run in measure(family, exact=exact, cap=cap):
            runs.append(run)
            state = "capped" if run.capped else f"error {run.error:8.1e}"
            print(f"{run.family:26} {run.setting:22} {state:16} {run.seconds:9.4f} s", flush=True)
    return runs


def solver_runs(*, cap: float, small: bool = False) -> list[SolverRun]:
    """All points of the second chart: first over size, then over contrast."""
    sizes = (
        ((0.5, 6), (0.3, 6))
        if small
        else ((0.15, 12), (0.1, 12), (0.08, 12), (0.056, 12), (0.04, 12), (0.1, 185))
    )
    contrasts = (1e-2, 1e2) if small else (1e-4, 1e-2, 1e2, 1e4)
    runs = []
    for solver in ("theta", "mumps") if small else ("theta", "mumps", "gamg"):
        for settings in (
            [(h, n, 4.0) for h, n in sizes],
            [(sizes[0][0], sizes[0][1], c) for c in contrasts],
        ):
            stopped = False
            for mesh_size, layers, contrast in settings:
                run = _solver_run(solver, mesh_size, layers, contrast, cap=cap, stopped=stopped)
                growing = settings[0][2] == settings[-1][2]
                stopped = stopped or run.capped or (4 if growing else 2) * run.seconds > cap
                runs.append(run)
                print(
                    f"{solver:8} h {mesh_size:5g}, {layers} layers, contrast {contrast:7g}: {run}",
                    flush=True,
                )
    return runs


def _solver_run(
    solver: str, mesh_size: float, layers: int, contrast: float, *, cap: float, stopped: bool
) -> SolverRun:
    from alphacut.rve.prism.model import PrismModel

    if stopped:
        return SolverRun(solver, mesh_size, layers, contrast, 0, cap, 0, capped=True)
    model = PrismModel(mesh_size=mesh_size, layers=layers, solver=solver)
    wall, processor = perf_counter(), process_time()
    try:
        result = model.solve(PAPER_MAP, MATRIX, [Phase(MATRIX.modulus * contrast)])[0]
    except RuntimeError as refusal:
        print(f"{solver}: {refusal}", flush=True)
        return SolverRun(solver, mesh_size, layers, contrast, 0, cap, 0, capped=True)
    share = min(1.0, (process_time() - processor) / (perf_counter() - wall))
    seconds = share * (result.seconds["setup"] + result.seconds["solve"])
    return SolverRun(
        solver,
        mesh_size,
        layers,
        contrast,
        result.unknowns,
        seconds,
        max(result.iterations, default=0),
    )


def write(rows: Sequence[Run] | Sequence[SolverRun], path: Path) -> None:
    """One CSV file, written whole or not at all."""
    path.parent.mkdir(parents=True, exist_ok=True)
    partial = path.with_suffix(".partial")
    with partial.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, list(asdict(rows[0])))
        writer.writeheader()
        writer.writerows(asdict(row) for row in rows)
    partial.replace(path)


def draw_accuracy(runs: Sequence[Run], stem: Path) -> None:
    """Error over time, one line for each family, named at its end; the recommended point ringed."""
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(9.5, 6), layout="constrained")
    for family in dict.fromkeys(run.family for run in runs):
        own = [run for run in runs if run.family == family]
        made = [run for run in own if not run.capped]
        colour = COLOURS.get(family, "black")
        seconds, errors = [run.seconds for run in made], [run.error for run in made]
        axes.loglog(seconds, errors, "o-", color=colour, label=family, ms=4, lw=1.6)
        for run in own:
            if run.capped:
                axes.plot(run.seconds, errors[-1], ">", mfc="none", color=colour)
            if (run.family, run.setting) == RECOMMENDED:
                axes.plot(run.seconds, run.error, "*", ms=20, color="gold", mec="black", zorder=5)
                text = "recommended:\n--method auto --tolerance 1e-6"
                axes.annotate(
                    text,
                    (run.seconds, run.error),
                    (16, -4),
                    textcoords="offset points",
                    fontsize=10,
                )
    axes.set(
        xlabel="seconds of one core",
        ylabel="relative error of E",
        title="What a digit of the effective modulus costs",
    )
    axes.invert_yaxis()
    axes.grid(alpha=0.25, which="major")
    axes.legend(fontsize=8, loc="center left", bbox_to_anchor=(1, 0.5), frameon=False)
    axes.text(
        0.01, 0.985, "better ↖", transform=axes.transAxes, va="top", fontsize=11, weight="bold"
    )
    _save(figure, stem)


def draw_solvers(runs: Sequence[SolverRun], stem: Path) -> None:
    """Time and iterations over unknowns and over contrast."""
    import matplotlib.pyplot as plt

    figure, panels = plt.subplots(2, 2, figsize=(10, 7), layout="constrained", sharex="col")
    names = list(dict.fromkeys(run.solver for run in runs))
    for name in names:
        own = [run for run in runs if run.solver == name and not run.capped]
        sized = sorted((run for run in own if run.contrast == 4.0), key=lambda run: run.unknowns)
        base = min((run.unknowns for run in sized), default=0)
        contrasted = sorted(
            (run for run in own if run.unknowns == base), key=lambda run: run.contrast
        )
        for column, (chosen, across) in enumerate(((sized, "unknowns"), (contrasted, "contrast"))):
            x = [getattr(run, across) for run in chosen]
            panels[0, column].loglog(x, [run.seconds for run in chosen], "o-", label=name, ms=4)
            panels[1, column].loglog(x, [max(run.iterations, 1) for run in chosen], "o-", ms=4)
        colour = panels[0, 0].lines[-1].get_color()
        sizes = {(run.mesh_size, run.layers): run.unknowns for run in runs if not run.capped}
        for run in runs:
            if run.solver == name and run.capped and (run.mesh_size, run.layers) in sizes:
                column, x = (
                    (0, sizes[run.mesh_size, run.layers])
                    if run.contrast == 4.0
                    else (1, run.contrast)
                )
                panels[0, column].plot(x, run.seconds, "^", mfc="none", color=colour)
    panels[0, 0].set(ylabel="seconds, set-up and both loads", title="over unknowns, contrast 4")
    panels[0, 1].set(title="over contrast E_i / E_m, smallest mesh")
    panels[1, 0].set(xlabel="unknowns", ylabel="iterations of a load")
    panels[1, 1].set(xlabel="contrast")
    panels[0, 0].legend(frameon=False)
    for panel in panels.flat:
        panel.grid(alpha=0.25)
    _save(figure, stem)


def _save(figure: Any, stem: Path) -> None:
    import matplotlib.pyplot as plt

    stem.parent.mkdir(parents=True, exist_ok=True)
    for suffix in (".svg", ".png"):
        figure.savefig(stem.with_suffix(suffix), dpi=160)
    plt.close(figure)


def main(arguments: Sequence[str] | None = None) -> int:
    """Make both charts."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--cap", type=float, default=30.0, help="seconds that one point may take (default 30)"
    )
    parser.add_argument("--small", action="store_true", help="a few coarse points, in seconds")
    parser.add_argument("--only", choices=("accuracy", "solvers"), help="one chart alone")
    parser.add_argument(
        "--out", type=Path, default=RESULTS, help="folder for CSV files and figures"
    )
    options = parser.parse_args(arguments)
    started = perf_counter()
    if options.only != "solvers":
        runs = accuracy_runs(cap=options.cap, small=options.small)
        write(runs, options.out / "cell_accuracy.csv")
        draw_accuracy(runs, options.out / "cell_accuracy")
    if options.only != "accuracy":
        solved = solver_runs(cap=options.cap, small=options.small)
        write(solved, options.out / "cell_solver_sizes.csv")
        draw_solvers(solved, options.out / "cell_solver_sizes")
    print(f"made in {perf_counter() - started:.0f} s, in {options.out}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
