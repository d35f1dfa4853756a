"""The dual function of one bound, its minimisation, and the model's own ascent: the inner loops.

Scaled variables are used: ẑ = (z − z₀)/s for each intervening variable, within [−1, 1] over the
box, so that ẑ(u) = a·u + u·Q u ± R with a, Q and R of order one. For a node, an output and a
side,

    D(μ) = Σ_k max over the grid of [ Σ_s c₀ e + |s e − μ_s| − μ_ω ω̂ − μ_g ĝ ]
         + max over u of [ Σ μ (a·u + u·Q u) + the group's share ] + Σ |μ| R

is convex, and a bound for any μ. Its second line is bounded, not solved: inputs whose linear
part outweighs all that couples them are at an end of the box, one after the other; products of
the rest count by magnitude.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from alphacut.fuzzy.arrays import Array, Rows

PATIENCE = 12
"""Steps without half the expected gain after which less is expected."""
FLOOR = 1.0
"""Multiple of the remainders' own part of a bound below which no effort is made."""
LOOSE = 0.1
"""Gap that suffices at nodes that lie far below the peak, as a share of how far."""
EXPECTED = 0.5
"""Share of the cubic parts' sizes that is expected of their sum, in which they partly cancel."""
ASCENTS = 8
"""Most steps of the model's ascent from one point."""
Pair = tuple[Array, Array]
Triple = tuple[Array, Array, Array]
Models = tuple[Array, Array, Array, Array, Array]
Data = tuple[Array, Pair, tuple[Array, Array, tuple[int, int]], Pair, Pair, Models, Triple]
"""Table (K, sources, T, Q W); scaled ω and g of its points; start, step and numbers of its grid;
centres and radii of ω and g (K, 2), and of the shares (K, sources); of all scaled variables linear
and packed quadratic parts, remainders with `EXPECTED` of the cubic parts, these and their sizes; of
the group its responses, linear and quadratic parts."""

compiled = njit(cache=True, nogil=True, error_model="numpy")
loops = njit(cache=True, nogil=True, error_model="numpy", fastmath=True)


@loops
def box_maximum(linear: Array, quadratic: Array, u: Array) -> float:
    """Bound of max over the box of linear·u + Σ_{i ≤ j} q_ij u_i u_j, and where about.

    The q_ij are packed by rows, i ≤ j; `u` is written.
    """
    d = len(u)
    full, slack, slope = np.empty((d, d)), np.empty(d), linear.copy()
    at = 0
    for i in range(d):
        for j in range(i, d):
            full[i, j] = full[j, i] = quadratic[at]
            at += 1
    for i in range(d):
        slack[i] = -abs(full[i, i])
        for j in range(d):
            slack[i] += abs(full[i, j])
    free = np.ones(d, np.bool_)
    total, moved = 0.0, True
    while moved:
        moved = False
        for i in range(d):
            if free[i] and abs(slope[i]) >= slack[i] + 2 * max(-full[i, i], 0.0):
                free[i], moved = False, True
                u[i] = 1.0 if slope[i] >= 0 else -1.0
                total += abs(slope[i]) + full[i, i]
                for j in range(d):
                    slope[j] += full[i, j] * u[i]
                    slack[j] -= abs(full[i, j])
    for i in range(d):
        if not free[i]:
            continue
        size, bend = abs(slope[i]), full[i, i]
        u[i] = 1.0 if slope[i] >= 0 else -1.0
        if bend >= 0 or size >= -2 * bend:
            total += size + bend
        else:
            total -= size * size / (4 * bend)
            u[i] *= size / (-2 * bend)
        for j in range(i + 1, d):
            if free[j]:
                total += abs(full[i, j])
    return total


@loops
def products(u: Array, out: Array) -> None:
    """u_i u_j, packed by rows, i ≤ j."""
    at = 0
    for i in range(len(u)):
        for j in range(i, len(u)):
            out[at] = u[i] * u[j]
            at += 1


@loops
def add(out: Array, factor: float, row: Array) -> None:
    """Adds factor × row."""
    for i in range(len(out)):
        out[i] += factor * row[i]


@loops
def dot(a: Array, b: Array) -> float:
    """a·b."""
    total = 0.0
    for i in range(len(a)):
        total += a[i] * b[i]
    return total


