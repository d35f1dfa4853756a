"""The cell of a sphere by finite elements on one eighth of it: a check of the series.

Reflections turn the periodic cell into Dirichlet problems on [0, 1]³. Under axial strains each face
moves along its normal only by what the strain asks for; under ε12 the reflections at x1 and x2
change the load's sign, so that the tangential displacements are known there. The energy of the
solution is the modulus, from above, up to the geometry: curved tetrahedra of second order.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import gmsh
import numpy as np

from alphacut.fuzzy.arrays import Array, Rows
from alphacut.fuzzy.refused import FailedError, RefusedError
from alphacut.rve.cell.cell import HALVES, Phase, require_mesh_size
from alphacut.rve.fenicsx import MPI, PETSc, cholesky, compiled, fem, petsc, ufl
from alphacut.rve.interruption import uninterrupted

with uninterrupted():
    try:
        from dolfinx.io import gmsh as gmshio  # from 0.10 on
    except ImportError:
        from dolfinx.io import gmshio

CLOSEST = 0.97
SOUND = 0.1  # least scaled Jacobian of an element
MATRIX, SPHERE = 1, 2

Faces = Mapping[tuple[int, int], Mapping[int, float]]
"""Face (axis, side) → displacement components known there, and their value at unit strain."""

AXIAL: Faces = {(axis, side): {axis: float(side)} for axis in range(3) for side in (0, 1)}
SHEAR: Faces = {
    **{(0, side): {1: side / 2, 2: 0.0} for side in (0, 1)},
    **{(1, side): {0: side / 2, 2: 0.0} for side in (0, 1)},
    **{(2, side): {2: 0.0} for side in (0, 1)},
}
# faces, factors of the displacement components, and twice the energy over the modulus
LOADS: tuple[tuple[Faces, tuple[float, float, float], float], ...] = (
    (AXIAL, (1, 1, 1), 9.0),
    (AXIAL, (-1, -1, 2), 12.0),
    (SHEAR, (1, 1, 1), 1.0),
)
"""Of K, (C11 − C12)/2 and C44."""


@dataclass(frozen=True)
class Octant:
    """Quadratic elements on one eighth of the cell.

    Args:
        radius: Radius over half the cell's side, in (0, 0.97].
        size: Edge length in halves of the cell's side, in (0, 1].

    Raises:
        RefusedError: A value out of range.
    """

    radius: float
    size: float

    def __post_init__(self) -> None:
        require_mesh_size(self.size)
        if not 0 < self.radius <= CLOSEST:
            raise RefusedError("radius of the sphere", self.radius, f"up to {CLOSEST}, {HALVES}")

    def moduli(self, matrix: Phase, inclusion: Phase) -> Array:
        """K, (C11 − C12)/2 and C44 in Pa, shape (3,), from above.

        Raises:
            FailedError: Curved elements fold.
        """
        mesh, tags = octant(self.radius, self.size)[:2]
        space, constant = fem.functionspace(mesh, ("Lagrange", 2, (3,))), ("DG", 0)
        lame, shear = (fem.Function(fem.functionspace(mesh, constant)) for _ in range(2))
        for tag, phase in ((MATRIX, matrix), (SPHERE, inclusion)):
            bulk, own = (value / matrix.modulus for value in phase.bulk_and_shear)
            cells = tags.find(tag)
            lame.x.array[cells], shear.x.array[cells] = bulk - 2 / 3 * own, own
        u, v = ufl.TrialFunction(space), ufl.TestFunction(space)
        dx = ufl.Measure("dx", mesh, metadata={"quadrature_degree": 4})
        strain, other = (ufl.sym(ufl.grad(w)) for w in (u, v))
        form = (2 * shear * ufl.inner(strain, other) + lame * ufl.div(u) * ufl.div(v)) * dx
        stiffness = petsc.assemble_matrix(compiled(form))
        stiffness.assemble()
        energies = [_energy(stiffness, space, *load[:2]) / load[2] for load in LOADS]
        return matrix.modulus * np.array(energies)


def _energy(
    stiffness: PETSc.Mat, space: fem.FunctionSpace, faces: Faces, strain: tuple[float, float, float]
) -> float:
    """Twice the least energy with the displacements of the faces."""
    known = stiffness.createVecRight()
    dofs, values = _on_faces(space, faces, strain)
    known.setValues(dofs, values)
    known.assemble()
    right, reduced = stiffness.createVecLeft(), stiffness.copy()
    reduced.zeroRowsColumns(dofs, 1.0, known, right)
    cholesky(reduced, "octant_").solve(right, known)
    stiffness.mult(known, right)
    return float(known.dot(right))


def _on_faces(
    space: fem.FunctionSpace, faces: Faces, strain: tuple[float, float, float]
) -> tuple[Rows, Array]:
    """Numbers of the displacements known on faces, and their values; none twice."""
    places, values = [], []
    x = space.tabulate_dof_coordinates()
    for (axis, side), components in faces.items():
        nodes = np.flatnonzero(np.isclose(x[:, axis], side, atol=1e-9))
        for component, value in components.items():
            places.append(3 * nodes + component)
            values.append(np.full(nodes.size, value * strain[component]))
    dofs, first = np.unique(np.concatenate(places), return_index=True)
    return dofs.astype(PETSc.IntType), np.concatenate(values)[first]


def octant(radius: float, size: float) -> gmshio.MeshData:
    """Mesh of [0, 1]³ with the sphere about the origin, cell tags `MATRIX` and `SPHERE`.

    Raises:
        FailedError: Curved elements fold.
    """
    gmsh.initialize(["", "-v", "1"], readConfigFiles=False, interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        _generate(radius, size)
        elements = gmsh.model.mesh.getElements(3)[1][0]
        if min(gmsh.model.mesh.getElementQualities(elements, "minSJ")) < SOUND:
            what = f"curved elements fold at radius {radius:.6g} and mesh size {size:.3g}"
            raise FailedError(what, "take a finer mesh")
        return gmshio.model_to_mesh(gmsh.model, MPI.COMM_SELF, 0, gdim=3)
    finally:
        gmsh.finalize()


def _generate(radius: float, size: float) -> None:
    """Box and ball fragmented, meshed, and curved."""
    occ = gmsh.model.occ
    ball, box = occ.addSphere(0, 0, 0, radius), occ.addBox(0, 0, 0, 1, 1, 1)
    part = occ.intersect([(3, box)], [(3, ball)], removeObject=False)[0]
    occ.fragment([(3, box)], part)
    occ.synchronize()
    volumes = [tag for _, tag in gmsh.model.getEntities(3)]
    inner = min(volumes, key=lambda tag: float(occ.getCenterOfMass(3, tag)[0]))
    gmsh.model.addPhysicalGroup(3, [tag for tag in volumes if tag != inner], MATRIX)
    gmsh.model.addPhysicalGroup(3, [inner], SPHERE)
    gmsh.option.setNumber("Mesh.MeshSizeMax", size * min(1.0, 1.5 * radius))
    gmsh.option.setNumber("Mesh.ElementOrder", 2)
    gmsh.option.setNumber("Mesh.HighOrderOptimize", 4)
    gmsh.model.mesh.generate(3)
