"""Taylor models: polynomials over the unit box with a proved bound of all that they leave out.

A Taylor model stands for functions f(u) of inputs u in [−1, 1]^d: |f(u) − p(u)| ≤ remainder for all
u of the box, p a polynomial (Makino, Berz 2003). Sums, products, powers and solutions of linear
systems of Taylor models are Taylor models.

Two errors go into the remainder. Terms of a product above the order kept are bounded by the sums
of the magnitudes of the coefficients of its factors. The Taylor series of a power is bounded by
Lagrange's remainder, with the derivative of the next order. Rounding is not in it: bounds hold in
exact arithmetic, and have a margin where they are used.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations_with_replacement
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from alphacut.base.arrays import Array, Ints
from alphacut.frame.calculus.polynomials import (
    convolve,
    derivative,
    exponents,
    matmul,
    monomial_values,
    monomials,
    places,
    product_part,
    zero_part,
)
from alphacut.frame.calculus.unproved import UnprovedError

# Order of a Taylor model unless another is given (tuned). A higher one has a smaller remainder, and
# many more coefficients: binomial(d + order, d) for d inputs.
ORDER = 3


@dataclass(frozen=True, eq=False)
class TaylorModel:
    """Taylor models of an array of functions, of shape V, on the unit box [−1, 1]^d.

    Operators act on the array as NumPy's act on arrays of numbers. Each result bounds the results
    of exact arithmetic on all functions that its operands stand for.

    Args:
        parts: Homogeneous parts of the polynomials by degree 0, 1, …: coefficients of shape
            (monomials of that degree, *V), real or complex, in the order of
            `monomials.monomials`. Parts of higher degrees are zero.
        remainder: Bound of |f(u) − p(u)| over the box, shape V, not negative.
        inputs: Number d of inputs.
        order: Degree above which products move their terms into the remainder.
    """

    # NumPy's arrays as left operands leave the operation to this class
    __array_ufunc__ = None

    parts: tuple[Array, ...]
    remainder: Array
    inputs: int
    order: int = ORDER

    @classmethod
    def constant(cls, value: ArrayLike, inputs: int, order: int = ORDER) -> TaylorModel:
        """Return constant functions, with the values `value` of shape V."""
        array = _numbers(value)
        return cls((array[None],), np.zeros(array.shape), inputs, order)

    @classmethod
    def variables(cls, centre: Array, radius: Array, order: int = ORDER) -> TaylorModel:
        """Return the d functions centre_i + radius_i u_i of inputs u in [−1, 1]^d.

        These are the uncertain parameters over a box.

        Args:
            centre: Midpoints, shape (d,).
            radius: Half-widths, not negative, shape (d,).
            order: Degree above which products move their terms into the remainder.

        Returns:
            Taylor model of an array of functions of the shape (d,).
        """
        constant_part = np.asarray(centre, float)[None]
        linear_part = np.diag(np.asarray(radius, float))
        return cls((constant_part, linear_part), np.zeros(len(centre)), len(centre), order)

    def like(self, value: ArrayLike) -> TaylorModel:
        """Return constant functions of the same inputs and to the same order."""
        return TaylorModel.constant(value, self.inputs, self.order)

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape V of the array of functions."""
        return self.remainder.shape

    @property
    def value(self) -> Array:
        """Values of the polynomials at the midpoint u = 0 of the box, shape V."""
        return np.asarray(self.parts[0][0])

    @property
    def T(self) -> TaylorModel:  # noqa: N802
        """The matrices with their last two axes swapped."""
        parts = tuple(part.swapaxes(-1, -2) for part in self.parts)
        return replace(self, parts=parts, remainder=self.remainder.swapaxes(-1, -2))

    @staticmethod
    def stack(models: Sequence[TaylorModel]) -> TaylorModel:
        """Return Taylor models of equal shape V, joined along a new last axis of V."""
        return concatenate([x[..., None] for x in models], -1)

    def homogeneous_part(self, degree: int) -> Array:
        """Return the coefficients of one degree, shape (monomials, *V); zeros if none are kept."""
        if degree < len(self.parts):
            return self.parts[degree]
        return zero_part(self.inputs, degree, self.shape, self.parts[0].dtype)

    @cached_property
    def part_magnitudes(self) -> tuple[Array, ...]:
        """Bound over the box of the magnitude of each homogeneous part.

        Since |u_i| ≤ 1, the sum of the magnitudes of its coefficients bounds a part.

        There is one array for each degree from 0 on, each of the shape of the array of functions.
        The remainder is not in them.
        """
        return tuple(np.abs(part).sum(0) for part in self.parts)

    def magnitude(self) -> Array:
        """Return a bound of |f| over the box, shape V."""
        return np.asarray(sum(self.part_magnitudes) + self.remainder)

    def deviation(self) -> Array:
        """Return a bound over the box of |f − p(0)|, where p(0) is `value`, shape V."""
        return np.asarray(sum(self.part_magnitudes[1:]) + self.remainder)

    def bounds(self) -> tuple[Array, Array]:
        """Return a lower and an upper bound of real functions over the box, each of shape V."""
        radius = self.deviation()
        return self.value - radius, self.value + radius

    def widened(self, more: ArrayLike) -> TaylorModel:
        """Return the model with `more`, of shape V, added to the remainder."""
        return replace(self, remainder=self.remainder + np.asarray(more))

    @cached_property
    def coefficients(self) -> Array:
        """Coefficients of all degrees, shape (terms, *V), ordered as in `monomial_values`."""
        return np.concatenate(self.parts)

    @property
    def exponents(self) -> Ints:
        """Exponents of the monomials of `coefficients`, shape (terms, d)."""
        return np.concatenate([exponents(self.inputs, k) for k in range(len(self.parts))])

    def at(self, u: Array) -> Array:
        """Return the values of the polynomials at points u, shape (S, d): shape (S, *V)."""
        powers = monomial_values(u, len(self.parts) - 1)
        flat = self.coefficients.reshape(powers.shape[1], -1)
        return _real_times(powers, flat).reshape(len(u), *self.shape)

    def jets(self, u: Array) -> Array:
        """Return values, gradients and Hessians of the polynomials of K functions at points.

        The remainder, which bounds their distance from the functions, is left out.

        Args:
            u: Points in the inputs of the model, shape (S, d).

        Returns:
            Array of shape (S, 1 + d + d (d + 1)/2, K). Along the second axis stand the value, the d
            first derivatives, and the second derivatives by u_i and u_j for i ≤ j: (0, 0), (0, 1) …
            (0, d − 1), (1, 1) ….
        """
        powers = monomial_values(u, len(self.parts) - 1)
        tables = [_real_times(powers[:, : len(x)], x) for x in self._derivative_tables]
        return np.hstack(tables).reshape(len(u), -1, *self.shape)

    @cached_property
    def _derivative_tables(self) -> list[Array]:
        """Coefficients of the polynomials of K functions and of their derivatives, as three arrays.

        They are for the derivatives of order 0, 1 and 2, of shape (monomials, K · derivatives of
        that order). Along the second axis stand the coefficients of all K functions differentiated
        by u_0, then by u_1 and so on, and in the third array by the pairs (u_i, u_j) with i ≤ j,
        the last index fastest. The rows are the monomials of all degrees that the derivatives have,
        by degree.
        """
        directions = np.eye(self.inputs)
        # homogeneous parts of the derivative by each list of inputs, such as (0, 0) or (0, 2)
        derivatives_by: dict[tuple[int, ...], Sequence[Array]] = {(): self.parts}
        tables = [self.coefficients]
        for order in (1, 2):
            of_this_order = []
            for inputs in combinations_with_replacement(range(self.inputs), order):
                # The derivative by one input less has been found before; it is differentiated by
                # the last input. A constant has the derivative zero, of degree 0.
                parts_before = derivatives_by[inputs[:-1]]
                direction = directions[inputs[-1]]
                parts = [
                    derivative(part, degree, direction)
                    for degree, part in enumerate(parts_before[1:], 1)
                ]
                derivatives_by[inputs] = parts or [0 * self.parts[0]]
                of_this_order.append(np.concatenate(derivatives_by[inputs]))
            tables.append(np.hstack(of_this_order))
        return tables

    def active_inputs(self) -> Ints:
        """Return the indices of the inputs that the polynomials depend on, rising."""
        is_active = np.zeros(self.inputs, bool)
        for degree, part in enumerate(self.parts[1:], 1):
            has_coefficient = part.reshape(len(part), -1).any(1)
            is_active[monomials(self.inputs, degree)[has_coefficient]] = True
        return np.flatnonzero(is_active)

    def restricted_to(self, inputs: Ints) -> TaylorModel:
        """Return the same functions as functions of fewer inputs.

        Args:
            inputs: Indices of the inputs that are kept, rising, shape (fewer,). The functions must
                not depend on any other input, which is not checked: terms with another input are
                lost.
        """
        fewer = len(inputs)
        parts = []
        for degree, part in enumerate(self.parts):
            kept = places(inputs[monomials(fewer, degree)], self.inputs)
            parts.append(part[kept])
        # a rising list of kept inputs stays a rising list, so that no monomial is met twice
        return TaylorModel(tuple(parts), self.remainder, fewer, self.order)

    def embedded(self, inputs: Ints, d: int) -> TaylorModel:
        """Return the same functions as functions of d inputs, the reverse of `restricted_to`.

        Args:
            inputs: Index of each present input among the d inputs, rising, shape (self.inputs,).
            d: Number of inputs of the result. If it is the present number, the model is returned
                as it is.
        """
        if self.inputs == d:
            return self
        parts = []
        for degree, part in enumerate(self.parts):
            wider_part = zero_part(d, degree, self.shape, part.dtype)
            wider_part[places(inputs[monomials(self.inputs, degree)], d)] = part
            parts.append(wider_part)
        return TaylorModel(tuple(parts), self.remainder, d, self.order)

    @property
    def real(self) -> TaylorModel:
        """Real parts of the functions."""
        return replace(self, parts=tuple(part.real for part in self.parts))

    @property
    def imag(self) -> TaylorModel:
        """Imaginary parts of the functions."""
        return replace(self, parts=tuple(part.imag for part in self.parts))

    @property
    def polynomial(self) -> TaylorModel:
        """The polynomials alone, with a remainder of zero."""
        return replace(self, remainder=np.zeros(self.shape))

    def truncated(self, order: int) -> TaylorModel:
        """Return the model to a lower order; bounds of the higher parts go into the remainder."""
        remainder = np.asarray(self.remainder + sum(self.part_magnitudes[order + 1 :]))
        return TaylorModel(self.parts[: order + 1], remainder, self.inputs, order)

    def on_subbox(self, low: Array, high: Array) -> TaylorModel:
        """Return the model on the sub-box low ≤ u ≤ high, as a model on the unit box.

        The new inputs w in [−1, 1]^d are those of u = (low + high)/2 + w (high − low)/2. The
        remainder stays.

        Args:
            low: Lower ends of the sub-box, shape (d,), not below −1.
            high: Upper ends, not above 1 and not below `low`.
        """
        midpoint = (low + high) / 2
        radius = (high - low) / 2
        shifted = self.shifted_parts(midpoint)
        # v_i = radius_i w_i
        parts = []
        for degree, part in enumerate(shifted):
            scale = radius[monomials(self.inputs, degree)].prod(-1)
            axes_of_functions = tuple(range(1, 1 + self.remainder.ndim))
            parts.append(np.expand_dims(scale, axes_of_functions) * part)
        return replace(self, parts=tuple(parts))

    def shifted_parts(self, point: Array) -> list[Array]:
        """Return the coefficients of the polynomials p(point + v) in v, by degree.

        The remainder is left out.

        Args:
            point: Any point, in the unit box or not, shape (d,).
        """
        # Taylor's formula: p(point + v) = Σ_k (point·∇)^k p(v) / k!, of which the k-th term turns a
        # part of degree m into one of degree m − k
        shifted = [np.zeros_like(part) for part in self.parts]
        for degree, part in enumerate(self.parts):
            term = part
            for k in range(degree + 1):
                shifted[degree - k] = shifted[degree - k] + term
                if k < degree:
                    term = derivative(term, degree - k, point) / (k + 1)
        return shifted

    def reshaped(self, *shape: int) -> TaylorModel:
        """Return the same functions with another shape V."""
        parts = tuple(part.reshape(len(part), *shape) for part in self.parts)
        return replace(self, parts=parts, remainder=self.remainder.reshape(shape))

    def __getitem__(self, index: Any) -> TaylorModel:
        key = index if isinstance(index, tuple) else (index,)
        parts = tuple(part[(slice(None), *key)] for part in self.parts)
        return replace(self, parts=parts, remainder=self.remainder[key])

    def __add__(self, other: TaylorModel | ArrayLike) -> TaylorModel:
        """Return the sum, which broadcasts as sums of arrays do.

        Args:
            other: Taylor model of the same inputs, or numbers, which stand for constant functions.

        Returns:
            Taylor model of the higher order of both.
        """
        b = self._as_model(other)
        ndim = max(len(self.shape), len(b.shape))
        parts = []
        for degree in range(max(len(self.parts), len(b.parts))):
            first = _padded(self.homogeneous_part(degree), ndim)
            second = _padded(b.homogeneous_part(degree), ndim)
            parts.append(first + second)
        remainder = self.remainder + b.remainder
        order = max(self.order, b.order)
        return TaylorModel(tuple(parts), remainder, self.inputs, order)

    __radd__ = __add__

    def __neg__(self) -> TaylorModel:
        """Return the negative functions."""
        return replace(self, parts=tuple(-part for part in self.parts))

    def __sub__(self, other: TaylorModel | ArrayLike) -> TaylorModel:
        return self + -self._as_model(other)

    def __rsub__(self, other: ArrayLike) -> TaylorModel:
        return -self + other

    def __mul__(self, other: TaylorModel | ArrayLike) -> TaylorModel:
        """Return the elementwise product, which broadcasts as products of arrays do.

        Args:
            other: Taylor model of the same inputs, or numbers, which scale the polynomials and, by
                their magnitude, the remainder.

        Returns:
            Taylor model of the higher order of both, whose remainder bounds the terms above this
            order.
        """
        if isinstance(other, TaylorModel):
            return _product(self, other, np.multiply)
        factor = _numbers(other)
        parts = tuple(_padded(part, factor.ndim) * factor for part in self.parts)
        remainder = self.remainder * np.abs(factor)
        return TaylorModel(parts, remainder, self.inputs, self.order)

    __rmul__ = __mul__

    def __matmul__(self, other: TaylorModel | Array) -> TaylorModel:
        """Return the products of matrices of functions with matrices of functions or numbers."""
        if isinstance(other, TaylorModel):
            return _product(self, other, matmul)
        return self._linear(np.matmul, _numbers(other))

    def __rmatmul__(self, other: Array) -> TaylorModel:
        factor = _numbers(other)
        return self._linear(lambda x, y: np.matmul(y, x), factor)

    def __truediv__(self, other: TaylorModel | ArrayLike) -> TaylorModel:
        if isinstance(other, TaylorModel):
            return self * other**-1.0
        return self * (1.0 / _numbers(other))

    def __rtruediv__(self, other: ArrayLike) -> TaylorModel:
        return self**-1.0 * other

    def __pow__(self, exponent: float) -> TaylorModel:
        """Return a real power of functions f that are positive over the box.

        With the value c of f's polynomial at the midpoint and t = f − c, the model is the Taylor
        series

            f^a = Σ_k binomial(a, k) c^(a − k) t^k,    k = 0 … N, N the order.

        By Lagrange's form the remainder bounds what follows by |binomial(a, N + 1)|
        max(ξ^(a − N − 1)) max|t|^(N + 1), ξ between the bounds of f. A power of ξ is monotonic, so
        that its maximum lies at one of these two bounds.

        Args:
            exponent: a.

        Raises:
            UnprovedError: A function is not known to be positive on the box.
        """
        centre = self.value
        deviation = self.deviation()
        N = self.order
        lower_bound = centre - deviation
        if not (lower_bound > 0).all():
            raise UnprovedError(
                "a quantity that must be positive is not known to be so over the box",
                "take narrower inputs",
            )
        step = self - centre
        binomial = 1.0
        series = self.like(centre**exponent)
        step_power = self.like(np.ones_like(centre))
        for k in range(1, N + 1):
            binomial = binomial * (exponent - k + 1) / k
            step_power = step_power * step
            coefficient = binomial * centre ** (exponent - k)
            series = series + step_power * coefficient
        next_binomial = abs(binomial * (exponent - N) / (N + 1))
        last_exponent = exponent - N - 1
        last_power = np.maximum(lower_bound**last_exponent, (centre + deviation) ** last_exponent)
        return series.widened(next_binomial * last_power * deviation ** (N + 1))

    def contract(self, arrays: Array) -> TaylorModel:
        """Return Σ_k f[…, k] arrays[k], for V = (…, e) and numbers of shape (e, …)."""
        factor = _numbers(arrays)
        return self._linear(lambda x, y: np.asarray(np.tensordot(x, y, 1)), factor)

    def _as_model(self, other: TaylorModel | ArrayLike) -> TaylorModel:
        """Return a Taylor model as it is, and numbers as constant functions."""
        if isinstance(other, TaylorModel):
            return other
        return self.like(_numbers(other))

    def _linear(self, bilinear: Callable[[Array, Array], Array], factor: Array) -> TaylorModel:
        """Return a bilinear product with numbers.

        Args:
            bilinear: Product of an array of functions' coefficients with `factor`. It must accept
                one more axis in front of the first array, and be a sum of products of entries, so
                that the product of the magnitudes bounds its magnitude.
            factor: The numbers.

        Returns:
            Taylor model of the array of functions that `bilinear` gives, of the same inputs and
            order.
        """
        remainder = np.asarray(bilinear(self.remainder, np.abs(factor)))
        parts = tuple(np.asarray(bilinear(part, factor)) for part in self.parts)
        return TaylorModel(parts, remainder, self.inputs, self.order)


