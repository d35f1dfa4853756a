"""Modes of structures with symmetric M, D and K and their sensitivities, in compiled code alone."""

from __future__ import annotations

import ctypes
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from alphacut.frame.calculus.c_library import FUSED, address, c_library
from alphacut.frame.calculus.jet import Array

SOURCE = Path(__file__).with_name("damped_modes.c").read_text(encoding="utf-8")


def _library() -> ctypes.CDLL | None:
    return c_library(SOURCE, (*FUSED, "-fcx-limited-range"))


@dataclass(frozen=True, eq=False)
class DampedModes:
    """Conjugate pairs of (λ² M + λ D + K) x = 0 at S sets, λ with Im λ > 0, by rising |λ|.

    Args:
        rate: λ, shape (S, n), in 1/s.
        right: x, shape (S, modes, n).
        left: What takes a mode's part of a state: [λ M x + D x, M x], shape (S, modes, 2n).
    """

    rate: Array
    right: Array
    left: Array

    @classmethod
    def of(cls, parts: Array) -> DampedModes | None:
        """Of M, D and K, shape (S, 3, n, n); None without a compiler, or where a mode is not found.

        That is one that does not oscillate, or two that nearly coincide.
        """
        library, (count, _, n, _) = _library(), parts.shape
        if library is None:
            return None
        rate, right = np.empty((count, n), complex), np.empty((count, n, n), complex)
        left, whole = np.empty((count, n, 2 * n), complex), np.ascontiguousarray(parts)
        given = map(address, (whole, *(x.view(float) for x in (rate, right, left))))
        good = library.damped_modes(ctypes.c_long(count), ctypes.c_int(n), *given)
        return cls(rate, right, left) if good else None

    def outputs(
        self,
        own: Array,
        time: Array,
        state: Array,
        rigid: Array,
        row: Array,
        ground: tuple[Array, Array] | None,
        near: float,
        *,
        deep: bool,
    ) -> tuple[Array, Array, Array, Array]:
        """Values (N,) of an output at a time, and what its parts do to them (eq. 17).

        Args:
            own: Set of each problem, shape (N,).
            time: Shape (N,), in s.
            state: Initial states, shape (S, 2n).
            rigid: How the unknowns move rigidly with the ground, shape (n,).
            row: What the outputs take of the state, shape (N, 2n).
            ground: Modes' answer to the ground and its derivative by λ, each (N, n), or None.
            near: Phase between two λ (rad) below which their divided difference is a derivative.
            deep: Whether derivatives are wanted; else they are not set.

        Returns:
            Values, derivatives by the entries of M, D and K, shape (N, 3, n, n), by the state,
            shape (N, 2n), and by the row, shape (N, 2n).
        """
        library, (count, n) = _library(), (len(own), self.rate.shape[1])
        assert library is not None
        shape = (count if deep else 0, 3, n, n)
        found = np.empty(count), np.empty(shape), *np.empty((2, shape[0], 2 * n))
        answers = np.zeros((2, 0), complex) if ground is None else np.array(ground)
        complexes = [np.ascontiguousarray(x).view(float) for x in answers]
        reals = [np.ascontiguousarray(x, float) for x in (own, time, state, rigid, row)]
        modes = [x.view(float) for x in (self.rate, self.right, self.left)]
        given = (*reals[:2], *modes, *reals[2:], *complexes, *found)
        sizes = map(ctypes.c_int, (n, deep, ground is not None))
        library.damped_outputs(
            ctypes.c_long(count), *sizes, ctypes.c_double(near), *map(address, given)
        )
        return found
