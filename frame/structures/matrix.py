"""Linear structure from matrices M, D, K: sums of arrays times smooth factors."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from alphacut.frame.calculus.jet import Jet, variables
from alphacut.frame.calculus.numbers import require_numbers
from alphacut.frame.structures.damping import modal_damping
from alphacut.frame.structures.linear import Accelerogram, Matrices
from alphacut.frame.structures.quantities import RATIO, Output, Parameter
from alphacut.fuzzy.arrays import Array
from alphacut.fuzzy.refused import RefusedError, real, require

KINDS = ("mass", "damping", "stiffness")
Factor = Callable[[Mapping[str, Any]], Any]
Terms = Sequence[tuple[Factor | str | float, Array]]


@dataclass(frozen=True, eq=False)
class MatrixStructure:
    """M(p) q̈ + D(p) q̇ + K(p) q = −M(p) ι a(t) with M(p) = Σ_i f_i(p) M_i, likewise D and K.

    A factor is a number, the name of a parameter, or a function of all parameters in plain
    arithmetic, such as `lambda p: p["E"] * p["l"] ** -3`.

    Args:
        parameters: All parameters with their modal values, in SI units.
        mass: Pairs (factor, symmetric array (n, n)), in kg; an array may be sparse, as those that
            `scipy.io.mmread` reads.
        stiffness: The same, in N/m.
        observed: Rows by output name (an `Output` gives its unit), each (n,) acting on
            displacements or (2n,) acting on displacements and velocities.
        damping: The same, in N s/m.
        q0: Initial displacements, shape (n,), in m; zero when None.
        v0: Initial velocities, shape (n,), in m/s; zero when None.
        ground: Base excitation, or None.
        pattern: ι, how the unknowns move rigidly with the ground, shape (n,); ones when None.
        ratios: Damping ratios ζ, numbers or names of parameters: one for all modes, or n by rising
            frequency; added to `damping`, they follow the parameters through the modes
            (`frame.damping`).

    Raises:
        RefusedError: A shape does not fit, a number is not finite, a factor names no parameter, an
            array is not symmetric, the modal mass matrix is not positive definite, or a modal ratio
            is outside [0, 1).
    """

    parameters: Mapping[str, float]
    mass: Terms
    stiffness: Terms
    observed: Mapping[str, Array]
    damping: Terms = ()
    q0: Array | None = None
    v0: Array | None = None
    ground: Accelerogram | None = None
    pattern: Array | None = None
    ratios: Sequence[str | float] = ()

    def __post_init__(self) -> None:
        for name, value in self.parameters.items():
            real(f"parameter {name}", value)
        for kind in ("mass", "stiffness", "observed"):
            require(bool(getattr(self, kind)), kind, None, "one entry at least")
        for kind in KINDS:
            terms = [self._term(kind, term) for term in getattr(self, kind)]
            object.__setattr__(self, kind, tuple(terms))
        self._require_shapes()
        self._require_ratios()
        modal = sum(float(value_of(f, self.parameters)) * A for f, A in self.mass)
        if not np.linalg.eigvalsh(modal).min() > 0:
            raise RefusedError("mass", "not positive definite", "a mass for every unknown")

    @property
    def size(self) -> int:
        """Number of unknowns n."""
        return len(self.mass[0][1])

    @property
    def outputs(self) -> tuple[Output, ...]:
        """Names of the observed quantities, with their units."""
        return tuple(map(Output, self.observed))

    def parameter(self, name: str) -> Parameter:
        """A parameter, whose range is known where it is a damping ratio."""
        ratios = [ratio for ratio in self.ratios if isinstance(ratio, str)]
        return Parameter(name, range=RATIO if name in ratios else "")

    def _term(self, kind: str, term: object) -> tuple[Factor | str | float, Array]:
        """A factor that exists and has derivatives, and its array without round-off."""
        if isinstance(term, str) or not isinstance(term, Sequence) or len(term) != 2:
            raise RefusedError(f"term of {kind}", type(term).__name__, "pairs (factor, array)")
        factor, array = term
        names, values = list(self.parameters), np.array([list(self.parameters.values())], float)
        try:
            value = value_of(factor, variables(values, names, names[:1]))
        except (KeyError, TypeError, AttributeError, ValueError) as failure:
            allowed = (
                f"arithmetic, sin, cos, exp of alphacut.frame.calculus.jet, of {', '.join(names)}"
            )
            raise RefusedError(f"factor of {kind}", repr(failure), allowed) from None
        if not isinstance(value, Jet | float | int | np.number):
            raise RefusedError(f"factor of {kind}", type(value).__name__, "functions to one number")
        return factor, _symmetric(kind, array)

    def _require_shapes(self) -> None:
        n, pairs = self.size, [(kind, A) for kind in KINDS for _, A in getattr(self, kind)]
        for kind, array in pairs:
            if array.shape != (n, n):
                raise RefusedError(f"array of {kind}", f"of shape {array.shape}", f"({n}, {n})")
        vectors: list[tuple[str, Any, tuple[int, ...]]]
        vectors = [(name, getattr(self, name), (n,)) for name in ("q0", "v0", "pattern")]
        vectors += [(f"observed: {k}", row, (n, 2 * n)) for k, row in self.observed.items()]
        for name, value, lengths in vectors:
            if value is None:
                continue
            require_numbers(name, value)
            if np.ndim(value) != 1 or len(value) not in lengths:
                raise RefusedError(name, f"of shape {np.shape(value)}", f"{lengths} numbers")

    def _require_ratios(self) -> None:
        if isinstance(self.ratios, str) or len(self.ratios) not in (0, 1, self.size):
            raise RefusedError("ratios", self.ratios, f"lists of one, or {self.size} by frequency")
        for ratio in self.ratios:
            if isinstance(ratio, str) and ratio not in self.parameters:
                raise RefusedError("ratios", ratio, ", ".join(self.parameters))
            value = float(value_of(ratio, self.parameters))
            require(Parameter("", range=RATIO).admits(value, value), "ratios", f"{value:g}", RATIO)

    def matrices(self, p: Mapping[str, Jet]) -> Matrices:
        """M, D, K and the initial state at S parameter sets."""
        like = next(iter(p.values()))
        n, samples = self.size, like.value.size

        def lifted(factor: Factor | str | float) -> Jet:
            value = value_of(factor, p)
            return value if isinstance(value, Jet) else like.like(np.full(samples, float(value)))

        def total(terms: Terms) -> Jet:
            out = like.like(np.zeros((samples, n, n)))
            for factor, array in terms:
                out = out + lifted(factor)[:, None, None] * array
            return out

        start = [np.zeros(n) if x is None else np.asarray(x, float) for x in (self.q0, self.v0)]
        q0, v0 = (like.like(np.tile(x[None, :, None], (samples, 1, 1))) for x in start)
        pattern = None if self.pattern is None else np.asarray(self.pattern, float)[:, None]
        mass, damping, stiffness = (total(getattr(self, kind)) for kind in KINDS)
        if self.ratios:
            ratios = [lifted(ratio) for ratio in self.ratios]
            damping = damping + modal_damping(mass, stiffness, ratios)
        return Matrices(mass, damping, stiffness, q0, v0, pattern)

    def observation(self, p: Mapping[str, Jet]) -> Jet:
        """Rows C(p) with output = C(p) [q; v], shape (S, m, 2n)."""
        like = next(iter(p.values()))
        rows = np.zeros((len(self.observed), 2 * self.size))
        for k, row in enumerate(self.observed.values()):
            rows[k, : len(row)] = row
        return like.like(np.tile(rows, (like.value.size, 1, 1)))


def _symmetric(kind: str, value: Any) -> Array:
    """The array, also a sparse one, without the round-off that parts its triangles."""
    array = np.asarray(value.toarray() if hasattr(value, "toarray") else value)
    if array.ndim != 2 or array.shape[0] != array.shape[1]:
        raise RefusedError(f"array of {kind}", f"of shape {array.shape}", "square arrays")
    require_numbers(kind, array)
    off = np.abs(array - array.T)
    i, j = np.unravel_index(off.argmax(), off.shape)
    if off[i, j] > 1e-9 * np.abs(array).max():
        what = f"not symmetric: [{i}, {j}] is {array[i, j]:g}, [{j}, {i}] is {array[j, i]:g}"
        raise RefusedError(f"array of {kind}", what, "symmetric arrays", "mirror one triangle")
    return np.asarray((array + array.T) / 2, float)


def value_of(factor: Factor | str | float, p: Mapping[str, Any]) -> Any:
    """A factor's value at parameters."""
    if isinstance(factor, str):
        return p[factor]
    return factor(p) if callable(factor) else factor
