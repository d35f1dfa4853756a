"""Bounds of a modal model's motion over time and of what quadratic Taylor models leave out.

A part of a modal model is 2 Re Σ_k C_k(p) w(t; λ_k(p)) with w = exp(λ t) or w = R = ∫ exp(λ (t −
s)) a(s) ds; its r-th derivative by λ is bounded by t^r exp(g t), or by ∫ τ^r exp(g τ) |a(t − τ)|
dτ, with g a bound of Re λ.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil

import numpy as np

from alphacut.frame.calculus.jet import Array
from alphacut.frame.calculus.polynomial import Polynomial, derivative
from alphacut.frame.dynamics.integrators import absolute_integrals
from alphacut.frame.modal.ground_response import REACH, Direct, LoadTables
from alphacut.frame.modal.model import ModalModel

MOST_PARAMETERS = 6
"""Tensors of third derivatives grow with the cube of the number of parameters."""
MOST_TERMS = 100
"""Terms of the series of a wave under a load, at most, as rounding counts them."""
ROUNDING = 1e-13
"""Error of a convolution by Fourier transforms over the norms of its factors; some ε log₂ N."""


def suprema(polynomial: Polynomial, reach: Array) -> list[Array]:
    """Upper bounds of the |derivatives| of K polynomials over the box |u_i| ≤ reach_i.

    Returns:
        Of order 0 to 3, shapes (d,) * order + (K,): Σ |coefficient| times its monomial's bound.
    """
    d = polynomial.index.shape[1]
    monomial_bounds = np.prod(reach**polynomial.index, axis=1)

    def bound(coefficients: Array) -> Array:
        return np.asarray(monomial_bounds @ np.abs(coefficients))

    zero = bound(polynomial.coefficients)
    first = np.stack([bound(polynomial.gradient[i]) for i in range(d)])
    second = np.stack([[bound(polynomial.hessian[i, j]) for j in range(d)] for i in range(d)])
    third = np.zeros((d, *second.shape))
    for i in range(d):
        for j in range(d):
            for k in range(d):
                third[i, j, k] = bound(derivative(polynomial.index, k, polynomial.hessian[i, j]))
    return [zero, first, second, third]


def largest_growth(eigenvalue: Polynomial, reach: Array) -> Array:
    """Upper bounds of the growth rates Re λ_k over the box |u_i| ≤ reach_i, shape (n,), in 1/s."""
    size = np.prod(reach**eigenvalue.index, axis=1)
    real = eigenvalue.coefficients.real
    return np.asarray(real[0] + size[1:] @ np.abs(real[1:]))


@dataclass(frozen=True, eq=False)
class MotionPart:
    """The free part of a modal model, or what one load adds.

    Args:
        share: Coefficients C_k, n m polynomials.
        waves: Bounds of the derivatives of w by λ, orders 0 to 3, shape (4, T, n).
        elapsed: Bounds of ∫ |w| from 0 to t, shape (T, n).
        push: Bound of the impulse ∫ |a| of the load up to t, shape (T,), in m/s; 1 of the free
            part.
        left_out: Bound of the model's error of w, over waves[0], shape (n,).
        load: The load; None of the free part.
        number: Its place among the loads.
    """

    share: Polynomial
    waves: Array
    elapsed: Array
    push: Array
    left_out: Array
    load: LoadTables | None = None
    number: int = 0


def parts(model: ModalModel, growth: Array) -> list[MotionPart]:
    """The free part of a model's motion, then the part of each load, with bounds over time.

    Args:
        model: The modal model.
        growth: Upper bounds of Re λ_k, shape (n,), in 1/s.
    """
    time = model.time[:, None]
    powers = time ** np.arange(4)[:, None, None]
    divisor = np.where(growth == 0, 1.0, growth)
    elapsed = np.where(growth == 0, time, np.expm1(growth * time) / divisor)
    free = MotionPart(
        share=model.coefficient,
        waves=powers * np.exp(growth * time),
        elapsed=elapsed,
        push=np.ones(len(time)),
        left_out=np.zeros(model.count),
    )
    return [free, *(_forced_part(model, growth, k) for k in range(len(model.loads)))]


def _forced_part(model: ModalModel, growth: Array, number: int) -> MotionPart:
    """Part of a modal model's motion that is due to load `number`, a(t).

    It has at the nodes bounds of the derivatives by λ of R = ∫ exp(λ (t − s)) a(s) ds, of orders 0
    to 3, of ∫ |R| and of ∫ |a|, from convolutions of |a| with upper sums of τ^k exp(g τ).

    Args:
        model: The modal model.
        growth: Upper bounds g of Re λ_k, shape (n,), in 1/s.
        number: Index of the load among the model's.
    """
    load, steps = model.loads[number], len(model.time) - 1
    if isinstance(load, Direct):
        return _feedthrough_part(model, load, number)
    substeps = ceil(model.flow.step / load.history.step - 1e-9)
    h, count = model.flow.step / substeps, substeps * steps
    kernels = [_kernel_maxima(growth, h, count, power) for power in range(4)]
    # upper sums of ∫ exp(g s) ds from 0 to the end of each interval
    integrated = np.cumsum(kernels[0], axis=0) * h
    impulses = absolute_integrals(load.history, h, count)
    waves, elapsed, push = (
        _convolution_bounds(kernel, impulses)[..., ::substeps, :]
        for kernel in (np.stack(kernels), integrated, np.ones((count, 1)))
    )
    return MotionPart(load.share, waves, elapsed, push[:, 0], load.truncation, load, number)


def _feedthrough_part(model: ModalModel, load: Direct, number: int) -> MotionPart:
    """The part of a load's direct feedthrough: w of the first mode is a(t), with no dynamics."""
    waves: Array = np.zeros((4, len(model.time), model.count))
    waves[0] = np.abs(load.at_nodes(np.zeros((1, model.count)))[0])
    no_push = np.zeros(len(model.time))
    return MotionPart(load.share, waves, 0 * waves[0], no_push, load.truncation, load, number)


