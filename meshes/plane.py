"""Parts of the scripts here: a square with circles in Gmsh, extruded along θ into prisms."""

from __future__ import annotations

from pathlib import Path

import gmsh
import numpy as np

FOLDER = Path(__file__).parent


def start() -> None:
    """Start Gmsh, quiet."""
    gmsh.initialize(["", "-v", "1"], readConfigFiles=False, interruptible=False)
    gmsh.option.setNumber("General.NumThreads", 1)


def square(size: float, *, matching: bool = True) -> int:
    """Curve loop of the square [−1, 1]²; opposite sides match unless told otherwise."""
    geo = gmsh.model.geo
    places = ((-1, -1), (1, -1), (1, 1), (-1, 1))
    corners = [geo.addPoint(x, y, 0, size) for x, y in places]
    sides = [geo.addLine(corners[k], corners[(k + 1) % 4]) for k in range(4)]
    geo.synchronize()
    if not matching:
        geo.mesh.setTransfiniteCurve(sides[1], 2 + round(2 / size))
        geo.mesh.setTransfiniteCurve(sides[3], 3 + round(2 / size))
        return geo.addCurveLoop(sides)
    for first, second, axis in ((sides[3], sides[1], 0), (sides[0], sides[2], 1)):
        shift = np.eye(4)
        shift[axis, 3] = 2
        gmsh.model.mesh.setPeriodic(1, [second], [first], shift.ravel().tolist())
    return geo.addCurveLoop(sides)


def circle(x: float, y: float, radius: float, size: float) -> int:
    """Curve loop of a circle."""
    geo = gmsh.model.geo
    centre = geo.addPoint(x, y, 0, size)
    steps = ((1, 0), (0, 1), (-1, 0), (0, -1))
    poles = [geo.addPoint(x + radius * a, y + radius * b, 0, size) for a, b in steps]
    arcs = [geo.addCircleArc(poles[k], centre, poles[(k + 1) % 4]) for k in range(4)]
    return geo.addCurveLoop(arcs)


def surface(outside: int, *holes: int) -> int:
    """Surface inside a loop without its holes."""
    return gmsh.model.geo.addPlaneSurface([outside, *holes])


def extrude(phases: dict[str, list[int]], name: str, layers: int = 3) -> None:
    """Extrude named surfaces over θ from −3 to 3 and write the file."""
    geo = gmsh.model.geo
    every = [(tag, phase) for phase, tags in phases.items() for tag in tags]
    geo.translate([(2, tag) for tag, _ in every], 0, 0, -3)
    made = geo.extrude(
        [(2, tag) for tag, _ in every], 0, 0, 6, numElements=[layers], recombine=True
    )
    geo.synchronize()
    volumes = [tag for dimension, tag in made if dimension == 3]
    for phase in phases:
        own = [volume for volume, (_, name) in zip(volumes, every, strict=True) if name == phase]
        gmsh.model.addPhysicalGroup(3, own, name=phase)
    gmsh.option.setNumber("Mesh.ElementOrder", 2)
    gmsh.option.setNumber("Mesh.SecondOrderIncomplete", 1)
    gmsh.option.setNumber("Mesh.Binary", 1)
    gmsh.model.mesh.generate(3)
    gmsh.write(str(FOLDER / name))
    gmsh.finalize()
