"""Figures of the paper that no other case needs: 1, 2, 13 to 17, 19 to 27, 36 and 37.

    ./enter python cases/paper_figures.py [CASE] [--out FOLDER] [--workers N]

The stages of the case, cases/paper.toml unless named, are taken from the folder of their results,
or computed. Figures are drawn beside those of `run`, as far as the case has what they show; of
cases/pendulum.toml these are 20 and 21 to 25. `make run` of the paper's cases calls this program.
"""

from __future__ import annotations

import argparse
import itertools
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import xarray
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import FancyBboxPatch
from mpl_toolkits.mplot3d.art3d import Poly3DCollection  # type: ignore[import-untyped]

from alphacut.base.arrays import Array, Ints, Mask
from alphacut.base.number_text import axis_prefix
from alphacut.case.material import RadiusMapSection
from alphacut.case.structure import Structure
from alphacut.commands.pipeline import Pipeline, open_results
from alphacut.figures import style
from alphacut.figures.envelope import time_axes
from alphacut.figures.style import BLUE, GREY, INK, ORANGE, PURPLE, Look, prefix_axis
from alphacut.frame.boxes import UnitFlow, boxes
from alphacut.frame.dynamics.nonlinear import make_flow
from alphacut.frame.methods.graph_follower import FollowedSteps, GraphFollower
from alphacut.frame.structures.quantities import Output
from alphacut.fuzzy import Crisp, FuzzyNumber, Interval, PiecewiseLinear, Trapezoidal
from alphacut.io.provenance import NESTED
from alphacut.rve.cell.cell import Cell
from alphacut.rve.cell.lattice import SQUARE, Lattice, lattice_of
from alphacut.rve.mesh.columns import extrude
from alphacut.rve.mesh.prism_grid import PrismGrid, reference_radius
from alphacut.stages.cell import GPA, CellProblem
from alphacut.stages.envelope import EnvelopeTask
from alphacut.stages.modulus import ModulusResult
from alphacut.stages.store import Stage, StageContext, StageResult, StageStore
from alphacut.stages.summary import Parts, Results
from alphacut.stochastic import HermiteMap


