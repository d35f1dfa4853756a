"""Families of ways to one modulus, from coarse to fine, for the charts."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from time import process_time

import numpy as np

from alphacut.rve.cell import Phase
from alphacut.rve.result import Homogenised, effective_modulus
from alphacut.rve.series.model import SeriesModel
from alphacut.stochastic import HermiteMap

PAPER_MAP = HermiteMap(0.1337, 0.1, 0.8663, 0.1692)  # modal values of the paper, section 4.1
MATRIX, PARTICLE = Phase(20e9), Phase(80e9)
ACCURACIES = (1e-2, 1e-4, 1e-5, 1e-6, 1e-7)  # of tables
PLANAR = ((0.6, 4), (0.45, 5), (0.3, 6), (0.2, 8), (0.14, 9), (0.1, 10))  # mesh size, nodes in θ
PRISMS = ((0.5, 4), (0.3, 6), (0.2, 9), (0.15, 12), (0.1, 12), (0.07, 12), (0.05, 12))  # layers


@dataclass(frozen=True)
class Run:
    """One point of a chart.

    Args:
        family: What is compared.
        setting: Its resolution, in words.
        error: Relative error of E against the series.
        seconds: Processor time of the one thread, so that other work on the machine does not count;
            without imports and compilation.
        unknowns: Of one linear system.
        capped: Whether the run was not made because it would take longer than allowed; then
            `seconds` is the cap and `error` nan.
    """

    family: str
    setting: str
    error: float
    seconds: float
    unknowns: int = 0
    capped: bool = False


# → E in Pa, seconds if not those of the whole call, unknowns
Way = Callable[[], tuple[float, float | None, int]]
Family = tuple[str, list[tuple[str, Way]]]


def exact_modulus() -> float:
    """E of the case by the series at its own accuracy, in Pa."""
    return SeriesModel().solve(PAPER_MAP, MATRIX, [PARTICLE])[0].modulus


def _of(result: Homogenised) -> tuple[float, None, int]:
    return result.modulus, None, result.unknowns


def prism(
    mesh_size: float, layers: int, *, interface: str = "conforming", solver: str = "theta"
) -> Way:
    """The product-space model."""
    from alphacut.rve.prism.model import PrismModel

    model = PrismModel(mesh_size=mesh_size, layers=layers, interface=interface, solver=solver)
    return lambda: _of(model.solve(PAPER_MAP, MATRIX, [PARTICLE])[0])


def slices(order: int, mesh_size: float, points: int) -> Way:
    """Planar cells at Gauss nodes, without the extra ones that only estimate the error."""
    from alphacut.rve.slices.curve import curve_of
    from alphacut.rve.slices.model import solve_slice
    from alphacut.rve.slices.theta_rule import theta_rule

    def run() -> tuple[float, None, int]:
        rule = theta_rule(PAPER_MAP, points=points)
        cells = [
            solve_slice(float(r), MATRIX, [PARTICLE], orders=(order,), mesh_size=mesh_size)
            for r in PAPER_MAP(rule.nodes)
        ]
        curve = curve_of(rule, np.array([cell.stiffness[0] for cell in cells]))
        return effective_modulus(*curve.mean)[0], None, max(cell.unknowns for cell in cells)

    return run


def table_built(accuracy: float) -> Way:
    """A table made for this map and modulus."""
    from alphacut.rve.table.build import build_table
    from alphacut.rve.table.interpolant import TableRange

    def run() -> tuple[float, None, int]:
        span = TableRange(
            MATRIX, PARTICLE.poisson, (0.13, 0.87), (PARTICLE.modulus, PARTICLE.modulus)
        )
        table = build_table(span, accuracy=accuracy)
        return _table_modulus(table), None, table.unknowns

    return run


def table_reused(accuracy: float) -> Way:
    """A further map by a table that is there."""
    from alphacut.rve.table.build import build_table
    from alphacut.rve.table.interpolant import Table, TableRange

    span = TableRange(MATRIX, PARTICLE.poisson, (0.13, 0.87), (PARTICLE.modulus, PARTICLE.modulus))
    built: list[Table] = []

    def run() -> tuple[float, float, int]:
        if not built:
            built.append(build_table(span, accuracy=accuracy))
        started = process_time()
        return _table_modulus(built[0]), process_time() - started, 0

    return run


def _table_modulus(table: object) -> float:
    from alphacut.rve.table.interpolant import Table

    from alphacut.rve.slices.theta_rule import settle_rule

    assert isinstance(table, Table)
    moduli = np.array([PARTICLE.modulus])
    curves, *_ = settle_rule(
        PAPER_MAP, lambda radii: table.stiffness(radii, moduli), points=None, accuracy=1e-10
    )
    return effective_modulus(*curves[0].mean)[0]


def series(points: int) -> Way:
    """The series at so many nodes, converged at each."""
    from alphacut.rve.series.stiffness import square_stiffness
    from alphacut.rve.slices.curve import curve_of
    from alphacut.rve.slices.theta_rule import theta_rule

    def run() -> tuple[float, None, int]:
        rule = theta_rule(PAPER_MAP, points=points)
        cells = square_stiffness(PAPER_MAP(rule.nodes), MATRIX, [PARTICLE])
        return (
            effective_modulus(*curve_of(rule, cells.matrix[:, 0]).mean)[0],
            None,
            int(cells.harmonics.max()),
        )

    return run


def monte_carlo(samples: int) -> Way:
    """Mean over θ by sampling: root mean square error of 20 seeds, and time.

    Each cell is as cheap as a planar cell can be; the sampling error hides its discretisation.
    """
    from alphacut.rve.series.stiffness import square_stiffness
    from alphacut.rve.slices.model import solve_slice

    def run() -> tuple[float, float, int]:
        law, squares, exact = PAPER_MAP.distribution, [], exact_modulus()
        for seed in range(20):
            radii = PAPER_MAP(law.quantile(np.random.default_rng(seed).uniform(size=samples)))
            cells = square_stiffness(radii, MATRIX, [PARTICLE], tolerance=1e-6)
            modulus = effective_modulus(
                0.01 * float(cells.bulk.mean()), 0.02 * float(cells.shear.mean())
            )[0]
            squares.append((modulus / exact - 1) ** 2)
        started = process_time()
        timed = [
            solve_slice(r, MATRIX, [PARTICLE], orders=(2,), mesh_size=0.5) for r in (0.3, 0.5, 0.7)
        ]
        seconds = (process_time() - started) / len(timed) * samples
        return exact * (1 + float(np.sqrt(np.mean(squares)))), seconds, timed[0].unknowns

    return run


def mpc(order: int, mesh_size: float, points: int) -> Way:
    """dolfinx_mpc on the same planar cells."""
    from benchmarks.rve.mpc import mpc_modulus

    return lambda: mpc_modulus(
        PAPER_MAP, MATRIX, PARTICLE, order=order, mesh_size=mesh_size, points=points
    )


def auto(tolerance: float, *, exclude: tuple[str, ...] = ()) -> Way:
    """Whatever `auto` takes."""
    from alphacut.rve.auto.model import AutoModel

    model = AutoModel(tolerance, exclude=exclude)
    return lambda: _of(model.solve(PAPER_MAP, MATRIX, [PARTICLE])[0])


def families(*, small: bool = False) -> list[Family]:
    """All families, every one from coarse to fine; two short ones if `small`."""
    if small:
        return [
            ("series", [(f"{n} nodes", series(n)) for n in (3, 5)]),
            ("slices, order 2", [("h 0.6", slices(2, 0.6, 3))]),
        ]
    return [
        ("auto", [(f"tolerance {t:g}", auto(t)) for t in (1e-2, 1e-4, 1e-6, 1e-8)]),
        ("series", [(f"{n} nodes in θ", series(n)) for n in (2, 3, 4, 5, 6, 8, 10, 12)]),
        ("table, kept", [(f"accuracy {a:g}", table_reused(a)) for a in ACCURACIES]),
        ("table, made", [(f"accuracy {a:g}", table_built(a)) for a in ACCURACIES]),
        *(planar_family(f"slices, order {p}", partial(slices, p)) for p in (2, 3, 4)),
        *(planar_family(f"dolfinx_mpc, order {p}", partial(mpc, p)) for p in (2, 3)),
        prism_family("prism", PRISMS),
        prism_family("prism, MUMPS", PRISMS[:5], solver="mumps"),
        prism_family("prism, CG + GAMG", PRISMS[:4], solver="gamg"),
        prism_family(
            "prism, interface ignored",
            [(h, 12) for h in (0.3, 0.15, 0.1, 0.07, 0.05)],
            interface="sign",
        ),
        ("Monte Carlo over θ", [(f"{n} samples", monte_carlo(n)) for n in (10, 100, 1000, 10_000)]),
    ]


def planar_family(name: str, way: Callable[[float, int], Way]) -> Family:
    """Planar solves at nodes of θ, both refined together."""
    return name, [(f"h {h:g}, {n} nodes in θ", way(h, n)) for h, n in PLANAR]


def prism_family(name: str, meshes: Sequence[tuple[float, int]], **options: str) -> Family:
    """Prisms refined in the plane and in θ."""
    return name, [(f"h {h:g}, {n} layers", prism(h, n, **options)) for h, n in meshes]


def measure(family: Family, *, exact: float, cap: float) -> Iterator[Run]:
    """Run one family up to `cap` seconds a run."""
    name, ways = family
    last, stopped = 0.0, False
    ways[0][1]()  # compilation and first imports are not what is compared
    for setting, way in ways:
        stopped = stopped or 5 * last > cap
        if stopped:
            yield Run(name, setting, float("nan"), cap, capped=True)
            continue
        modulus, last, unknowns = _timed(way)
        yield Run(name, setting, max(abs(modulus / exact - 1), 1e-16), last, unknowns)


def _timed(way: Way) -> tuple[float, float, int]:
    """E, the least processor time of a few calls when they are short, and the unknowns."""
    times = []
    for _ in range(5):
        started = process_time()
        modulus, own, unknowns = way()
        times.append(process_time() - started if own is None else own)
        if times[-1] > 0.2:
            break
    return modulus, min(times), unknowns
