"""Two particles of one material, straight along θ: ``./enter python meshes/two_particles.py``."""

import plane

SIZE = 0.12
plane.start()
first, second = plane.circle(-0.4, -0.45, 0.35, SIZE), plane.circle(0.45, 0.4, 0.40, SIZE)
matrix = plane.surface(plane.square(SIZE), first, second)
particles = [plane.surface(first), plane.surface(second)]
plane.extrude({"matrix": [matrix], "particles": particles}, "two-particles.msh", layers=1)