def main(arguments: Sequence[str] | None = None) -> None:
    """Draw the figures of a case into the folder of its results, and print their paths."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("case", nargs="?", default="cases/paper.toml", metavar="CASE")
    parser.add_argument("--out", metavar="FOLDER", help="results of the case (results/CASE)")
    parser.add_argument("--workers", type=int, default=1, metavar="N")
    options = parser.parse_args(arguments, argparse.Namespace(set=[], petsc={}, quiet=False))
    folder = options.out or f"results/{Path(options.case).stem}"
    with open_results(options, folder) as (case, store):
        results = Pipeline(Results(case.content), store, figures=False).run()
        for name in draw_figures(results, store):
            print(Path(folder, name))


def draw_figures(results: Results, store: StageStore) -> list[str]:
    """Draw all figures anew where what they show is new; return their paths in the folder."""

    def compute(context: StageContext) -> StageResult[list[str]]:
        assert context.folder is not None
        paths = list[Path]()
        with style.figure_style():
            for name, figure in drawings(results):
                paths += style.save(figure, context.folder / "figures" / name)
        return StageResult([path.relative_to(context.folder).as_posix() for path in paths])

    inputs = [results.content, sorted(results.fingerprints.values()), Path(__file__).read_text()]
    stage = Stage("paper_figures", inputs, (*NESTED, "alphacut"), list[str], compute)
    return store.take(stage).numbers


def drawings(results: Results) -> Iterator[tuple[str, Figure]]:
    """Yield the name and the drawing of each figure that the results allow."""
    content, modulus = results.content, results.modulus
    if content.radius_map is not None:
        yield "fig13-p-box", p_box(content.radius_map)
        section = content.particle_cell
        lattice = SQUARE if section is None else lattice_of(section.lattice)
        yield "fig14-cone", cone(content.radius_map, lattice)
    if modulus is not None:
        if content.particle_cell is not None and content.modulus.method == "prism":
            cell, mesh = CellProblem.of(content).nominal, content.mesh
            yield "fig01-domains", domains(cell, mesh.size, mesh.layers)
            yield "fig15-prism-mesh", draw_mesh(cell, mesh.size, mesh.layers)
        yield "fig16-stress-curves", stress_curves(modulus.arrays)
        yield "fig17-mean-stress", mean_stress(modulus.arrays)
        yield "fig19-membership", membership(modulus.arrays)
        inclusion = getattr(content.cell, "inclusion_modulus", None)
        if isinstance(inclusion, FuzzyNumber):
            effective = fuzzy_modulus_of(modulus.numbers)
            yield "fig36-fuzzy-numbers", kinds_of_numbers(inclusion, effective)
            yield "fig37-alpha-cuts", alpha_cuts(inclusion)
    if not results.envelopes or results.structure is None:
        return
    yield "fig02-stages", stages(results)
    yield "fig20-mapping", mapping(results)
    if results.structure.model.floors:
        yield "fig26-frame", draw_frame(results.structure)
        yield "fig27-chain", draw_chain(results.structure)
    task = max(results.tasks, key=lambda task: len(task.fuzzy))
    if task.section.method == "graph-follower":
        yield "fig21-25-graph-follower", graph_follower_steps(results, task)


def fuzzy_modulus_of(numbers: ModulusResult) -> FuzzyNumber:
    """Return the cell's fuzzy Young's modulus in Pa, piecewise linear between its α-cuts."""
    lower = tuple(GPA * numbers.E_GPa.lower)
    upper = tuple(GPA * numbers.E_GPa.upper)
    return PiecewiseLinear(tuple(numbers.alpha), lower, upper)


MATRIX, PARTICLE = "#f6d9b8", "#b79ad9"
CUT_MATRIX = "#f0a860"  # of the matrix that is cut open
LIGHT = np.array([0.2, -0.5, 0.84])  # direction of the light on the mesh, a unit vector


def domains(cell: Cell, size: float, layers: int) -> Figure:
    """Fig. 1: physical, stochastic and product domain, from a mesh, `size` in half sides."""
    grid, levels = prism_mesh(cell, size, layers)
    figure = plt.figure(figsize=(11.0, 4.2))
    widths = figure.add_gridspec(1, 3, width_ratios=(1, 0.8, 1.2))
    plane, density = figure.add_subplot(widths[0]), figure.add_subplot(widths[1])
    middle = levels[layers // 2]
    corners = middle[grid.plane.triangles[:, :3], :2]
    for mask, colour in ((~grid.plane.inside, MATRIX), (grid.plane.inside, PARTICLE)):
        plane.add_collection(PolyCollection(list(corners[mask]), facecolor=colour, ec=INK, lw=0.25))
    right, top = cell.lattice.corners.max(axis=0)
    plane.set(xlim=(-right, right), ylim=(-top, top), aspect="equal")
    plane.set(xlabel="x$_1$/a", ylabel="x$_2$/a")
    plane.set_title(f"physical domain, θ = {middle[0, 2]:g}")
    plane.grid(visible=False)
    law, layer_ends = cell.radius_map.distribution, levels[:, 0, 2]
    theta = np.linspace(law.lower, law.upper, 300)
    density.plot(law.pdf(theta), theta, color=BLUE, lw=1.6)
    density.fill_betweenx(theta, 0, law.pdf(theta), color=BLUE, alpha=0.15, lw=0)
    density.hlines(layer_ends, 0, law.pdf(layer_ends), color=ORANGE, lw=0.9)
    title = f"stochastic domain, {layers} layers"
    density.set(xlabel="density $f_Θ$", ylabel="θ", xlim=0, title=title)
    _draw_prisms(figure.add_subplot(widths[2], projection="3d"), grid, levels)
    return figure


def prism_mesh(cell: Cell, size: float, layers: int) -> tuple[PrismGrid, Array]:
    """Mesh of the product domain, `size` in half sides, and its corners (levels of θ, nodes, 3)."""
    shape: Any = {"outline": cell.outline, "lattice": cell.lattice}
    radius = reference_radius(cell.radius_map, **shape)
    grid = extrude(size=size, radius=radius, layers=layers, **shape)
    points = grid.positions(cell.radius_map)
    # corner nodes come first, level by level of θ
    return grid, points[: (layers + 1) * len(grid.plane.points)].reshape(layers + 1, -1, 3)


def _draw_prisms(axes: Any, grid: PrismGrid, levels: Array) -> None:
    """Draws prisms on the particle's cone, two sides and the bottom, by corners (θ, nodes, 3)."""
    plane, triangles = grid.plane.points, grid.plane.triangles[:, :3]
    edges, _ = edges_of(triangles)

    def faces_on(nodes: Mask) -> Array:
        return layer_faces(levels, edges[nodes[edges].all(axis=1)])

    cone = faces_on(grid.plane.arc)  # over edges between nodes on the particle
    axes.add_collection3d(Poly3DCollection(cone, facecolor=PARTICLE, edgecolor=PURPLE, lw=0.3))
    thin = {"facecolor": (*to_rgb(MATRIX), 0.15), "edgecolor": (*to_rgb(INK), 0.35), "lw": 0.2}
    across = grid.plane.lattice.side_coordinates(plane)
    for on_side in (across[:, 1] <= -1 + 1e-9, across[:, 0] >= 1 - 1e-9):
        axes.add_collection3d(Poly3DCollection(faces_on(on_side), **thin))
    bottom = levels[0][triangles[~grid.plane.inside]]
    axes.add_collection3d(Poly3DCollection(bottom, facecolor=MATRIX, ec=INK, lw=0.15))
    axes.set(xlabel="x$_1$/a", ylabel="x$_2$/a", zlabel="θ", xticks=[-1, 0, 1], yticks=[-1, 0, 1])
    right, top = grid.plane.lattice.corners.max(axis=0)
    axes.set(xlim=(-right, right), ylim=(-top, top), zlim=(levels[0, 0, 2], levels[-1, 0, 2]))
    axes.set_box_aspect((1, 1, 1.2), zoom=0.85)
    axes.view_init(elev=25, azim=-55)
    axes.set_title(f"product domain, {len(grid.cells):,} prisms")


