"""Galerkin's projection on solutions at a few moduli of the particle.

The energy is stationary, so the error of the projected moduli falls like the square of that of the
displacements. Solutions are added between the ends of the range, whatever moduli are asked for, so
that a sample does not depend on its companions.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from alphacut.rve.cell import Phase
from alphacut.rve.mesh.periodicity import mismatch
from alphacut.rve.petsc import PETSc
from alphacut.rve.prism.slice_stress import CELL_AREA
from alphacut.rve.prism.system import PhaseMeans, SliceMeans
from alphacut.rve.prism.task import CONTRAST_GRID, PrismTask
from alphacut.stochastic.theta.truncated_normal import Array

_TOLERANCE = 1e-10  # of the energy; E is off by half of it
_MOST = 8  # solutions
_CHEBYSHEV = (0.5 - np.sqrt(0.125), 0.5 + np.sqrt(0.125))


class BasisError(RuntimeError):
    """A few solutions do not carry the others."""


class ModulusBasis:
    """Solutions of one map at moduli of the particle that span a range.

    Args:
        task: The map, its loads and its solver.
        phases: Matrix, and the particle's Poisson's ratio.
        moduli: Least and greatest modulus of the particle, in Pa.

    Attributes:
        nodes: Moduli that were solved, in Pa.
        iterations: Of their loads.
        error: Relative energy that the projection leaves out, at the most.
        mismatch: Of the fluctuations on opposite sides of the cell.

    Raises:
        ConvergenceError: A linear solve stopped early.
        BasisError: The range is too wide for a few solutions.
    """

    def __init__(
        self, task: PrismTask, phases: tuple[Phase, Phase], moduli: tuple[float, float]
    ) -> None:
        self.task, self.matrix, self.poisson = task, phases[0], phases[1].poisson
        self.iterations: tuple[int, ...] = ()
        self._solutions: Array = np.empty((task.system.numbering.size, 0))
        low, high = moduli
        nodes = [low]
        if high > low:  # Chebyshev's two points: the error is the same at the ends and between
            nodes = [low * (high / low) ** share for share in _CHEBYSHEV]
        groups = [nodes] if high <= CONTRAST_GRID * low else [[modulus] for modulus in nodes]
        for group in groups:  # one preconditioner is good for all of a group
            self._add(group)
        while True:
            checked = [low, *(self._between(*ends) for ends in pairwise(sorted(nodes))), high]
            errors = self._residuals(checked, together=len(groups) == 1)
            worst = int(np.argmax(errors))
            if low == high or errors[worst] <= _TOLERANCE:
                break
            if len(nodes) == _MOST:
                raise BasisError(
                    f"{_MOST} solutions leave a relative error of {errors[worst]:.1e} between"
                    f" moduli of {low:.3g} and {high:.3g} Pa"
                )
            nodes.append(checked[worst])
            self._add([checked[worst]])
        self.error, self.nodes = float(max(errors)), tuple(nodes)
        with task.watch("solve"):
            self._measure()

    def _between(self, low: float, high: float) -> float:
        """Modulus inside an interval, away from the matrix's, where nothing is to be seen."""
        share = 0.5
        if abs(np.log(low * high / self.matrix.modulus**2)) < np.log(high / low) / 5:
            share = 0.75
        return float(low * (high / low) ** share)

    def _phases(self, modulus: float) -> tuple[Phase, Phase]:
        return self.matrix, Phase(modulus, self.poisson)

    def _add(self, moduli: list[float]) -> None:
        """Solve at moduli, side by side, and project the system on all solutions."""
        task = self.task
        values, iterations = task.fluctuations([self._phases(e) for e in moduli])
        self.iterations += iterations
        with task.watch("solve"):
            sizes = np.linalg.norm(values, axis=0)
            fresh = values[:, sizes > 0] / sizes[sizes > 0]  # equal phases: nothing fluctuates
            self._solutions = np.linalg.qr(np.concatenate([self._solutions, fresh], axis=1))[0]
            self._images = [_product(matrix, self._solutions) for matrix in task.matrices]
            self._forces = [np.stack([v.array_r for v in part], axis=1) for part in task.loads]
            self._stiffness = [self._solutions.T @ image for image in self._images]
            self._loads = [self._solutions.T @ force for force in self._forces]

    def _coefficients(self, modulus: float) -> Array:
        """Of the solutions for each load, shape (solutions, loads)."""
        fixed, unit = self._stiffness
        load = self.matrix.modulus * self._loads[0] + modulus * self._loads[1]
        return np.asarray(np.linalg.solve(self.matrix.modulus * fixed + modulus * unit, load))

    def _residuals(self, moduli: list[float], *, together: bool) -> list[float]:
        """Largest energy of a load's residual, in the preconditioner's norm, over the matrix's."""
        residuals = [self._residual(modulus) for modulus in moduli]
        if together:
            middle = self._phases(moduli[len(moduli) // 2])
            stacked = self.task.preconditioned(np.concatenate(residuals, axis=1), middle)
            answers = np.split(stacked, len(moduli), axis=1)
        else:
            pairs = zip(residuals, moduli, strict=True)
            answers = [self.task.preconditioned(r, self._phases(e)) for r, e in pairs]
        strains = self.task.strains
        energy = CELL_AREA * np.einsum("li,ij,lj->l", strains, self.matrix.stiffness, strains)
        return [
            float(((residual * answer).sum(axis=0) / energy).max())
            for residual, answer in zip(residuals, answers, strict=True)
        ]

    def _residual(self, modulus: float) -> Array:
        """Load less stiffness times the projected solution, shape (size, loads)."""
        weights, coefficients = (self.matrix.modulus, modulus), self._coefficients(modulus)
        parts = zip(weights, self._forces, self._images, strict=True)
        return np.asarray(sum(w * (force - image @ coefficients) for w, force, image in parts))

    def _measure(self) -> None:
        """Means of the slices for the affine fields and every solution."""
        task = self.task
        fluctuations = task.system.at_nodes(self._solutions)
        self.mismatch = mismatch(task.system.positions, fluctuations)
        fields = np.concatenate([task.affine, fluctuations], axis=-1)
        self._means: PhaseMeans = task.system.means_by_phase(fields, self._phases(1.0))

    def project(self, modulus: float) -> SliceMeans:
        """Means of the slices with this modulus of the particle, inside the range."""
        with self.task.watch("solve"):
            coefficients = self._coefficients(modulus)
            combined = np.concatenate([np.eye(coefficients.shape[1]), coefficients])
            return self._means.combined((self.matrix.modulus, modulus), combined)


def _product(matrix: PETSc.Mat, vectors: Array) -> Array:
    """Matrix times vectors, shape (n, k)."""
    source = PETSc.Mat().createDense(
        ((len(vectors), None), (None, vectors.shape[1])), comm=matrix.comm
    )
    source.setUp()
    source.getDenseArray()[:] = vectors
    source.assemble()
    product = matrix.matMult(source)  # which owns what is copied
    return np.array(product.getDenseArray(readonly=True))
