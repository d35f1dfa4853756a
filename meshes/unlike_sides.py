"""Sides that do not match, to be refused: ``./enter python meshes/unlike_sides.py``."""

import plane

plane.start()
particle = plane.circle(0, 0, 0.5, 0.5)
phases = {
    "matrix": [plane.surface(plane.square(0.5, matching=False), particle)],
    "particle": [plane.surface(particle)],
}
plane.extrude(phases, "unlike-sides.msh", layers=2)
