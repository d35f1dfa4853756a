import os
import re
from dataclasses import dataclass

import numpy as np
import pytest
from numpy.polynomial import chebyshev

from alphacut.rve import Phase
from alphacut.rve.cell import with_ratio
from alphacut.rve.ranks import ALONE, Ranks
from alphacut.rve.series.model import SeriesModel
from alphacut.rve.series.stiffness import square_stiffness
from alphacut.rve.slices.model import solve_slice
from alphacut.rve.table.build import Asked, PlanarSource, SolvedCell, TableError, build_table
from alphacut.rve.table.cache import table_key
from alphacut.rve.table.interpolant import TableRange, coefficients, leja, tail
from alphacut.rve.table.model import TableModel
from alphacut.stochastic import HermiteMap

MATRIX = Phase(20e9)
PAPER = HermiteMap(0.1337, 0.1, 0.8663, 0.1692)
SPAN = TableRange(MATRIX, 0.3, (0.13, 0.87), (75e9, 85e9))


@dataclass
class SeriesSource:
    """Moduli by multipole series, to round-off: what a table does to them is its own."""

    span: TableRange
    accuracy: float
    mesh_size, unknowns, systems = 0.0, 0, 0
    space = np.array([[0.5], *4 * [[1e-13]]])

    def moduli(self, radii, modulus):
        return [self.rough(radius, modulus) for radius in radii]

    def rough(self, radius, modulus):
        phases = [Phase(float(e), self.span.poisson) for e in modulus]
        cell = square_stiffness(np.array([radius]), self.span.matrix, phases)
        return np.stack([cell.bulk[0], cell.deviator[0], cell.shear[0]], axis=-1)


@pytest.fixture
def by_series(monkeypatch):
    monkeypatch.setattr("alphacut.rve.table.model.PlanarSource", SeriesSource)


def errors(table, radii, moduli):
    cells = square_stiffness(
        radii, table.span.matrix, [Phase(e, table.span.poisson) for e in moduli]
    )
    exact = np.stack([cells.bulk, cells.deviator, cells.shear], axis=-1)
    return np.abs(with_ratio(table.moduli(radii, moduli)) / with_ratio(exact) - 1)


def test_leja_points_are_nested_and_become_lobatto_points():
    np.testing.assert_allclose(
        np.sort(leja(17)), np.sort(np.cos(np.pi * np.arange(17) / 16)), atol=1e-15
    )
    np.testing.assert_array_equal(leja(9), leja(14)[:9])
    assert len(np.unique(np.round(leja(40), 12))) == 40


def test_coefficients_of_a_polynomial_are_exact():
    x, y = leja(6), leja(3)
    values = (
        np.polynomial.chebyshev.chebval(x, [1, 0, 2, 0, 0, 0.5])[:, None]
        * np.polynomial.chebyshev.chebval(y, [0, 1, 3])
    )[..., None]
    expected = np.outer([1, 0, 2, 0, 0, 0.5], [0, 1, 3])
    np.testing.assert_allclose(coefficients(values)[..., 0], expected, atol=1e-13)


def test_tail_of_a_geometric_series():
    series = (0.2 ** np.arange(9.0))[:, None, None] * np.ones(3)
    rest = 0.2**9 / 0.8
    assert rest < tail(series, 0).max() < 200 * rest
    assert tail(series, 1).max() == 0
    assert tail(np.full((8, 1, 3), 1e-9), 0, noise=2e-9)[:3].tolist() == [1e-9] * 3
    both = series * np.array([0.0, 2.0, 3.0])  # the ratio's coefficients are their difference
    assert tail(both, 0)[3] == pytest.approx(tail(both, 0)[2] / 3)


@pytest.mark.parametrize("count", [17, 33])
def test_the_interpolation_error_is_tight(count):
    """A function whose interpolant fades like 0.7^k, the last three coefficients by chance half as
    large, and whose own further ones have the worst signs for one point.
    """
    x, nodes = np.cos(np.linspace(0, np.pi, 3001)), leja(count)
    through = chebyshev.chebvander(x, count - 1) @ np.linalg.inv(
        chebyshev.chebvander(nodes, count - 1)
    )
    left = chebyshev.chebvander(x, 140) - through @ chebyshev.chebvander(nodes, 140)
    series = 0.7 ** np.arange(141.0)
    true = (np.abs(left[:, count:]) @ series[count:]).max()
    series[count - 3 : count] /= 2
    declared = tail(series[:count, None, None], 0)[0]
    assert true <= declared <= 1.8 * true