def _kernel_maxima(growth: Array, step: float, count: int, power: int) -> Array:
    """Largest value of τ^power exp(g τ) in each of `count` intervals of time, shape (count, n).

    It lies at an end of the interval, or at τ = −power / g where that is inside.

    Args:
        growth: g, shape (n,), in 1/s.
        step: Length of an interval, in s.
        count: Number of intervals, from τ = 0 on.
        power: Exponent of τ.
    """
    ends = (np.arange(count + 1) * step)[:, None]
    value = ends**power * np.exp(growth * ends)
    peak_time = -power / np.where(growth < 0, growth, -1e-300)
    inside = (peak_time > ends[:-1]) & (peak_time < ends[1:])
    peak = np.where(inside, peak_time, 0.0) ** power * np.exp(-float(power))
    return np.asarray(np.maximum(np.maximum(value[:-1], value[1:]), np.where(inside, peak, 0.0)))


def _convolution_bounds(kernel: Array, size: Array) -> Array:
    """Upper bounds of ∫ kernel(τ) |a(t − τ)| dτ at t = 0 and the ends of J equal intervals.

    Args:
        kernel: Maxima of the kernel over the intervals, shape (…, J, n).
        size: ∫ |a| over each interval, shape (J,).

    Returns:
        Upper sums with the rounding of the Fourier transforms, shape (…, J + 1, n).
    """
    from scipy.signal import oaconvolve  # which takes time to import

    count = len(size)
    record = size.reshape((1,) * (kernel.ndim - 2) + (-1, 1))
    convolution = oaconvolve(kernel, record, axes=-2)[..., :count, :]
    # what rounding of the Fourier transforms may take off, per row
    rounding = ROUNDING * np.sqrt((kernel**2).sum(-2, keepdims=True) * (size**2).sum())
    start = np.zeros((*convolution.shape[:-2], 1, convolution.shape[-1]))
    return np.concatenate([start, np.maximum(convolution, 0.0) + rounding], axis=-2)