def draw_mesh(cell: Cell, size: float, layers: int) -> Figure:
    """Fig. 15: the prism mesh, its matrix cut open, `size` in half sides."""
    grid, levels = prism_mesh(cell, size, layers)
    figure = plt.figure(figsize=(6.0, 6.5))
    axes: Any = figure.add_subplot(projection="3d")
    triangles, is_particle = grid.plane.triangles[:, :3], grid.plane.inside
    x, y = grid.plane.points[triangles].mean(axis=1).T[:2]
    polygons, fills = list[Array](), list[Array]()
    for shown, colour in (
        (~is_particle & ~((x > 0) & (y < 0)), CUT_MATRIX),
        (is_particle, PARTICLE),
    ):
        edges, count = edges_of(triangles[shown])
        for faces in (layer_faces(levels, edges[count == 1]), levels[-1][triangles[shown]]):
            normals = np.cross(faces[:, 1] - faces[:, 0], faces[:, 2] - faces[:, 0])
            cosines = np.abs(normals @ LIGHT) / np.linalg.norm(normals, axis=1)
            polygons += [*faces]
            fills += [*np.outer(0.7 + 0.3 * cosines, to_rgb(colour))]
    # one collection, so that farther polygons are drawn first whatever their phase
    look: Look = {"edgecolors": "#54402c", "lw": 0.4}
    axes.add_collection3d(Poly3DCollection(polygons, facecolors=fills, **look))
    right, top = grid.plane.lattice.corners.max(axis=0)
    axes.set(xlim=(-right, right), ylim=(-top, top), zlim=(levels[0, 0, 2], levels[-1, 0, 2]))
    axes.set_box_aspect((1, 1, 1.6), zoom=1.0)
    axes.view_init(elev=25, azim=-55)
    axes.axis("off")
    return figure


def edges_of(triangles: Ints) -> tuple[Ints, Ints]:
    """Edges of triangles (n, 3), each once by its nodes, (edges, 2), and how many share each."""
    pairs = np.concatenate([triangles[:, [0, 1]], triangles[:, [0, 2]], triangles[:, [1, 2]]])
    edges, count = np.unique(np.sort(pairs, axis=1), axis=0, return_counts=True)
    return edges, count


def layer_faces(levels: Array, edges: Ints) -> Array:
    """Side faces (n, 4, 3) of prisms over edges (edges, 2), from corners (levels, nodes, 3)."""
    first, second = edges.T
    below, above = levels[:-1], levels[1:]
    faces = np.stack([below[:, first], below[:, second], above[:, second], above[:, first]], axis=2)
    return np.asarray(faces.reshape(-1, 4, 3))


def stages(results: Results) -> Figure:
    """Fig. 2: the stages of the run, with the data that each hands to the next."""
    width, pitch = 2.4, 3.3  # of a box, and distance of the left ends of two
    stage_boxes = boxes_of(results)
    figure, axes = plt.subplots(figsize=(2.9 * len(stage_boxes), 1.9))
    box: Look = {"boxstyle": "round,pad=0.02", "facecolor": "#dbe9f4", "edgecolor": INK, "lw": 1}
    centred: Look = {"ha": "center", "va": "top"}
    for number, (title, lines, words) in enumerate(stage_boxes):
        left, middle = pitch * number, pitch * number + width / 2
        axes.add_patch(FancyBboxPatch((left, 0), width, 1.5, **box))
        axes.text(middle, 1.4, title, weight="bold", size=10, **centred)
        axes.text(middle, 1.1, "\n".join(lines), size=8, **centred)
        if number + 1 == len(stage_boxes):
            break
        start, end = left + width, left + pitch
        arrow = {"arrowstyle": "-|>", "color": ORANGE}
        axes.annotate("", (end, 0.75), (start, 0.75), arrowprops=arrow)
        axes.text((start + end) / 2, 0.85, words, ha="center", size=9, color=ORANGE)
    axes.set(xlim=(-0.1, pitch * len(stage_boxes) - pitch + width + 0.1), ylim=(-0.1, 1.6))
    axes.axis("off")
    return figure