def concatenate(models: Sequence[TaylorModel], axis: int) -> TaylorModel:
    """Return Taylor models of arrays of functions of the same inputs, joined along an axis.

    Args:
        models: At least one. Their arrays of functions fit as those of `numpy.concatenate`.
        axis: Axis of these arrays, negative, counted from the last one.

    Returns:
        Taylor model with the highest order of all.
    """
    parts = []
    for degree in range(max(len(model.parts) for model in models)):
        of_degree = [model.homogeneous_part(degree) for model in models]
        parts.append(np.concatenate(of_degree, axis))
    remainder = np.concatenate([model.remainder for model in models], axis)
    order = max(model.order for model in models)
    return TaylorModel(tuple(parts), remainder, models[0].inputs, order)


def all_on_subbox(models: Sequence[TaylorModel], low: Array, high: Array) -> list[TaylorModel]:
    """Return each model on the sub-box low ≤ u ≤ high, as a model on the unit box.

    The new inputs w in [−1, 1]^d are those of u = (low + high)/2 + w (high − low)/2. All models are
    moved at once as one array of functions, which is faster than one by one.

    Args:
        models: At least one; all of the same d inputs.
        low: Lower ends of the sub-box, shape (d,), not below −1.
        high: Upper ends, not above 1 and not below `low`.

    Returns:
        The models in their order, each with its shape and order.
    """
    # The highest order serves all while they are joined: the sub-box forms no products, so that no
    # model gains terms.
    joined = concatenate([model.reshaped(-1) for model in models], axis=-1).on_subbox(low, high)
    moved = list[TaylorModel]()
    first = 0
    for model in models:
        last = first + model.remainder.size
        moved.append(replace(joined[first:last].reshaped(*model.shape), order=model.order))
        first = last
    return moved