class Remainder:
    """Bounds of what quadratic Taylor models of the outputs leave out in a box, and of rounding.

    They follow for the box [lower, upper] by Leibniz' rule on C_k w(t; λ_k).

    Attributes:
        tensor: |∂³ output / ∂u_i ∂u_j ∂u_k| at most, shape (T, m, d, d, d), symmetric in the last
            three.
        margin: Rounding of values, and of slopes, at most, shape (T, m, 1 + d).
        rate: Bounds of derivatives of the eigenvalues, orders 0 to 3, shapes (d,) * order + (n,).
        share: The same of the shares of the last part, shapes (d,) * order + (n, m).
    """

    def __init__(self, model: ModalModel, lower: Array, upper: Array) -> None:
        d, n, m = len(lower), model.count, len(model.outputs)
        reach, width = np.maximum(np.abs(lower), np.abs(upper)), upper - lower
        rate, growth = suprema(model.eigenvalue, reach), largest_growth(model.eigenvalue, reach)
        third = np.zeros((len(model.time), m, d, d, d))
        margin = np.zeros((len(model.time), m, 1 + d))
        for part in parts(model, growth):
            share = [x.reshape((*x.shape[:-1], n, m)) for x in suprema(part.share, reach)]
            noise = _rounding_bound(model, rate[0], part.load)
            for k in range(n):
                of_mode = [x[..., k, :] for x in share], [x[..., k] for x in rate]
                sizes = []
                for order in range(4):
                    bounds = np.stack(leibniz(*of_mode, order))
                    waves = 2 * part.waves[: order + 1, :, k]
                    sizes.append(np.tensordot(waves, bounds, (0, 0)))  # (T, d, …, m)
                third += np.moveaxis(sizes[3], -1, 1)
                slope_change = np.einsum("tijm,j->tim", sizes[2], width)
                slopes, mean_slope = sizes[1] + slope_change, sizes[1] + slope_change / 2
                values = sizes[0] + np.einsum("tim,i->tm", mean_slope, width)
                margin[..., 0] += noise[:, k, None] * values
                margin[..., 1:] += noise[:, k, None, None] * np.moveaxis(slopes, -1, 1)
        third[model.time == 0] = _initial_third_derivatives(model, reach)
        self.tensor, self.margin, self.rate, self.share = (1 + 1e-9) * third, margin, rate, share


def _rounding_bound(model: ModalModel, rate: Array, load: LoadTables | None) -> Array:
    """Bound of the relative rounding error of each mode's motion at each node, shape (T, n).

    It is ε times a count of operations. The rounding of λ enters exp(λ t) times |λ| t. A load's
    response is a Taylor series in λ, whose terms may exceed its sum by the factor exp(REACH).

    Args:
        model: The modal model.
        rate: Bounds of |λ_k|, shape (n,), in 1/s.
        load: The load; None for the free motion.
    """
    n_terms, d = model.eigenvalue.index.shape
    of_polynomial = n_terms + model.degree + 2
    phase = rate * model.time[:, None]
    operations = of_polynomial * (2 + phase) + 12 * model.count + 4 * d**3 + 50
    if load is not None:
        operations = operations + (8 * load.longest + MOST_TERMS) * np.exp(REACH)
    return np.finfo(float).eps * operations


def _initial_third_derivatives(model: ModalModel, reach: Array) -> Array:
    """Bounds of the outputs' third derivatives by u at t = 0, |u_i| ≤ reach_i, shape (m, d, d, d).

    The polynomials 2 Re C_k are summed over the modes before they are bounded, since most of the
    sum cancels.
    """
    coefficients = model.coefficient.coefficients
    mode_sum = 2 * coefficients.reshape(len(coefficients), model.count, -1).sum(1).real
    third = suprema(Polynomial(model.coefficient.index, mode_sum), reach)[3]
    return np.moveaxis(third, -1, 0)


def leibniz(c: list[Array], r: list[Array], order: int) -> list[Array]:
    """Bounds of the derivatives of C exp(λ t), divided by exp(λ t), as coefficients of powers of t.

    Args:
        c: Bounds of the derivatives of C, shapes (d,) * its order + (m,).
        r: The same of λ, shapes (d,) * its order.
        order: Of the derivative.

    Returns:
        One array for each power of t from 0 to `order`, shape (d,) * order + (m,).
    """
    d, m = len(r[1]), c[0].shape[-1]
    out: list[Array] = [np.zeros((d,) * order + (m,)) for _ in range(order + 1)]
    axes = "ijk"[:order]
    for chosen in range(2**order):
        first_axes = "".join(a for bit, a in enumerate(axes) if chosen >> bit & 1)
        second_axes = [a for a in axes if a not in first_axes]
        for blocks in _partitions(second_axes):
            factors = [c[len(first_axes)], *(r[len(block)] for block in blocks)]
            names = ",".join([first_axes + "z", *blocks])
            out[len(blocks)] += np.einsum(f"{names}->{axes}z", *factors)
    return out


def _partitions(items: list[str]) -> list[list[str]]:
    """All set partitions of distinct letters, each a list of blocks (Faà di Bruno's formula)."""
    if not items:
        return [[]]
    first, found = items[0], []
    for part in _partitions(items[1:]):
        found.append([first, *part])
        found += [[*part[:k], first + part[k], *part[k + 1 :]] for k in range(len(part))]
    return found