def boxes_of(results: Results) -> list[tuple[str, list[str], str]]:
    """Title and lines of each box, one a stage of the run, and what it hands to the next."""
    content, modulus = results.content, results.modulus
    found = list[tuple[str, list[str], str]]()
    if content.radius is not None and modulus is not None:
        numbers = getattr(content.radius, "numbers", {})
        values = {name: sorted({x.nominal, *x.support}) for name, x in numbers.items()}
        lines = [f"{k} = [{', '.join(f'{x:.4g}' for x in ends)}]" for k, ends in values.items()]
        found.append(("radius of the particle", lines, "r(θ)"))
    if modulus is not None:
        lower, upper = modulus.numbers.E_GPa
        lines = [f"method {modulus.numbers.method}", f"{modulus.numbers.samples} samples"]
        lines += [f"E = {lower[0]:.5g} … {upper[0]:.5g} GPa"]
        found.append(("cell on the product domain", lines, "fuzzy E"))
    if results.structure is not None:
        fuzzy = ", ".join(dict.fromkeys(name for task in results.tasks for name in task.fuzzy))
        lines = [f"fuzzy: {fuzzy}", f"outputs: {', '.join(results.structure.outputs[:4])}"]
        found.append(("structure", lines, "flow q(t; p)"))
        studies = [f"{x.name}: {', '.join(x.fuzzy)} for {x.duration:g} s" for x in results.tasks]
        lines = [f"by {results.tasks[0].section.method}", *studies[:5]]
        found.append(("envelopes", lines, "bounds"))
    return found


def kinds_of_numbers(given: FuzzyNumber, result: FuzzyNumber) -> Figure:
    """Fig. 36: five kinds of numbers: four of the particle's E in Pa, `given`, and the cell's E."""
    numbers: dict[str, FuzzyNumber] = {
        "crisp": Crisp(given.nominal),
        "interval": Interval(*given.cut(0.5)),
        "triangular": given,
        "trapezoidal": Trapezoidal(given.support.lower, *given.cut(0.75), given.support.upper),
        "piecewise linear": result,
    }
    figure, panels = plt.subplots(1, len(numbers), figsize=(11.0, 2.6), sharey=True)
    for axes, (name, number) in zip(panels, numbers.items(), strict=True):
        number.plot(axes, color=BLUE, lw=1.6)
        margin = 0.15 * (number.support.width or given.support.width)
        lower, upper = number.support
        axes.set(xlim=(lower - margin, upper + margin), ylim=(0, 1.08), title=name)
        source = "E" if number.nominal == result.nominal else "E$_i$"
        style.prefix_axis(axes, source, "Pa", across=True)
    panels[0].set_ylabel("membership μ")
    return figure


def alpha_cuts(number: FuzzyNumber) -> Figure:
    """Fig. 37: the particle's Young's modulus in Pa, a triangular number, in six α-cuts."""
    figure, axes = plt.subplots()
    number.plot(axes, color=INK, lw=1.4)
    factor, unit = axis_prefix(number.support.upper, "Pa")
    beside: Look = {"xytext": (8, 0), "textcoords": "offset points", "va": "center", "fontsize": 8}
    for level in np.linspace(0, 1, 6):
        cut = number.cut(float(level))
        axes.plot(cut, [level, level], color=ORANGE, lw=2.5, marker="o", ms=4)
        ends = f": {factor * cut.lower:.4g} … {factor * cut.upper:.4g} {unit}" if cut.width else ""
        axes.annotate(f"α = {level:.1f}{ends}", (cut.upper, level), **beside)
    axes.set_xlim(right=number.support.upper + 0.35 * number.support.width)
    style.membership_axes(axes, "")
    axes.set_ylim(-0.06, 1.06)
    style.prefix_axis(axes, "fuzzy Young's modulus of the particle E$_i$", "Pa", across=True)
    return figure


def distribution(radius: HermiteMap, at: Array) -> Array:
    """Probabilities P(r ≤ at) of the radius under the law of θ, in the shape of `at`."""
    law = radius.distribution
    theta = np.linspace(law.lower, law.upper, 4001)
    radii, mass = radius((theta[1:] + theta[:-1]) / 2), np.diff(law.cdf(theta))  # of each piece
    order = np.argsort(radii, kind="stable")  # the map need not rise
    cdf = np.cumsum(mass[order]) - mass[order] / 2
    return np.asarray(np.interp(at, radii[order], cdf, left=0.0, right=1.0))


