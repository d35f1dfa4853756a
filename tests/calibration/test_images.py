"""Proved bounds of random images beside finite elements of another kind, refined three times."""

import numpy as np
import pytest
from scipy.sparse import coo_array
from scipy.sparse.linalg import splu

from alphacut.rve import solve_image
from tests.calibration.declared import Calibration, free_seed

REFINEMENTS = (2, 4, 8)
STRAINS = 20


def quadratic_element(aspect):
    """Matrices of trace and deviator of a Q2 element on a pixel, and its nodes, by 3 × 3 points."""
    points, weights = np.polynomial.legendre.leggauss(3)
    x, w = (points + 1) / 2, weights / 2
    value = np.array([(1 - x) * (1 - 2 * x), 4 * x * (1 - x), x * (2 * x - 1)])
    slope = np.array([4 * x - 3, 4 - 8 * x, 4 * x - 1])
    across = np.einsum("ap,bq->abpq", value, slope).reshape(9, -1)  # node (y, x), point (y, x)
    up = np.einsum("ap,bq->abpq", slope, value).reshape(9, -1) / aspect
    zero = np.zeros_like(across)
    xx, yy = (np.concatenate(pair) for pair in ((across, zero), (zero, up)))
    xy = np.concatenate([up, across])
    scale = aspect * np.outer(w, w).ravel()
    trace = ((xx + yy) * scale) @ (xx + yy).T
    deviator = ((xx - yy) * scale) @ (xx - yy).T + (xy * scale) @ xy.T
    nodes = np.array([(i / 2, j / 2 * aspect) for j in range(3) for i in range(3)])
    return trace, deviator, nodes


def stiffness_above(bulk, shear, aspect, parts):
    """Stiffness by displacements on every pixel in so many parts along each side."""
    bulk, shear = (np.kron(one, np.ones((parts, parts))) for one in (bulk, shear))
    rows, columns = bulk.shape
    trace, deviator, nodes = quadratic_element(aspect)
    local = bulk.reshape(-1, 1, 1) * trace + shear.reshape(-1, 1, 1) * deviator
    y, x = np.divmod(np.arange(rows * columns), columns)
    j, i = np.divmod(np.arange(9), 3)
    node = (2 * y[:, None] + j) % (2 * rows) * 2 * columns + (2 * x[:, None] + i) % (2 * columns)
    dofs = np.hstack([node, node + 4 * rows * columns])
    size = 8 * rows * columns
    places = [np.repeat(dofs, 18, axis=1).ravel(), np.tile(dofs, (1, 18)).ravel()]
    matrix = coo_array((local.ravel(), places), shape=(size, size)).tocsc()
    place = nodes + np.stack([x, y * aspect], axis=1)[:, None]
    uniform = np.zeros((len(dofs), 18, 3))
    uniform[:, :9, 0], uniform[:, 9:, 1] = place[..., 0], place[..., 1]
    uniform[:, :9, 2], uniform[:, 9:, 2] = place[..., 1] / 2, place[..., 0] / 2
    load = np.zeros((size, 3))
    np.add.at(load, dofs, -np.einsum("eij,ejl->eil", local, uniform))
    free = np.setdiff1d(np.arange(size), [0, size // 2])
    whole = np.zeros((size, 3))
    whole[free] = splu(matrix[free][:, free]).solve(load[free])
    fields = uniform + whole[dofs]
    return np.einsum("eil,eij,ejm->lm", fields, local, fields) / (rows * columns * aspect)


def truth(bulk, shear, aspect):
    """Stiffness above the true one, one extrapolated from three, and the doubt of that."""
    coarse, middle, fine = (stiffness_above(bulk, shear, aspect, n) for n in REFINEMENTS)
    rate = np.clip((middle - fine) / np.where(middle == coarse, 1, coarse - middle), 0.0, 0.7)
    guess = fine - rate / (1 - rate) * (middle - fine)
    return fine, guess, np.linalg.norm(guess - fine) / 2


def draw(rng):
    """Moduli of the pixels of an image of two or three phases, and the aspect of a pixel."""
    shape = tuple(rng.integers(4, 8, 2))
    phases, contrast = rng.integers(2, 4), 10.0 ** rng.uniform(0, 2)
    young = np.exp(rng.uniform(0, np.log(contrast), phases))
    nu = rng.uniform(-0.3, 0.45, phases)
    labels = rng.integers(phases, size=shape)
    mu = young / (2 * (1 + nu))
    bulk = young / (3 * (1 - 2 * nu)) + mu / 3
    return bulk[labels], mu[labels], rng.choice([1.0, rng.uniform(0.5, 2)])


def energies(stiffness, strains):
    return np.einsum("si,ij,sj->s", strains, stiffness, strains)


def beside(table, rng, bounds, reference, case):
    """Adds the energies of random strains: proved ends, and the truth between two others."""
    above, guess, doubt = reference
    strains = rng.normal(size=(STRAINS, 3))
    strains /= np.linalg.norm(strains, axis=1)[:, None]
    size = energies(guess, strains)
    low, high = (energies(end, strains) for end in (bounds.lower, bounds.upper))
    attained = energies(above, strains), size - doubt
    table.guaranteed("energy", (low, high), attained, size=size, case=case)


@pytest.mark.slow
def test_random_images():
    seed = free_seed("images")
    table = Calibration("Images", seed)
    for k in range(40):
        rng = np.random.default_rng([seed, k])
        bulk, shear, aspect = draw(rng)
        solution = solve_image(bulk, shear, sides=(aspect, 1.0), division=int(rng.integers(1, 4)))
        beside(table, rng, solution.bounds, truth(bulk, shear, aspect), k)
    table.judge()