@pytest.mark.parametrize("seed", [1, 2])
def test_interpolation_errors_cover_random_tables(seed):
    check_random_tables(seed, 4)


@pytest.mark.slow
def test_interpolation_errors_cover_two_hundred_random_tables():
    check_random_tables(int(os.environ.get("SEED", "7")), 200)


def check_random_tables(seed, count):
    """Interpolation errors of tables over anything, to touching voids and rigid particles."""
    rng = np.random.default_rng(seed)
    for _ in range(count):
        low, high = rng.uniform(0.02, 0.8), 1 - 10 ** rng.uniform(-2.3, -0.7)
        least = 20e9 * 10 ** rng.uniform(-4, 4)
        matrix, poisson = Phase(20e9, rng.uniform(0, 0.49)), rng.uniform(0, 0.49)
        moduli = least, least * np.exp(rng.choice([0.0, 0.1, 1.0]))
        span = TableRange(matrix, poisson, (min(low, high - 0.05), high), moduli)
        table = build_table(span, accuracy=10 ** rng.uniform(-6, -1), make=SeriesSource)
        true = errors(table, np.linspace(*span.radii, 120), np.unique(np.linspace(*moduli, 5)))
        assert (true.max(axis=(0, 1)) <= table.interpolation + 1e-12).all(), span


@pytest.mark.parametrize("accuracy", [1e-3, 1e-5, 1e-7, 1e-9])
@pytest.mark.parametrize(
    "span",
    [
        SPAN,
        TableRange(Phase(20e9, 0.2), 0.4, (0.05, 0.97), (2e7, 2e9)),
        TableRange(MATRIX, 0.0, (0.3, 0.9), (2e12, 2e14)),
    ],
)
def test_declared_interpolation_error_holds(span, accuracy):
    table = build_table(span, accuracy=accuracy, make=SeriesSource)
    true = errors(table, np.linspace(*span.radii, 41), np.geomspace(*span.moduli, 13)).max()
    assert true < table.interpolation.max() + 1e-12 <= accuracy + 1e-12


def test_planar_table_reaches_its_accuracy():
    table = build_table(SPAN, accuracy=1e-5)
    true = errors(table, np.linspace(0.13, 0.87, 25), np.linspace(75e9, 85e9, 5)).max()
    declared = (table.interpolation + table.space[1:].max(axis=1)).max()
    assert true < declared < 1e-5
    assert table.systems > 0
    assert table.unknowns > 1000


def test_a_table_declares_what_three_orders_declare_of_its_cells():
    span = TableRange(Phase(20e9, 0.48), 0.3, (0.3, 0.6), (80e9, 80e9))
    table = build_table(span, accuracy=1e-3)
    for radius, *declared in table.space.T:
        cell = solve_slice(
            radius, span.matrix, [Phase(80e9)], orders=(2, 3, 4), mesh_size=table.mesh_size
        )
        assert declared == pytest.approx(cell.error[0], rel=1e-6)


def test_meshes_of_a_narrow_range_are_judged_between_its_ends_too():
    """Errors of one rough mesh and the next differ threefold; drawn by the calibration."""
    matrix, particle = Phase(20e9, 0.433756752943451), Phase(8.006285984e9, 0.437920942616843)
    bent = HermiteMap(0.18152259879, -0.05140253720, 0.23140204727, 0.41588731573)
    exact = SeriesModel().solve(bent, matrix, [particle])[0]
    found = TableModel(accuracy=1e-4).solve(bent, matrix, [particle])[0]
    assert abs(found.modulus / exact.modulus - 1) <= found.estimated_error


def test_degenerate_ranges_take_one_node():
    table = build_table(
        TableRange(MATRIX, 0.3, (0.5, 0.5), (80e9, 80e9)), accuracy=1e-9, make=SeriesSource
    )
    assert table.coefficients.shape == (1, 1, 3)
    assert errors(table, np.array([0.5]), np.array([80e9])).max() < 1e-13


