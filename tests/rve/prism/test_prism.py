"""The product-space model against exact values, itself refined, and other solvers."""

from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("dolfinx")

from alphacut.rve.cell import STRAIN, Phase
from alphacut.rve.prism import error_estimate
from alphacut.rve.prism.model import PrismModel, error_of_layers
from alphacut.rve.prism.system import PrismSystem
from alphacut.rve.table.cache import stored_table
from alphacut.stochastic import HermiteMap

PAPER = HermiteMap(0.1337, 0.1, 0.8663, 0.1692)
MATRIX, PARTICLE = Phase(20e9), Phase(80e9)
# GPa
EXACT = {
    0.2: (0.396401666057, 0.158812312491),
    0.5: (0.467852842132, 0.186140947852),
    0.8: (0.667472541097, 0.255628130639),
}


def solve(radius_map=PAPER, particle=PARTICLE, **options):
    return PrismModel(**options).solve(radius_map, MATRIX, [particle])[0]


def crisp_errors(radius, size):
    mean = solve(HermiteMap(radius, 0, radius, 0), mesh_size=size, layers=1).curve.mean
    return np.array(mean) / np.array(EXACT[radius]) / 1e9 - 1


@pytest.mark.parametrize("radius", EXACT)
def test_crisp_radius_meets_the_exact_stress(radius):
    errors = crisp_errors(radius, 0.15)
    assert (errors > 0).all()  # a Galerkin stiffness is too stiff
    assert (errors < 2e-4).all()


@pytest.mark.parametrize("radius", EXACT)
def test_shear_stress_converges_with_order_three_to_four_and_a_half(radius):
    coarse, fine = crisp_errors(radius, 0.08)[1], crisp_errors(radius, 0.04)[1]
    assert 3.0 < np.log2(coarse / fine) < 4.5


def test_homogeneous_cell_returns_its_material_for_any_map():
    for radius_map in (PAPER, HermiteMap(0.3, 0.0, 0.9, 2.0)):
        result = solve(radius_map, MATRIX, mesh_size=0.3, layers=3)
        assert result.modulus == pytest.approx(20e9, rel=1e-10)
        assert result.poisson == pytest.approx(0.3, rel=1e-10)
        assert np.ptp(result.curve.s11) < 1e-10 * result.curve.s11[0]
        assert result.iterations == (0, 0)


def test_one_set_up_serves_many_inclusions():
    particles = [Phase(e) for e in (75e9, 80e9, 85e9, 20e9 * 40)]
    together = PrismModel(mesh_size=0.3, layers=4).solve(PAPER, MATRIX, particles)
    alone = [solve(particle=p, mesh_size=0.3, layers=4) for p in particles]
    # bit for bit: a resumed campaign must not differ
    assert [r.modulus for r in together] == [r.modulus for r in alone]


def test_inclusions_of_near_moduli_share_a_preconditioner(monkeypatch):
    made, own = [], PrismSystem.preconditioner

    def counted(*given):
        made.append(given)
        return own(*given)

    monkeypatch.setattr(PrismSystem, "preconditioner", counted)
    moduli = (79e9, 80e9, 81e9, 20e9)
    PrismModel(0.5, 2).solve(PAPER, MATRIX, [Phase(modulus) for modulus in moduli])
    assert len(made) == 2


@pytest.mark.parametrize(("poisson", "times"), [(0.3, 0), (0.49, 2)])
def test_matrices_of_single_moduli_are_made_once_where_they_are_wanted(poisson, times, monkeypatch):
    made, own = [], PrismSystem.stiffness

    def counted(*given):
        made.append(given)
        return own(*given)

    monkeypatch.setattr(PrismSystem, "stiffness", counted)
    particles = [Phase(modulus, poisson) for modulus in (40e9, 80e9)]
    PrismModel(0.5, 2).solve(PAPER, Phase(20e9, poisson), particles)
    assert len(made) == times


def test_a_result_does_not_depend_on_what_was_solved_before():
    first = solve(mesh_size=0.3, layers=4)
    solve(HermiteMap(0.4, 0, 0.6, 0), mesh_size=0.3, layers=4)
    assert solve(mesh_size=0.3, layers=4).curve.s11.tobytes() == first.curve.s11.tobytes()


@pytest.mark.parametrize("solver", ["mumps", "gamg"])
def test_every_solver_gives_the_same_modulus(solver):
    assert solve(mesh_size=0.3, layers=4, solver=solver).modulus == pytest.approx(
        solve(mesh_size=0.3, layers=4).modulus, rel=1e-9
    )


def test_iterations_depend_on_neither_mesh_nor_contrast_and_fall_with_layers():
    count = max(solve(mesh_size=0.2).iterations)
    assert count <= 12
    assert max(solve(mesh_size=0.1).iterations) <= count + 1
    for contrast in (1e-4, 1e4):
        assert max(solve(particle=Phase(20e9 * contrast), mesh_size=0.2).iterations) <= 1.5 * count
    assert max(solve(mesh_size=0.2, layers=36).iterations) < count


