"""Every plan against brute force on the usual test functions; and on random problems, what each
bound claims to be.
"""

import numpy as np
import pytest

from alphacut.fuzzy import (
    Automatic,
    Chebyshev,
    Extended,
    General,
    Interval,
    Known,
    MonteCarlo,
    Optimisation,
    QuasiMonteCarlo,
    Reduced,
    Signed,
    Trapezoidal,
    Triangular,
    levels,
    propagate,
)
from alphacut.fuzzy.samples.nature import Nature


def ishigami(x1, x2, x3):
    return np.sin(x1) + 7 * np.sin(x2) ** 2 + 0.1 * x3**4 * np.sin(x1)


def rosenbrock(x, y):
    return (1 - x) ** 2 + 100 * (y - x * x) ** 2


def branin(x, y):
    return (
        (y - 5.1 / (4 * np.pi**2) * x**2 + 5 / np.pi * x - 6) ** 2
        + 10 * (1 - 1 / (8 * np.pi)) * np.cos(x)
        + 10
    )


def inside(x, y):
    """Both optima lie inside the support."""
    return np.exp(-((x - 0.4) ** 2) - (y - 0.3) ** 2) - np.exp(-((x + 0.5) ** 2) - (y + 0.6) ** 2)


PROBLEMS = {
    "ishigami": (ishigami, {name: Triangular(-np.pi, 0.5, np.pi) for name in ("x1", "x2", "x3")}),
    "rosenbrock": (rosenbrock, {"x": Triangular(-2, 0.5, 2), "y": Triangular(-1, 1, 3)}),
    "branin": (branin, {"x": Triangular(-5, 2, 10), "y": Triangular(0, 5, 15)}),
    "inside": (inside, {"x": Triangular(-2, 0.1, 2), "y": Triangular(-2, 0.0, 2)}),
}
EXACT = {
    "multistart": Optimisation(),
    "direct": Optimisation("direct", budget=400),
    "chebyshev": Chebyshev(),
    "surface": Chebyshev(confirm=False),
}
COARSE = {
    "general": General(),
    "reduced": Reduced(),
    "extended": Extended(),
    "signed": Signed(),
    "evolution": Optimisation("differential_evolution", budget=600),
    "annealing": Optimisation("dual_annealing", budget=100),
    "shgo": Optimisation("shgo", budget=50),
    "random": MonteCarlo(200),
    "even": QuasiMonteCarlo(256),
    "ends": QuasiMonteCarlo(256, density="chebyshev"),
}


def brute_force(function, domain_inputs, alpha, steps):
    """Bounds over a grid of every cut, and the bound of what the grid can miss by."""
    lower, upper = [], []
    for level in alpha:
        axes = [np.linspace(*number.cut(level), steps) for number in domain_inputs.values()]
        values = function(*np.meshgrid(*axes, indexing="ij", sparse=True))
        lower.append(values.min())
        upper.append(values.max())
    return np.array(lower), np.array(upper)


@pytest.fixture(scope="module")
def truth():
    return {
        name: brute_force(f, inputs, levels(4), 201 if len(inputs) == 3 else 1001)
        for name, (f, inputs) in PROBLEMS.items()
    }


@pytest.mark.parametrize("problem", PROBLEMS)
@pytest.mark.parametrize("plan", EXACT)
def test_searching_plans_find_the_brute_force_bounds(problem, plan, truth):
    function, inputs = PROBLEMS[problem]
    result = propagate(function, inputs, EXACT[plan], vectorised=True)
    lower, upper = truth[problem]
    span = upper[0] - lower[0]
    grid = 2e-4 * span  # what brute force itself can miss
    assert (np.abs(result.bounds()[0] - lower) <= grid + 1e-4 * span).all()
    assert (np.abs(result.bounds()[1] - upper) <= grid + 1e-4 * span).all()
    assert result.nature is (Nature.ESTIMATED if plan == "surface" else Nature.INNER)


@pytest.mark.parametrize("problem", PROBLEMS)
@pytest.mark.parametrize("plan", COARSE)
def test_coarse_plans_stay_inside_and_are_nested(problem, plan, truth):
    function, inputs = PROBLEMS[problem]
    result = propagate(function, inputs, COARSE[plan], vectorised=True)
    true_lower, true_upper = truth[problem]
    lower, upper = result.bounds()
    grid = 3e-3 * (true_upper[0] - true_lower[0])
    assert (lower >= true_lower - grid).all()
    assert (upper <= true_upper + grid).all()
    assert (np.diff(lower) >= 0).all()
    assert (np.diff(upper) <= 0).all()