@loops
def dual(
    mu: Array, slab: Rows, node: int, side: float, data: Data, gradient: Array, u: Array
) -> float:
    """D(μ) without its constants, a subgradient, and the inputs u at which its second line is met.

    `slab` holds, for each mode, the first and last place along ω and along q that its table is read
    at, shape (K, 4).
    """
    table, place, grid, _, share, models, group = data
    omega, decay = place
    count = grid[2][1]
    middle, radius = share
    linear, quadratic, doubt = models[:3]
    group_size, group_linear, group_quadratic = group
    modes, sources = middle.shape
    width, d = 2 + sources, linear.shape[1]
    gradient[:] = 0.0
    total = 0.0
    values = np.empty(omega.shape[1])
    for k in range(modes):
        first = k * width
        of_omega, of_decay = mu[first], mu[first + 1]
        w, g = omega[k], decay[k]
        best, at = -1e300, 0
        for row in range(slab[k, 2], slab[k, 3] + 1):
            begin, end = row * count + slab[k, 0], row * count + slab[k, 1] + 1
            for i in range(begin, end):
                values[i] = -of_omega * w[i] - of_decay * g[i]
            for s in range(sources):
                e, c, r = table[k, s, node], side * middle[k, s], side * radius[k, s]
                m = mu[first + 2 + s]
                for i in range(begin, end):
                    values[i] += c * e[i] + abs(r * e[i] - m)
            top = values[begin]
            for i in range(begin, end):
                top = max(top, values[i])
            if top > best:
                best, at = top, begin
                while values[at] != top:
                    at += 1
        total += best
        gradient[first] = -w[at]
        gradient[first + 1] = -g[at]
        for s in range(sources):
            off = side * radius[k, s] * table[k, s, node, at] - mu[first + 2 + s]
            gradient[first + 2 + s] = -1.0 if off >= 0 else 1.0
    slope, bend = np.zeros(d), np.zeros(quadratic.shape[1])
    for s in range(len(group_linear)):
        add(slope, side * group_size[s, node], group_linear[s])
        add(bend, side * group_size[s, node], group_quadratic[s])
    for z in range(len(mu)):
        add(slope, mu[z], linear[z])
        add(bend, mu[z], quadratic[z])
    total += box_maximum(slope, bend, u)
    products(u, bend)
    for z in range(len(mu)):
        total += abs(mu[z]) * doubt[z]
        gradient[z] += dot(linear[z], u) + dot(quadratic[z], bend) + np.sign(mu[z]) * doubt[z]
    return total


@loops
def model(u: Array, node: int, side: float, data: Data, gradient: Array) -> float:
    """The output's model at inputs u, side × its value, and its gradient."""
    table, _, grid, scale, share, models, group = data
    start, step, count = grid
    centre, radius_z = scale
    middle, radius = share
    linear, quadratic = models[:2]
    group_size, group_linear, group_quadratic = group
    modes, sources = middle.shape
    width = 2 + sources
    total, both = 0.0, np.empty(quadratic.shape[1])
    products(u, both)
    z, weight = np.empty(len(linear)), np.empty(len(linear))
    for a in range(len(linear)):
        z[a] = dot(linear[a], u) + dot(quadratic[a], both)
    for k in range(modes):
        first = k * width
        w = centre[k, 0] + radius_z[k, 0] * z[first]
        g = centre[k, 1] + radius_z[k, 1] * z[first + 1]
        q = g / w
        x = min(max((w - start[k, 0]) / step[k, 0], 0.0), count[1] - 1.000001)
        y = min(max((q - start[k, 1]) / step[k, 1], 0.0), count[0] - 1.000001)
        i, j = int(x), int(y)
        x, y = x - i, y - j
        by_omega = by_decay = 0.0
        for s in range(sources):
            e = table[k, s, node]
            a, b = side * e[j * count[1] + i], side * e[j * count[1] + i + 1]
            c, f = side * e[(j + 1) * count[1] + i], side * e[(j + 1) * count[1] + i + 1]
            value = (1 - y) * ((1 - x) * a + x * b) + y * ((1 - x) * c + x * f)
            along = ((1 - y) * (b - a) + y * (f - c)) / step[k, 0]
            across = ((1 - x) * (c - a) + x * (f - b)) / step[k, 1]
            own = middle[k, s] + radius[k, s] * z[first + 2 + s]
            total += own * value
            by_omega += own * (along - across * g / w**2)
            by_decay += own * across / w
            weight[first + 2 + s] = value * radius[k, s]
        weight[first] = by_omega * radius_z[k, 0]
        weight[first + 1] = by_decay * radius_z[k, 1]
    gradient[:] = 0.0
    bend = np.zeros(len(both))
    for a in range(len(linear)):
        add(gradient, weight[a], linear[a])
        add(bend, weight[a], quadratic[a])
    for s in range(len(group_linear)):
        m = side * group_size[s, node]
        total += m * (dot(group_linear[s], u) + dot(group_quadratic[s], both))
        add(gradient, m, group_linear[s])
        add(bend, m, group_quadratic[s])
    at = 0
    for i in range(len(u)):
        for j in range(i, len(u)):
            gradient[i] += bend[at] * u[j]
            gradient[j] += bend[at] * u[i]
            at += 1
    return total