@pytest.mark.usefixtures("by_series")
def test_model_agrees_with_the_series_to_1e_7():
    inclusions = [Phase(75e9), Phase(80e9, 0.2), Phase(85e9)]
    model = TableModel(accuracy=1e-7)
    for result, exact in zip(
        model.solve(PAPER, MATRIX, inclusions),
        SeriesModel().solve(PAPER, MATRIX, inclusions),
        strict=True,
    ):
        assert abs(result.modulus / exact.modulus - 1) < 1e-7
        assert abs(result.modulus / exact.modulus - 1) < result.estimated_error < 1e-7
        np.testing.assert_allclose(result.stiffness, exact.stiffness, rtol=1e-7, atol=1)


@pytest.mark.usefixtures("by_series")
def test_kept_on_disk_by_all_that_it_depends_on(tmp_path, monkeypatch):
    from alphacut.rve.table import cache as table_store

    monkeypatch.setattr(table_store, "_in_process", {})
    model = TableModel(accuracy=1e-4, cache=tmp_path)
    first = model.solve(PAPER, MATRIX, [Phase(80e9)])[0]
    assert "built in" in first.reason
    (path,) = tmp_path.iterdir()
    table_store._in_process.clear()
    second = model.solve(PAPER, MATRIX, [Phase(80e9)])[0]
    assert "kept" in second.reason
    assert second.modulus == first.modulus
    table_store._in_process.clear()
    path.write_bytes(path.read_bytes()[:100])  # cut off: made anew, and whole again
    assert "built in" in model.solve(PAPER, MATRIX, [Phase(80e9)])[0].reason
    assert [p.name for p in tmp_path.iterdir()] == [path.name]


def test_key_changes_with_every_input():
    keys = {
        table_key(span, accuracy=accuracy, source=source)
        for span in (
            SPAN,
            TableRange(MATRIX, 0.2, SPAN.radii, SPAN.moduli),
            TableRange(Phase(21e9), 0.3, SPAN.radii, SPAN.moduli),
        )
        for accuracy in (1e-4, 1e-5)
        for source in ("planar", "series")
    }
    assert len(keys) == 12


@pytest.mark.usefixtures("by_series")
def test_similar_maps_share_a_table():
    model = TableModel(accuracy=1e-4)
    other = HermiteMap(0.1337, 0.3145, 0.8663, 0.001)
    model.solve(PAPER, MATRIX, [Phase(80e9)])
    assert "kept" in model.solve(other, MATRIX, [Phase(80e9)])[0].reason


@pytest.mark.usefixtures("by_series")
def test_refuses_what_lies_outside():
    with pytest.raises(
        ValueError, match=r"asked for a radius of .* it covers 0.2 to 0.5: widen it"
    ):
        TableModel(radii=(0.2, 0.5)).solve(PAPER, MATRIX, [Phase(80e9)])
    with pytest.raises(ValueError, match=r"asked for a modulus of 8e\+10 Pa"):
        TableModel(moduli=(1e9, 2e9)).solve(PAPER, MATRIX, [Phase(80e9)])


def test_options_out_of_range():
    with pytest.raises(ValueError, match="must lie in"):
        TableModel(accuracy=1.0)


@pytest.mark.parametrize(
    "changes", [{"radii": (0.5, 0.4)}, {"radii": (0.0, 0.4)}, {"moduli": (0.0, 1.0)}]
)
def test_ranges_out_of_order(changes):
    with pytest.raises(ValueError, match="they need 0 < least <= greatest"):
        TableRange(
            **{
                "matrix": MATRIX,
                "poisson": 0.3,
                "radii": (0.1, 0.5),
                "moduli": (1e9, 2e9),
                **changes,
            }
        )


class Two(Ranks):
    """Two ranks, of which the second has done all when the first could stop it."""

    size, told, orders = 2, [], []

    def each(self, function, items, progress=None, costs=None):
        return [function(item) for item in items]

    def until(self, enough, function, items, progress=None):
        found = {k: function(item) for k, item in enumerate(items)}
        self.told.append([enough(k, one) for k, one in found.items()])
        self.orders.append(list(items))
        return found


