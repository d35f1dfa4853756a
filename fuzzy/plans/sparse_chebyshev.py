"""Sparse Chebyshev surface in the model's place, searched in every cut (Fig. 2)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from alphacut.fuzzy.plans.monotonicity import primary
from alphacut.fuzzy.samples.design import Design
from alphacut.fuzzy.samples.model import Memo, Model
from alphacut.fuzzy.samples.nature import Nature
from alphacut.fuzzy.samples.result import FuzzyResult
from alphacut.fuzzy.sets.boxes import Domain
from alphacut.fuzzy.sets.given import require_end, require_fields
from alphacut.fuzzy.sets.numbers import Array, Rows
from alphacut.fuzzy.surrogates.chebyshev_polynomial import Polynomial

_SEARCHES = 20_000  # searches of the surface at most
_SAFETY = 2  # the surface may miss other places by more than the samples that were held out
_TINY = np.finfo(float).tiny
_ROUGH = 3  # the same of several inputs where the budget ended the surface, as about kinks


class _Ends(NamedTuple):
    """Extremes of the surface: places (levels, outputs, 2, inputs), values (levels, outputs, 2)."""

    places: Array
    values: Array


@dataclass(frozen=True)
class Chebyshev:
    """Interpolation until new samples agree; the surface is searched in every cut.

    Args:
        tolerance: Largest disagreement, as a share of the range of each output, at which refinement
            ends.
        budget: Samples at which it ends at the latest (the last step may pass it).
        confirm: Run the model where the surface has its extremes. The bounds are then attained
            (inner), their error the disagreement there and twice that at held-out samples (three
            times where the budget ended it for several inputs); otherwise they are the surface's
            (estimated), their error the latter alone.
        outputs: Outputs whose bounds matter; all if none is named. The others are printed as the
            samples happen to bound them, without an error.

    Raises:
        ValueError: A number is not positive.
    """

    tolerance: float = 1e-4
    budget: int = 1000
    confirm: bool = True
    outputs: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        require_fields(self)
        require_end(self.tolerance, self.budget)

    stepwise = True  # samples depend on those before

    def run(self, model: Model, domain: Domain) -> FuzzyResult:
        """Build the surface, search it, confirm what it says."""
        from alphacut.fuzzy.plans.sparse_grid import SparseGrid

        memo = Memo(model)
        columns = memo(domain.modal[None]).columns
        names = self.outputs or primary(columns, model.known)
        _require_few(names, domain)
        grid = SparseGrid(memo, *(ends[0] for ends in domain.boxes))
        missed, met = grid.refine(self.tolerance, self.budget)
        left = float((missed / np.maximum(np.ptp(memo.values.array, axis=0), _TINY)).max())
        missed = (_SAFETY if met or len(domain.names) == 1 else _ROUGH) * missed
        chosen = np.array([memo.values.column(name) for name in names])
        ends = _extremes(grid.polynomial(), domain, chosen)
        error = np.broadcast_to(missed[chosen], ends.values.shape[:2])
        if self.confirm:
            error = error + self._disagreement(memo, ends, chosen)
        result = Design.from_samples(domain, memo.points).bounds(memo.values, plan="chebyshev")
        table = np.broadcast_to(missed, result.lower.shape).copy()
        table[:, chosen] = error
        ended = f"the surface ended at its budget of {self.budget} samples with {left:.1e} of"
        notes = () if met else (f"{ended} the range missed",)
        result = replace(result, error=table, notes=notes)
        result = result if self.confirm else _estimated(result, ends, chosen)
        return result.searched(chosen, self.outputs)

    def _disagreement(self, memo: Memo, ends: _Ends, chosen: Rows) -> Array:
        """Distance of model and surface at the surface's extremes, (levels, outputs)."""
        values = memo(ends.places.reshape(-1, ends.places.shape[-1])).array[:, chosen]
        own = np.einsum("loso->los", values.reshape(*ends.values.shape, -1))
        return np.asarray(np.abs(own - ends.values).max(axis=2))


def _require_few(outputs: Sequence[str], domain: Domain) -> None:
    """Refuse so many outputs that the search of their surfaces would not end.

    Raises:
        ValueError: There are too many.
    """
    searches = len(outputs) * len(domain.alpha)
    if searches > _SEARCHES:
        raise ValueError(
            f"{len(outputs):,} outputs at {len(domain.alpha)} levels are {searches:,} searches of"
            f" the surface, some {_SEARCHES:,} take minutes: name those that matter, as"
            f" Automatic(outputs=({outputs[0]!r},)), return fewer, or take Reduced() or Signed()"
        )


def _extremes(surface: Polynomial, domain: Domain, chosen: Rows) -> _Ends:
    lowers, uppers = domain.boxes
    places = np.empty((len(lowers), len(chosen), 2, lowers.shape[1]))
    values = np.empty(places.shape[:3])
    for level, alpha in enumerate(domain.alpha):
        slack = (
            (lambda points, alpha=alpha: domain.slack(points, alpha))
            if domain.interactions
            else None
        )
        for row in range(len(chosen)):
            for side, sign in enumerate((1.0, -1.0)):
                found = surface.minimum(
                    lowers[level], uppers[level], output=int(chosen[row]), sign=sign, slack=slack
                )
                places[level, row, side], values[level, row, side] = found
    return _Ends(places, values)


def _estimated(result: FuzzyResult, ends: _Ends, chosen: Rows) -> FuzzyResult:
    """The surface's bounds in place of the samples'."""
    lower, upper, lower_at, upper_at = (
        table.copy() for table in (result.lower, result.upper, result.lower_at, result.upper_at)
    )
    lower[:, chosen], upper[:, chosen] = ends.values[..., 0], ends.values[..., 1]
    lower_at[:, chosen], upper_at[:, chosen] = ends.places[:, :, 0], ends.places[:, :, 1]
    return replace(
        result,
        lower=lower,
        upper=upper,
        lower_at=lower_at,
        upper_at=upper_at,
        base=Nature.ESTIMATED,
    )
