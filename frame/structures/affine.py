"""Matrices that are affine in parameters, K(p) = K_0 + Σ p_i K_i, from exports of a program."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from alphacut.base.arrays import Array
from alphacut.base.errors import require, require_numbers
from alphacut.frame.structures.matrix import require_symmetric

# Fewer printed digits than these do not tell a rounding from a term that is not affine.
MIN_DIGITS = 6
# Largest rounding of what a program adds up, relative to √(K_ii K_jj). Tuned: some thousand units
# of double precision, since entries of several elements may cancel.
ASSEMBLY_ROUNDING = 1e-12
# A step of a tenth of a parameter loses one printed digit of its term.
MIN_STEP = 0.1


def affine_terms(
    exports: Sequence[tuple[Mapping[str, float], Array]],
    *,
    unknowns: Sequence[str] = (),
    is_affine: bool = False,
) -> tuple[tuple[str | float, Array], ...]:
    """Return the terms of a matrix that a program wrote for several values of its parameters.

    The matrix must be affine in each parameter and in all together, K(p) = K_0 + Σ p_i K_i, as the
    stiffness is in a modulus or a spring. K_i is the difference of two exports over the step of
    p_i. All other exports must lie on the sum to within the rounding of their digits, whose number
    is estimated; E and I of one beam, for example, do not.

    Args:
        exports: Pairs of the values of all parameters by name, in SI units, and the symmetric array
            (n, n). The first pair is the nominal one. For each parameter there are two more at
            least in which it alone differs, by a tenth of its value or more; of several parameters
            all differ in one more.
        unknowns: Names of the n rows, for messages; their numbers, from 1 on, where empty.
        is_affine: Whether the caller knows that the matrix is affine, as in the modulus of a model
            of one material. Then one more export for each parameter is enough, and what is
            computed from the exports is not checked by others unless there are some.

    Returns:
        Pairs (factor, array) as `MatrixStructure` takes them: the name of each parameter with K_i,
        and 1.0 with K_0 where it is not 0. Entries within the rounding are 0.

    Raises:
        RefusedError: There are too few exports, or steps too small to tell; arrays are not square,
            finite, symmetric, or of one shape; a parameter changes nothing; or the matrix is not
            affine. The message has the largest deviation, relative to its entry.

    Example:
        >>> import numpy as np
        >>> exports = [({"k": k}, np.array([[100.0 + k]])) for k in (200.0, 400.0, 300.0)]
        >>> [(factor, float(array[0, 0])) for factor, array in affine_terms(exports)]
        [('k', 1.0), (1.0, 100.0)]
    """
    _require_exports(exports, unknowns, least=2 if is_affine else 3)
    names = tuple(exports[0][0])
    values = np.array([[parameters[name] for name in names] for parameters, _ in exports], float)
    arrays = np.array([array for _, array in exports], float)
    chosen = [_chosen_export(values, k, name, is_affine) for k, name in enumerate(names)]
    is_joint = is_affine or len(names) == 1 or bool((values != values[0]).all(axis=1).any())
    require(
        is_joint, "exports that move all parameters", 0, "one, to see that they do not multiply"
    )
    # Each entry is rounded to `unit` of its magnitude by printing, and by what the program adds up.
    diagonal = np.sqrt(np.abs(np.diagonal(arrays, axis1=1, axis2=2)).max(axis=0))
    assembly = ASSEMBLY_ROUNDING * np.outer(diagonal, diagonal)
    roundings = _rounding_unit(arrays) * np.abs(arrays) + assembly
    model = _AffineMatrix(
        values[0],
        np.diag(values[chosen] - values[0]),
        _Rounded(arrays[0], roundings[0]),
        _Rounded(arrays[chosen] - arrays[0], roundings[chosen] + roundings[0]),
    )

    for k, array in enumerate(arrays):
        expected = model.at(values[k])
        deviation = np.abs(array - expected.entries)
        excess = deviation - expected.rounding - roundings[k]
        i, j = divmod(int(excess.argmax()), len(array))  # entries are counted row by row
        relative = deviation[i, j] / max(np.abs(arrays[:, i, j]).max(), assembly[i, j])
        rows = unknowns or range(1, len(array) + 1)
        moved = [name for name, x in zip(names, values[k] != values[0], strict=True) if x]
        value = f"not affine in {' and '.join(moved)}:"
        value += f" {relative:.2g} of the entry at [{rows[i]}, {rows[j]}]"
        cure = "let exports differ in this parameter alone"
        if len(moved) > 1:
            cure = "make one parameter of what is multiplied, as EI"
        allowed = "a sum of terms with one parameter each"
        require(bool(excess[i, j] <= 0), f"export {k + 1}", value, allowed, cure)
    return model.terms(names)


class _Rounded(NamedTuple):
    """Entries of arrays, and the largest error of each by rounding, in the same shape."""

    entries: Array
    rounding: Array

    @property
    def cleared(self) -> Array:
        """The entries, 0 where rounding alone can have made them."""
        return np.where(np.abs(self.entries) <= self.rounding, 0.0, self.entries)


class _AffineMatrix(NamedTuple):
    """The affine matrix through a nominal array and one more for each of P parameters.

    Args:
        point: Nominal parameters, shape (P,).
        steps: Change of each parameter in its array, shape (P,).
        nominal: The nominal array, shape (n, n).
        differences: Changes of the arrays, shape (P, n, n).
    """

    point: Array
    steps: Array
    nominal: _Rounded
    differences: _Rounded

    def at(self, point: Array) -> _Rounded:
        """Return the matrix at some parameters, shape (P,)."""
        fractions = (point - self.point) / self.steps
        change = np.tensordot(fractions, self.differences.entries, 1)
        rounding = np.tensordot(np.abs(fractions), self.differences.rounding, 1)
        return _Rounded(self.nominal.entries + change, self.nominal.rounding + rounding)

    def terms(self, names: Sequence[str]) -> tuple[tuple[str | float, Array], ...]:
        """Return the term of each parameter, and the constant one if there is one.

        Raises:
            RefusedError: A parameter changes nothing.
        """
        terms: list[tuple[str | float, Array]] = []
        for name, difference, step in zip(names, self.differences.cleared, self.steps, strict=True):
            require(bool(difference.any()), name, "without any effect", "parameters of the matrix")
            terms.append((name, np.asarray(difference / step)))
        constant = self.at(np.zeros(len(names))).cleared
        if constant.any():
            terms.append((1.0, constant))
        return tuple(terms)


def _chosen_export(values: Array, k: int, name: str, is_affine: bool) -> int:
    """Return the number of the export that moves a parameter alone, the farthest.

    Args:
        values: Parameters of all exports, shape (exports, P).
        k: Number of the parameter.
        name: Its name, for the message.
        is_affine: Whether no further export must tell a straight line from a bent one.

    Raises:
        RefusedError: There are no two such exports, far enough from the nominal one and apart.
    """
    is_moved = values != values[0]
    alone = np.flatnonzero(is_moved[:, k] & (is_moved.sum(axis=1) == 1))
    steps = np.append(values[alone, k] - values[0, k], 0.0)
    far = int(np.abs(steps).argmax())
    # A further export tells a straight line from a bent one if it is well inside of its ends.
    inner = np.abs(steps * (steps[far] - steps)).max()
    is_told = is_affine or inner > MIN_STEP / 2 * steps[far] ** 2
    is_told = is_told and abs(steps[far]) >= MIN_STEP * abs(values[0, k])
    value = f"moved alone by {', '.join(f'{step:g}' for step in steps[:-1]) or 'none'}"
    cure = "move it by its own size, and once by half of this"
    require(is_told, name, value, "two steps of a tenth or more, well apart", cure)
    return int(alone[far])


def _require_exports(
    exports: Sequence[tuple[Mapping[str, float], Array]], unknowns: Sequence[str], *, least: int
) -> None:
    """Check that exports have the same parameters and symmetric arrays of one shape.

    Raises:
        RefusedError: One is of another kind, or there are fewer than `least`, 2 or 3.
    """
    allowed = f"{least} or more, each with its parameters"
    cure = "of a matrix that is known to be affine two are enough: affine = true says so"
    is_enough = len(exports) >= least
    require(is_enough, "exports", len(exports), allowed, cure if least > 2 else "")
    names = list(exports[0][0])
    shape = np.shape(exports[0][1])
    for number, (parameters, array) in enumerate(exports, 1):
        key = f"export {number}"
        value = f"of parameters {', '.join(parameters)}"
        is_same = bool(names) and set(parameters) == set(names)
        require(is_same, key, value, ", ".join(names) or "names")
        require_numbers(key, [*parameters.values()])
        is_square = np.shape(array) == shape == shape[:1] * 2 and np.size(array) > 0
        cure = "write all from one model, with the same unknowns"
        value = f"of shape {np.shape(array)}"
        require(is_square, key, value, f"a square array of shape {shape}", cure)
        require_numbers(key, array)
        require_symmetric(key, np.asarray(array), unknowns or range(1, len(array) + 1))


def _rounding_unit(arrays: Array) -> float:
    """Return the largest relative rounding of numbers that were printed with as many digits."""
    numbers = arrays[arrays != 0]
    sample = numbers[:: len(numbers) // 10000 + 1]
    digits = 0
    for number in np.abs(sample):
        mantissa = np.format_float_scientific(number, trim="-").partition("e")[0]
        digits = max(digits, len(mantissa.replace(".", "")))
    unit = 0.5 * 10.0 ** (1 - max(digits, MIN_DIGITS))
    if np.array_equal(arrays, arrays.astype(np.float32)):  # as binary files of single precision
        unit = max(unit, 2.0**-24)
    return max(unit, 2.0**-53)
