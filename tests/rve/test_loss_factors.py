"""Loss factors of the cell: shares of energy, against complex moduli and between models."""

import numpy as np
import pytest

from alphacut.rve import Phase, PrismModel, SeriesModel, SlicesModel, SpheresModel, loss_factors
from alphacut.stochastic import HermiteMap

RADIUS = HermiteMap(0.1337, 0.1, 0.8663, 0.1692)
MATRIX, PARTICLE = Phase(20e9, 0.3), Phase(80e9, 0.2)
LOSSES = np.array([[0.01, 0.02], [0.005, 0.003]])
MODELS = [SeriesModel(energies=True), SlicesModel(0.5, 6), PrismModel(0.5, 4, stiffness=True)]


def solved(model, matrix=MATRIX, particle=PARTICLE):
    return model.solve(RADIUS, matrix, [particle])[0].with_average("isotropic")


def test_the_shares_of_the_paper_s_cell_are_those_of_differences_of_its_modulus():
    result = SeriesModel(energies=True).solve(RADIUS, MATRIX, [Phase(80e9, 0.3)])[0]
    of_phases = [
        result.with_average(x)
        .energies.energy_fractions(result.with_average(x).constants_of)[0][..., 0]
        .sum(1)
        for x in ("axes", "isotropic")
    ]
    assert np.allclose(of_phases, [[0.90141, 0.09859], [0.87617, 0.12383]], atol=1e-5)


@pytest.mark.parametrize("model", MODELS, ids=lambda model: model.name)
def test_models_agree_within_their_errors_and_keep_the_modulus(model):
    exact, result = solved(MODELS[0]), solved(model)
    work = result.energies.values.sum(axis=(0, 1))
    assert np.allclose(work, result.moduli, rtol=1e-9, atol=0)
    truth, found = loss_factors(exact, LOSSES), loss_factors(result, LOSSES)
    for name, value in found.values.items():
        assert abs(value - truth.values[name]) <= found.errors[name] < 0.02 * value
    same = loss_factors(result, np.full((2, 2), 0.02)).values
    assert np.allclose([*same.values()], 0.02, rtol=1e-12, atol=0)
    if model.name == "series":
        without = type(model)(**{**vars(model), "energies": False})
        assert solved(without).modulus == result.modulus


def test_the_first_order_misses_complex_moduli_by_the_square_of_the_losses():
    result, losses = solved(MODELS[0]), np.array([[0.48, 0.44], [0.12, 0.16]])
    gaps = []
    for scale in (1, 0.5, 0.25):
        exact = loss_factors(result, losses * scale)  # above a tenth, by complex moduli
        linear = loss_factors(result, losses * scale / 100)  # to first order
        values = 100 * np.array([*linear.values.values()])
        gaps.append(abs(values / [*exact.values.values()] - 1))
    slopes = np.log2(np.array(gaps[:-1]) / gaps[1:])
    assert (abs(slopes - 2) < 0.1).all()
    assert (gaps[0] < np.ptp(losses) ** 2).all()


@pytest.mark.parametrize("contrast", [1e-9, 1e9])
def test_pores_and_rigid_particles_lose_nothing_whatever_their_loss(contrast):
    result = solved(MODELS[0], particle=Phase(20e9 * contrast, 0.2))
    loss = loss_factors(result, np.array([[0.02, 0.02], [0.09, 0.09]]))
    assert np.allclose([*loss.values.values()], 0.02, rtol=1e-6)


def test_errors_of_coarse_energies_cover_what_finer_ones_find(rng):
    """Of random cells; a tenth of the declared error would not."""
    covered = []
    for _ in range(12):
        first, width = rng.uniform(0.2, 0.5), rng.uniform(0.2, 0.4)
        radius = HermiteMap(first, 0.1, first + width, 0.1)
        particle = Phase(MATRIX.modulus * 10 ** rng.uniform(-2, 2), 0.2)
        coarse, fine = (
            SeriesModel(points=points, accuracy=accuracy, energies=True)
            .solve(radius, MATRIX, [particle])[0]
            .energies
            for points, accuracy in ((4, 1e-2), (40, 1e-12))
        )
        covered.append((abs(coarse.values - fine.values) / coarse.errors).max())
    assert 0.1 < max(covered) <= 1


def test_losses_of_spheres_are_those_of_differences_of_the_modulus():
    model, radius = SpheresModel(energies=True), HermiteMap(0.2, 0.1, 0.6, 0.1)

    def result_at(*factors):
        matrix, sphere = (
            Phase(phase.modulus * factor, phase.poisson)
            for phase, factor in zip((MATRIX, PARTICLE), factors, strict=True)
        )
        return model.solve(radius, matrix, [sphere])[0]

    result = result_at(1, 1)
    assert np.allclose(result.energies.values.sum(axis=(0, 1)), result.moduli, rtol=1e-6, atol=0)
    step, found = 1e-4, loss_factors(result, np.array([[0.02, 0.02], [0.005, 0.005]]))
    slope = np.log(result_at(1, 1 + step).modulus / result_at(1, 1 - step).modulus) / (2 * step)
    exact = 0.02 * (1 - slope) + 0.005 * slope
    assert abs(found.values["E"] - exact) < found.errors["E"] < 0.01 * exact


def test_few_spheres_lose_what_eshelby_s_lone_sphere_does():
    fraction = np.pi / 6 * 0.1**3
    result = SpheresModel(energies=True).solve(HermiteMap(0.1, 0, 0.1, 0), MATRIX, [PARTICLE])
    energies = result[0].energies.values[:, :, 0]
    (bulk, shear), sphere = MATRIX.bulk_and_shear, PARTICLE.bulk_and_shear[0]
    # K = K_m + c (K_i − K_m)(3 K_m + 4 G_m)/(3 K_i + 4 G_m) to first order in c
    slope = fraction * (3 * bulk + 4 * shear) ** 2 / (3 * sphere + 4 * shear) ** 2
    assert energies[1, 0] == pytest.approx(sphere * slope, rel=2e-3)
    assert energies[1, 1] == pytest.approx(0, abs=1e-6 * energies[1, 0])
