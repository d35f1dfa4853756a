"""Bounds at nodes: the model's own ascent from below, and the largest dual bound of all slabs.

Where a bound is too far from the model's own value, the ranges of the modes' tables are halved, the
slab with the largest bound first (best-first search).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from alphacut.frame.dual.dual_function import Data, add, compiled, dot, loops, minimise, products
from alphacut.fuzzy.arrays import Array, Rows

JUMPS, CLIMBS = 4, 16
"""Most steps of the model's ascent from one point: towards ends of the box, and along gradients."""

GRID = 2.0**24
"""Steps of the model's ascent in unit coordinates, so that rounding does not lead it elsewhere."""

TRIED, MIN_PROGRESS = 8, 0.5
"""Slabs after which the effort for a node ends where its gap has fallen by less than this share of
an even fall to what suffices."""


class Effort(NamedTuple):
    """Effort that a node is worth.

    Args:
        slabs: Most slabs.
        steps: Most evaluations of the dual function for a slab.
        enough: Gap at which a bound is left.
        top: The output's peak.
        loose: Gap that suffices below the peak, as a share of how far; at 1 only bounds above the
            peak count.
        floor: Multiple of the remainders' own part of a bound below which no effort is made.
    """

    slabs: int
    steps: int
    enough: float
    top: float
    loose: float
    floor: float


class Slabs(NamedTuple):
    """Parts of the modes' tables with their bounds, `Effort.slabs` of them.

    Args:
        ends: First and last place along ω and along q for each mode, shape (…, K, 4).
        mu: Multipliers, shape (…, Z).
        weight: By how much each variable's two sides still differ, the same.
        value: Bounds of the dual function, shape (…,).
    """

    ends: Rows
    mu: Array
    weight: Array
    value: Array


@loops
def model(u: Array, node: int, side: float, data: Data, gradient: Array) -> float:
    """The output's model at inputs u, side × its value, and its gradient."""
    bilinear, weight = np.empty(data.quadratic.shape[1]), np.zeros(len(data.linear))
    products(u, bilinear)
    total = sensitivities(u, node, side, data, weight)
    gradient[:] = 0.0
    bend = np.zeros(len(bilinear))
    for a in range(len(weight)):
        add(gradient, weight[a], data.linear[a])
        add(bend, weight[a], data.quadratic[a])
    for s in range(len(data.group_linear)):
        m = side * data.group_wave[s, node]
        total += m * (dot(data.group_linear[s], u) + dot(data.group_quadratic[s], bilinear))
        add(gradient, m, data.group_linear[s])
        add(bend, m, data.group_quadratic[s])
    at = 0
    for i in range(len(u)):
        for j in range(i, len(u)):
            gradient[i] += bend[at] * u[j]
            gradient[j] += bend[at] * u[i]
            at += 1
    return total


@loops
def sensitivities(u: Array, node: int, side: float, data: Data, weight: Array) -> float:
    """The modes' part of the model at inputs u; `weight` takes its slopes by all variables (Z,)."""
    bilinear, z = np.empty(data.quadratic.shape[1]), np.empty(len(data.linear))
    products(u, bilinear)
    for a in range(len(z)):
        z[a] = dot(data.linear[a], u) + dot(data.quadratic[a], bilinear)
    weight[:] = 0.0
    total = 0.0
    for k in range(len(data.share)):
        total += of_mode(z, k, node, side, data, weight)
    return total


@loops
def of_mode(z: Array, k: int, node: int, side: float, data: Data, weight: Array) -> float:
    """One mode's part of the model at scaled variables z; `weight` takes its derivatives."""
    width, sources = int(data.points[0]), data.share.shape[1]
    first = k * (2 + sources)
    w = data.centre[k, 0] + data.radius[k, 0] * z[first]
    g = data.centre[k, 1] + data.radius[k, 1] * z[first + 1]
    x = min(max((w - data.start[k, 0]) / data.step[k, 0], 0.0), width - 1.000001)
    y = min(max((g / w - data.start[k, 1]) / data.step[k, 1], 0.0), data.points[1] - 1.000001)
    i, j = int(x), int(y)
    x, y = x - i, y - j
    at, total = j * width + i, 0.0
    for s in range(sources):
        e = data.table[k, s, node]
        a, b, c, f = e[at], e[at + 1], e[at + width], e[at + width + 1]
        value = side * ((1 - y) * ((1 - x) * a + x * b) + y * ((1 - x) * c + x * f))
        along = side * ((1 - y) * (b - a) + y * (f - c)) / data.step[k, 0]
        across = side * ((1 - x) * (c - a) + x * (f - b)) / data.step[k, 1]
        amplitude = data.share[k, s] + data.reach[k, s] * z[first + 2 + s]
        total += amplitude * value
        weight[first] += amplitude * (along - across * g / w**2) * data.radius[k, 0]
        weight[first + 1] += amplitude * across / w * data.radius[k, 1]
        weight[first + 2 + s] = value * data.reach[k, s]
    return total


@loops
def ascend(u: Array, node: int, side: float, data: Data) -> float:
    """Improve u by steps to the ends of the box that its gradient names, then along the gradient.

    Returns:
        The model's value at u.
    """
    d = len(u)
    slope, trial, trial_slope = np.empty(d), np.empty(d), np.empty(d)
    value = model(u, node, side, data, slope)
    for _ in range(JUMPS):
        gained, length = False, 1.0
        for _ in range(3):
            for i in range(d):
                trial[i] = u[i] + length * (np.sign(slope[i]) - u[i])
            new = model(trial, node, side, data, trial_slope)
            if new > value + 1e-9 * abs(value):
                value, gained = new, True
                u[:], slope[:] = trial, trial_slope
                break
            length *= 0.35
        if not gained:
            break
    return climb(u, node, side, data, value, slope)


