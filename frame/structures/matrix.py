"""Linear structure from matrices M, D, K: sums of arrays times smooth factors."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from alphacut.frame.calculus.jet import Array, Jet, variables
from alphacut.frame.calculus.numbers import require_number, require_numbers
from alphacut.frame.structures.damping import modal_damping
from alphacut.frame.structures.linear import Accelerogram, Matrices
from alphacut.frame.structures.quantities import Output


def require_factors(kind: str, terms: object, parameters: Mapping[str, float]) -> None:
    """Refuse terms that are no pairs, and factors without derivatives.

    Args:
        kind: What the terms make up: mass, damping or stiffness.
        terms: Pairs (factor, array).
        parameters: All parameters with their modal values.

    Raises:
        ValueError: There is one.
    """
    if isinstance(terms, str) or not isinstance(terms, Sequence):
        raise ValueError(
            f"{kind}: {type(terms).__name__} is no list of terms; give pairs (factor, array), as"
            " [(1.0, array)]"
        )
    for term in terms:
        if not isinstance(term, Sequence) or isinstance(term, str) or len(term) != 2:
            raise ValueError(
                f"{kind}: {type(term).__name__} is no term; give a list of pairs (factor, array),"
                " as [('m', array)]"
            )
        factor = term[0]
        if isinstance(factor, str) and factor not in parameters:
            raise ValueError(
                f"{kind}: factor '{factor}' is no parameter; known are {', '.join(parameters)}"
            )
        if callable(factor):
            _require_smooth(kind, factor, parameters)
        elif not isinstance(factor, str) and (
            np.ndim(factor) or np.asarray(factor).dtype.kind not in "iuf" or not np.isfinite(factor)
        ):
            shown = type(factor).__name__ if np.ndim(factor) else repr(factor)
            raise ValueError(
                f"{kind}: factor {shown} is not allowed; give a number, the name of a parameter or"
                " a function of all, then the array"
            )


def _require_smooth(kind: str, factor: Any, parameters: Mapping[str, float]) -> None:
    names, values = list(parameters), np.array([list(parameters.values())], float)
    try:
        found = factor(variables(values, names, names[:1]))
    except KeyError as unknown:
        raise ValueError(
            f"{kind}: a factor asks for {unknown}, which is no parameter; known are"
            f" {', '.join(parameters)}"
        ) from None
    except (TypeError, AttributeError, ValueError) as failure:
        cure = "use arithmetic, as p['k'] ** 0.5, and sin, cos, exp of alphacut.frame.calculus.jet"
        raise ValueError(
            f"{kind}: a factor cannot take parameters with derivatives ({failure}); {cure}"
        ) from None
    if not isinstance(found, Jet | float | int | np.number):
        raise ValueError(
            f"{kind}: a factor gives a {type(found).__name__}; it must give one number"
        )


def _symmetric(kind: str, given: Any, n: int) -> Array:
    """The array, also a sparse one, without the round-off that parts its triangles."""
    array = np.asarray(given.toarray() if hasattr(given, "toarray") else given)
    if array.shape != (n, n):
        raise ValueError(f"{kind}: an array has shape {array.shape}; all must be ({n}, {n})")
    require_numbers(kind, array, "SI units")
    array = array.astype(float)
    off = np.abs(array - array.T)
    i, j = np.unravel_index(off.argmax(), off.shape)
    if off[i, j] <= 1e-9 * np.abs(array).max():
        even: Array = (array + array.T) / 2
        return even
    cure = "mirror the one that is right, or take (A + A.T) / 2 where round-off parts them"
    if not (np.triu(array, 1).any() and np.tril(array, -1).any()):
        cure = "only one triangle is there: take A + A.T - np.diag(np.diag(A))"
    raise ValueError(
        f"{kind}: an array is not symmetric, by {off[i, j]:.2g}: entry [{i}, {j}] is"
        f" {array[i, j]:g} and [{j}, {i}] is {array[j, i]:g}; {cure}"
    )


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
        ValueError: A shape does not fit, a number is not finite, a factor names no parameter, an
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
    size: int = field(init=False)

    def __post_init__(self) -> None:
        for name, value in self.parameters.items():
            require_number(f"parameter {name}", value, "SI units")
        for kind in ("mass", "damping", "stiffness"):
            require_factors(kind, getattr(self, kind), self.parameters)
        rows = self.observed if isinstance(self.observed, Mapping) else ()
        if not (self.mass and self.stiffness and rows):
            raise ValueError(
                "mass, stiffness and observed: each needs at least one entry, observed by name, as"
                " {'q1': row}"
            )
        n = self._usual_size()
        object.__setattr__(self, "size", n)
        for kind in ("mass", "damping", "stiffness"):
            even = tuple((factor, _symmetric(kind, a, n)) for factor, a in getattr(self, kind))
            object.__setattr__(self, kind, even)
        self._check_vectors()
        self._check_ratios()
        self._check_mass()

    def _usual_size(self) -> int:
        """The size that most arrays have, with one row's vote, so that the odd one is refused."""
        terms = (*self.mass, *self.damping, *self.stiffness)
        sizes = [max((1, *np.shape(array))) for _, array in terms]
        row = max((0, *np.shape(next(iter(self.observed.values())))))
        return Counter([*sizes, row if row in sizes else row // 2]).most_common(1)[0][0]

    def _check_vectors(self) -> None:
        n = self.size
        for name in ("q0", "v0", "pattern"):
            if getattr(self, name) is not None and np.shape(getattr(self, name)) != (n,):
                raise ValueError(
                    f"{name}: shape {np.shape(getattr(self, name))} does not fit; it must be ({n},)"
                )
            require_numbers(
                name, () if getattr(self, name) is None else getattr(self, name), "SI units"
            )
        for name, row in self.observed.items():
            if np.shape(row) not in ((n,), (2 * n,)):
                raise ValueError(
                    f"observed: '{name}' has shape {np.shape(row)}; it must be ({n},) or ({2 * n},)"
                )
            require_numbers(f"observed: '{name}'", row, "SI units")

    def _check_mass(self) -> None:
        modal = sum(float(_value(f, self.parameters)) * A for f, A in self.mass)
        if not np.linalg.eigvalsh(modal).min() > 0:
            raise ValueError(
                "mass: the matrix at the modal parameters is not positive definite; every unknown"
                " needs a mass"
            )

    def _check_ratios(self) -> None:
        if isinstance(self.ratios, str) or not isinstance(self.ratios, Sequence):
            raise ValueError(
                f"ratios: {self.ratios!r} is not allowed; it must be a list, as [0.02]"
            )
        if len(self.ratios) not in (0, 1, self.size):
            raise ValueError(
                f"ratios: got {len(self.ratios)}; give one for all modes, or {self.size}, by rising"
                " frequency"
            )
        for ratio in self.ratios:
            if isinstance(ratio, str) and ratio not in self.parameters:
                raise ValueError(
                    f"ratios: '{ratio}' is no parameter; known are {', '.join(self.parameters)}"
                )
            value = float(_value(ratio, self.parameters))
            if not 0 <= value < 1:
                raise ValueError(
                    f"ratios: {value:g} is not allowed; it must be 0 or greater and below 1, the"
                    " critical damping"
                )

    @property
    def outputs(self) -> tuple[Output, ...]:
        """Names of the observed quantities, with their units."""
        return tuple(map(Output, self.observed))

    def matrices(self, p: Mapping[str, Jet]) -> Matrices:
        """M, D, K and the initial state at S parameter sets."""
        like = next(iter(p.values()))
        n, samples = self.size, like.value.size

        def lifted(factor: Factor | str | float) -> Jet:
            value = _value(factor, p)
            return value if isinstance(value, Jet) else like.like(np.full(samples, float(value)))

        def total(terms: Terms) -> Jet:
            out = like.like(np.zeros((samples, n, n)))
            for factor, array in terms:
                out = out + lifted(factor)[:, None, None] * array
            return out

        start = [np.zeros(n) if x is None else np.asarray(x, float) for x in (self.q0, self.v0)]
        q0, v0 = (like.like(np.tile(x[None, :, None], (samples, 1, 1))) for x in start)
        pattern = None if self.pattern is None else np.asarray(self.pattern, float)[:, None]
        mass, damping, stiffness = (
            total(terms) for terms in (self.mass, self.damping, self.stiffness)
        )
        if self.ratios:
            damping = damping + modal_damping(
                mass, stiffness, [lifted(ratio) for ratio in self.ratios]
            )
        return Matrices(mass, damping, stiffness, q0, v0, pattern)

    def observation(self, p: Mapping[str, Jet]) -> Jet:
        """Rows C(p) with output = C(p) [q; v], shape (S, m, 2n)."""
        like = next(iter(p.values()))
        rows = np.zeros((len(self.observed), 2 * self.size))
        for k, row in enumerate(self.observed.values()):
            rows[k, : len(row)] = row
        return like.like(np.tile(rows, (like.value.size, 1, 1)))


def _value(factor: Factor | str | float, p: Mapping[str, Any]) -> Any:
    if isinstance(factor, str):
        return p[factor]
    return factor(p) if callable(factor) else factor