def inverse_bound(matrix: TaylorModel) -> Array | None:
    """Return a bound, entry by entry, of |A⁻¹| for all matrices A of a Taylor model.

    With an approximate inverse C of the matrix at the midpoint, A⁻¹ = (I − (I − C A))⁻¹ C. If the
    spectral radius of R ≥ |I − C A| is below 1, Neumann's series converges and |A⁻¹| ≤ (I − R)⁻¹
    |C|. Of a matrix that is diagonal at the midpoint, this bound is the inverse of Ostrowski's
    comparison matrix (1937).

    Args:
        matrix: Square matrices of functions, of the shape (n, n).

    Returns:
        The bound, shape (n, n), or None where the series is not known to converge: then A may be
        singular.

    Raises:
        numpy.linalg.LinAlgError: The matrix at the midpoint, or I − R, is exactly singular.
    """
    n = len(matrix.value)
    C = np.linalg.inv(matrix.value)  # any C would do; a good one makes the bound tight
    R = np.abs(C) @ matrix.deviation() + np.abs(np.eye(n) - C @ matrix.value)
    inverse = np.linalg.inv(np.eye(n) - R)
    # R ≥ 0 has a spectral radius below 1 if and only if (I − R)⁻¹ exists and is ≥ 0 (M-matrices).
    # The distance of 1e-9 from 1 is far above the rounding of R.
    radius = np.abs(np.linalg.eigvals(R)).max(initial=0.0)
    if not ((inverse >= 0).all() and radius < 1 - 1e-9):
        return None
    return np.asarray(inverse @ np.abs(C))