def p_box(section: RadiusMapSection) -> Figure:
    """Fig. 13: p-box of the reduced radius, between the maps at the corners of the supports."""
    figure, axes = plt.subplots()
    corners = itertools.product(*(set(number.support) for number in section.numbers.values()))
    maps = [section.at(dict(zip(section.numbers, corner, strict=True))) for corner in corners]
    lowest, highest = np.array([radius.extremes() for radius in maps]).T
    at = np.asarray(np.linspace(lowest.min(), highest.max(), 600), float)
    family = np.array([distribution(radius, at) for radius in maps])
    ends, shade = (family.min(0), family.max(0)), "p-box, α = 0"
    axes.fill_between(at, *ends, color=PURPLE, alpha=0.15, lw=0, label=shade)
    axes.plot(at, np.transpose(ends), color=INK, lw=1)
    nominal = distribution(section.nominal, at)
    axes.plot(at, nominal, color=PURPLE, lw=1.8, label="nominal map")
    axes.set(xlabel="reduced radius r$_n$ = r/a", ylabel="cumulative distribution", ylim=(0, 1.02))
    axes.legend(loc="lower right")
    return figure


def cone(section: RadiusMapSection, lattice: Lattice = SQUARE) -> Figure:
    """Fig. 14: the particle in the product domain, of radius r(θ) at every θ."""
    figure = plt.figure(figsize=(5.0, 5.4))
    axes: Any = figure.add_subplot(projection="3d")
    radius = section.nominal
    theta, angle = np.linspace(*section.theta, 80)[:, None], np.linspace(0, 2 * np.pi, 80)
    x, y = radius(theta) * np.cos(angle), radius(theta) * np.sin(angle)
    axes.plot_surface(x, y, np.broadcast_to(theta, (80, 80)), color=PURPLE, alpha=0.65, lw=0)
    low, high = section.theta
    ring = np.concatenate([lattice.corners, lattice.corners[:1]]).T
    for level in np.linspace(low, high, 5):
        axes.plot(*ring, level, color=GREY, lw=0.8)
        x, y = radius(level) * np.cos(angle), radius(level) * np.sin(angle)
        axes.plot(x, y, level, color=INK, lw=0.8)
    for x, y in lattice.corners:
        axes.plot([x, x], [y, y], [low, high], color=GREY, lw=0.8)
    axes.set(xlabel="x$_1$/a", ylabel="x$_2$/a", zlabel="θ", xticks=[-1, 0, 1], yticks=[-1, 0, 1])
    axes.set_box_aspect((1, 1, 1.3), zoom=0.88)
    axes.view_init(elev=18, azim=-55)
    return figure


def levels_of_samples(dataset: xarray.Dataset) -> Array:
    """Membership of each sample: the highest level whose cuts hold all its inputs, (samples,)."""
    points, alpha = dataset["point"].values, dataset["alpha"].values
    extreme_points = dataset["E_at"].values  # (alpha, bound, parameter)
    low, high = extreme_points.min(axis=1), extreme_points.max(axis=1)  # (alpha, parameter)
    slack = 1e-9 * np.maximum(high[0] - low[0], 1e-300)
    levels = np.full(len(points), alpha[0])
    for level, lower, upper in zip(alpha, low, high, strict=True):
        levels[((points >= lower - slack) & (points <= upper + slack)).all(axis=1)] = level
    return levels


def stress_curves(dataset: xarray.Dataset) -> Figure:
    """Fig. 16: homogenised stress σ₁₁ over θ, one curve a sample, coloured by its membership."""
    figure, axes = plt.subplots()
    alpha = dataset["alpha"].values
    shades = dict(zip(alpha, [*style.colours(alpha)[:-1], INK], strict=True))
    membership = levels_of_samples(dataset)
    theta, stress_GPa = dataset["theta"].values, dataset["curve11"].values / GPA
    for sample in np.argsort(membership, kind="stable"):  # high memberships on top
        axes.plot(theta, stress_GPa[sample], color=shades[membership[sample]], lw=0.8)
    label = "homogenised σ$_{11}$(ε$^{(1)}$) (GPa)"
    axes.set(xlabel="θ", ylabel=label, title=f"{len(stress_GPa)} samples")
    style.alpha_legend(axes, alpha)
    return figure


def mean_stress(dataset: xarray.Dataset) -> Figure:
    """Fig. 17: mean homogenised stress σ₁₁ of each sample at its membership, and its α-cuts."""
    figure, axes = plt.subplots()
    means, levels = dataset["s11_sample"].values / GPA, levels_of_samples(dataset)
    axes.plot(means, levels, ".", color=ORANGE, ms=4, zorder=4, label="samples")
    style.shaded_cuts(axes, dataset["alpha"].values, *(dataset["s11"].values / GPA).T)
    style.membership_axes(axes, "mean homogenised σ$_{11}$(ε$^{(1)}$) (GPa)")
    axes.legend(loc="upper left")
    return figure