def test_ignoring_the_interface_is_first_order_and_too_stiff():
    exact = solve(mesh_size=0.08).modulus
    errors = [solve(mesh_size=h, interface="sign").modulus / exact - 1 for h in (0.2, 0.1)]
    assert 0 < errors[1] < errors[0]
    assert 0.5 < np.log2(errors[0] / errors[1]) < 1.6


@pytest.mark.parametrize(
    ("options", "matrix", "particle", "what"),
    [
        (
            {"interface": "sign"},
            MATRIX,
            Phase(20e15),
            "cg with python stopped after 2000 iterations",
        ),
        ({}, Phase(1.0, 0.0), Phase(1e4, 0.4999), "mean stress times mean strain"),
    ],
)
def test_where_the_default_solver_fails_a_direct_one_takes_over_and_the_result_says_so(
    options, matrix, particle, what
):
    options = {"mesh_size": 0.4, "layers": 3, **options}
    result = PrismModel(**options).solve(PAPER, matrix, [particle])[0]
    direct = PrismModel(solver="mumps", **options).solve(PAPER, matrix, [particle])[0]
    assert result.curve.s11.tobytes() == direct.curve.s11.tobytes()
    assert result.solver == "mumps"
    assert f"solved by mumps, since by the default solver {what}" in result.reason
    assert direct.reason == ""


@pytest.mark.parametrize("contrast", [1e-3, 1e3])
def test_a_mesh_that_ignores_the_interface_needs_few_iterations_too(contrast):
    assert (
        max(
            solve(
                particle=Phase(20e9 * contrast), interface="sign", mesh_size=0.25, layers=6
            ).iterations
        )
        < 350
    )


def test_a_solver_that_stops_early_is_an_error():
    with pytest.raises(
        RuntimeError, match="stopped after 2 iterations without reaching its tolerance"
    ):
        solve(mesh_size=0.3, layers=4, petsc={"ksp_max_it": "2"})


def test_a_wrong_petsc_option_is_named():
    with pytest.raises(
        ValueError, match=r"PETSc refuses the options -rve_ksp_type nonsense: .*nonsense"
    ):
        solve(mesh_size=0.3, layers=4, petsc={"ksp_type": "nonsense"})


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"mesh_size": 0.0}, r"the mesh size is 0; it must lie in \(0, 1\]"),
        ({"layers": 0}, "the number of layers is 0; at least 1"),
        ({"interface": "soft"}, "the interface is 'soft'; known are conforming, sign"),
        ({"solver": "magic"}, "the solver is 'magic'; known are theta"),
    ],
)
def test_an_option_out_of_range_is_refused(options, message):
    with pytest.raises(ValueError, match=message):
        PrismModel(**options)


def test_a_misspelt_petsc_option_is_not_passed_over():
    with pytest.raises(
        ValueError, match="PETSc has no use for -rve_ksp_tipe cg: check its spelling"
    ):
        solve(mesh_size=0.3, layers=4, petsc={"ksp_tipe": "cg"})


@pytest.mark.parametrize(
    "options",
    [
        {"mesh_size": 1.0, "layers": 4},
        {"mesh_size": 0.4},
        {"layers": 1},
        {"layers": 2},
        {"mesh_size": 0.2, "layers": 5},
    ],
)
@pytest.mark.parametrize(
    ("radius_map", "particle"),
    [
        (PAPER, PARTICLE),
        (PAPER, Phase(20e13)),
        (PAPER, Phase(2e6)),
        (HermiteMap(0.5, 2.0, 0.5, 2.0), PARTICLE),
        (HermiteMap(0.02, 0, 0.02, 0), PARTICLE),
    ],
)
def test_the_declared_error_covers_the_true_one(options, radius_map, particle):
    from alphacut.rve.series.model import SeriesModel

    exact = SeriesModel().solve(radius_map, MATRIX, [particle])[0].modulus
    result = solve(radius_map, particle, estimate=True, **options)
    assert set(result.error) == {"space", "theta"}
    assert abs(result.modulus / exact - 1) <= result.estimated_error


def test_a_mesh_follows_a_particle_from_a_speck_to_nearly_touching():
    coarse, fine = (solve(HermiteMap(0.01, 0, 0.98, 0), mesh_size=h).modulus for h in (0.15, 0.08))
    assert 0 < coarse / fine - 1 < 2e-4


def test_the_declared_error_covers_particles_that_the_mesh_cannot_see():
    """A hole of a thousandth in a matrix of ν near −1 counts a hundred times its area."""
    from alphacut.rve.series.model import SeriesModel

    speck, matrix, hole = HermiteMap(1e-3, 0, 3e-3, 0), Phase(20e9, -0.9), Phase(20e3, 0.45)
    exact = SeriesModel().solve(speck, matrix, [hole])[0].modulus
    result = PrismModel(mesh_size=0.25, layers=6, estimate=True).solve(speck, matrix, [hole])[0]
    assert abs(result.modulus / exact - 1) <= result.estimated_error


