"""The paper's cell with its cone, on a coarse mesh: ``./enter python meshes/paper_coarse.py``."""

from pathlib import Path

from alphacut.rve.mesh.columns import extrude
from alphacut.rve.mesh.file import write
from alphacut.stochastic import HermiteMap

grid = extrude(size=0.5, radius=0.5, layers=4)
points = grid.positions(HermiteMap(0.1337, 0.1, 0.8663, 0.1692))
path = Path(__file__).parent / "paper-coarse.msh"
write(path, points, grid.cells, grid.phase, grid.names)