def membership(dataset: xarray.Dataset) -> Figure:
    """Fig. 19: membership function of a convex fuzzy parameter and one of its α-cuts."""
    shown_level = 0.5
    figure, axes = plt.subplots()
    alpha, (left, right) = dataset["alpha"].values, dataset["E"].values.T / GPA
    lower, upper = (float(np.interp(shown_level, alpha, side)) for side in (left, right))
    axes.plot(style.outline(left, right), style.outline(alpha, alpha), color=INK, lw=1.5)
    axes.plot([lower, upper], [shown_level] * 2, color=ORANGE, lw=3, solid_capstyle="butt")
    axes.vlines([lower, upper], 0, shown_level, color=ORANGE, lw=0.8, ls=":")
    words, spot = f"α-cut at {shown_level:g}: {lower:.2f} … {upper:.2f}", (lower + upper) / 2
    axes.annotate(words, (spot, shown_level + 0.03), ha="center", color=ORANGE)
    beside: style.Look = {"xytext": (8, -2), "textcoords": "offset points", "va": "center"}
    axes.annotate("core", ((left[-1] + right[-1]) / 2, 1.0), **beside)
    style.membership_axes(axes, "fuzzy parameter, here E (GPa)")
    return figure


def mapping(results: Results) -> Figure:
    """Fig. 20: 40 motions of random inputs in the lowest cut for 5 s, and their envelope."""
    task = next((x for x in results.tasks if len(x.fuzzy) > 1), results.tasks[0])
    dataset, structure = results.envelopes[task.name].arrays.isel(alpha=0), results.structure
    assert structure is not None
    names = [str(name) for name in dataset["output"].values]
    output = names[-1] if "q" in names[-1] else names[0]  # the last one if it is a displacement
    inputs, step = structure.inputs(task.fuzzy), task.section.step
    end = round(min(5.0, task.duration) / step) * step
    flow = make_flow(structure.model, tuple(inputs), end, step, task.section.integrator)
    lower, upper = np.array([x.cut(float(dataset["alpha"])) for x in inputs.values()]).T
    points = np.random.default_rng(0).uniform(lower, upper, (40, len(inputs)))
    curves = flow.values(points)[:, :, list(flow.outputs).index(output)]
    figure, axes = plt.subplots()
    axes.plot(flow.time, curves.T, color=BLUE, lw=0.5, alpha=0.5)
    shown = dataset.sel(output=output).isel(time=slice(0, len(flow.time)))
    for side in ("lower", "upper"):
        axes.plot(flow.time, shown[side], color=INK, lw=1.3)
    unit = Parts.of(results).shown_units[output]
    time_axes(axes, flow.time, Output(output, structure.unit(output)), unit)
    level = f"α = {float(dataset['alpha']):g}"
    axes.set_title(f"{output} at {level}: {len(points)} random motions (blue) and their envelope")
    return figure


Point = tuple[float, float]
ARROW = {"arrowstyle": "-|>", "color": ORANGE}
PITCH = 1.6  # distance of the masses of the chain in Fig. 27; a mass is 1 wide


def draw_frame(structure: Structure) -> Figure:
    """Fig. 26: floors with mass m and displacement q, columns with length l or stiffness k."""
    masses, numbers = structure.floor_masses, structure.numbers
    # not to scale where only stiffnesses are given
    heights = [structure.heights.get(f"drift{z + 1}", Crisp(3.0)) for z in range(len(masses))]
    lengths = [height.nominal for height in heights]
    height, level = sum(lengths), 0.0  # of the frame, and of the floor below, in m
    span = 0.45 * max(height, 6.0) if len(lengths) < 5 else 0.3 * height
    inches = min(9.0, 1.4 + 0.5 * height, 2.31 * height / span)
    figure, axes = plt.subplots(figsize=(1.9 * inches * span / height, inches))
    draw_ground(axes, (-0.1 * span, 1.1 * span), (-0.03 * span, 0))
    for floor, (length, mass) in enumerate(zip(lengths, masses, strict=True), start=1):
        words = f"$l_{{{floor}}}$ = {length:.2f} m"
        if (stiffness := numbers.get(f"k{floor}")) is not None:
            words = f"$k_{{{floor}}}$ = {stiffness.nominal / 1e6:.4g} MN/m"
        for x in (0.0, span):
            axes.plot([x, x], [level, level + length], color=INK, lw=1.4)
        axes.annotate(words, (-0.06 * span, level + length / 2), ha="right", fontsize=8)
        level += length
        axes.plot([-0.03 * span, 1.03 * span], [level, level], color=INK, lw=6)
        above: Look = {"xytext": (0, 6), "textcoords": "offset points", "ha": "center"}
        words = f"$m_{{{floor}}}$ = {mass.nominal / 1000:g} t"
        axes.annotate(words, (span / 2, level), fontsize=8, **above)
        axes.annotate("", (1.32 * span, level), (1.08 * span, level), arrowprops=ARROW)
        axes.annotate(f"$q_{{{floor}}}$", (1.35 * span, level), va="center", color=ORANGE)
    set_to_scale(axes, (-0.6 * span, 1.55 * span), (-0.05 * height, 1.08 * height))
    return figure


