import numpy as np
import pytest

from alphacut.rve import Phase
from alphacut.rve.cell import square_moduli, with_ratio
from alphacut.rve.model import CrossCheckError, cross_check, named
from alphacut.rve.series.model import SeriesModel
from alphacut.rve.series.stiffness import square_stiffness
from alphacut.rve.slices.model import SlicesModel, solve_slice
from alphacut.rve.slices.theta_rule import extreme_radii, theta_error, theta_rule
from alphacut.stochastic import HermiteMap

planar = pytest.importorskip("alphacut.rve.planar.problem")
planar_mesh = pytest.importorskip("alphacut.rve.mesh.planar")

MATRIX, INCLUSION = Phase(20e9), Phase(80e9)
INDEPENDENT = ([0, 0, 2], [0, 1, 2])


def largest_error(stiffness, radius, matrix, inclusions):
    exact = square_stiffness(np.array([radius]), matrix, inclusions).matrix[0]
    return np.abs(stiffness[:, *INDEPENDENT] / exact[:, *INDEPENDENT] - 1).max()


def planar_stiffness(
    radius, order, *, size, matrix=MATRIX, inclusions=(INCLUSION,), centre=(0.0, 0.0)
):
    mesh = planar_mesh.planar_mesh(radius, size=size, centre=centre)
    return planar.PlanarCell(mesh, order).stiffness(matrix, inclusions)


@pytest.mark.parametrize("order", [1, 2, 3, 4])
def test_affine_field_is_reproduced_on_curved_elements(order):
    stiffness = planar_stiffness(0.6, order, size=0.5, inclusions=[MATRIX])
    np.testing.assert_allclose(stiffness[0], MATRIX.stiffness, rtol=1e-12, atol=1e-2)


@pytest.mark.parametrize("order", [2, 3, 4])
def test_curved_elements_enclose_the_disc(order):
    """Area of the particle by its nodes' polygon on the circle: every interface node has distance r
    from the centre.
    """
    mesh = planar_mesh.planar_mesh(0.7, size=0.4)
    points, cells = planar_mesh.curved_nodes(mesh, order)
    inside, outside = (set(cells[mesh.inside == flag].ravel()) for flag in (True, False))
    shared = sorted(inside & outside)
    np.testing.assert_allclose(np.linalg.norm(points[shared], axis=1), 0.7, atol=1e-12)
    assert len(shared) == order * sum(
        np.isin(t, shared).sum() == 2 for t in mesh.triangles[mesh.inside]
    )


@pytest.mark.parametrize(("order", "low", "high"), [(2, 3.0, 5.0), (3, 4.6, 7.5), (4, 6.0, 9.5)])
def test_rate_of_the_stiffness(order, low, high):
    """Energies converge twice as fast as strains: order 2p."""
    errors = [
        largest_error(planar_stiffness(0.5, order, size=h), 0.5, MATRIX, [Phase(80e9)])
        for h in (0.2, 0.1)
    ]
    assert low < np.log2(errors[0] / errors[1]) < high
    assert errors[1] > 1e-13


def test_full_stiffness_is_exact_for_other_poissons_ratios():
    inclusions = [Phase(300e9, 0.1), Phase(1e9, 0.45)]
    stiffness = planar_stiffness(0.8, 4, size=0.2, matrix=Phase(20e9, 0.2), inclusions=inclusions)
    assert largest_error(stiffness, 0.8, Phase(20e9, 0.2), inclusions) < 5e-6
    np.testing.assert_allclose(
        stiffness, np.swapaxes(stiffness, 1, 2), rtol=0, atol=1e-9 * stiffness.max()
    )


def test_stiffness_is_that_of_dolfinx():
    reference = pytest.importorskip("tests.rve.slices.by_dolfinx")
    for radius, order, matrix, inclusion, size in reference.cells():
        mesh = planar_mesh.planar_mesh(radius, size=size)
        found = planar.PlanarCell(mesh, order).stiffness(matrix, [inclusion])[0]
        exact = reference.ByDolfinx(mesh, order).stiffness(matrix, inclusion)
        assert found == pytest.approx(exact, rel=1e-10, abs=1e-10 * matrix.modulus)


