"""Bounds of conductivities of pixels and voxels against exact, published and independent ones."""

import numpy as np
import pytest
from scipy.sparse import coo_array
from scipy.sparse.linalg import cg

from alphacut.base.errors import RefusedError
from alphacut.fuzzy import Triangular
from alphacut.rve import GreyImage, fuzzy_image_conductivity, solve_conduction, solve_image
from alphacut.rve.image.conductivity import hashin_shtrikman
from alphacut.rve.image.model import ConductionModel
from alphacut.rve.image.phases import ModuliImages
from tests.refused import refuses
from tests.rve.image.test_bounds import TIGHT


@pytest.mark.parametrize("shape", [(4, 6), (4, 6, 8)])
def test_laminates_are_exact(shape):
    sides = (0.7, 2.0, 1.0)[-len(shape) :]
    for axis in range(len(shape)):
        layers = np.indices(shape)[axis] % 2
        bounds = solve_conduction(np.where(layers, 3.0, 1.0), sides=sides, solver=TIGHT).bounds
        along = np.full(len(shape), 2.0)
        along[len(shape) - 1 - axis] = 1.5  # the components are along x, y, z
        expected = np.diag(along)
        assert np.abs(bounds.lower - expected).max() < 1e-10
        assert np.abs(bounds.upper - expected).max() < 1e-10
        assert bounds.contains(expected)


