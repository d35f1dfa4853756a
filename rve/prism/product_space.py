"""The product space for laws of the user: space, measure, reduced assembly, preconditioned solve.

A law is a UFL form in displacements u of two components on cell × θ. Each integrand carries the
factor `density`, f_Θ of eq. 1, and the strain is that of `strain`, without a derivative along θ.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import cast

import numpy as np

from alphacut.base.errors import RefusedError, require
from alphacut.rve.fenicsx import PETSc, compiled, fem, ufl
from alphacut.rve.prism.cell_fields import CellFields
from alphacut.rve.prism.fields import fields_of_solution
from alphacut.rve.prism.model import PrismModel
from alphacut.rve.prism.own_mesh import MeshModel
from alphacut.rve.prism.problem import PrismProblem
from alphacut.rve.solver.form import strain
from alphacut.rve.solver.krylov import Solutions, SolverOptions, require_petsc, solve
from alphacut.rve.solver.theta_preconditioner import ThetaPreconditioner
from alphacut.stochastic import RadiusMap, ThetaDistribution


class ProductSpace:
    """Periodic fluctuations on cell × θ, zero on the line of one corner over θ.

    The mesh belongs to this object alone: it does not follow later maps of the model.

    Args:
        model: Mesh size, layers and outline, or the file of a mesh; communicator; PETSc options.
        law: Radius of the particle over θ, or the law of θ where the mesh is that of a file.

    Attributes:
        space: Displacements of two components in serendipity prisms.
        dx: Measure of each phase by its name, with the quadrature of the prisms.
        density: f_Θ at the quadrature points.

    Raises:
        FoldedMeshError: The map bends more than the layers can follow, or the particle nearly
            touches the sides of the cell.
        RefusedError: The mesh of the model does not follow the particles, as that of a level set.

    Example:
        >>> from alphacut.stochastic import HermiteMap
        >>> space = ProductSpace(PrismModel(0.5, 2), HermiteMap(0.2, 0.1, 0.6, 0.1))
        >>> 0.1 < space.mean(space.density * space.dx["inclusion"]) < 0.15  # mean of π r² / 4
        True
    """

    def __init__(self, model: PrismModel | MeshModel, law: RadiusMap | ThetaDistribution) -> None:
        self._problem = _separate_problem(model, law)
        self._petsc = model.petsc
        self.space: fem.FunctionSpace = self._problem.space
        self.dx: dict[str, ufl.Measure] = self._problem.dx
        self.density: fem.Function = self._problem.density
        self._forms: dict[ufl.Form, fem.Form] = {}

    strain = staticmethod(strain)

    def assemble_matrix(self, form: ufl.Form) -> PETSc.Mat:
        """Reduced matrix Pᵀ A P of a bilinear form in `space`."""
        return self._problem.assemble_operator(self._compiled(form, num_arguments=2))

    def assemble_vector(self, form: ufl.Form) -> PETSc.Vec:
        """Reduced vector Pᵀ b of a linear form in `space`."""
        values = fem.assemble_vector(self._compiled(form, num_arguments=1)).array
        return self._problem.elimination.forces(values)

    def mean(self, form: ufl.Form) -> float:
        """Mean over cell and θ of a scalar form: its integral over that of f_Θ."""
        # the quadrature integrates f_Θ over θ to 1 but for some 1e-7
        total = sum(self._integral(self.density * dx) for dx in self.dx.values())
        return self._integral(form) / total

    def _integral(self, form: ufl.Form) -> float:
        """Return the integral of a scalar form, summed over all ranks, all of which must call."""
        scalar = fem.assemble_scalar(self._compiled(form, num_arguments=0))
        return float(self._problem.comm.allreduce(scalar))

    def assign(self, function: fem.Function, vector: PETSc.Vec) -> None:
        """Set a function of `space` to the displacements of reduced unknowns."""
        function.x.array[:] = self._problem.elimination.displacements(vector).ravel()

    def fields(
        self,
        u: fem.Function,
        stress: Mapping[str, ufl.core.expr.Expr],
        strain: Sequence[float],
        scalars: Mapping[str, ufl.core.expr.Expr] | None = None,
    ) -> CellFields:
        """Return displacements and stresses at the nodes for a solution, to be drawn or written.

        Args:
            u: The fluctuation of the displacements, a function of `space`, in halves of the cell's
                side; it is without the displacements of the macroscopic strain.
            stress: (σ11, σ22, σ12) of each phase by its name, UFL expressions of shape (3,), in Pa.
            strain: The macroscopic strain (ε11, ε22, 2 ε12).
            scalars: Further fields by name, as scalar UFL expressions of `u` and of the place;
                files have them by these names.

        Returns:
            Total displacements, and stresses and scalars as means over the prisms of one phase that
            meet in a node.

        Raises:
            RefusedError: The names in `stress` are not exactly those of the phases, or an
                expression has not three components, or of `scalars` not one.
        """
        load = np.asarray(strain, float)
        return fields_of_solution(self._problem, u, stress, load, scalars or {})

    def preconditioner(self, matrix: PETSc.Mat) -> ThetaPreconditioner:
        """Preconditioner along θ for `PC.setPythonContext`; the form has the density as factor."""
        return self._problem.preconditioner(matrix)

    def solve(
        self,
        matrix: PETSc.Mat,
        loads: Sequence[PETSc.Vec],
        petsc_options: Mapping[str, str] | None = None,
    ) -> Solutions:
        """Solve A x = b for each load, by default by conjugate gradients preconditioned along θ.

        Args:
            matrix: Symmetric reduced matrix, as `assemble_matrix` returns it.
            loads: Reduced right-hand sides, at least one, as `assemble_vector` returns them.
            petsc_options: Options of PETSc without the prefix `rve_`, which override the default
                solver; the options of the model if left out.

        Returns:
            The reduced solutions in the order of the loads, iterations, and the largest relative
            residual.

        Raises:
            RefusedError: The matrix is not symmetric, `petsc_options` is no table of options, or
                PETSc does not use an option.
            ConvergenceError: The tolerance was not reached.
        """
        require_symmetric(matrix)
        if petsc_options is None:
            petsc_options = self._petsc
        require_petsc(petsc_options)
        return solve(self._problem.solver(SolverOptions(petsc_options), matrix), loads)

    def _compiled(self, form: ufl.Form, *, num_arguments: int) -> fem.Form:
        """Return a form compiled by DOLFINx, after a check; it is kept for the next call.

        A kept form uses the values that its coefficients have when it is assembled, not the values
        of this call. DOLFINx does not check the number of the form's arguments (test and trial
        functions) nor their spaces when it assembles, and would write beyond its arrays.

        Args:
            form: Form of the user.
            num_arguments: 0 for a scalar, 1 for a vector, 2 for a matrix.

        Raises:
            RefusedError: It is no form on this mesh with `num_arguments` arguments in `space`.
        """
        require_form(form, space=self.space, num_arguments=num_arguments)
        if form not in self._forms:
            self._forms[form] = compiled(form)
        return self._forms[form]


def require_form(form: object, *, space: fem.FunctionSpace, num_arguments: int) -> None:
    """Raise unless a form is one on the mesh of `space` with some number of arguments, all in it.

    Args:
        form: What the user gave as a form.
        space: The only space that its test and trial functions may have.
        num_arguments: 0 for a scalar form, 1 with a test function, 2 with a trial function too.

    Raises:
        RefusedError: It is no UFL form, has another number of arguments, has one in another space,
            or is integrated over another mesh.
    """
    arities = {
        0: "scalar form (without test or trial function)",
        1: "linear form (with a test function)",
        2: "bilinear form (with a trial and a test function)",
    }
    allowed = f"a {arities[num_arguments]}, in `space` of this ProductSpace"
    cure = "write it with `ufl.TrialFunction(space)`, `ufl.TestFunction(space)` and its `dx`"
    if not isinstance(form, ufl.Form):
        raise RefusedError("form", type(form).__name__, allowed, cure)
    arguments = form.arguments()
    if len(arguments) != num_arguments:
        value = f"a {arities.get(len(arguments), 'multilinear form')}"
        raise RefusedError("form", value, allowed, cure)
    in_space = all(argument.ufl_function_space() == space for argument in arguments)
    domains = form.ufl_domains()
    if not in_space or any(domain != space.mesh.ufl_domain() for domain in domains):
        raise RefusedError("form", "a form on another space or mesh", allowed, cure)


def _separate_problem(
    model: PrismModel | MeshModel, law: RadiusMap | ThetaDistribution
) -> PrismProblem:
    """Return a new problem for a map or distribution, moved to it.

    The cached problem of the model would move to the next map of the model. Only the grid, which
    does not change, is taken from it.

    Args:
        model: Prisms around a particle, or a mesh from a file.
        law: Radius map for prisms; distribution of θ for a mesh from a file.

    Raises:
        FoldedMeshError: The map bends more than the layers can follow, or the particle nearly
            touches the sides of the cell.
        MeshError: The file holds no mesh of a cell.
        RefusedError: `law` is not of the kind that the model takes, does not fit the mesh, or has a
            density that is zero at a quadrature point; or the mesh of the model does not follow the
            particles, as that of a level set.
    """
    # A level set gives phases to points, while `dx` of a phase covers whole prisms.
    require(
        isinstance(model, PrismModel | MeshModel),
        "model",
        type(model).__name__,
        "a PrismModel, or a MeshModel",
        "give the particle as an outline, or mesh the particles",
    )
    if isinstance(model, MeshModel):
        cached = model.moved_problem(law)
    else:
        cached = model.problem(cast("RadiusMap", law))
    problem = PrismProblem(cached.grid, cached.comm)
    problem.move(cached.map)
    return problem


def require_symmetric(matrix: PETSc.Mat) -> None:
    """Raise unless a matrix A is symmetric; for others conjugate gradients would be wrong.

    A x and Aᵀ x are compared for one random vector x, always the same for a number of ranks. A zero
    matrix passes. All ranks that share the matrix must call.

    Raises:
        RefusedError: |(A − Aᵀ) x| exceeds 1e-8 |A x|, or one of them is NaN.
    """
    # For an asymmetric matrix (A − Aᵀ) x vanishes only for x in a proper subspace, which a random
    # vector misses with probability 1. A comparison of entries would need the transpose.
    x, product = matrix.createVecs()
    difference = x.duplicate()
    x.array[:] = np.random.default_rng(x.owner_range[0]).standard_normal(x.local_size)
    matrix.mult(x, product)
    matrix.multTranspose(x, difference)
    difference.axpy(-1, product)
    asymmetry = difference.norm() / (product.norm() or 1.0)
    max_asymmetry = 1e-8  # of |(A − Aᵀ) x| over |A x|; round-off leaves some 1e-15
    if not asymmetry <= max_asymmetry:
        cure = (
            "use a Krylov method of PETSc for others, with `preconditioner` of the symmetric part"
        )
        what = "asymmetry of the matrix"
        raise RefusedError(what, f"{asymmetry:.1e}", "symmetric operators", cure)
