"""Plane cell by six-node triangles in NumPy alone, to judge prisms that are straight along θ.

Fields that are quadratic in the plane and constant along θ are among those of the wedges, and are
their solution where nothing depends on θ. So both agree to the accuracy of the linear solver.
"""

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

SIX_POINTS = np.array(
    [
        [a, b]
        for c in (0.445948490915965, 0.091576213509771)
        for a, b in ((c, c), (c, 1 - 2 * c), (1 - 2 * c, c))
    ]
)
WEIGHTS = np.repeat([0.223381589678011, 0.109951743655322], 3) / 2


def gradients(x, y):
    """Derivatives of the shape functions at a point, vertices, then edges 01, 02, 12; (2, 6)."""
    z = 1 - x - y
    along_x = [1 - 4 * z, 4 * x - 1, 0, 4 * (z - x), -4 * y, 4 * y]
    along_y = [1 - 4 * z, 0, 4 * y - 1, -4 * x, 4 * (z - y), 4 * x]
    return np.array([along_x, along_y])


def strain_matrices(points, triangles):
    """B of each triangle at its quadrature points, (m, q, 3, 12), and areas of these, (m, q)."""
    reference = np.array([gradients(*point) for point in SIX_POINTS])
    jacobian = np.einsum("qdn,mnk->mqdk", reference, points[triangles])
    d = np.linalg.solve(jacobian, np.broadcast_to(reference, (len(triangles), *reference.shape)))
    b = np.zeros((*d.shape[:2], 3, 12))
    b[..., 0, 0::2], b[..., 1, 1::2] = d[:, :, 0], d[:, :, 1]
    b[..., 2, 0::2], b[..., 2, 1::2] = d[:, :, 1], d[:, :, 0]
    return b, np.linalg.det(jacobian) * WEIGHTS


def periodic_nodes(points):
    """The node that each node is one with, the corner −1, shape (n,)."""
    wrapped = np.round((points + 1) % 2 / 2, 7) % 1
    number = np.unique(wrapped, axis=0, return_inverse=True)[1].ravel()
    return np.where((wrapped == 0).all(axis=1), -1, number)


def plane_stiffness(points, triangles, stiffness):
    """Homogenised stiffness, (3, 3), for the stiffness of each triangle, (m, 3, 3)."""
    b, areas = strain_matrices(points, triangles)
    weighted = np.einsum("mq,mij,mqja->mqia", areas, stiffness, b)
    blocks = np.einsum("mqia,mqib->mab", b, weighted)
    forces = -weighted.sum(axis=1).transpose(0, 2, 1)
    node = periodic_nodes(points)[triangles]
    rows = np.stack([2 * node, 2 * node + 1], axis=-1).reshape(len(node), 12)
    rows = np.where(np.repeat(node, 2, axis=1) < 0, rows.max() + 1, rows)
    size = rows.max() + 1
    places = np.repeat(rows, 12, axis=1).ravel(), np.tile(rows, (1, 12)).ravel()
    whole = sp.csc_matrix((blocks.ravel(), places), (size, size))
    loads = np.stack(
        [np.bincount(rows.ravel(), f.ravel(), size) for f in np.moveaxis(forces, 2, 0)]
    )
    used = np.setdiff1d(np.unique(rows), [size - 1])
    answer = splu(whole[used][:, used]).solve(loads[:, used].T)
    uniform = np.einsum("mq,mij->ij", areas, stiffness)
    return (uniform - loads[:, used] @ answer) / 4