@pytest.mark.parametrize("scale", [1e-13, 1e-6, 1e13])
@pytest.mark.parametrize(
    "plan", [Chebyshev(), Chebyshev(confirm=False), Optimisation(), Optimisation("shgo", budget=50)]
)
def test_the_unit_of_an_output_does_not_matter(plan, scale):
    function, inputs = PROBLEMS["inside"]
    one = propagate(function, inputs, plan, vectorised=True)
    other = propagate(lambda **x: scale * function(**x), inputs, plan, vectorised=True)
    np.testing.assert_allclose(np.array(other.bounds()) / scale, one.bounds(), rtol=1e-6)


def test_product_of_eight_factors_by_its_corners():
    inputs = {f"x{i}": Triangular(0.5, 1.0, 2.0) for i in range(8)}
    result = propagate(
        lambda **x: np.prod(list(x.values()), axis=0),
        inputs,
        Reduced(),
        vectorised=True,
        known=Known(monotone=tuple(inputs)),
    )
    cuts = np.array([inputs["x0"].cut(level) for level in levels(4)])
    np.testing.assert_allclose(result.bounds(), cuts.T**8, rtol=1e-12)
    assert result.runs == 4 * 256 + 1
    assert result.nature is Nature.GUARANTEED


def test_a_fall_back_that_explodes_is_refused():
    inputs = {f"x{i}": Triangular(-1.0, 0.0, 2.0) for i in range(8)}
    for plan in (Signed(), Extended()):
        with pytest.raises(
            ValueError,
            match=(
                r"the plan would take [\d,]+ samples since output y is not monotone in input"
                r" x0.*state the signs"
            ),
        ):
            propagate(lambda **x: sum(value**2 for value in x.values()), inputs, plan)


def random_problem(rng):
    """A smooth function of two or three inputs: a quadratic, a wave and a product; and the signs
    that hold of it on the support.
    """
    inputs = {}
    for name in ("a", "b", "c")[: rng.integers(2, 4)]:
        low, modal, high = np.sort(rng.uniform(-1, 1, 3))
        inputs[name] = Triangular(low, modal, high) if rng.random() < 0.8 else Interval(low, high)
    n = len(inputs)
    slope, matrix, wave, size = (
        rng.normal(0, 2, n),
        rng.normal(0, 1, (n, n)),
        rng.normal(0, 2, n),
        rng.normal(0, 0.5),
    )

    def function(*x):
        linear = sum(s * v for s, v in zip(slope, x, strict=True))
        square = sum(matrix[i, j] * x[i] * x[j] for i in range(n) for j in range(n)) / 2
        return linear + square + size * np.sin(sum(w * v for w, v in zip(wave, x, strict=True)))

    # |∂f/∂x_i| >= |slope_i| − Σ_j |(M + Mᵀ)_ij| / 2 − |size wave_i| on [−1, 1]^n
    room = np.abs(slope) - np.abs(matrix + matrix.T).sum(axis=1) / 2 - np.abs(size * wave)
    signs = {name: int(np.sign(s)) for name, s, r in zip(inputs, slope, room, strict=True) if r > 0}
    return function, inputs, signs