@pytest.mark.parametrize("cells", [2, 4, 8, 16, 32, 64])
@pytest.mark.parametrize("contrast", [3.0, 100.0, 1e4])
def test_checkerboards_hold_the_geometric_mean(cells, contrast):
    """Exactly √(k₁ k₂) (Keller 1964; Dykhne 1970), whatever the number of pixels of a square."""
    board = np.kron([[1.0, contrast], [contrast, 1.0]], np.ones((cells // 2, cells // 2)))
    bounds = solve_conduction(board).bounds
    low, high = bounds.mean
    assert low < np.sqrt(contrast) < high
    assert bounds.contains(np.sqrt(contrast) * np.eye(2))
    assert low * high == pytest.approx(contrast, rel=1e-4)  # by the same relation


def multipoles(fraction, ratio, *, hexagonal):
    """Conductivity of an array of discs over that of the matrix, by Rayleigh's multipoles.

    The lattice has cells of unit area; sums of z⁻ⁿ over it are Eisenstein series, n = 4, 6, …, and
    that of z⁻² is π in Rayleigh's order.
    """
    tau = np.exp(1j * np.pi / 3) if hexagonal else 1j
    highest = 80
    q = np.exp(2j * np.pi * tau)
    zeta = [np.sum(np.arange(1.0, 4000.0) ** -n) for n in range(highest)]
    sums = np.zeros(highest)
    sums[2] = np.pi
    for n in range(4, highest, 2):
        # G_n = 2 ζ(n) + 2 (2πi)ⁿ/(n − 1)! Σ_m σ_{n−1}(m) qᵐ, by Lipschitz's formula
        rows = sum(m ** float(n - 1) * q**m / (1 - q**m) for m in range(1, 200)) * (
            (2j * np.pi) ** n / np.prod(np.arange(1.0, n))
        )
        sums[n] = (2 * zeta[n] + 2 * rows).real * tau.imag ** (n / 2)
    radius = np.sqrt(fraction / np.pi)
    contrast = (1 - ratio) / (1 + ratio)
    orders = np.arange(1, highest // 2, 2)
    system = np.eye(len(orders))
    for row, k in enumerate(orders):
        for column, m in enumerate(orders):
            binomial = np.prod([(m + j) / (j + 1) for j in range(k)])
            system[row, column] += binomial * sums[m + k] * contrast * radius ** (2 * m)
    # (A − sums of the images) = mean gradient; the dipole of the disc is contrast · radius² A₁
    series = np.linalg.solve(system, np.eye(len(orders))[0])
    return 1 - 2 * fraction * contrast * series[0]


def published(fraction, ratio, *, hexagonal):
    """Formula of Perrins, McKenzie and McPhedran (1979, Proc. R. Soc. A 369, 207)."""
    t = (1 + ratio) / (1 - ratio)
    if hexagonal:
        first = 0.075422 * fraction**6 * t / (t**2 - 1.060283 * fraction**12)
        last = 0.000076 * fraction**12 / t
    else:
        first = 0.305827 * fraction**4 * t / (t**2 - 1.402958 * fraction**8)
        last = 0.013362 * fraction**8 / t
    return 1 - 2 * fraction / (t + fraction - first - last)


def discs(shape, width, height, centres, radius, *, ratio):
    """Images of discs in a periodic cell: conductivities below and above those of round discs.

    A pixel is inside if its farthest corner is, and outside if its nearest point is.
    """
    ny, nx = shape
    x = (np.arange(nx) + 0.5) * width / nx
    y = (np.arange(ny)[:, None] + 0.5) * height / ny
    half = np.array([height / ny, width / nx])[:, None, None] / 2
    inside = np.zeros(shape, bool)
    touched = np.zeros(shape, bool)
    for cx, cy in centres:
        dx = np.abs((x - cx + width / 2) % width - width / 2) + 0 * y
        dy = np.abs((y - cy + height / 2) % height - height / 2) + 0 * x
        centre_distance = np.stack([dy, dx])
        inside |= np.hypot(*(centre_distance + half)) <= radius
        touched |= np.hypot(*np.maximum(centre_distance - half, 0)) < radius
    ends = [np.where(mask, ratio, 1.0)[None] for mask in (inside, touched)]
    low, high = ends if ratio > 1 else ends[::-1]
    return ModuliImages(low, high)


@pytest.mark.parametrize("hexagonal", [False, True], ids=["square", "hexagonal"])
@pytest.mark.parametrize("fraction", [0.2, 0.4, 0.6])
@pytest.mark.parametrize("ratio", [0.02, 10.0, 50.0])
def test_arrays_of_discs_hold_the_values_of_multipoles(hexagonal, fraction, ratio):
    exact = multipoles(fraction, ratio, hexagonal=hexagonal)
    # The formula leaves out multipoles that matter at high fractions of the square array.
    assert published(fraction, ratio, hexagonal=hexagonal) == pytest.approx(exact, rel=4e-4)
    width, height, centres, shape = 1.0, 1.0, [(0.5, 0.5)], (96, 96)
    if hexagonal:
        height, centres, shape = np.sqrt(3), [(0.0, 0.0), (0.5, np.sqrt(3) / 2)], (110, 64)
    radius = np.sqrt(fraction * width * height / len(centres) / np.pi)
    images = discs(shape, width, height, centres, radius, ratio=ratio)
    sides = (height / shape[0] * shape[1] / width, 1.0)
    bounds = ConductionModel(sides).solve(images).bounds
    assert bounds.contains(exact * np.eye(2))
    assert bounds.width < 0.25


def finite_volumes(conductivity):
    """Conductivity along x by cells with harmonic means between them, fluxes of second order."""
    k = np.asarray(conductivity, float)
    number = np.arange(k.size).reshape(k.shape)
    rows, columns, entries = [], [], []
    for axis in range(k.ndim):
        other = np.roll(k, -1, axis)
        link = np.divide(2 * k * other, k + other, out=np.zeros(k.shape), where=k * other > 0)
        link = link.ravel()
        here, there = number.ravel(), np.roll(number, -1, axis).ravel()
        rows += [here, there, here, there]
        columns += [here, there, there, here]
        entries += [link, link, -link, -link]
        if axis == k.ndim - 1:
            source = np.zeros(k.size)
            np.add.at(source, here, link)
            np.add.at(source, there, -link)
            along = link, here, there
    matrix = coo_array(
        (np.concatenate(entries), (np.concatenate(rows), np.concatenate(columns)))
    ).tocsr()
    solution, info = cg(matrix, source, rtol=1e-10)
    assert info == 0
    link, here, there = along
    return float(np.mean(link * (1 + solution[there] - solution[here])))


@pytest.mark.parametrize("seed", range(20))
def test_random_volumes_hold_what_finite_volumes_tend_to(seed):
    """The values on 1, 2 and 3 times finer grids, extrapolated with the order they show."""
    rng = np.random.default_rng([seed, 91])
    contrast = 10.0 ** rng.uniform(-1.5, 1.5)
    volume = np.where(rng.random((6, 6, 6)) < rng.uniform(0.2, 0.6), contrast, 1.0)
    bounds = solve_conduction(volume).bounds
    low, high = bounds.components()[0]
    coarse, middle, fine = (finite_volumes(np.kron(volume, np.ones((n, n, n)))) for n in (1, 2, 4))
    limit = fine + (fine - middle) ** 2 / (middle - coarse - (fine - middle))
    for value in (middle, fine, limit):
        assert low < value < high
    shear = solve_image(5 / 3 * volume, volume).bounds.shear()
    assert high / low - 1 < 1.5 * (shear.upper / shear.lower - 1)


@pytest.mark.parametrize("contrast", [0.01, 10.0, 1000.0])
def test_a_cube_in_each_cell_holds_what_finite_volumes_tend_to(contrast):
    """A cube of half the cell's side, as in NIST IR 6269: the simplest solid with edges."""
    cube = np.ones((4, 4, 4))
    cube[1:3, 1:3, 1:3] = contrast
    coarse, middle, fine = (finite_volumes(np.kron(cube, np.ones((n, n, n)))) for n in (2, 4, 8))
    limit = fine + (fine - middle) ** 2 / (middle - coarse - (fine - middle))
    gaps = []
    for n in (1, 2, 4):
        bounds = solve_conduction(np.kron(cube, np.ones((n, n, n)))).bounds
        low, high = bounds.components()[0]
        assert low < limit < high
        gaps.append(high - low)
    assert gaps[2] < 0.6 * gaps[1] < 0.36 * gaps[0]


@pytest.mark.parametrize("shape", [(12, 12), (10, 10, 10)])
def test_insulators_and_perfect_conductors(shape, rng):
    """In the plane the cell of insulators is the inverse of that of perfect conductors."""
    hole = tuple(slice(3, 6) for _ in shape)
    image = np.ones(shape)
    image[hole] = 0.0
    empty = solve_conduction(image).bounds
    low, high = empty.mean
    assert 0.9 * high < low < high < 1
    image[hole] = 1e-6  # a nearly insulating material conducts more
    assert solve_conduction(image).bounds.mean.upper > low
    image[hole] = np.inf
    full = solve_conduction(image).bounds
    assert full.has_lower
    assert not full.has_upper
    image[hole] = 1e6
    assert full.mean.lower < solve_conduction(image).bounds.mean.upper
    if len(shape) == 2:
        assert full.mean.lower * high > 0.99
        assert full.mean.lower * low < 1
    image[:] = 1.0
    image[0] = 0.0  # a layer of insulator: the other ones conduct along it
    bounds = solve_conduction(image).bounds
    along = 1 - 1 / len(image)
    assert not bounds.has_lower
    assert np.diag(bounds.lower)[:-1] == pytest.approx(along, rel=1e-9)
    assert bounds.lower[-1, -1] == 0


def test_a_fuzzy_image_holds_every_image_of_its_cuts(rng, tmp_path):
    waves = np.sin(2 * np.pi * np.indices((8, 8, 8)) / 8 + rng.uniform(0, 6, (3, 1, 1, 1)))
    grey = 0.5 + 0.2 * waves.sum(axis=0)
    fuzzy = Triangular(0.8, 1.0, 1.2), Triangular(5.0, 10.0, 12.0)
    threshold = Triangular(0.45, 0.5, 0.55)
    image = GreyImage(grey, (1e-6, 2e-6, 1e-6))
    found = fuzzy_image_conductivity(image, fuzzy, thresholds=[threshold], progress=False)
    for level, bounds in zip(found.alpha, found.bounds, strict=True):
        for _ in range(5):
            low, high = (rng.uniform(*number.cut(level)) for number in fuzzy)
            mask = grey >= rng.uniform(*threshold.cut(level))
            inside = solve_conduction(np.where(mask, high, low), sides=image.sides).bounds
            assert bounds.contains((inside.lower + inside.upper) / 2)
    nominal = solve_conduction(np.where(grey >= 0.5, 10.0, 1.0), sides=image.sides).bounds.mean
    assert found.mean[-1] == pytest.approx(nominal, rel=1e-2)
    assert (np.diff(found.mean[:, 0]) >= 0).all()
    assert (np.diff(found.mean[:, 1]) <= 0).all()
    assert found.conductivity.cut(0.0) == pytest.approx(found.mean[0])
    assert found.reference[0] < found.mean[-1].mean() < found.reference[1]
    found.to_csv(str(tmp_path / "k.csv"))
    assert (tmp_path / "k.csv").read_text().splitlines()[1].startswith("k,0,")
    dataset = found.to_dataset()
    assert dataset["k_xx"].sel(bound="lower", alpha=1.0) == found.components["k_xx"][-1, 0]
    assert dataset["conductivity"].dims == ("alpha", "bound", "row", "column")
    assert "k_yy: α = 0: " in str(found)


def test_the_bounds_of_hashin_and_shtrikman_are_those_of_coated_spheres():
    """Maxwell's formula for spheres of k₂ in k₁, and the other way round."""
    k = np.array([2.0, 7.0])
    fractions = np.array([0.7, 0.3])
    for ends, dimension in (
        (hashin_shtrikman(k, fractions=fractions, dimension=d), d) for d in (2, 3)
    ):
        for end, (matrix, grain), fraction in ((ends[0], k, 0.3), (ends[1], k[::-1], 0.7)):
            contrast = (grain - matrix) / (grain + (dimension - 1) * matrix)
            exact = matrix * (1 + (dimension - 1) * fraction * contrast) / (1 - fraction * contrast)
            assert end == pytest.approx(exact, rel=1e-12)


def test_conductivities_that_are_none_are_refused():
    for wrong in (np.full((2, 2), -1.0), np.full((2, 2), np.nan), np.zeros((3, 3)), np.ones(4)):
        with refuses("conductivity"):
            solve_conduction(wrong)
    image = GreyImage(np.array([[0, 1], [1, 0]]), (1.0, 1.0))
    for values in ([1.0], [-1.0, 1.0], [1e-80, 1.0], [0.0, 1e20], [Triangular(-1, 0, 1), 1.0]):
        with pytest.raises(RefusedError):
            fuzzy_image_conductivity(image, values, labels=[0, 1], progress=False)