def solution_series(matrix: TaylorModel, right: TaylorModel) -> TaylorModel:
    """Return polynomials Y that solve A Y = B degree by degree, without a bound of their error.

    The part of degree m of A Y = B gives Y_m = A_0⁻¹ (B_m − Σ_{k < m} A_{m−k} Y_k), where A_0 is
    the matrix at the midpoint of the box.

    Args:
        matrix: A, matrices of functions of the shape (n, n).
        right: B, of the shape (n, m), of the same inputs.

    Returns:
        Y, of the shape (n, m) and the higher order of both, with a remainder of zero. Where there
        are no inputs, it is constant.

    Raises:
        numpy.linalg.LinAlgError: A_0 is singular.
    """
    order = 0
    if matrix.inputs:
        order = max(matrix.order, right.order)
    midpoint_inverse = np.linalg.inv(matrix.value)
    parts = [midpoint_inverse @ right.homogeneous_part(0)]
    for degree in range(1, order + 1):
        lower_degrees = product_part(matrix.parts, parts, degree, matrix.inputs, matmul)
        parts.append(midpoint_inverse @ (right.homogeneous_part(degree) - lower_degrees))
    return TaylorModel(tuple(parts), np.zeros(right.shape), matrix.inputs, order)


def solve(matrix: TaylorModel, right: TaylorModel) -> TaylorModel:
    """Return a Taylor model of the solutions Y of A Y = B.

    Polynomials Y' that solve the system degree by degree have the error |Y' − Y| ≤ |A⁻¹| |A Y' −
    B|, whose factors are bounded over the box. Both sides of the system are first multiplied by the
    inverse of A at the midpoint, which makes these bounds tight.

    Args:
        matrix: A, matrices of functions of the shape (n, n).
        right: B, of the shape (n, m), of the same inputs.

    Raises:
        UnprovedError: A may be singular somewhere in the box.
        numpy.linalg.LinAlgError: A is exactly singular at the midpoint.
    """
    # any matrix serves as a preconditioner
    midpoint_inverse: Any = np.linalg.inv(matrix.value)
    matrix = midpoint_inverse @ matrix
    right = midpoint_inverse @ right
    solution = solution_series(matrix, right)
    bound = inverse_bound(matrix)
    if bound is None:
        raise UnprovedError("a matrix may be singular in the box", "take narrower inputs")
    return solution.widened(bound @ (matrix @ solution - right).magnitude())


