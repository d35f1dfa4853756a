"""Modes and blocks of them, what couples them and what the others add: nothing leaves the bounds.

Pieces of the dual proof that matter by themselves: enclosures of blocks, bounds of their coupling,
and what is known of the truncated modes by sums alone, each also hardly wider than need be.
"""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.linalg import eigh

from alphacut.frame import Accelerogram, MatrixStructure, StoreyFrame, UnprovedError
from alphacut.frame.bounds.box import over_box
from alphacut.frame.bounds.level import LevelModels, OutputBounds
from alphacut.frame.calculus.taylor_model import TaylorModel, concatenate
from alphacut.frame.modes.blocks import (
    Block,
    CentredMatrices,
    SolutionBounds,
    SubspaceEquations,
    enclosed_block,
    max_eigenvalue_decrease,
    subspace_series,
)
from alphacut.frame.modes.classical_modes import ModeSelection, classical_modes
from alphacut.frame.modes.clusters import BlockParticipation, centred_matrices, enclose_subspaces
from alphacut.frame.modes.modes import Excitation
from alphacut.frame.modes.structure import classical_structure
from alphacut.frame.modes.truncated_modes import (
    WeightedSums,
    _coupling_factors,
    _largest_within_steps,
    _with_best_weights,
    coupling_bounds,
    inverse_form,
    response_slopes,
)
from alphacut.frame.response.tables import (
    Oscillators,
    Source,
    grid_over,
    response_ranges,
)
from tests.frame.motions import off_chords

TIGHT = 0.5
"""Share of a bound that something reaches: half the bound would be passed."""


def matrices(stiffness, parameters, observed, mass=None, **values):
    """A structure of springs with a mass matrix that does not vary."""
    mass = np.eye(len(stiffness[0][1])) if mass is None else mass
    return MatrixStructure(parameters, [(1.0, mass)], stiffness, observed, **values)


def over(structure, widths):
    """The structure over a box about its nominal values, and its inputs' centre and radius."""
    names = tuple(widths)
    centre = np.array([structure.parameters[name] for name in names])
    radius = np.array(list(widths.values()))
    return over_box(structure, names, centre - radius, centre + radius), centre, radius


def pencil(structure, names, values):
    p = {**structure.parameters, **dict(zip(names, values, strict=True))}
    return tuple(
        sum((p[f] if isinstance(f, str) else f) * A for f, A in terms)
        for terms in (structure.stiffness, structure.mass)
    )


def draws(d, count=60, seed=0):
    rng = np.random.default_rng(seed)
    return np.vstack([np.sign(rng.normal(size=(count, d))), rng.uniform(-1, 1, (count, d))])


def three_storeys_beside_a_mast(coupling):
    """Sway of two storeys beside a vertical mode on a soil spring, and a mast on the roof."""
    beams, soil = np.zeros((4, 4)), np.zeros((4, 4))
    beams[:2, :2] = [[1, -1], [-1, 1]]
    soil[1, 1], soil[1, 2], soil[2, 1], soil[2, 2] = coupling**2, -coupling, -coupling, 1
    mast = np.outer([0, 1, 0, -1], [0, 1, 0, -1])
    return matrices(
        [("kc", 300 * np.diag([1.0, 0, 0, 0])), ("kb", 250 * beams), ("ks", soil), ("km", mast)],
        {"kc": 1.0, "kb": 1.0, "ks": 160.0, "km": 900.0},
        {"roof": np.array([0, 1.0, 0, 0])},
        mass=np.diag([1.0, 1.0, 2.0, 0.5]),
        ratios=(0.03,),
        v0=np.array([1.0, 1.0, 0.2, 0]),
    )


def exact_block(block, K, M, basis):
    """L, X and N of a block's modes in the coordinates `basis`, X with the rotation of `block`."""
    squared, shape = eigh(K, M)
    b, seen = block.modes, np.linalg.solve(basis, shape)
    turn = np.linalg.solve(seen[np.ix_(b, b)], block.shapes.value[:, b].T)
    X = seen[:, b] @ turn
    rate = np.linalg.solve(turn, squared[b, None] * turn)
    return {"eigenvalue_block": rate.T, "shapes": X.T, "modal_mass": X.T @ basis.T @ M @ basis @ X}