def draw_chain(structure: Structure) -> Figure:
    """Fig. 27: the frame as a chain of masses and springs, with its dampers if it has any."""
    floors = structure.model.floors
    dampers = [structure.numbers[f"d{floor}"] for floor in range(1, floors + 1)]
    has_dampers = any(damper.support.upper > 0 for damper in dampers)
    placement = getattr(structure.model, "damper_placement", None) if has_dampers else None
    foot = -0.9 if placement == "ground" else -0.5
    right, width = PITCH * floors + 0.2, min(12.0, 2.2 + 1.5 * floors)  # of the axes, in inches
    height = 2.15 * width / (PITCH * floors + 0.5) + 0.1
    figure, axes = plt.subplots(figsize=(width, height))
    draw_ground(axes, (-0.12, 0), (foot, 0.75))
    if placement == "ground":
        draw_ground(axes, (-0.12, right), (foot - 0.12, foot))
    for floor in range(1, floors + 1):
        draw_storey(axes, floor, placement)
    set_to_scale(axes, (-0.2, right + 0.1), (foot - 0.2, 1.05))
    return figure


def draw_storey(axes: Axes, floor: int, placement: str | None) -> None:
    """Draws a floor's mass m, spring k, displacement q and damper d to "ground" or "storey"."""
    right = PITCH * floor
    left, start = right - 1.0, max(0.0, right - PITCH)
    middle, half = (left + right) / 2, (start + left) / 2
    inner = np.linspace(start + 0.15 * (left - start), left - 0.15 * (left - start), 10)
    zigzag = 0.2 + 0.1 * np.array([0, 1, -1, 1, -1, 1, -1, 1, -1, 0])
    axes.plot([start, *inner, left], [0.2, *zigzag, 0.2], color=BLUE, lw=1.2)
    axes.annotate(f"$k_{{{floor}}}$", (half, 0.36), ha="center", fontsize=9)
    box: Look = {"facecolor": "#dbe9f4", "edgecolor": INK, "lw": 1}
    axes.fill_between([left, right], [-0.3] * 2, [0.6] * 2, **box)
    axes.annotate(f"$m_{{{floor}}}$", (middle, 0.15), ha="center", va="center")
    axes.annotate("", (right + 0.12, 0.85), (left + 0.4, 0.85), arrowprops=ARROW)
    axes.annotate(f"$q_{{{floor}}}$", (left + 0.25, 0.85), ha="center", va="center", color=ORANGE)
    if placement == "ground":
        draw_damper(axes, (middle, -0.3), (middle, -0.9))
        axes.annotate(f"$d_{{{floor}}}$", (middle + 0.16, -0.6), va="center", fontsize=9)
    elif placement == "storey":
        draw_damper(axes, (start, -0.1), (left, -0.1))
        axes.annotate(f"$d_{{{floor}}}$", (half, -0.3), ha="center", va="top", fontsize=9)


def set_to_scale(axes: Axes, across: Point, up: Point) -> None:
    """Sets the limits of axes to scale, and hides their lines and ticks."""
    axes.set(xlim=across, ylim=up, aspect="equal")
    axes.axis("off")


def draw_ground(axes: Axes, across: Point, up: Point) -> None:
    """Draws a rectangle that stands for the ground."""
    axes.fill_between(across, *up, hatch="////", facecolor="white", edgecolor=GREY, lw=0)


def draw_damper(axes: Axes, start: Point, end: Point) -> None:
    """Draws a dashpot between two points on a horizontal or vertical line."""
    a, b = np.array(start), np.array(end)
    along = b - a
    across = 0.09 * np.array([-along[1], along[0]]) / np.hypot(*along)
    bottom, rim, piston = a + 0.4 * along, a + 0.68 * along, a + 0.55 * along
    cylinder = [rim + across, bottom + across, bottom - across, rim - across]
    head = [piston + 0.8 * across, piston - 0.8 * across]
    for points in ([a, bottom], cylinder, head, [piston, b]):
        axes.plot(*np.array(points).T, color=INK, lw=1)