@pytest.mark.parametrize("ranks", [ALONE, Two()])
@pytest.mark.parametrize(("rate", "tried"), [(8.0, 1), (6.5, 2), (4.5, 3)])
def test_a_mesh_as_fine_as_likely_is_tried_where_the_rougher_one_fails_or_at_once(
    rate, tried, ranks
):
    source, sizes = PlanarSource(SPAN, 1e-5, ranks), []
    Two.told.clear()
    Two.orders.clear()
    source.mesh_size = 0.5

    def judge(radius, size):
        sizes.append((radius, size))
        error = 1e-3 * (size / 0.5) ** rate
        return SolvedCell(np.full((1, 3), size), np.full(4, error), 1)

    source._judge = judge
    cells = source._refined(0.5, judge(0.5, 0.5), Asked([0.3, 0.7]))
    foretold = [0.5 * 0.008 ** (1 / power) for power in (7.5, 6.0)]  # 0.8 · 1e-5 / 1e-3
    own = [size for radius, size in sizes[1:] if radius == 0.5]
    assert own[:2] == pytest.approx(foretold[: tried if ranks is ALONE else 2])
    assert len(own) >= tried
    assert [cell.moduli[0, 0] for cell in cells] == 3 * [source.mesh_size]
    assert max(cell.error for cell in cells) <= 1e-5
    assert sizes.count((0.3, source.mesh_size)) == 1
    if ranks is not ALONE:  # the others are in vain where the rougher mesh or none will do
        assert ranks.told[0] == [tried == 1, tried == 3, False, False]
        assert ranks.orders[0] == [0, 1, 2, 3]  # small particles take longest


@pytest.mark.parametrize(("accuracy", "radii"), [(1e-6, [7, 2]), (1e-8, [7, 4])])
def test_the_decay_of_coefficients_tells_how_many_radii_are_missing(accuracy, radii):
    asked = []

    class Counted(SeriesSource):
        def moduli(self, radii, modulus):
            asked.append(len(radii))
            return super().moduli(radii, modulus)

    span = TableRange(MATRIX, 0.3, (0.3, 0.6), (80e9, 80e9))
    build_table(span, accuracy=accuracy, make=Counted)
    assert asked == radii


def test_the_larger_error_that_a_refusal_names_is_enough(monkeypatch):
    monkeypatch.setattr("alphacut.rve.table.build._FINEST", 0.25)
    span = TableRange(MATRIX, 0.3, (0.3, 0.3), (80e9, 80e9))
    with pytest.raises(TableError, match=r"or --method series") as told:
        build_table(span, accuracy=1e-9, make=PlanarSource)
    larger = float(re.search(r"modulus.tolerance\) of ([\d.e-]+), say", str(told.value))[1])
    assert 1e-9 < larger < 1e-2
    assert build_table(span, accuracy=larger, make=PlanarSource).mesh_size >= 0.25


def test_refuses_when_interpolation_does_not_settle():
    with pytest.raises(TableError, match="cover less, or take a --tolerance"):
        build_table(
            TableRange(MATRIX, 0.3, (0.1, 0.9), (20.0, 20e18)), accuracy=1e-9, make=SeriesSource
        )


@pytest.mark.parametrize(
    ("matrix", "inclusion", "ends"),
    [
        (Phase(20e9, 0.23527), Phase(20.4e6, 0.06717), (0.6, 0.925)),
        (Phase(20e9, 0.431842), Phase(400.9e9, 0.285917), (2**-7, 0.275)),
    ],
)
def test_the_mesh_is_judged_at_every_radius(matrix, inclusion, ends):
    """What a finer mesh gains at one radius, it does not gain at another."""
    span = TableRange(matrix, inclusion.poisson, ends, (inclusion.modulus,) * 2)
    table = build_table(span, accuracy=1e-3)
    radii = np.linspace(*ends, 9)
    exact = square_stiffness(radii, matrix, [inclusion])
    shear = table.moduli(radii, np.array([inclusion.modulus]))[:, 0, 2]
    true = abs(shear / exact.shear[:, 0] - 1)
    declared = (table.space_error(radii) + table.interpolation)[:, 2]
    assert (true <= 1.5 * declared).all()  # a single radius counts half as much again
    assert true.mean() <= declared.mean()