@pytest.mark.parametrize("coupling", [0.0, 0.05])
def test_blocks_hold_the_subspaces_of_modes_that_cross(coupling):
    own = three_storeys_beside_a_mast(coupling)
    widths = {"kc": 0.1, "kb": 0.1, "ks": 40.0}
    structure, centre, radius = over(own, widths)
    middle, used = centred_matrices(structure.mass, structure.stiffness)
    found = enclose_subspaces(middle, used, 4)
    assert sum(len(block.modes) for block in found.blocks) == 4
    assert max(len(block.modes) for block in found.blocks) > 1
    for u in draws(3):
        K, M = pencil(own, widths, centre + radius * u)
        squared = eigh(K, M, eigvals_only=True)
        assert (found.eigenvalue_low <= squared * (1 + 1e-12)).all()
        assert (squared <= found.eigenvalue_high * (1 + 1e-12)).all()
        for block in found.blocks:
            for name, exact in exact_block(block, K, M, middle.basis).items():
                model = getattr(block, name)
                off = np.abs(model.at(u[None])[0] - exact)
                assert (off <= model.remainder + 1e-12 * np.abs(exact).max()).all()


def is_tight(off, bound):
    return (TIGHT * bound < off).all() and (off <= bound * (1 + 1e-9)).all()


def all_blocks(structure):
    """All blocks of a structure over a box."""
    centre, used = centred_matrices(structure.mass, structure.stiffness)
    return enclose_subspaces(centre, used, centre.mode_count)


def test_modes_of_crisp_matrices_are_enclosed_though_rounding_is_all_they_leave(rng):
    for storeys in (2, 3, 4) * 7:
        masses, stiffness = rng.uniform([[0.5], [500.0]], [[2.0], [2000.0]], (2, storeys))
        frame = StoreyFrame(masses=masses, stiffness=stiffness, outputs=("q1",))
        found = all_blocks(over_box(frame, ("q1_0",), np.array([-1.0]), np.array([1.0])))
        enclosed = [mode for block in found.blocks for mode in block.modes]
        assert sorted(enclosed) == list(range(storeys))
        assert max(block.relative_error for block in found.blocks) < 1e-9


def test_half_of_the_range_of_eigenvalues_would_not_do():
    own = StoreyFrame(masses=(2e4,), stiffness=(3e7,), v0=(1.0,), damping_ratio=0.03)
    p = {name: TaylorModel.constant(x, 1) for name, x in own.parameters.items()}
    widths = {name: 0.1 * own.parameters[name] for name in ("k1", "m1")}
    loose = p | {name: p[name].widened(width) for name, width in widths.items()}
    for one in (over(own, widths)[0], classical_structure(own, loose)):
        found = all_blocks(one)
        assert found.eigenvalue_low[0] == pytest.approx(3e7 / 2e4 * 0.9 / 1.1)
        assert found.eigenvalue_high[0] == pytest.approx(3e7 / 2e4 * 1.1 / 0.9)


def masses_on_springs(stiffness):
    """Three of them beside one another, and their sum."""
    arrays = [np.diag(row) for row in np.eye(3)]
    return MatrixStructure(
        dict(zip("abc", stiffness, strict=True)),
        mass=[(1.0, np.eye(3))],
        stiffness=list(zip("abc", arrays, strict=True)),
        observed={"sum": np.ones(3)},
        v0=np.ones(3),
    )


def test_half_of_what_springs_and_start_are_loosened_by_would_not_do():
    """Two of three masses on springs have the same frequency."""
    centre, time, parts = np.array([1.0, 1.0, 3.0]), np.arange(0, 22.01, 0.25), 4
    p = TaylorModel.variables(centre, 1e-3 * centre).widened(0.03 * centre)
    springs = classical_structure(masses_on_springs(centre), {x: p[i] for i, x in enumerate("abc")})
    both = springs.initial_state.widened(np.array([[0.0] * 3, [0.1, 0.1, 0.0]]))
    excitation = Excitation(time, [Source.named("velocity")])
    modes = classical_modes(replace(springs, initial_state=both), excitation)
    level = LevelModels.from_modes(modes)
    bounds = [OutputBounds.initial(level, 0, s, 1e-6) for s in (0, 1)]
    for of_side in bounds:
        of_side.improve(np.arange(len(time)), of_side.effort(240, 100, 1.0, 0.25))
    omega = np.sqrt(np.array([1.0, 1, 3])[:, None] * np.linspace(0.969, 1.031, 201))
    fine = np.arange(len(time) * parts - parts + 1) * 0.25 / parts
    waves = np.sin(omega * fine[:, None, None]) / omega
    start, middle = np.array([0.1, 0.1, 0])[:, None], waves[:, :, 100].sum(-1)
    for side, column in ((-1, 0), (1, 1)):
        most = np.maximum((1 - start) * side * waves, (1 + start) * side * waves).max(-1).sum(-1)
        off = (most - side * middle)[parts::parts]
        assert is_tight(off, bounds[column].upper[1:] - side * middle[parts::parts])
    off = off_chords(middle, parts)
    stray = level.interpolation_error()[1:, 0]
    assert (off <= stray).all()
    assert (off > TIGHT * stray).any()