@loops
def ascend(u: Array, node: int, side: float, data: Data) -> float:
    """Improve u by steps towards the ends of the box that its gradient names; the model's value."""
    d = len(u)
    slope, trial, other = np.empty(d), np.empty(d), np.empty(d)
    value = model(u, node, side, data, slope)
    for _ in range(ASCENTS):
        gained, length = False, 1.0
        for _ in range(4):
            for i in range(d):
                trial[i] = u[i] + length * (np.sign(slope[i]) - u[i])
            new = model(trial, node, side, data, other)
            if new > value + 1e-9 * abs(value):
                value, gained = new, True
                u[:], slope[:] = trial, other
                break
            length *= 0.35
        if not gained:
            break
    return value


@compiled
def minimise(
    mu: Array,
    slab: Rows,
    node: int,
    side: float,
    data: Data,
    steps: int,
    target: float,
    aim: float,
    weight: Array,
    u: Array,
) -> tuple[float, int]:
    """The least D(μ) that a deflected subgradient method meets in `steps`, and its μ in `mu`.

    Args:
        mu: Multipliers to begin with, and the best ones afterwards.
        slab: As of `dual`.
        node: Node.
        side: +1 or −1.
        data: As of `bounds`.
        steps: Most evaluations of D.
        target: Value below which no effort is made.
        aim: A value that D cannot fall below, the model's own somewhere.
        weight: Written: by how much each variable's two sides still differ, in units of D, (nz,).
        u: Written: inputs that the best multipliers name.
    """
    nz = len(mu)
    gradient, direction, best = np.empty(nz), np.zeros(nz), mu.copy()
    here = np.empty(len(u))
    least, drop, idle, used = np.inf, np.inf, 0, 0
    weight[:] = 0.0
    for _ in range(steps):
        used += 1
        value = dual(mu, slab, node, side, data, gradient, here)
        for z in range(nz):
            weight[z] = 0.8 * weight[z] + abs(gradient[z] * mu[z])
        if value < least:
            if least - value > 0.3 * drop:
                idle = 0
            least = value
            best[:], u[:] = mu, here
        if least <= target:
            break
        if drop == np.inf:
            drop = 0.7 * max(least - aim, 0.0)
        idle += 1
        if idle > PATIENCE:
            drop, idle = 0.5 * drop, 0
            mu[:], direction[:] = best, 0.0
            if drop < 0.1 * (target - aim):
                break
            continue
        length = along = 0.0
        for z in range(nz):
            along += gradient[z] * direction[z]
            length += direction[z] ** 2
        kept = -1.5 * along / length if along < 0 and length > 0 else 0.0
        length = 0.0
        for z in range(nz):
            direction[z] = gradient[z] + kept * direction[z]
            length += direction[z] ** 2
        if length < 1e-24:
            break
        size = (value - least + drop) / length
        for z in range(nz):
            mu[z] -= size * direction[z]
    mu[:] = best
    return least + cancelled(mu, data[5]), used


@loops
def cancelled(mu: Array, models: Models) -> float:
    """Bound of Σ μ (cubic part) over the box, less what D(μ) has expected of it."""
    cubic, size = models[3], models[4]
    total, expected = np.zeros(cubic.shape[1]), 0.0
    for z in range(len(mu)):
        add(total, mu[z], cubic[z])
        expected += abs(mu[z]) * size[z]
    return np.abs(total).sum() - EXPECTED * expected


