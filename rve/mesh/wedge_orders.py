"""Orders of the nodes of a quadratic wedge in other programs, from that of Basix."""

MESHIO_ORDER = [0, 1, 2, 3, 4, 5, 6, 9, 7, 12, 14, 13, 8, 10, 11]
"""Of meshio, Abaqus and Gmsh: edges of the lower triangle, of the upper, and vertical ones."""
VTK_OF_MESHIO = [0, 2, 1, 3, 5, 4, 8, 7, 6, 11, 10, 9, 12, 14, 13]
"""From meshio's order to that of VTK, whose lower triangle is seen from outside."""
VTK_ORDER = [MESHIO_ORDER[k] for k in VTK_OF_MESHIO]