def test_many_moduli_share_a_few_solutions():
    cell = planar.PlanarCell(planar_mesh.planar_mesh(0.7, size=0.4), 3)
    inclusions = [Phase(e) for e in np.geomspace(2e6, 2e14, 15)]
    shared = cell.stiffness(MATRIX, inclusions, share=True)
    assert cell.factorisations < 15
    alone = np.array([cell.stiffness(MATRIX, [phase])[0] for phase in inclusions])
    np.testing.assert_allclose(shared, alone, rtol=1e-10, atol=1e-10 * MATRIX.modulus)
    cell.factorisations = 0
    cell.stiffness(MATRIX, [Phase(e) for e in np.linspace(75e9, 85e9, 9)], share=True)
    assert cell.factorisations <= 4


@pytest.mark.slow
def test_series_and_finest_slices_agree_to_1e_7():
    rng = np.random.default_rng(20)
    for _ in range(20):
        radius, contrast = rng.uniform(0.1, 0.85), 10 ** rng.uniform(-2, 2)
        matrix, inclusion = (
            Phase(20e9, rng.uniform(0, 0.45)),
            Phase(20e9 * contrast, rng.uniform(0, 0.45)),
        )
        assert (
            largest_error(
                planar_stiffness(radius, 4, size=0.08, matrix=matrix, inclusions=[inclusion]),
                radius,
                matrix,
                [inclusion],
            )
            < 1e-7
        )


@pytest.mark.parametrize("centre", [(0.37, -0.21), (0.9, 0.85), (1.0, 1.0)])
def test_moving_the_particle_leaves_the_stiffness(centre):
    """Section 4.2: a particle that crosses the cell's sides is the same particle."""
    moved = planar_stiffness(0.55, 4, size=0.2, centre=centre)
    assert largest_error(moved, 0.55, MATRIX, [Phase(80e9)]) < 1e-6


def test_refuses_particles_that_nearly_touch():
    with pytest.raises(planar_mesh.TouchingError, match=r"planar meshes end at 0\.9995"):
        planar_mesh.planar_mesh(0.9996, size=0.3)


def test_refuses_a_particle_that_touches_a_side():
    with pytest.raises(ValueError, match="touches a side of the cell without crossing it"):
        planar_mesh.planar_mesh(0.5, size=0.3, centre=(0.5, 0.0))


@pytest.mark.parametrize(
    ("radius", "size", "message"),
    [(1.2, 0.2, "the radius is 1.2"), (0.5, 0.0, "the mesh size is 0")],
)
def test_refuses_mesh_arguments_out_of_range(radius, size, message):
    with pytest.raises(ValueError, match=message):
        planar_mesh.planar_mesh(radius, size=size)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"order": 5}, "must be 2, 3 or 4"),
        ({"mesh_size": 2}, "must lie in"),
        ({"points": 1}, "at least 2"),
    ],
)
def test_refuses_options_out_of_range(options, message):
    with pytest.raises(ValueError, match=message):
        SlicesModel(**options)


@pytest.mark.parametrize("poissons", [(0.3, 0.499999), (0.499999, 0.3), (0.499999, 0.499999)])
def test_order_4_cures_the_locking_of_order_2(poissons):
    matrix, inclusions = Phase(20e9, poissons[0]), [Phase(80e9, poissons[1])]
    errors = {
        order: largest_error(
            planar_stiffness(0.6, order, size=0.2, matrix=matrix, inclusions=inclusions),
            0.6,
            matrix,
            inclusions,
        )
        for order in (2, 4)
    }
    assert errors[4] < 2e-5
    # a nearly incompressible particle alone does not lock
    assert (errors[2] > 5e-3) == (poissons[0] > 0.49)