@pytest.mark.parametrize(
    ("source", "quotient", "share"),
    [("start", 15.0, 0.8), ("start", 0.05, 0.9), ("load", 0.3, 0.8)],
)
def test_no_response_falls_faster_with_its_eigenvalue(source, quotient, share):
    """Damped by the masses, so that g/ω falls with λ; nearly critically, that is felt."""
    omega, time = 2.0, np.linspace(0.05, 6, 400)
    decay, h = quotient * omega, 1e-5
    squared = omega**2 + decay**2 + np.array([-h, 0, h])[:, None]
    sigma = -decay + 1j * np.sqrt(squared - decay**2)
    rho = np.exp((sigma + decay) * time)  # of all decays alike, which exp(g t) undoes
    moved = Source.named(source)
    e = moved.read(sigma, rho)
    bound = response_slopes(moved, np.abs(rho[1]), time * np.abs(rho[1]), omega, quotient)
    reached = np.abs(e[2] - e[0]) / (2 * h) / bound
    assert share < reached.max() <= 1 + 1e-6


RECORD = Accelerogram(0.02, np.sin(np.arange(150) * 0.21) * np.sin(np.arange(150) * 0.047))


@pytest.mark.parametrize("power", [0, 1])
def test_modes_known_by_sums_stay_within_both_norms(power, monkeypatch):
    own = matrices(
        [("a", 100 * np.array([[2.0, -1], [-1, 1]])), ("b", np.diag([0, 60.0]))],
        {"a": 1.0, "b": 1.0},
        {"q": np.array([1.0, 0])},
        ground=RECORD,
        ratios=(0.03,),
    )
    structure, centre, radius = over(own, {"a": 0.05, "b": 0.05})
    time = np.linspace(0, 3, 61)

    def chosen(structure, sums, ranges):
        narrow = [
            WeightedSums(C, size if k == power else size + 1e6) for k, (C, size) in enumerate(sums)
        ]
        return _with_best_weights(structure, narrow, ranges)

    monkeypatch.setattr("alphacut.frame.modes.truncated_modes._with_best_weights", chosen)
    monkeypatch.setattr(
        "alphacut.frame.modes.classical_modes.required_modes",
        lambda *_, **__: ModeSelection(1, np.zeros(9)),
    )
    load = Source.named("load", RECORD)
    excitation = Excitation(time, [load])
    models = classical_modes(structure, excitation, np.ones(1))
    (others,) = models.truncated
    assert len(models.oscillators) == 1
    ratios = np.zeros(len(time))
    for u in draws(2, 8):
        K, _ = pencil(own, "ab", centre + radius * u)
        squared, shape = np.linalg.eigh(K)
        omega = np.sqrt(squared[1] * (1 - 0.03**2))
        point = grid_over((omega, omega), (0.03 / np.sqrt(1 - 0.03**2),) * 2, (2, 2))
        wave = Oscillators(point, time, {0}).responses(load, 0).value[:, 0, 0]
        motion = shape[0, 1] * shape[:, 1].sum() * wave
        share, size = (x.at(u[None])[0, 0, 0] for x in (others.participation, others.amplitude))
        width = (size + others.amplitude.remainder[0, 0]) * others.response_radius[0, 0]
        off = np.abs(motion - share * others.response_midpoint[0, 0])
        slack = others.participation.remainder[0, 0] * np.abs(others.response_midpoint[0, 0])
        assert (off <= width + slack + 1e-12).all()
        ratios = np.maximum(ratios, off / np.maximum(width + slack, 1e-300))
    assert ratios[1:].max() > TIGHT


