"""Proof: guaranteed bounds of linear structures with up to six fuzzy inputs.

1. Displacements oscillate in the inputs; the modes' eigenvalues λ_k(p) and shares C_k(p) do not
   (section 7). Polynomials of them, fitted to eigen-analyses, give q(t; p) = 2 Re Σ C_k exp(λ_k t),
   and likewise the motion under a record (`frame.modal`).
2. What these polynomials miss in the equations of motion is bounded over the whole box, and with it
   the error of the motion (`frame.certificate.model_error`). The degree rises until that takes a
   fifth of the gap wanted. Where it does not, the box is cut in two across its relatively widest
   input, and each part has polynomials of its own, up to `parts` of them. Where these are too few
   to cut every input once, none is cut: the error would seldom fall enough.
3. Branch and bound encloses the polynomials' extremes at all nodes, for all outputs, sides and
   levels, between a point that is attained and a bound that is proved (`frame.certificate`).
4. The envelope is the union over the parts: proved bounds, the points that attain all but the gap
   of them, and a bound of what the motion does between nodes.
"""

from __future__ import annotations

import os
import time
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from alphacut.frame.boxes import Boxes, UnitFlow
from alphacut.frame.certificate.certificate import Certificate, certify
from alphacut.frame.certificate.model_error import proved_error
from alphacut.frame.certificate.remainder import MOST_PARAMETERS
from alphacut.frame.dynamics.flow import LinearFlow
from alphacut.frame.dynamics.integrators import Exact
from alphacut.frame.envelope import Ends, Envelope
from alphacut.frame.modal.fitting import fit_modes
from alphacut.frame.modal.model import ModalModel
from alphacut.frame.structures.modes import ModalError
from alphacut.frame.structures.polynomial_dependence import UnprovedError
from alphacut.fuzzy.arrays import Array
from alphacut.fuzzy.progress_bar import Progress, share
from alphacut.fuzzy.refused import real
from alphacut.fuzzy.result import Nature

PORTION = 0.2
"""Share of the gap that the error of the modal model may take on either side."""
USUAL = 10.0
"""Proved over sampled error of the model, seldom less."""
ATTEMPTS = 5
"""Models of rising degree that are tried on a box."""


class GapError(UnprovedError):
    """The error of the modal model is bounded, but leaves too little of the gap."""