@pytest.mark.parametrize("radius", [0.001, 0.3, 0.85, 0.98])
@pytest.mark.parametrize("contrast", [1e-6, 1e6])
def test_error_of_a_slice_is_declared_at_the_edges(radius, contrast):
    inclusion = Phase(20e9 * contrast, 0.2)
    solved = solve_slice(radius, MATRIX, [inclusion], orders=(2, 3, 4), mesh_size=0.5)
    exact = square_stiffness(np.array([radius]), MATRIX, [inclusion])
    true = max(
        abs((solved.stiffness[0, 0, 0] + solved.stiffness[0, 0, 1]) / exact.bulk[0, 0] - 1),
        abs(solved.stiffness[0, 2, 2] / exact.shear[0, 0] - 1),
    )
    assert true < solved.error[0, [0, 2]].max() < 10 * true


@pytest.mark.parametrize(
    ("radius", "matrix", "inclusion"),
    [
        (0.00109, Phase(20e9, 0.4997), Phase(5.5e9, 0.2336)),
        (0.00418, Phase(20e9, 0.4998), Phase(0.25e9, 0.2836)),
        (0.005763695545, Phase(20e9, 0.12270752), Phase(331588660.6, 0.42187752)),
    ],
)
def test_coarse_meshes_hide_no_small_particle_from_every_order(radius, matrix, inclusion):
    exact = square_stiffness(np.array([radius]), matrix, [inclusion]).matrix[0]
    for order in (2, 3, 4):
        orders = (2, 3, 4)
        solved = solve_slice(radius, matrix, [inclusion], orders=orders, order=order, mesh_size=1.0)
        own, right = (with_ratio(square_moduli(one)) for one in (solved.stiffness, exact))
        true = abs(right / own - 1).ravel()[[0, 2]]
        assert (true <= solved.error[0, [0, 2]]).all()


@pytest.mark.parametrize(("order", "most"), [(2, 1.1), (3, 1.8)])
def test_an_order_below_4_is_judged_by_order_4(order, most):
    orders = (2, 3, 4)
    solved = solve_slice(0.6, MATRIX, [Phase(80e9)], orders=orders, order=order, mesh_size=0.4)
    exact = square_stiffness(np.array([0.6]), MATRIX, [Phase(80e9)]).matrix[0]
    own, right = (with_ratio(square_moduli(one)) for one in (solved.stiffness, exact))
    true = abs(right / own - 1)[0]
    assert (true <= solved.error[0]).all()
    assert (solved.error[0] <= most * true).all()


@pytest.mark.parametrize("seed", range(4))
def test_the_error_counts_what_cancels_about_a_stiff_particle(seed):
    """Contrasts from 1e7 to 1e10: two orders agree by chance, and both are off."""
    rng = np.random.default_rng(seed)
    radius, contrast, size = rng.uniform(0.1, 0.9), 10 ** rng.uniform(7, 10), rng.uniform(0.1, 0.3)
    given = Phase(20e9), [Phase(20e9 * contrast)]
    found = solve_slice(radius, *given, orders=(2, 3, 4), mesh_size=size)
    cell = square_stiffness(np.array([radius]), *given)
    exact = np.array([cell.bulk[0, 0], cell.deviator[0, 0], cell.shear[0, 0]])
    assert (abs(square_moduli(found.stiffness)[0] / exact - 1) <= found.error[0, :3]).all()


def test_the_error_counts_what_locking_hides_of_the_decay():
    """Order 2 locks, so its change to order 3 is large and tells of too fast a decay."""
    matrix, soft = Phase(20e9, 0.4993), Phase(28e6, 0.468)
    solved = solve_slice(0.844, matrix, [soft], orders=(2, 3, 4), mesh_size=0.6)
    exact = square_stiffness(np.array([0.844]), matrix, [soft])
    true = abs(square_moduli(solved.stiffness)[0, 2] / exact.shear[0, 0] - 1)
    assert true <= solved.error[0, 2] <= 5 * true


