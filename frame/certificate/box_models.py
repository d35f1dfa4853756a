"""Modal models over boxes of parameters: what does not depend on time, once for each box.

An output at a time is Re Σ G w, a sum over the derivatives w of all modes' waves by their
eigenvalues, orders 0 to 2; G holds what each brings into value, gradient and Hessian.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from alphacut.frame.calculus.jet import Array
from alphacut.frame.calculus.polynomial import Polynomial, basis, product, terms
from alphacut.frame.modal.model import ModalModel

ROWS = 1000
"""Rows whose response to a load is computed together; more would leave the cache."""


@dataclass(frozen=True, eq=False)
class BoxModels:
    """Derivatives and waves of a modal model at the centres of boxes.

    Args:
        model: The modal model.
    """

    model: ModalModel

    @cached_property
    def shares(self) -> list[Polynomial]:
        """Shares of the free motion and of that under a load, those that vanish left out."""
        load = [] if self.model.load is None else [self.model.load.share]
        return [share for share in (self.model.coefficient, *load) if share.coefficients.any()]

    @cached_property
    def derivatives(self) -> list[Array]:
        """Coefficients of eigenvalues and shares, their slopes and curvatures (upper triangle)."""
        index = self.model.eigenvalue.index
        d, degree = index.shape[1], self.model.degree
        columns = [part.coefficients for part in (self.model.eigenvalue, *self.shares)]
        whole = Polynomial(index, np.hstack(columns))
        sizes = [terms(d, max(degree - k, 0)) for k in range(3)]  # a derivative has fewer terms
        pairs = zip(*np.triu_indices(d), strict=True)
        return [
            whole.coefficients,
            *(whole.slope[i, : sizes[1]] for i in range(d)),
            *(whole.curve[i, j, : sizes[2]] for i, j in pairs),
        ]

    def jets(self, centre: Array) -> tuple[Array, Array]:
        """Derivatives at centres (B, d) of the eigenvalues, (q, B, n), and shares, (q, B, P, n, m).

        They are the value, the gradient and the upper triangle of the Hessian, q in all.
        """
        n, m = self.model.count, len(self.model.outputs)
        B = basis(centre, self.model.eigenvalue.index)
        both = np.empty(
            (len(self.derivatives), len(centre), n * (1 + len(self.shares) * m)), complex
        )
        for row, coefficients in zip(both, self.derivatives, strict=True):
            row[:] = product(B[:, : len(coefficients)], coefficients)
        share = both[..., n:].reshape(*both.shape[:2], -1, n, m)
        return np.ascontiguousarray(both[..., :n]), np.ascontiguousarray(share)

    def waves(self, rate: Array, box: Array, node: Array) -> Array:
        """Waves of boxes `box` (R,) with eigenvalues (B, n) at nodes (R,), shape (R, P, 3, n).

        Along the third axis they are derived by the eigenvalue.
        """
        found = []
        time = self.model.time[node][:, None]
        if self.shares[0] is self.model.coefficient:
            wave = np.exp(rate[box] * time)
            found.append(np.stack([wave, time * wave, time * time * wave], 1))
        if self.model.load is not None:
            load, rows = self.model.load, range(0, len(node), ROWS)
            parts = [load.response(rate[box[k : k + ROWS]], node[k : k + ROWS]) for k in rows]
            found.append(np.concatenate([np.stack(part, 1) for part in parts]))
        return np.stack(found, axis=1)
