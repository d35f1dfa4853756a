"""Stresses of a pixel or voxel by the moments of their tractions: rank and energies, exactly."""

from fractions import Fraction

import numpy as np
import pytest

from alphacut.rve.image.fields.macro_element import (
    MacroElement,
    affine_displacements,
    component_pairs,
    constraints,
    corners,
    trace_matrix,
)


def reduced(rows):
    """Rational rows in echelon form, each as a dictionary, by their leading column."""
    pivots = {}
    for row in rows:
        left = {int(k): Fraction(float(row[k])) for k in np.flatnonzero(row)}
        while left:
            column = min(left)
            if column not in pivots:
                scale = left[column]
                pivots[column] = {k: x / scale for k, x in left.items()}
                break
            factor = left[column]
            for k, x in pivots[column].items():
                value = left.get(k, 0) - factor * x
                if value:
                    left[k] = value
                else:
                    left.pop(k, None)
    return pivots


@pytest.mark.parametrize(("dimension", "attained"), [(2, 13), (3, 48)])
def test_all_moments_in_equilibrium_are_attained(dimension, attained):
    """The rank of the tractions of all stresses of the class, by rational numbers.

    Pivots are taken from the stresses first, so that the rows whose pivot is a traction are the
    conditions that tractions obey: force and torque.
    """
    _, rows = constraints(dimension)
    assert not (4 * rows % 1).any()  # the entries are exact
    pivots = reduced(rows)
    n_moments = 2 * dimension**3
    conditions = sum(column >= rows.shape[1] - n_moments for column in pivots)
    assert n_moments - conditions == attained


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("nu", [-0.9, -0.5, 0.0, 0.3, 0.49, 0.4999])
def test_uniform_stresses_have_their_energy(dimension, nu, rng):
    """The least energy under tractions of a uniform stress is that of the stress itself."""
    sides = (*rng.uniform(0.5, 2.0, dimension - 1), 1.0)
    ratio = 2 * (1 + nu) / (3 * (1 - 2 * nu)) + (1 / 3 if dimension == 2 else 0)
    element = MacroElement.of_ratio(ratio, sides)
    pairs = component_pairs(dimension)
    stress = rng.normal(size=len(pairs))
    tensor = np.zeros((dimension, dimension))
    for value, (i, j) in zip(stress, pairs, strict=True):
        tensor[i, j] = tensor[j, i] = value
    moments = np.zeros((dimension, 2, dimension, dimension))
    for axis in range(dimension):
        moments[axis, 1, 0] = tensor[:, axis]
        moments[axis, 0, 0] = -tensor[:, axis]
    actual = tensor * np.outer(sides, sides)
    trace = np.trace(actual)
    energy = trace**2 / (dimension**2 * ratio) + (np.sum(actual**2) - trace**2 / dimension) / 2
    found = np.sum((element.modes @ moments.ravel()) ** 2)
    margin = 2.0**-40 * element.norm**2 * np.sum(moments**2)
    assert abs(found - energy) <= margin
    strained = trace_matrix(dimension) @ affine_displacements(dimension)
    assert np.linalg.eigvalsh(element.stiffness)[dimension * (dimension + 1) // 2] > 0
    # The table of displacements and that of moments are inverse to one another.
    products = element.stiffness @ strained
    energies = np.einsum("mk,mk->k", strained, products)
    again = np.sum((element.modes @ products) ** 2, axis=0)
    assert again == pytest.approx(energies, rel=1e-8)


@pytest.mark.parametrize("dimension", [2, 3])
def test_a_wrong_entry_of_a_table_is_seen(dimension, monkeypatch):
    """Rigid motions of the corners have no moments."""
    element = MacroElement.of_ratio(2.0, (1.0,) * dimension)
    trace = trace_matrix(dimension)
    points = corners(dimension) - 0.5
    turned = np.zeros_like(points)
    turned[:, 0], turned[:, 1] = points[:, 1], -points[:, 0]
    motion = trace @ (turned + 1.0).ravel()
    assert abs(element.stiffness @ motion).max() < 1e-13 * abs(element.stiffness).max()
    wrong = element.stiffness.copy()
    wrong[1, 1] *= 1 + 1e-6
    assert abs(wrong @ motion).max() > 1e-9 * abs(element.stiffness).max()