def _numbers(value: ArrayLike) -> Array:
    """Return numbers as an array of floats or of complex numbers."""
    array = np.asarray(value)
    if np.iscomplexobj(array):
        return array
    return np.asarray(array, float)


def _real_times(real: Array, coefficients: Array) -> Array:
    """Return real @ coefficients, (S, terms) by (terms, K), for real or complex coefficients.

    NumPy would first convert `real` to complex numbers; here the real and the imaginary parts are
    2 K real columns.
    """
    if not np.iscomplexobj(coefficients):
        return np.asarray(real @ coefficients)
    real_columns = np.ascontiguousarray(coefficients).view(float)
    return np.asarray((real @ real_columns).view(complex))


def _padded(part: Array, ndim: int) -> Array:
    """Return a part (monomials, *V) whose V has at least `ndim` axes, new ones on the left."""
    missing = max(ndim - (part.ndim - 1), 0)
    if not missing:  # as in most products, of which there are many
        return part
    return part.reshape(len(part), *(1,) * missing, *part.shape[1:])


def _product(
    a: TaylorModel, b: TaylorModel, bilinear: Callable[[Array, Array], Array]
) -> TaylorModel:
    """Return the product a b, with the terms above the higher order of both in the remainder.

    Args:
        a: Left factor.
        b: Right factor, of the same inputs.
        bilinear: `np.multiply` for elementwise products, or `matmul` of the module of monomials for
            products of matrices.

    Returns:
        Taylor model whose remainder bounds what the product of the polynomials leaves out of the
        product of the functions, and the terms above the order.
    """
    order = max(a.order, b.order)
    ndim = max(a.remainder.ndim, b.remainder.ndim)
    a_magnitudes = a.part_magnitudes
    b_magnitudes = b.part_magnitudes
    # |f g − p q| ≤ |f − p| |g| + |p| |g − q|
    remainder = bilinear(a.remainder, np.asarray(sum(b_magnitudes)) + b.remainder)
    remainder = remainder + bilinear(np.asarray(sum(a_magnitudes)), b.remainder)
    degrees = range(min(order, len(a_magnitudes) + len(b_magnitudes) - 2) + 1)
    dtype = np.result_type(a.parts[0], b.parts[0])
    parts = [zero_part(a.inputs, k, remainder.shape, dtype) for k in degrees]
    b_padded = [_padded(y, ndim) for y in b.parts]
    for i, x in enumerate(a.parts):
        x_padded = _padded(x, ndim)
        for j, y_padded in enumerate(b_padded):
            if i + j <= order:
                parts[i + j] += convolve(x_padded, y_padded, (i, j), a.inputs, bilinear)
            else:
                remainder = remainder + bilinear(a_magnitudes[i], b_magnitudes[j])
    return TaylorModel(tuple(parts), np.asarray(remainder), a.inputs, order)