@pytest.fixture
def references(monkeypatch):
    """Accuracies of the tables that errors are measured against; finer ones than `least` fail."""
    asked, least = [], [0.0]

    def table(*arguments, accuracy, **options):
        asked.append(accuracy)
        if accuracy < least[0]:
            raise RuntimeError("none so fine")
        return stored_table(*arguments, accuracy=accuracy, **options)

    monkeypatch.setattr(error_estimate, "stored_table", table)
    return asked, least


@pytest.mark.parametrize(
    ("size", "layers", "modulus"),
    [
        (0.4, 6, 80e9),
        (0.25, 12, 80e9),
        (0.25, 2, 80e9),
        (0.12, 9, 80e9),
        (0.1, 16, 80e9),
        (0.25, 6, 1e6),
    ],
)
def test_one_reference_does_where_coarser_means_foretell_its_accuracy(
    references, size, layers, modulus
):
    result = solve(PAPER, Phase(modulus), mesh_size=size, layers=layers, estimate=True)
    told = max(np.nanmax(result.errors[name]) for name in ("space", "theta"))
    assert len(references[0]) == 1
    assert 0.01 * told < references[0][0] < told


@pytest.mark.parametrize("size", [0.15, 0.5])
def test_a_reference_gets_more_accurate_until_its_own_error_hardly_counts(references, size):
    result, still = solve(mesh_size=size, layers=12), np.zeros(4)
    told, sharp = (
        error_estimate.judged(
            result, PAPER, (MATRIX, PARTICLE), layers=still, expected=expected
        ).errors["space"]
        for expected in (1.0, 1e-9)
    )
    assert references[0][0] == 1e-3
    assert references[0][-1] == 1e-7
    assert (told[[0, 2]] < 1.5 * sharp[[0, 2]]).all()
    assert told[2] < 1.2 * sharp[2]


@pytest.mark.parametrize(("small", "large"), [(1e-6, 1e-4), (1e-4, 1e-2), (4.5e-5, 4.5e-5)])
def test_a_reference_hardly_counts_beside_errors_large_and_small(small, large):
    """Moduli of a made-up cell, off by `small` in the one and `large` in the other."""
    curve, off = solve(mesh_size=0.5, layers=2).curve, np.array([small, np.nan, large])
    moduli = error_estimate.moduli_of(curve).mean(axis=0)
    flat = replace(
        curve,
        s11=np.full_like(curve.s11, moduli[0] * (1 + off[0]) * STRAIN),
        s12=np.full_like(curve.s12, moduli[2] * (1 + off[2]) * 2 * STRAIN),
    )

    def source(accuracy):
        exact = np.where(np.isnan(moduli), 1.0, moduli)
        return lambda r: np.tile(exact, (r.size, 1)), lambda r: np.full((r.size, 4), accuracy)

    declared, _ = error_estimate._distances(flat, PAPER, source, 1.0)
    assert (declared[[0, 2]] > off[[0, 2]] * (1 - 1e-6)).all()
    assert declared[0] < 1.6 * off[0]
    assert declared[2] < 1.3 * off[2]


def test_a_reference_that_fails_gives_way_to_one_less_accurate(references):
    sharp = solve(mesh_size=0.25, layers=12, estimate=True).estimated_error
    asked, least = references
    asked.clear()
    least[0] = 2e-4
    told = solve(mesh_size=0.25, layers=12, estimate=True).estimated_error
    assert asked[-1] >= 2e-4 > min(asked)
    assert sharp < told < 2 * sharp + 5e-4
    least[0] = 1.0  # bounds take its place
    assert solve(mesh_size=0.25, layers=12, estimate=True).estimated_error > 1e-2


def test_a_mesh_that_folds_over_is_refused_with_its_cure():
    bent = HermiteMap(0.235, 0.0138, 0.1165, 0.932)  # down to 0.004 and up again at the end
    with pytest.raises(
        RuntimeError,
        match=(
            "the mesh folds over where it follows the radius through 2 layers in θ: take more"
            " layers"
        ),
    ):
        solve(bent, mesh_size=0.4, layers=2)
    assert solve(bent, mesh_size=0.4, layers=8).modulus > 20e9


@pytest.mark.parametrize("layers", [2, 4, 6])
@pytest.mark.parametrize("modulus", [80e9, 400e9])
def test_errors_of_layers_are_about_what_eight_times_as_many_take_away(layers, modulus):
    radii, matrix, particle = PAPER, Phase(20e9), [Phase(modulus)]
    ((coarse, thick),) = PrismModel(0.25, layers).coarser(radii, matrix, particle)
    told = error_of_layers(coarse, thick)
    few, many = (
        PrismModel(0.25, n).solve(radii, matrix, particle)[0].curve for n in (layers, 8 * layers)
    )
    for own, name in ((told[0], "s11"), (told[2], "s12")):
        means = [one.weights @ getattr(one, name) for one in (few, many)]
        true = abs(means[0] / means[1] - 1)
        assert true < own < 5 * true