def check_claims(seed, plans):
    """No inner bound beyond the truth, no guaranteed bound short of it; and a guarantee wherever
    its condition holds.
    """
    rng = np.random.default_rng(seed)
    function, inputs, signs = random_problem(rng)
    alpha = (0.0, 0.5, 1.0)
    steps = 25 if len(inputs) == 3 else 101
    brute = brute_force(function, inputs, alpha, steps)
    span = max(brute[1][0] - brute[0][0], 1e-9)
    guaranteed = 0
    for plan in plans:
        result = propagate(
            lambda **x: function(*x.values()),
            inputs,
            plan,
            alpha=alpha,
            vectorised=True,
            known=Known(signs),
        )
        lower, upper = result.bounds()
        slack = 0.02 * span  # what brute force itself can miss
        if result.base is Nature.INNER:
            assert (lower >= brute[0] - slack).all(), (seed, plan)
            assert (upper <= brute[1] + slack).all(), (seed, plan)
            attained = [
                function(*place) for place in (*result.lower_at[:, 0], *result.upper_at[:, 0])
            ]
            np.testing.assert_allclose(attained, [*lower, *upper], rtol=1e-9, atol=1e-9 * span)
        else:
            assert (np.abs(lower - brute[0]) <= slack + result.error[:, 0]).all(), (seed, plan)
        proved = np.array([nature is Nature.GUARANTEED for nature in result.nature_of()])
        assert (lower[proved] <= brute[0][proved] + 1e-12).all(), (seed, plan)
        assert (upper[proved] >= brute[1][proved] - 1e-12).all(), (seed, plan)
        if len(signs) == len(inputs) and isinstance(plan, Signed | Reduced | General | Extended):
            assert proved.all(), (seed, plan)
        guaranteed += int(proved.all())
    return guaranteed


QUICK = ((General(), Signed()), (Reduced(), Extended(), QuasiMonteCarlo(16)))


def test_claims_hold_on_hundreds_of_random_problems():
    """Other ones every time; a failure tells its seed."""
    seeds = int(np.random.default_rng().integers(10**9)) + np.arange(300)
    assert sum(check_claims(int(seed), QUICK[k % 2]) for k, seed in enumerate(seeds)) > 20


def test_claims_of_the_searching_plans_hold_on_random_problems():
    for seed in range(1000, 1012):
        check_claims(
            seed,
            (Optimisation(), Chebyshev(tolerance=1e-3), Chebyshev(tolerance=1e-3, confirm=False)),
        )


@pytest.mark.slow
def test_claims_of_the_searching_plans_hold_on_a_thousand_random_problems():
    for seed in range(1000, 2000):
        check_claims(
            seed,
            (Optimisation(), Chebyshev(tolerance=1e-3), Chebyshev(tolerance=1e-3, confirm=False)),
        )


def test_error_of_the_surface_covers_what_it_misses(truth):
    function, inputs = PROBLEMS["ishigami"]
    rough = propagate(
        function, inputs, Chebyshev(tolerance=1e-9, budget=40, confirm=False), vectorised=True
    )
    assert "ended at its budget of 40 samples" in rough.notes[0]
    assert (np.abs(rough.bounds()[0] - truth["ishigami"][0]) <= rough.error[:, 0]).all()
    assert rough.error.max() > 0.01


def test_named_outputs_are_searched_and_the_others_get_what_is_there():
    def model(x):
        return {"f": (x - 0.3) ** 2, "g": -((x - 0.8) ** 2)}

    for plan in (Optimisation(outputs=("f",)), Chebyshev(outputs=("f",))):
        result = propagate(model, {"x": Triangular(0.0, 0.5, 1.0)}, plan)
        assert result.bounds("f")[0][0] == pytest.approx(0, abs=1e-9)
        assert result.outputs == ("f", "g")


@pytest.mark.parametrize("plan", [Automatic, Chebyshev, Optimisation])
def test_outputs_that_are_not_searched_have_no_error_and_a_note_says_so(plan):
    def model(a, b):
        return {"p": a**2 * np.sin(b) + b, "q": a * np.cos(3 * b)}

    inputs = {"a": Triangular(1, 2, 3), "b": Interval(0.5, 2.5)}
    found = propagate(model, inputs, plan(outputs=("p",)), alpha=[0, 1])
    assert np.isnan(found.error[:, 1]).all()
    assert "q was not searched: outputs = ('p',)" in found.notes
    assert "not searched" not in str(propagate(model, inputs, plan(), alpha=[0]))
    if plan is not Optimisation:
        assert np.isfinite(found.error[:, 0]).all()
    if plan is Chebyshev:
        rough = propagate(model, inputs, plan(outputs=("p",), confirm=False), alpha=[0])
        assert [rough.nature_of(name)[0] for name in "pq"] == ["estimated", "inner"]
        exact = propagate(model, {"a": 1, "b": 2}, plan(outputs=("p",)), alpha=[0])
        assert exact.error[0, 1] == 0