def test_model_declares_its_error():
    radius_map, inclusions = HermiteMap(0.1337, 0.1, 0.8663, 0.1692), [Phase(75e9), Phase(80e9)]
    progress = []
    results = SlicesModel(order=4, mesh_size=0.5, points=6, progress=progress.append).solve(
        radius_map, MATRIX, inclusions
    )
    exact = SeriesModel().solve(radius_map, MATRIX, inclusions)
    for result, truth in zip(results, exact, strict=True):
        true = abs(result.modulus / truth.modulus - 1)
        assert true < result.estimated_error < 30 * true
    assert progress[-1] == 1
    assert cross_check(results, exact, tolerance=1e-3) < 1e-3
    with pytest.raises(CrossCheckError, match=r"slices gives E = .* and series"):
        cross_check(results, exact, tolerance=1e-9)


def estimated_and_true(points, *, seed, decades):
    """Of the rule in θ, for random maps and materials; the estimate needs no more than the
    stresses, so the series stands in for slices.
    """
    rng, pairs = np.random.default_rng(seed), []
    while len(pairs) < 60:
        a1, a2, a3, a4 = rng.uniform([0.05, -0.5, 0.1, -0.5], [0.6, 1, 0.95, 1])
        try:
            radius_map = HermiteMap(a1, a2, a3, a4)
        except ValueError:
            continue
        matrix = Phase(20e9, rng.choice([rng.uniform(0, 0.45), 0.499]))
        inclusion = Phase(20e9 * 10 ** rng.uniform(-decades, decades), 0.2)
        rule = theta_rule(radius_map, points=points(rng))
        radii = np.unique(
            np.round(np.concatenate([radius_map(rule.nodes), radius_map.extremes()]), 12)
        )
        cells = square_stiffness(radii, matrix, [inclusion])
        moduli = square_moduli(cells.matrix[:, 0])
        estimate = theta_error(
            radius_map, rule, radii=radii, moduli=moduli, phases=(matrix, inclusion)
        )
        fine = theta_rule(radius_map, points=200)
        exact = square_moduli(square_stiffness(radius_map(fine.nodes), matrix, [inclusion]).matrix)
        own = moduli[np.searchsorted(radii, np.round(radius_map(rule.nodes), 12))]
        means = with_ratio(rule.weights @ own), with_ratio(fine.weights @ exact[:, 0])
        pairs.append((estimate, abs(means[0] / means[1] - 1)))
    return np.array(pairs).reshape(-1, 2, 4).swapaxes(0, 1).reshape(2, -1)


def test_estimate_of_the_rule_bounds_its_error():
    estimate, true = estimated_and_true(lambda rng: int(rng.integers(4, 10)), seed=7, decades=2)
    assert np.quantile(estimate / true, 0.05) > 1
    assert np.median(estimate / true) < 30


def test_estimate_of_the_rule_falls_with_its_error():
    """Many nodes must not make the estimate worse, whatever the contrast: maps bunch their radii at
    one end.
    """
    estimate, true = estimated_and_true(lambda _: 16, seed=8, decades=4)
    assert (estimate > true - 1e-11).all()
    assert np.quantile(estimate, 0.9) < 1e-6


@pytest.mark.parametrize("at", [-3.0, 3.0])
@pytest.mark.parametrize("slope", [0.0, 4e-4, 1.1e-3, 3e-3])
def test_radii_beyond_an_end_by_less_than_a_sample_are_within_the_extremes(at, slope):
    curve = HermiteMap(0.16, -slope, 0.7, 0.66) if at < 0 else HermiteMap(0.7, 0.66, 0.16, slope)
    low, high = extreme_radii(curve)
    near = curve(at * (1 - np.geomspace(1e-7, 1, 100_001)))
    assert low <= near.min() * (1 + 1e-10)
    assert high >= near.max() * (1 - 1e-10)


def test_models_by_name():
    assert named("slices", order=2) == SlicesModel(order=2)
    with pytest.raises(ValueError, match="known models are prism, slices, table, series, image"):
        named("slice")
    with pytest.raises(ValueError, match="has no option 'h'; its options are order"):
        named("slices", h=1)