@pytest.mark.parametrize("order", [0, 1, 2])
def test_ranges_hold_all_responses_times_powers_of_frequency(order):
    time, ends, quotient = np.linspace(0, 3, 31), (8.0, 90.0), (0.02, 0.05)
    sources = [Source.named("load", RECORD), Source.named("velocity")]
    found = response_ranges(ends, quotient, time, sources, [order])[order]
    fine = grid_over(ends, quotient, (400, 4))
    squared = np.abs(fine.sigma) ** 2
    for s, source in enumerate(sources):
        value = Oscillators(fine, time, {order}).responses(source, order).value
        for k, power in enumerate((0.0, 1.0)):
            scaled = (value * squared**power).reshape(len(time), -1)
            assert (scaled.max(1) <= found.high[k, s] + 1e-9).all()
            assert (scaled.min(1) >= found.low[k, s] - 1e-9).all()
            if source.load:
                reached = np.ptp(scaled, axis=1)[1:] / (found.high[k, s] - found.low[k, s])[1:]
                assert reached.max() > TIGHT


def random_signs(rng, shape, size):
    """Matrices of random signs, (20000, *shape), with entries of about a size."""
    magnitude = size * rng.uniform(0.5, 1.5, shape)
    return magnitude * rng.choice([-1.0, 1.0], (20_000, *shape))


@pytest.mark.parametrize("modes", [1, 2])
@pytest.mark.parametrize("kind", ["values", "changes"])
def test_right_sides_of_a_subspace_are_bounded_and_so_is_how_fast_they_change(kind, modes, rng):
    """Of random matrices whose magnitudes attain their bounds, transposed as in the code.

    The bounds of changes make the map contract, on which continuity of a block in the inputs rests.
    """
    p, n = modes, 2
    change = 1e-3
    unknown, residual = (0.05, 1.0) if kind == "values" else (1.0, 0.0)
    R, X, MX, Z = (random_signs(rng, (p, n), size) for size in (residual, 1.0, 1.0, unknown))
    M = random_signs(rng, (n, n), 1.0)
    L = random_signs(rng, (p, p), 1.0)
    D = random_signs(rng, (p, p), unknown)
    diagonal = np.diagonal(L, axis1=1, axis2=2)
    F = L * (1 - np.eye(p))

    def right_sides(Z, D):
        W = Z @ MX.swapaxes(1, 2)
        of_shape = -R + D @ MX + (D + F) @ Z @ M
        of_rate = R @ X.swapaxes(1, 2) + Z @ R.swapaxes(1, 2)
        of_rate += W @ L.swapaxes(1, 2) - L @ W - D @ W
        return of_shape, of_rate

    bounds = SubspaceEquations(
        residual=np.abs(R[0]),
        shapes=np.abs(X[0]),
        mass_times_shapes=np.abs(MX[0]),
        mass=np.abs(M[0]),
        coupling=np.abs(F[0]),
        difference=np.abs(diagonal[:, :, None] - diagonal[:, None, :]).max(0),
    ).right_sides(np.abs(Z[0]), np.abs(D[0]))
    found = right_sides(Z, D)
    if kind == "changes":
        nearby = right_sides((1 - change) * Z, (1 - change) * D)
        found = [(x - y) / change for x, y in zip(found, nearby, strict=True)]
    for exact, bound in zip(found, bounds, strict=True):
        largest = np.abs(exact).max(0)
        assert (largest <= bound * (1 + 1e-9)).all()
        assert (largest >= 0.8 * bound).all()


