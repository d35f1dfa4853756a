import numpy as np
import pytest

from alphacut.rve import Phase
from alphacut.rve.auto.model import AutoModel, ChoiceError
from alphacut.rve.series.model import SeriesModel
from alphacut.rve.slices.model import SlicesModel
from alphacut.stochastic import HermiteMap, TruncatedNormal

MATRIX = Phase(20e9)
PAPER = HermiteMap(0.1337, 0.1, 0.8663, 0.1692)


def random_cases(count, seed, *, decades=2, greatest=0.97):
    rng = np.random.default_rng(seed)
    while count:
        a1, a2, a3, a4 = rng.uniform([0.05, -0.5, 0.1, -0.5], [0.6, 1, greatest, 1])
        matrix, inclusion = (
            Phase(20e9, rng.uniform(0, 0.45)),
            Phase(20e9 * 10 ** rng.uniform(-decades, decades), rng.uniform(0, 0.45)),
        )
        try:
            radius_map = HermiteMap(a1, a2, a3, a4)
        except ValueError:
            continue
        if radius_map.extremes()[1] < greatest:
            count -= 1
            yield radius_map, matrix, inclusion


def true_and_declared(model, cases):
    """Pairs of true and estimated relative error of E."""
    pairs = []
    for radius_map, matrix, inclusion in cases:
        result = model.solve(radius_map, matrix, [inclusion])[0]
        exact = SeriesModel().solve(radius_map, matrix, [inclusion])[0]
        pairs.append((abs(result.modulus / exact.modulus - 1), result.estimated_error))
    return np.array(pairs)


@pytest.mark.parametrize("tolerance", [1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7])
def test_promise_holds_on_random_cases(tolerance):
    true, declared = true_and_declared(
        AutoModel(tolerance), random_cases(30, seed=int(-np.log10(tolerance)))
    ).T
    assert true.max() < tolerance
    assert declared.max() <= tolerance
    assert np.median(declared / np.maximum(true, 1e-15)) < 30


@pytest.mark.parametrize("tolerance", [1e-2, 1e-4, 1e-7])
def test_declared_error_covers_the_true_one_at_any_contrast_up_to_near_touch(tolerance):
    true, declared = true_and_declared(
        AutoModel(tolerance), random_cases(40, seed=3, decades=6, greatest=0.995)
    ).T
    assert (declared >= true).all()
    assert np.median(declared / true) < 5


@pytest.mark.parametrize(
    ("tolerance", "count"), [(1e-2, 3), (1e-5, 3), pytest.param(1e-5, 30, marks=pytest.mark.slow)]
)
def test_promise_holds_without_series(tolerance, count):
    model = AutoModel(tolerance, exclude=("series",))
    true, declared = true_and_declared(model, random_cases(count, seed=11)).T
    assert true.max() < tolerance
    assert declared.max() <= tolerance
    assert np.median(declared / true) < 30


def test_promise_holds_by_slices_alone():
    model = AutoModel(1e-4, exclude=("series", "table"))
    true, declared = true_and_declared(model, random_cases(2, seed=5)).T
    assert true.max() < declared.max() < 1e-4


def test_several_moduli_and_poissons_ratios_at_once():
    inclusions = [Phase(75e9), Phase(80e9, 0.2), Phase(85e9)]
    for exclude in ((), ("series",)):
        results = AutoModel(1e-4, exclude=exclude).solve(PAPER, MATRIX, inclusions)
        for result, exact in zip(
            results, SeriesModel().solve(PAPER, MATRIX, inclusions), strict=True
        ):
            assert abs(result.modulus / exact.modulus - 1) < 1e-4


def test_reason_names_model_tolerance_and_what_was_excluded():
    result = AutoModel(1e-3, exclude=("series",)).solve(PAPER, MATRIX, [Phase(80e9)])[0]
    assert result.method == "table"
    assert result.reason.startswith(
        "table reaches a relative error of 0.001 in E, stresses and stiffness (series excluded):"
        " planar cells over r and E_i once"
    )
    assert set(result.error) == {"space", "theta", "table"}
    assert AutoModel(1e-3).solve(PAPER, MATRIX, [Phase(80e9)])[0].method == "series"


def test_no_inclusions_are_refused():
    with pytest.raises(ValueError, match=r"list \(empty\); it takes the radius map"):
        AutoModel(1e-3).solve(PAPER, MATRIX, [])


class Touching:
    """Particles that all but touch at every θ."""

    distribution = TruncatedNormal()

    def __call__(self, theta):
        return np.full(np.shape(theta), 0.99999)


def test_refuses_with_the_reason_of_every_model():
    with pytest.raises(
        ChoiceError, match=r"series refused: the series at r = 0.99999 .* table excluded"
    ):
        AutoModel(1e-6, exclude=("table", "slices", "prism")).solve(
            Touching(), MATRIX, [Phase(20.0)]
        )


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"tolerance": 0.5}, "must lie in"),
        ({"exclude": ("seris",)}, "exclude 'seris'; known models are series, table, slices, prism"),
        ({"exclude": ("series", "table", "slices", "prism")}, "exclude every model"),
    ],
)
def test_options_out_of_range(options, message):
    with pytest.raises(ValueError, match=message):
        AutoModel(**options)


@pytest.mark.parametrize("exclude", [(), ("series",)])
def test_a_result_is_the_same_bits_in_any_company(exclude):
    model = AutoModel(1e-5, exclude=exclude, moduli=(75e9, 85e9))
    inclusions = [Phase(e) for e in (75e9, 78.3e9, 80e9, 85e9)]
    together = model.solve(PAPER, MATRIX, inclusions)
    assert [r.modulus for r in together] == [
        model.solve(PAPER, MATRIX, [phase])[0].modulus for phase in inclusions
    ]


def test_slices_are_the_same_bits_in_any_company():
    model = SlicesModel(order=2, mesh_size=0.5, points=3)
    inclusions = [Phase(e) for e in (75e9, 78.3e9, 80e9, 85e9)]
    together = model.solve(PAPER, MATRIX, inclusions)
    assert [r.modulus for r in together] == [
        model.solve(PAPER, MATRIX, [phase])[0].modulus for phase in inclusions
    ]
