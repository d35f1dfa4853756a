"""A particle in a ring of a third material, straight along θ: ``./enter python meshes/ring.py``."""

import plane

SIZE = 0.25
plane.start()
inner, outer = plane.circle(0, 0, 0.5, SIZE), plane.circle(0, 0, 0.6, SIZE)
phases = {
    "matrix": [plane.surface(plane.square(SIZE), outer)],
    "ring": [plane.surface(outer, inner)],
    "particle": [plane.surface(inner)],
}
plane.extrude(phases, "ring.msh")