@compiled
def divided(slab: Rows, weight: Array, sources: int, parts: Rows) -> bool:
    """Halve the slab along the ω or q whose sides differ most; whether there is one to halve."""
    most, at, axis = 0.0, -1, 0
    for k in range(len(slab)):
        for way in range(2):
            if slab[k, 2 * way + 1] - slab[k, 2 * way] < 2:
                continue
            own = weight[k * (2 + sources) + way]
            if own > most:
                most, at, axis = own, k, way
    if at < 0:
        return False
    half = (slab[at, 2 * axis] + slab[at, 2 * axis + 1]) // 2
    parts[0], parts[1] = slab, slab
    parts[0, at, 2 * axis + 1] = half
    parts[1, at, 2 * axis] = half
    return True


@compiled
def bounds(
    nodes: Rows,
    side: float,
    most: int,
    steps: int,
    enough: float,
    top: float,
    constant: Array,
    data: Data,
    mu: Array,
    u: Array,
    out: Array,
    at: Array,
) -> None:
    """Bounds at rising nodes, each begun with the multipliers of the one before.

    Where a bound is too far from the model's own value, the ranges of the modes' tables are halved,
    the slab with the largest bound first: the bound is the largest of all slabs'.

    Args:
        nodes: Nodes, shape (J,).
        side: +1 or −1.
        most: Most slabs of a node.
        steps: Most evaluations of the dual function for a slab.
        enough: Distance from the model's own value at which a bound is left.
        top: The output's peak: a value as far below it may be left at `LOOSE` of the distance.
        constant: What the motion has besides the model, and what a bound has besides, (2, T).
        data: Table, place, grid, scale, share, models and group of the output.
        mu: Multipliers to begin with, (nz,); the last node's afterwards.
        u: Inputs to begin the ascent with, (d,).
        out: Written: bounds, the model's values, evaluations of D and slabs, shape (4, J).
        at: Written: inputs of the model's value, shape (J, d).
    """
    grid, share, doubt = data[2], data[4], data[5][2]
    nz, d = len(mu), len(u)
    modes, sources = share[0].shape
    slabs, parts = np.empty((most, modes, 4), np.int64), np.empty((2, modes, 4), np.int64)
    each, weights, values = np.empty((most, nz)), np.empty((most, nz)), np.empty(most)
    here = np.empty(d)
    for j in range(len(nodes)):
        node = nodes[j]
        slabs[0, :, 0], slabs[0, :, 2] = 0, 0
        slabs[0, :, 1], slabs[0, :, 3] = grid[2][1] - 1, grid[2][0] - 1
        reached, count, used, floor = ascend(u, node, side, data), 1, 0, 0.0
        each[0] = mu
        for i in range(most):
            # the slab made last is examined, and where it was halved the other half too
            if i == 0:
                todo, first = 1, 0
            else:
                first = values[:count].argmax()
                aim = _aim(reached, max(enough, floor), top, constant[:, node])
                if values[first] <= aim or not divided(
                    slabs[first], weights[first], sources, parts
                ):
                    break
                slabs[first], slabs[count] = parts[0], parts[1]
                each[count], values[count] = each[first], values[first]
                count += 1
                todo = 2
            for half in range(todo):
                own = first if half == 0 else count - 1
                aim = _aim(reached, max(enough, floor), top, constant[:, node])
                value, more = minimise(
                    each[own], slabs[own], node, side, data, steps, aim, reached, weights[own], here
                )
                values[own] = min(value, values[own]) if i > 0 else value
                used += more
                if values[own] > aim or i == 0:
                    other = ascend(here, node, side, data)
                    if other > reached:
                        reached = other
                        u[:] = here
            if i == 0:
                mu[:] = each[0]
                floor = FLOOR * (constant[1, node] + dot(np.abs(mu), doubt))
        out[0, j] = values[:count].max() + constant[0, node] + constant[1, node]
        out[1, j], out[2, j], out[3, j] = reached + constant[0, node], used, count
        at[j] = u


@compiled
def _aim(reached: float, enough: float, top: float, constant: Array) -> float:
    """Value of D at which a bound is left."""
    return reached + enough + LOOSE * max(0.0, top - reached - constant[0]) - constant[1]
