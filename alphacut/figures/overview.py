"""The paper's own figures: domains (1), stages (2), prism mesh (15), fuzzy numbers (36, 37)."""

from __future__ import annotations

from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.collections import PolyCollection
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.patches import FancyBboxPatch
from mpl_toolkits.mplot3d.art3d import Poly3DCollection  # type: ignore[import-untyped]

from alphacut.base.arrays import Array, Ints, Mask
from alphacut.base.number_text import axis_prefix
from alphacut.figures import style
from alphacut.figures.style import BLUE, INK, ORANGE, PURPLE, Look
from alphacut.fuzzy import Crisp, FuzzyNumber, Interval, Trapezoidal
from alphacut.rve.cell.cell import Cell
from alphacut.rve.mesh.columns import extrude
from alphacut.rve.mesh.prism_grid import PrismGrid, reference_radius
from alphacut.stages.summary import Results

MATRIX, PARTICLE = "#f6d9b8", "#b79ad9"
CUT_MATRIX = "#f0a860"  # of the matrix that is cut open
LIGHT = np.array([0.2, -0.5, 0.84])  # direction of the light on the mesh, a unit vector
BOX_WIDTH, PITCH = 2.4, 3.3  # width of a stage's box in Fig. 2, and distance of the boxes


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
    plane.set(xlim=(-1, 1), ylim=(-1, 1), aspect="equal", xlabel="x$_1$/a", ylabel="x$_2$/a")
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
    radius = reference_radius(cell.radius_map, cell.outline)
    grid = extrude(size=size, radius=radius, layers=layers, outline=cell.outline)
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
    for on_side in (plane[:, 1] <= -1 + 1e-9, plane[:, 0] >= 1 - 1e-9):
        axes.add_collection3d(Poly3DCollection(faces_on(on_side), **thin))
    bottom = levels[0][triangles[~grid.plane.inside]]
    axes.add_collection3d(Poly3DCollection(bottom, facecolor=MATRIX, ec=INK, lw=0.15))
    axes.set(xlabel="x$_1$/a", ylabel="x$_2$/a", zlabel="θ", xticks=[-1, 0, 1], yticks=[-1, 0, 1])
    axes.set(xlim=(-1, 1), ylim=(-1, 1), zlim=(levels[0, 0, 2], levels[-1, 0, 2]))
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
    axes.set(xlim=(-1, 1), ylim=(-1, 1), zlim=(levels[0, 0, 2], levels[-1, 0, 2]))
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
    boxes = boxes_of(results)
    figure, axes = plt.subplots(figsize=(2.9 * len(boxes), 1.9))
    box: Look = {"boxstyle": "round,pad=0.02", "facecolor": "#dbe9f4", "edgecolor": INK, "lw": 1}
    centred: Look = {"ha": "center", "va": "top"}
    for number, (title, lines, words) in enumerate(boxes):
        left, middle = PITCH * number, PITCH * number + BOX_WIDTH / 2
        axes.add_patch(FancyBboxPatch((left, 0), BOX_WIDTH, 1.5, **box))
        axes.text(middle, 1.4, title, weight="bold", size=10, **centred)
        axes.text(middle, 1.1, "\n".join(lines), size=8, **centred)
        if number + 1 == len(boxes):
            break
        start, end = left + BOX_WIDTH, left + PITCH
        arrow = {"arrowstyle": "-|>", "color": ORANGE}
        axes.annotate("", (end, 0.75), (start, 0.75), arrowprops=arrow)
        axes.text((start + end) / 2, 0.85, words, ha="center", size=9, color=ORANGE)
    axes.set(xlim=(-0.1, PITCH * len(boxes) - PITCH + BOX_WIDTH + 0.1), ylim=(-0.1, 1.6))
    axes.axis("off")
    return figure


def boxes_of(results: Results) -> list[tuple[str, list[str], str]]:
    """Title and lines of each box, one a stage of the run, and what it hands to the next."""
    content, modulus, boxes = results.content, results.modulus, list[tuple[str, list[str], str]]()
    if content.radius is not None and modulus is not None:
        numbers = getattr(content.radius, "numbers", {})
        values = {name: sorted({x.nominal, *x.support}) for name, x in numbers.items()}
        lines = [f"{k} = [{', '.join(f'{x:.4g}' for x in ends)}]" for k, ends in values.items()]
        boxes.append(("radius of the particle", lines, "r(θ)"))
    if modulus is not None:
        low, high = modulus.numbers.E_GPa[0]
        lines = [f"method {modulus.numbers.method}", f"{modulus.numbers.samples} samples"]
        lines += [f"E = {low:.5g} … {high:.5g} GPa"]
        boxes.append(("cell on the product domain", lines, "fuzzy E"))
    if results.structure is not None:
        fuzzy = ", ".join(dict.fromkeys(name for task in results.tasks for name in task.fuzzy))
        lines = [f"fuzzy: {fuzzy}", f"outputs: {', '.join(results.structure.outputs[:4])}"]
        boxes.append(("structure", lines, "flow q(t; p)"))
        studies = [f"{x.name}: {', '.join(x.fuzzy)} for {x.duration:g} s" for x in results.tasks]
        lines = [f"by {results.tasks[0].section.method}", *studies[:5]]
        boxes.append(("envelopes", lines, "bounds"))
    return boxes


CUTS = 6  # levels in Fig. 37


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
    for level in np.linspace(0, 1, CUTS):
        cut = number.cut(float(level))
        axes.plot(cut, [level, level], color=ORANGE, lw=2.5, marker="o", ms=4)
        ends = f": {factor * cut.lower:.4g} … {factor * cut.upper:.4g} {unit}" if cut.width else ""
        axes.annotate(f"α = {level:.1f}{ends}", (cut.upper, level), **beside)
    axes.set_xlim(right=number.support.upper + 0.35 * number.support.width)
    style.membership_axes(axes, "")
    axes.set_ylim(-0.06, 1.06)
    style.prefix_axis(axes, "fuzzy Young's modulus of the particle E$_i$", "Pa", across=True)
    return figure