@pytest.mark.parametrize("plan", [Automatic(), Chebyshev(), Optimisation()])
def test_derivatives_that_are_not_named_are_not_searched(plan):
    known = Known(derivatives={"f": {"x": "slope"}})
    model = lambda x: {"f": np.sin(3 * x), "slope": 3 * np.cos(3 * x)}  # noqa: E731
    found = propagate(model, {"x": Interval(0, 2)}, plan, alpha=[0], known=known)
    assert np.isnan(found.error[0, 1])
    assert "slope was not searched: of derivatives only those named are" in found.notes


def test_samples_depend_on_the_seed_only():
    function, inputs = PROBLEMS["branin"]
    for plan in (MonteCarlo(50, seed=3), QuasiMonteCarlo(64, seed=3)):
        one, other = (propagate(function, inputs, plan, workers=workers) for workers in (1, 2))
        assert (one.points == other.points).all()
        assert (one.lower == other.lower).all()
    assert (propagate(function, inputs, QuasiMonteCarlo(64, seed=4)).points != one.points).any()


def test_chebyshev_density_finds_corners_sooner():
    inputs = {name: Interval(0.0, 1.0) for name in "abc"}
    missed = []
    for density in ("uniform", "chebyshev"):
        result = propagate(
            lambda a, b, c: np.exp(a + b + c),
            inputs,
            QuasiMonteCarlo(128, density=density),
            vectorised=True,
        )
        missed.append(np.exp(3.0) - result.upper[0, 0])
    assert 0 <= missed[1] < missed[0] / 3


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: MonteCarlo(0), "samples per level is 0"),
        (
            lambda: QuasiMonteCarlo(8, density="normal"),
            "density is 'normal'; it must be 'uniform' or 'chebyshev'",
        ),
        (
            lambda: Optimisation("newton"),
            "optimiser is 'newton'; it must be one of multistart, differential_evolution",
        ),
        (lambda: Optimisation(starts=0), "starts, look and budget are 0, 8, 2000"),
        (lambda: Chebyshev(tolerance=0), "tolerance and budget are 0 and 1000"),
    ],
)
def test_wrong_plans_are_refused(make, message):
    with pytest.raises(ValueError, match=message):
        make()


def test_a_campaign_beyond_memory_is_refused_before_it_starts():
    inputs = {f"x{i}": Triangular(0, 1, 2) for i in range(20)}
    message = (
        r"samples of 20 inputs and outputs need [\d.e+]+ GB of memory and [\d.]+ GB are free; take"
        r" fewer levels"
    )
    with pytest.raises(ValueError, match=message):
        propagate(lambda **x: 0.0, inputs, General())


def test_a_result_prints_a_line_for_each_level_and_what_they_are_worth():
    found = propagate(lambda a: 2 * a, {"a": Triangular(1, 2, 4)}, General(), alpha=[0.0, 0.5, 1.0])
    assert str(found).splitlines() == [
        f"inner bounds by the plan general, {found.runs} runs; their error is not estimated",
        "y, α = 0: 2 … 8",
        "y, α = 0.5: 3 … 6",
        "y, α = 1: 4 … 4",
        "opinions: a",
    ]


def test_the_error_of_a_surface_that_kinks_ended_at_its_budget_covers():
    def kinked(a, b, c, d, e):
        return abs(a - 0.31) * b + np.maximum(c - 0.62, d) * (1 + e) + abs(a + b - 1.43)

    inputs = {
        "a": Interval(-0.15, 0.6),
        "b": Interval(0.8, 1.3),
        "c": Interval(0.25, 0.85),
        "d": Interval(-0.1, 0.25),
        "e": Interval(-0.4, 0.35),
    }
    wide = {
        "a": Triangular(-0.5, 0.2, 1.0),
        "b": Interval(0.8, 1.3),
        "c": Trapezoidal(0.0, 0.5, 0.7, 1.0),
        "d": Triangular(-0.3, 0.1, 0.4),
        "e": Triangular(-1.0, 0.2, 0.5),
    }
    found = propagate(kinked, wide, Chebyshev(), alpha=[0, 0.5, 1], vectorised=True)
    assert "ended at its budget" in found.notes[0]
    proved = propagate(kinked, inputs, Optimisation(starts=16), vectorised=True, alpha=[0])
    missed = found.bounds()[0][1] - proved.bounds()[0][0]
    assert missed <= found.error[1, 0]
    assert missed > 2 / 3 * found.error[1, 0]