@loops
def climb(u: Array, node: int, side: float, data: Data, value: float, slope: Array) -> float:
    """Improve u by projected gradient steps of Barzilai's and Borwein's length; its value."""
    d = len(u)
    here, there, slope_there = u.copy(), np.empty(d), np.empty(d)
    size = 0.3 / (np.abs(slope).max() + 1e-300)
    for _ in range(CLIMBS):
        for i in range(d):
            there[i] = np.rint(GRID * min(max(here[i] + size * slope[i], -1.0), 1.0)) / GRID
        new = model(there, node, side, data, slope_there)
        along = bend = 0.0
        for i in range(d):
            step = there[i] - here[i]
            along += step * step
            bend += step * (slope[i] - slope_there[i])
        if along < 1e-8:
            break
        if new < value - 0.02 * abs(value):
            size *= 0.3
            continue
        size = along / bend if bend > 0 else 4 * size
        here[:], slope[:] = there, slope_there
        if new > value:
            value = new
            u[:] = here
    return value


@compiled
def bounds(
    nodes: Rows, side: float, effort: Effort, constant: Array, data: Data, out: Array, at: Array
) -> None:
    """Bounds at rising nodes, each begun with the multipliers and inputs of the one before.

    Args:
        nodes: Nodes, shape (J,).
        side: +1 or −1.
        effort: Effort for each node.
        constant: What the motion has besides the model, and what a bound has besides, (2, T).
        data: Models and tables of the output.
        out: Written: bounds and the model's values, shape (2, J).
        at: Written: inputs of the model's values, shape (J, L).
    """
    modes, most, Z = len(data.share), effort.slabs, len(data.linear)
    slabs = Slabs(
        np.zeros((most, modes, 4), np.int64),
        np.zeros((most, Z)),
        np.zeros((most, Z)),
        np.zeros(most),
    )
    mu, u = np.zeros(Z), np.zeros(data.linear.shape[1])
    for j in range(len(nodes)):
        refine(nodes[j], side, effort, constant[:, nodes[j]], data, slabs, mu, u, out[:, j])
        at[j] = u


@compiled
def refine(
    node: int,
    side: float,
    effort: Effort,
    constant: Array,
    data: Data,
    slabs: Slabs,
    mu: Array,
    u: Array,
    out: Array,
) -> None:
    """Bound at one node; the multipliers of the whole are left in `mu`, the best inputs in `u`."""
    slabs.ends[0], slabs.mu[0], slabs.value[0] = data.ends.astype(np.int64), mu, np.inf
    reached = ascend(u, node, side, data)
    aim = sufficient(reached, 0.0, effort, constant)
    reached = examine(0, node, side, data, effort.steps, aim, slabs, reached, u)
    mu[:] = slabs.mu[0]
    floor = effort.floor * (constant[1] + dot(np.abs(mu), data.remainder))
    count, start_value = 1, slabs.value[0]
    while count < effort.slabs:
        first = int(np.argmax(slabs.value[:count]))
        aim = sufficient(reached, floor, effort, constant)
        even = start_value - (start_value - aim) * MIN_PROGRESS * count / effort.slabs
        if slabs.value[first] <= aim or (count >= TRIED and slabs.value[first] > even):
            break
        if not halve_widest(slabs, first, count):
            break
        for slab in (first, count):
            reached = examine(slab, node, side, data, effort.steps, aim, slabs, reached, u)
        count += 1
    out[0] = slabs.value[:count].max() + constant[0] + constant[1]
    out[1] = reached + constant[0]


@compiled
def sufficient(reached: float, floor: float, effort: Effort, constant: Array) -> float:
    """Value of D at which a bound is left."""
    below = max(0.0, effort.top - reached - constant[0])
    return reached + max(effort.enough, floor) + effort.loose * below - constant[1]


@compiled
def examine(
    slab: int,
    node: int,
    side: float,
    data: Data,
    steps: int,
    aim: float,
    slabs: Slabs,
    reached: float,
    u: Array,
) -> float:
    """Bound of one slab; the model's best value, with its inputs in `u`."""
    here, mu, weight = np.empty(len(u)), slabs.mu[slab], slabs.weight[slab]
    value = minimise(mu, slabs.ends[slab], node, side, data, steps, aim, reached, weight, here)
    slabs.value[slab] = min(value, slabs.value[slab])
    if slabs.value[slab] > aim or slab == 0:
        other = ascend(here, node, side, data)
        if other > reached:
            reached = other
            u[:] = here
    return reached


@compiled
def halve_widest(slabs: Slabs, first: int, count: int) -> bool:
    """Halve a slab along the ω or q whose sides differ most, into its place and `count`; if any."""
    ends, weight = slabs.ends[first], slabs.weight[first]
    width = len(weight) // len(ends)
    most, at, axis = 0.0, -1, 0
    for k in range(len(ends)):
        for way in range(2):
            if ends[k, 2 * way + 1] - ends[k, 2 * way] >= 2 and weight[k * width + way] > most:
                most, at, axis = weight[k * width + way], k, way
    if at < 0:
        return False
    half = (ends[at, 2 * axis] + ends[at, 2 * axis + 1]) // 2
    slabs.ends[count], slabs.mu[count] = ends, slabs.mu[first]
    slabs.value[count] = slabs.value[first]
    slabs.ends[first, at, 2 * axis + 1] = half
    slabs.ends[count, at, 2 * axis] = half
    return True