@dataclass(frozen=True)
class Proof:
    """The method and its options.

    Args:
        gap: Wanted distance of attained and proved bounds, in m, or in the unit of the first output
            where none is a displacement; a tenth of the tolerance unless given.
        tolerance: Largest error allowed: what the gap may grow to where a smaller one is not
        proved.
        boxes: Most boxes looked at for each bound, on average; where they end, the gap is wider.
        parts: Most parts of the box with polynomials of their own; d inputs are cut from 2^d on.
        budget: Most eigen-analyses on each part.
        workers: Threads, which do not change the result; all cores unless given.

    Raises:
        RefusedError: A value is not positive.
    """

    name: ClassVar[str] = "proof"
    gap: float | None = None
    tolerance: float | None = None
    boxes: float = 4000
    parts: int = 8
    budget: int = 280
    workers: int | None = None

    def __post_init__(self) -> None:
        for key in ("gap", "tolerance", "boxes", "parts", "budget"):
            if getattr(self, key) is not None:
                real(key, getattr(self, key), positive=True)

    def run(self, flow: UnitFlow, progress: Progress | None = None) -> Envelope:
        """Guaranteed envelope of all outputs on all levels.

        Raises:
            UnprovedError: The error of the modal model cannot be bounded within the tolerance.
            ModalError: The structure has no smooth oscillating modes over the box.
        """
        begun, tolerance = time.perf_counter(), flow.tolerance(self.tolerance or self.gap)
        linear, count = exact(flow), len(flow.boxes.names)
        if count > MOST_PARAMETERS:
            raise UnprovedError(
                f"proofs are affordable up to {MOST_PARAMETERS} fuzzy inputs, and there are {count}"
            )
        gaps = (self.gap,) if self.gap else (0.1 * tolerance, tolerance)
        modelled = self._modelled(linear, flow, gaps)
        parts: list[tuple[Boxes, Certificate]] = []
        for done, (boxes, model, error, gap) in enumerate(modelled):
            tick = share(progress, done / len(modelled), (done + 1) / len(modelled))
            proof = certify(
                model,
                gap=gap,
                model_error=error,
                scale=flow.scale,
                workers=self.workers or os.cpu_count() or 1,
                budget=self.boxes,
                progress=tick,
            )
            parts.append((boxes, proof))
        inner, outer, at = _united(flow, parts)
        error = (outer - inner).max(-1)
        facts = {
            "model_error": max(float((error / flow.scale).max()) for _, _, error, _ in modelled),
            "degree": max(model.degree for _, model, _, _ in modelled),
            "gap": float((error / flow.scale).max()),
            "boxes": sum(proof.boxes for _, proof in parts),
            "parts": len(parts),
        }
        envelope = flow.envelope(
            outer,
            at,
            error,
            method=self.name,
            nature=Nature.GUARANTEED,
            evaluations=sum(model.analyses for _, model, _, _ in modelled),
            seconds=time.perf_counter() - begun,
            facts=facts,
        )
        return replace(
            envelope,
            basis=("the equations of motion hold",),
            inner=Ends(-inner[..., 0], inner[..., 1]),
            between=np.max([proof.between for _, proof in parts], axis=0),
            attained_error=np.max([proof.attained_error for _, proof in parts], axis=0),
        )

    def _modelled(
        self, linear: LinearFlow, flow: UnitFlow, gaps: tuple[float, ...]
    ) -> list[tuple[Boxes, ModalModel, Array, float]]:
        """Parts of the box with their models, proved errors and gaps."""
        reason: UnprovedError | ModalError = UnprovedError("nothing was tried")
        most = self.parts if 2 ** len(flow.boxes.names) <= self.parts else 1
        for gap in gaps:
            done: list[tuple[Boxes, ModalModel, Array, float]] = []
            left = [flow.boxes]
            while left:
                boxes = left.pop()
                try:
                    done.append((boxes, *self._proved(linear, boxes, flow, gap), gap))
                    continue
                except (GapError, ModalError) as error:
                    reason = error
                if len(done) + len(left) + 2 > most:
                    break
                left += boxes.halves()
            else:
                return done
        raise reason

    def _proved(
        self, linear: LinearFlow, boxes: Boxes, flow: UnitFlow, gap: float
    ) -> tuple[ModalModel, Array]:
        """Modal model over boxes with its proved error (T, m).

        That exceeds the sampled error some thirty times, so the polynomials are refined until it
        takes little of the gap.

        Raises:
            GapError: It takes too much.
            UnprovedError: No degree can help, or a proof needs more than is affordable.
        """
        aim, before, largest = gap / 30, 0, np.inf
        for _ in range(ATTEMPTS):
            how = {"budget": self.budget, "scale": flow.scale, "energy": True}
            model = fit_modes(linear, boxes, tolerance=aim, **how)  # type: ignore[arg-type]
            if model.degree <= before:
                break
            sampled = float((model.error / flow.scale).max())
            largest = USUAL * sampled  # a bound is seldom less, and takes time
            if largest <= PORTION * gap:
                error = proved_error(model)
                largest = float((error / flow.scale).max())
                if largest <= PORTION * gap:
                    return model, error
            # a degree more divides it by ten or so
            aim, before = sampled * min(0.99, 4 * PORTION * gap / largest), model.degree
        raise GapError(
            f"the proved error of the modes, some {flow.in_words(largest)}, takes too much of the"
            f" gap {flow.in_words(gap)}",
            "narrower or fewer fuzzy inputs, or a wider gap, can be proved",
        )


def exact(flow: UnitFlow) -> LinearFlow:
    """The exact motion of a linear structure.

    Raises:
        UnprovedError: It is none.
    """
    linear = flow.flow
    if not isinstance(linear, LinearFlow):
        raise UnprovedError("the system is not linear")
    if not isinstance(linear.integrator, Exact):
        raise UnprovedError(
            f"the motion is that of the scheme '{linear.integrator.name}', and a proof is of the"
            " exact one"
        )
    return linear


def _united(flow: UnitFlow, parts: list[tuple[Boxes, Certificate]]) -> tuple[Array, Array, Array]:
    """Attained bounds and proved ones of the union, and where; some parts have fewer levels."""
    levels, d = len(flow.boxes.alpha), len(flow.boxes.names)
    shape = (levels, len(flow.time), len(flow.outputs), 2)
    inner, outer, at = np.full(shape, -np.inf), np.full(shape, -np.inf), np.zeros((*shape, d))
    for boxes, proof in parts:
        own = slice(0, len(boxes.alpha))
        better = proof.bounds > inner[own]
        inner[own][better] = proof.bounds[better]
        at[own][better] = flow.boxes.to_unit(boxes.to_physical(proof.at))[better]
        outer[own] = np.maximum(outer[own], proof.outer)
    return inner, outer, at