DURATION = 5.0  # s
TITLES = (
    "initial guess, the nominal trajectory",
    "optimum of the Taylor model, new trajectories",
    "at a later node the best stored one is the guess",
    "bounds left by the sweep, and the best of all",
    "the discrete fuzzy mapping",
)
STORED: Look = {"color": GREY, "lw": 0.5}
GUESS, NEW, ENVELOPE = ({"color": colour, "lw": 1.3} for colour in (BLUE, ORANGE, INK))
NODE: Look = {"color": INK, "lw": 0.8, "ls": ":"}
LINES: dict[str, Look] = {
    "stored trajectory": STORED,
    "new trajectory": NEW,
    "guess, or bound left by the sweep": GUESS,
    "envelope": ENVELOPE,
    "node that is treated": NODE,
}


def graph_follower_steps(results: Results, task: EnvelopeTask) -> Figure:
    """Figs. 21 to 25: five steps of the Graph Follower, for one output at the lowest level.

    A graph is the trajectory of one point of the inputs. At each node (of time) and side (lower,
    upper) the follower guesses the best stored graph, and may compute a new one.
    """
    run, column = followed_run(results, task)
    assert run.storage is not None
    flow, points = run.storage.flow, run.storage.points
    time, graphs = flow.time, flow.values(points)[..., column]  # (T,), (graphs, T)
    guess, new = run.guess[0, :, column], run.new[0, :, column]  # graphs by (node, side); −1: none
    computed = np.argwhere(new >= 0)  # (node, side) of each new graph
    first_node = computed[0, 0]
    first_graphs = new[first_node][new[first_node] >= 0]
    late = computed[(computed[:, 0] > 0.5 * len(time)) & (guess[*computed.T] > 0)]
    node, side = late[0] if len(late) else computed[-1]
    # what the sweep knew at each node: the guess, and the new graph if there is one
    nodes = np.arange(len(time))[:, None]
    swept = np.stack([graphs[guess, nodes], graphs[np.where(new < 0, guess, new), nodes]])
    bounds = np.stack([swept[..., 0].min(0), swept[..., 1].max(0)])
    envelope = np.stack([graphs.min(0), graphs.max(0)])
    figure, mosaic = plt.subplot_mosaic("12;34;55", figsize=(8.4, 8.4), sharex=True, sharey=True)
    panels = [mosaic[letter] for letter in "12345"]
    drawn: list[tuple[int, Array, Look]] = [
        (0, graphs[:1], GUESS),
        (1, graphs[:1], STORED),
        (1, graphs[first_graphs], NEW),
        (2, graphs[: new[node, side]], STORED),
        (2, graphs[new[node, side]][None], NEW),
        (2, graphs[guess[node, side]][None], GUESS),
        (3, graphs, STORED),
        (3, bounds, GUESS),
        (3, envelope, ENVELOPE),
        (4, envelope, ENVELOPE),
    ]
    for panel, curves, look in drawn:
        panels[panel].plot(time, curves.T, **look)
    for panel, marked in enumerate((first_node, first_node, node)):
        panels[panel].axvline(time[marked], **NODE)
    panels[4].fill_between(time, *envelope, color=BLUE, alpha=0.2, lw=0)
    for number, (axes, title) in enumerate(zip(panels, TITLES, strict=True), start=1):
        label = f"Fig. {20 + number}" if task.figures else number
        axes.set_title(f"{label}: {title}", fontsize=9)
    panels[4].set_xlabel("time t (s)")
    output = flow.outputs[column]
    for axes in panels[::2]:
        prefix_axis(axes, output, Output(output).unit)
    lines = [Line2D([], [], label=words, **look) for words, look in LINES.items()]
    figure.legend(handles=lines, loc="outside lower center", ncols=3)
    return figure


def followed_run(results: Results, task: EnvelopeTask) -> tuple[FollowedSteps, int]:
    """Return the steps of a Graph Follower at α = 0, and the column of the highest displacement."""
    structure, step = results.structure, task.section.step
    assert structure is not None
    cuts, tolerance = boxes(structure.inputs(task.fuzzy), (0.0,)), task.tolerance(structure)
    steps = max(1, min(round(DURATION / step), round(task.duration / step)))
    motion = make_flow(structure.model, cuts.names, steps * step, step, "midpoint")
    flow = UnitFlow(motion, cuts, not tolerance.unit)
    column = max(0, len([name for name in flow.outputs if name.startswith("q")]) - 1)
    for refinement in (1.0, 1e-2, 1e-4, 1e-8):  # until a new graph is computed, to have one to show
        gain = refinement * task.section.gain * tolerance.value
        run = FollowedSteps()
        GraphFollower(tolerance=gain).run(flow, steps=run)
        if (run.new[0, :, column] >= 0).any():
            break
    return run, column


if __name__ == "__main__":
    main()