@pytest.mark.parametrize("degree", [0, 1, 2, 3])
def test_remainders_of_a_mode_are_nearly_attained(degree, rng):
    """Of a mode that the other one approaches, so that all terms beyond the degree add up.

    At degree 0 the other mode's part of the shape is a remainder alone, also in the norm.
    """
    approach, coupling, second = rng.uniform([0.05, 0.02, 2.5], [0.15, 0.05, 3.5])
    change = np.array([[approach, coupling], [coupling, -approach]])
    middle, nothing = np.diag([1.0, second]), np.zeros((2, 2))
    centre = CentredMatrices(
        mass=TaylorModel((np.eye(2)[None],), nothing, inputs=1, order=6),
        stiffness=TaylorModel((middle[None], change[None]), nothing, inputs=1, order=6),
        basis=np.eye(2),
        mode_count=2,
    )
    lowest = np.array([0])
    series = subspace_series(lowest, degree, centre)
    block = enclosed_block(lowest, np.eye(1), series, centre)
    attained = dict.fromkeys(("eigenvalue_block", "shapes", "mass_times_shapes", "modal_mass"), 0.0)
    for u in (-1.0, 1.0):
        squared, shapes = eigh(middle + u * change)
        shape = shapes[:, 0] / shapes[0, 0]
        exact = {
            "eigenvalue_block": squared[:1],
            "shapes": shape,
            "mass_times_shapes": shape,
            "modal_mass": shape @ shape,
        }
        for name in attained:
            model = getattr(block, name)
            off = np.abs(model.at(np.array([[u]]))[0] - exact[name])
            assert (off <= model.remainder + 1e-13).all(), name
            fractions = off / np.maximum(model.remainder, 1e-13)
            attained[name] = max(attained[name], fractions.max())
    assert min(attained.values()) > 0.6, attained


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_eigenvalues_drop_by_all_parts_of_a_model(sign, rng):
    """Of a number a + v u + w u² ± r, over the box |u| ≤ 1, times the square of a scale."""
    slope, bend, remainder, scale = rng.uniform(0.1, 1.0, 4)
    bend = -sign * bend  # a square that lowers sign × the number
    parts = tuple(np.full((1, 1, 1), x) for x in (2.0, slope, bend))
    model = TaylorModel(parts, np.full((1, 1), remainder), inputs=1, order=2)
    drop = max_eigenvalue_decrease(model, np.array([scale]), sign=sign)
    assert drop == pytest.approx(scale**2 * (slope + abs(bend) + remainder), rel=1e-9)


def test_solutions_are_bounded_in_the_norm_and_row_by_row(rng):
    """Of A = D + F with |F_ij| ≤ S, hence |D^-½ r| ≥ (1 − ‖D^-½ S D^-½‖) |D^½ y|."""
    distance, spread = rng.uniform(1.0, 3.0, 3), rng.uniform(0.0, 0.3, (3, 3))
    spread = (spread + spread.T) / 2
    scaled = spread / np.sqrt(np.outer(distance, distance))
    right = rng.uniform(0.5, 2.0, 3)
    smallest = 1 - np.linalg.norm(scaled, 2)
    bound = SolutionBounds(distance, spread, smallest).solution_bounds(right)
    hindered = np.linalg.solve(np.diag(distance) - spread, right)
    assert (hindered <= bound * (1 + 1e-12)).all()
    assert (bound <= 1.5 * hindered).all()
    signs = rng.choice([-1.0, 1.0], (200, 3, 3))
    signs = np.triu(signs) + np.triu(signs, 1).swapaxes(1, 2)
    for A in np.diag(distance) + signs * spread:
        y = np.linalg.solve(A, right * rng.choice([-1.0, 1.0], 3))
        assert (np.abs(y) <= bound * (1 + 1e-9)).all()


@pytest.mark.parametrize("order", [1, 2, 3])
def test_remainder_of_an_inverse_form_is_that_of_a_geometric_series(order, rng):
    """Of a (1 + ρ u) the inverse is a geometric series, whose remainder all bounds attain.

    At u = −1 the terms beyond the order N add ρ^(N + 1) / (1 − ρ) of the value in the middle.
    """
    variation, value = rng.uniform(0.2, 0.6), rng.uniform(0.5, 5)
    parts = np.full((1, 1, 1), value), np.full((1, 1, 1), value * variation)
    matrix = TaylorModel(parts, np.zeros((1, 1)), inputs=1, order=order)
    left, right = (matrix.like(rng.uniform(-3, 3, (count, 1))) for count in (2, 3))
    found = inverse_form(matrix, left, right, min_eigenvalue=1 - variation)
    middle = left.value @ right.value.T / value
    for u in (-1.0, 1.0):
        exact = middle / (1 + variation * u)
        off = np.abs(found.at(np.array([[u]]))[0] - exact)
        assert (off <= found.remainder + 1e-12 * np.abs(middle)).all()
    of_series = np.abs(middle) * variation ** (order + 1) / (1 - variation)
    np.testing.assert_allclose(found.remainder, of_series, rtol=1e-9)


