"""Taylor models, eigenpairs and tables hold their bounds; half of a bound would not do."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import eigh

from alphacut.frame import Accelerogram, MatrixStructure, StoreyFrame
from alphacut.frame.bounds.box import over_box
from alphacut.frame.bounds.level import LevelModels, OutputBounds
from alphacut.frame.calculus.taylor_model import TaylorModel
from alphacut.frame.modes.clusters import centred_matrices, enclose_subspaces
from alphacut.frame.modes.intervening import Excitation
from alphacut.frame.modes.structure import classical_structure
from alphacut.frame.response.oscillators import Grid, Oscillators

TIGHT = 0.5
"""Share of a bound that something reaches: half the bound would be passed."""


def is_tight(off, bound):
    return (TIGHT * bound < off).all() and (off <= bound * (1 + 1e-9)).all()


def frame(storeys=4, width=0.05, **values):
    """A frame with a stiffness and a mass a storey, and its structure over the box."""
    own = StoreyFrame(
        masses=(2e4,) * storeys,
        stiffness=(3e7,) * storeys,
        v0=(1.0,) * storeys,
        damping_ratio=0.03,
        **values,
    )
    names = tuple(f"{kind}{z + 1}" for kind in "km" for z in range(storeys))
    centre = np.array([own.parameters[name] for name in names])
    radius = width * centre
    return own, names, centre, radius, over_box(own, names, centre - radius, centre + radius)


def along(own, names, centre, radius, i):
    """The structure where input i alone varies."""
    only = radius * (np.arange(len(names)) == i)
    return over_box(own, names, centre - only, centre + only)


def modes(structure):
    """All blocks of a structure."""
    centre, used = centred_matrices(structure.mass, structure.stiffness)
    return enclose_subspaces(centre, used, centre.mode_count)


def exact_modes(own, names, centre, radius, u):
    """λ and shapes, those with 1 in their own coordinate of the middle, at points u."""
    n = own.floors
    below = np.eye(n) - np.eye(n, k=-1)

    def pencil(values):
        k, m = values[:n], values[n:]
        return below.T @ np.diag(k) @ below, np.diag(m)

    basis = eigh(*pencil(centre))[1]
    for row in centre + radius * u:
        K, M = pencil(row)
        squared, shape = eigh(K, M)
        seen = np.linalg.solve(basis, shape)
        yield squared, seen / np.diag(seen)


def test_half_of_a_remainder_of_eigenpairs_would_not_do():
    own, names, centre, radius, _ = frame(2, 0.1)
    first = (0, 0)
    for i, entries in (
        (0, {"eigenvalue_block": first, "shapes": (0, 1), "modal_mass": first}),
        (2, {"mass_times_shapes": first}),
    ):
        found, u = modes(along(own, names, centre, radius, i)), np.array([-1.0, 1])
        ends = exact_modes(own, names, centre, radius, u[:, None] * np.eye(4)[i])
        off = {name: [] for name in entries}
        seen = found.centre.mass.at(u[:, None])
        for at, M, (squared, shapes) in zip(u, seen, ends, strict=True):
            x = shapes[:, :1].T
            exact = {
                "eigenvalue_block": squared[None],
                "shapes": x,
                "modal_mass": x @ M @ x.T,
                "mass_times_shapes": x @ M,
            }
            for name, entry in entries.items():
                value = getattr(found.blocks[0], name).at(np.array([[at]]))[0]
                off[name].append(abs(exact[name][entry] - value[entry]))
        for name, entry in entries.items():
            assert is_tight(np.max(off[name]), getattr(found.blocks[0], name).remainder[entry])


def test_half_of_the_range_of_eigenvalues_would_not_do():
    own, _, _, _, structure = frame(1, 0.1)
    p = {name: TaylorModel.constant(x, 1) for name, x in own.parameters.items()}
    loose = {name: p[name].widened(0.1 * own.parameters[name]) for name in ("k1", "m1")}
    for one in (structure, classical_structure(own, p | loose)):
        found = modes(one)
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
    level = LevelModels.from_structure(
        replace(springs, initial_state=both), Excitation({}, time, ("velocity",))
    )
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
    off = np.abs(middle - np.interp(fine, time, middle[::parts]))[1:].reshape(-1, parts).max(1)
    stray = level.interpolation_error()[1:, 0]
    assert (off <= stray).all()
    assert (off > TIGHT * stray).any()


RECORD = Accelerogram(0.02, np.sin(np.arange(200) * 0.11) * np.sin(np.arange(200) * 0.47))


@pytest.mark.parametrize("source", ["load", "velocity", "start"])
@pytest.mark.parametrize("order", [0, 1, 2])
def test_tables_miss_what_they_state_and_no_less_than_half(source, order):
    time = np.arange(0, 3, 0.05)
    fine = Grid(np.linspace(9.5, 10.5, 41), np.linspace(0.02, 0.035, 41))
    for omega, quotient in ((5, 1), (1, 10), (5, 10)):  # points of the fine grid in a cell
        coarse = Grid(fine.omega[::omega], fine.quotient[::quotient])
        table = Oscillators(coarse, {"load": RECORD}, time, {order}).responses(source, order)
        exact = Oscillators(fine, {"load": RECORD}, time, {order}).responses(source, order).value
        at = table.value
        for axis, (own, grid) in enumerate(
            ((fine.quotient, coarse.quotient), (fine.omega, coarse.omega)), 1
        ):
            weights = np.array([np.interp(own, grid, row) for row in np.eye(len(grid))])
            at = np.moveaxis(np.tensordot(at, weights, (axis, 0)), -1, axis)
        off = np.abs(at - exact).max((1, 2))
        assert (off <= table.error + 1e-14).all()
        if (omega, quotient) != (5, 10):
            assert (off[1:] / table.error[1:]).max() > TIGHT


def test_what_second_derivatives_do_within_a_cell_is_in_the_error():
    """G″ = (σ − σ₁)(σ − σ₂) is zero at both ends of a cell, and G strays by 5 h⁴/384 within."""
    grid, h = Grid(np.array([10.0, 11.0]), np.zeros(1)), 1.0
    oscillators = Oscillators(grid, {}, np.zeros(1), range(3))
    zero, fourth = np.zeros((3, 1)), np.array([[0.0], [0.0], [0.0], [0.0], [2.0]])
    error, _ = oscillators._error(zero, fourth, 0, start=True)
    exact = 5 * h**4 / 384
    assert exact <= error[0] <= 3 * exact


def test_responses_are_those_of_a_fine_march_and_stray_as_stated():
    grid, parts = Grid(np.linspace(9.99, 10.01, 3), np.array([0, 1e-3])), 8
    resonant = Accelerogram(0.02, np.sin(0.2 * np.arange(400)))
    ended = Accelerogram(0.02, np.ones(51))  # between two nodes
    cases = [(source, resonant, 0.05) for source in ("load", "velocity", "start")]
    for source, ground, step in (*cases, ("load", ended, 0.01)):
        coarse = step * (np.arange(120) + 0.5)
        time = coarse[0] + step / parts * np.arange(119 * parts + 1)
        for order in (0, 1, 2):
            wide = Oscillators(grid, {"load": ground}, coarse, {order}).responses(source, order)
            fine = Oscillators(grid, {"load": ground}, time, {order}).responses(source, order).value
            assert np.allclose(fine[::parts], wide.value, atol=1e-12 * np.abs(fine).max())
            line = np.array([np.interp(time, coarse, x) for x in wide.value.reshape(120, -1).T]).T
            off = np.abs(fine.reshape(len(time), -1) - line)[1:].reshape(119, -1).max(1)
            assert (off <= wide.line_deviation[1:] + 1e-13).all()
            assert (off > TIGHT * wide.line_deviation[1:]).any()