def test_coupling_within_a_block_attains_its_bounds_at_nodes_and_between(rng):
    """Of two alike oscillators, of which one is moved and the other read, in closed form.

    With L = λ + ε off the diagonal, N = 1 + ν u and cos(√λ t) as response, the coupling adds
    a (cos(√(λ + ε) t) − cos(√(λ − ε) t))/2. Nodes are a period apart, where late motions are at
    their extremes, so that they stray from lines by twice as much within the steps.
    """
    omega, variation = rng.uniform(5, 20), rng.uniform(0.35, 0.5)
    squared = omega**2
    time = (2 * np.pi * np.arange(30) + np.pi / 2) / omega
    off = 0.05 * omega / time[-1]  # ε, whose phase ε t/(2 ω) stays small

    def polynomial(*coefficients):
        parts = tuple(np.full((1, 1), x) for x in coefficients)
        return TaylorModel(parts, np.zeros(1), inputs=1, order=10)

    mass = polynomial(1.0, variation)
    read = polynomial(1.0, variation / 2)  # a, so that a²/N is about 1
    nothing, zero = mass * 0.0, polynomial(0.0)
    constant = zero.like(np.ones(1))

    def matrix(rows):
        return concatenate([concatenate(row, -1)[None] for row in rows], -2)

    rate = matrix([[constant * squared, constant * off], [constant * off, constant * squared]])
    norm = matrix([[mass, nothing], [nothing, mass]])
    block = Block(np.arange(2), rate, rate, rate, norm)
    of_block = BlockParticipation(
        block,
        output_modes=matrix([[nothing], [read]]),
        modal_forces=matrix([[mass], [nothing]]),
        source_participation=matrix([[constant], [nothing]]),
    )
    structure = SimpleNamespace(
        derivative_orders=np.zeros(1, int),
        distinct_orders=[0],
        output_factors=constant,
        rayleigh=zero.like(np.zeros(2)),
        damping_ratios=zero.like(np.zeros(2)),
    )
    found = SimpleNamespace(
        eigenvalue_low=np.full(2, squared - off), eigenvalue_high=np.full(2, squared + off)
    )
    excitation = Excitation(time, [Source.named("start")])
    added, deviation, _ = coupling_bounds(structure, of_block, found, excitation)
    largest_read = 1 + variation / 2

    def coupled(t):
        fast, slow = np.cos(np.sqrt(squared + off) * t), np.cos(np.sqrt(squared - off) * t)
        return largest_read * (fast - slow) / 2

    at_nodes = np.abs(coupled(time))
    assert (at_nodes <= added[:, 0] + 1e-12).all()
    assert (at_nodes[-10:] >= 0.9 * added[-10:, 0]).all()
    between = off_chords(coupled(np.linspace(time[0], time[-1], 2 * len(time) - 1)), 2)
    assert (between <= deviation[1:, 0] + 1e-12).all()
    assert (between[-10:] >= 0.8 * deviation[-10:, 0]).all()


def test_a_block_whose_modal_masses_may_be_singular_is_refused():
    """They are 1 at the midpoint of the box, and all entries are at u = 1."""
    unit = TaylorModel.constant(np.eye(2), inputs=1)
    masses = TaylorModel((unit.parts[0], 1.0 - np.eye(2)[None]), np.zeros((2, 2)), 1)
    ones = unit.like(np.ones((2, 1)))
    of_block = BlockParticipation(
        Block(np.arange(2), unit, unit, unit, masses), ones, masses @ ones, ones
    )
    structure = SimpleNamespace(output_factors=TaylorModel.constant(np.ones(1), 1))
    with pytest.raises(UnprovedError, match="singular"):
        _coupling_factors(structure, of_block)


@pytest.mark.parametrize("order", [0, 1, 2])
def test_the_slope_of_a_slow_mode_within_a_step_is_bounded(order, rng):
    """d/dσ of σ^order ∫ exp(σ s) ds from 0 to h, at σ = iω."""
    for omega in 10 ** rng.uniform(-3, 1, 10):
        h = rng.uniform(0.1, 1.0)
        time = np.array([0.0, h])
        _, slopes = _largest_within_steps(
            np.zeros((2, 2)), time, max_force=1.0, max_sigma=omega, order=order
        )
        s = np.linspace(0, h, 4001)
        waves = np.exp(1j * omega * s)
        power = (1j * omega) ** order
        exact = power * np.trapezoid(s * waves, s)
        if order:
            exact += order * (1j * omega) ** (order - 1) * np.trapezoid(waves, s)
        assert slopes[1] >= abs(exact) * (1 - 1e-6)
