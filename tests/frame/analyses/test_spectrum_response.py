"""The response-spectrum method: modes and combinations by hand, and its range over inputs."""

import numpy as np
import pytest
import scipy.linalg

from alphacut.frame import (
    MatrixStructure,
    StoreyFrame,
    TargetSpectrum,
    asce7_two_period,
    eurocode8_spectrum,
    spectrum_response,
)
from alphacut.frame.modes.spectral_modes import spectral_modes
from alphacut.frame.spectra.displacement_chord import displacement_chord, max_acceleration
from alphacut.frame.spectra.modal_combination import (
    Combination,
    correlation,
    correlation_range,
    decorrelation_fit,
)
from alphacut.frame.structures.linear import evaluate
from alphacut.fuzzy import Interval
from tests.refused import refuses

SPECTRUM = eurocode8_spectrum(2.0, "B")


def by_hand(frame, spectrum, combination, ratios):
    """Combined peaks of drift1, q of the top and the base shear, mode by mode."""
    k = np.append(frame.stiffness, 0.0)
    K = np.diag(k[:-1] + k[1:]) - np.diag(k[1:-1], 1) - np.diag(k[1:-1], -1)
    squares, shapes = scipy.linalg.eigh(K, np.diag(frame.masses))
    total = np.zeros(3)
    peaks = []
    for square, shape in zip(squares, shapes.T, strict=True):
        displacement = shape * (shape @ frame.masses) * spectrum(2 * np.pi / square**0.5) / square
        peaks.append(displacement[[0, -1, 0]] * [1, 1, k[0]])
    for i, a in enumerate(squares**0.5):
        for j, b in enumerate(squares**0.5):
            rho = float(i == j)
            if combination == "CQC":  # Chopra, 13.7.10
                x, y, beta = ratios[i], ratios[j], a / b
                rho = 8 * (x * y) ** 0.5 * (beta * x + y) * beta**1.5
                rho /= (
                    (1 - beta**2) ** 2
                    + 4 * x * y * beta * (1 + beta**2)
                    + 4 * (x**2 + y**2) * beta**2
                )
            total += rho * peaks[i] * peaks[j]
    return total**0.5


@pytest.mark.parametrize(
    ("combination", "own_ratios"), [("SRSS", False), ("CQC", False), ("CQC", True)]
)
def test_combined_peaks_are_those_by_hand(combination, own_ratios, rng):
    ratios = rng.uniform(0.02, 0.2, 4)
    frame = StoreyFrame(
        masses=rng.uniform(2e4, 8e4, 4),
        stiffness=rng.uniform(2e7, 8e7, 4),
        damping_ratio=ratios,
        outputs=("drift1", "q4", "base_shear"),
    )
    inputs = {"k1": frame.stiffness[0]}
    found = spectrum_response(
        frame, inputs, SPECTRUM, combination=combination, own_ratios=own_ratios, alpha=[0]
    )
    used = ratios if own_ratios else np.full(4, 0.05)
    assert found.nominal == pytest.approx(by_hand(frame, SPECTRUM, combination, used), rel=1e-9)
    assert found.modes.mass_fractions.sum() == pytest.approx(1.0)
    assert found.modes.ratios[0] == pytest.approx(ratios)
    sums = found.modes.mass_fractions[0].cumsum()
    assert sums[found.sufficient_modes - 1] >= 0.9 - 1e-9
    assert not (sums[: found.sufficient_modes - 1] >= 0.9).any()


def test_modes_of_one_frequency_add_up_by_cqc_and_not_by_srss():
    twins = MatrixStructure(
        {"k": 4e6},
        mass=[(1.0, np.diag([1e4, 3e4]))],
        stiffness=[("k", np.diag([1.0, 3.0]))],
        observed={"sum": np.ones(2), "difference": np.array([1.0, -1.0])},
        ratios=[0.05],
    )
    rules = ("CQC", "SRSS")
    sum_, difference = np.transpose(
        [spectrum_response(twins, {"k": 4e6}, SPECTRUM, combination=x).nominal for x in rules]
    )
    omega = 20.0
    each = float(SPECTRUM(2 * np.pi / omega)) / omega**2
    assert sum_ == pytest.approx([2 * each, each * 2**0.5])
    assert difference == pytest.approx([0.0, each * 2**0.5], abs=1e-7 * each)


def test_the_range_of_one_storey_is_that_of_the_spectrum_between_its_corners():
    frame = StoreyFrame(masses=[1e4], stiffness=[4e6], outputs=("base_shear",))
    site = TargetSpectrum([0.1, 0.3, 0.5], [2.0, 4.0, 1.0])
    found = spectrum_response(frame, {"k1": Interval(3e6, 6e6)}, site, alpha=[0.0])
    low, high = found.attained[0, 0]
    # The periods .257 … .363 s contain the corner, at which the spectrum is largest.
    assert low == pytest.approx(1e4 * float(site(2 * np.pi * (1e4 / 3e6) ** 0.5)))
    assert 0.99 * 4e4 <= high <= 4e4
    assert found.mode_table().rows[0][:2] == ("1", "296.2 ms")


@pytest.mark.parametrize(
    ("change", "more", "key"),
    [
        ({"outputs": ("v1",)}, {}, "output"),
        ({"outputs": ("a1",)}, {}, "output"),
        ({"yield_force": [1e5]}, {}, "structure"),
        ({}, {"combination": "ABS"}, "combination"),
        ({}, {"modes": 0}, "modes"),
        ({}, {"own_ratios": True}, "damping ratio"),
        ({"stiffness": [1e3]}, {}, "period"),
    ],
)
def test_what_the_method_does_not_cover_is_refused(change, more, key):
    frame = StoreyFrame(**({"masses": [1e4], "stiffness": [4e6]} | change))
    with refuses(key):
        spectrum_response(frame, {"k1": frame.stiffness[0]}, SPECTRUM, **more)


def random_structure(rng, number):
    """A structure, the names of its inputs, and a spectrum."""
    floors = 1 + number % 4
    rules = [SPECTRUM, asce7_two_period(9.0, 4.0, 6.0), eurocode8_spectrum(2.0, "C", q=3.0)]
    names = [f"k{floors}", "m1", "rayleigh_mass"][: 1 + number % 3]
    period = rng.uniform(0.2, 1.2)
    masses = rng.uniform(3e4, 6e4, floors)
    stiffness = rng.uniform(0.8, 1.2, floors) * 4e4 * (2 * np.pi / period) ** 2 * floors**2 / 2
    if number % 2:
        outputs = ("drift1", f"q{floors}", "base_shear", "overturning_moment")
        frame = StoreyFrame(
            masses,
            stiffness=stiffness,
            lengths=[3.0] * floors,
            rayleigh=(0.3, 1e-4),
            outputs=outputs,
            # Dashpots do not count where no damping ratio of a mode does.
            dampers=[1e5 * (number % 4 > 1)] * floors,
            damper_placement="storey",
        )
        return frame, names, rules[number % 3]
    # The same chain on a spring without a mass, and a member force.
    k = {f"k{z + 1}": x for z, x in enumerate(stiffness)}
    rows = np.eye(floors + 1)[1:] - np.eye(floors + 1)[:-1]
    chain = [(f"k{z + 1}", np.outer(row, row)) for z, row in enumerate(rows)]
    chain.append((1.3 * stiffness[0], np.outer(np.eye(floors + 1)[0], np.eye(floors + 1)[0])))
    mass = [("m1", np.diag(np.eye(floors + 1)[1]))]
    mass += [(m, np.diag(np.eye(floors + 1)[z])) for z, m in enumerate(masses[1:], 2)]
    structure = MatrixStructure(
        k | {"m1": masses[0]},
        mass=mass,
        stiffness=chain,
        observed={"top": np.eye(floors + 1)[-1], "force": rows[-1]},
        row_factors={"force": f"k{floors}"},
        ratios=[0.03],
    )
    return structure, [x for x in names if x != "rayleigh_mass"], rules[number % 3]


@pytest.mark.parametrize("number", range(20))
def test_no_sample_of_a_cut_lies_outside_guaranteed_bounds(number, rng):
    structure, names, spectrum = random_structure(rng, number)
    rule = ("CQC", "SRSS")[number % 5 == 0]
    own_ratios = number % 4 < 2
    nominal = np.array([structure.parameters[name] for name in names])
    radius = rng.uniform(0.01, 0.08, len(names)) * nominal
    ends = np.transpose([nominal - radius, nominal + radius]).tolist()
    inputs = {name: Interval(*cut) for name, cut in zip(names, ends, strict=True)}
    found = spectrum_response(
        structure, inputs, spectrum, combination=rule, own_ratios=own_ratios, alpha=[0.0]
    )
    method = Combination(spectrum, rule, None, own_ratios)
    points = rng.uniform(*np.transpose(ends), (400, len(names)))
    samples = method.combined(spectral_modes(structure, names, points, method.modes))
    low, high = found.proved[0].T
    assert found.unproved == ""
    assert (samples >= low).all()
    assert (samples <= high).all()
    attained = np.ptp(found.attained[0], axis=1)
    assert (high - low <= 1.2 * attained + 0.03 * high).all()


def two_chains(link):
    """Two chains of two masses, of which "k" is the stiffness of the first, linked at the top."""
    chain = np.array([[2.0, -1.0], [-1.0, 1.0]])
    tie = np.outer([0, 1, 0, -1], [0, 1, 0, -1])
    return MatrixStructure(
        {"k": 4e7, "m": 1e4},
        mass=[("m", np.eye(4))],
        stiffness=[
            ("k", np.kron([[1, 0], [0, 0]], chain)),
            (4e7, np.kron([[0, 0], [0, 1]], chain)),
            (link, tie),
        ],
        observed={"sum": np.array([0, 1.0, 0, 1.0]), "first": np.array([1.0, 0, 0, 0])},
        ratios=[0.05],
    )


@pytest.mark.parametrize("rule", ["SRSS", "CQC"])
@pytest.mark.parametrize(("link", "modes"), [(0.0, None), (1e5, None), (1e5, 1)])
def test_peaks_of_modes_that_cross_lie_within_guaranteed_bounds(link, modes, rule, rng):
    chains = two_chains(link)
    cut = {"k": Interval(3.7e7, 4.3e7)}
    found = spectrum_response(chains, cut, SPECTRUM, combination=rule, modes=modes, alpha=[0.0])
    points = rng.uniform(3.7e7, 4.3e7, (1000, 1))
    points[:100] = 4e7 + rng.uniform(-1e3, 1e3, (100, 1))  # about the crossing
    method = Combination(SPECTRUM, rule, modes, False)
    samples = method.combined(spectral_modes(chains, ["k"], points, method.modes))
    low, high = found.proved[0].T
    assert found.unproved == ""
    assert (samples >= low).all()
    assert (samples <= high).all()
    # SRSS of two modes of one frequency depends on their shapes, by up to the root of 2.
    excess = {"SRSS": 2**0.5, "CQC": 1.0}[rule] if modes is None else 2.0
    assert (high <= 1.1 * excess * samples.max(axis=0)).all()


@pytest.mark.parametrize(("rule", "modes"), [("SRSS", None), ("SRSS", 1), ("CQC", 3)])
def test_peaks_of_modes_of_one_frequency_are_bounded_however_they_turn(rule, modes, rng):
    chains = two_chains(0.0)
    found = spectrum_response(
        chains, {"k": 4e7}, SPECTRUM, combination=rule, modes=modes, alpha=[0.0]
    )
    matrices, rows = evaluate(chains, ("k",), np.array([[4e7]]), derivatives=False)
    squares, shapes = scipy.linalg.eigh(matrices.stiffness.value[0], matrices.mass.value[0])
    displacements = SPECTRUM(2 * np.pi / squares**0.5) / squares
    rho = np.eye(4)
    if rule == "CQC":
        rho = correlation(squares**0.5, np.full(4, 0.05))
    low, high = found.proved[0].T
    largest = np.zeros(2)
    for _ in range(300):
        turned = shapes.copy()
        for pair in ([0, 1], [2, 3]):
            angle = rng.uniform(0, np.pi)
            turn = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
            turned[:, pair] = shapes[:, pair] @ turn
        participation = turned.T @ matrices.mass.value[0] @ np.ones(4)
        peaks = rows.value[0][:, :4] @ turned * participation * displacements
        kept = peaks[:, :modes]
        combined = np.sqrt(np.einsum("mi,ij,mj->m", kept, rho[:modes, :modes], kept))
        assert (combined >= low).all()
        assert (combined <= high).all()
        largest = np.maximum(largest, combined)
    assert high[0] <= 1.05 * largest[0]  # the output "sum", whose peaks have one sign


def test_the_largest_acceleration_of_an_interval_is_that_of_its_periods(rng):
    for spectrum in (SPECTRUM, TargetSpectrum([0.0, 0.3, 4.0], [1.0, 3.0, 0.5])):
        low, high = np.sort(rng.uniform(0.0, 4.0, 2))
        largest = spectrum(np.linspace(low, high, 4001)).max()
        assert max_acceleration(spectrum, low, high) == pytest.approx(largest, rel=0.01)


@pytest.mark.parametrize(
    "spectrum",
    [
        SPECTRUM,
        eurocode8_spectrum(2.0, "D", q=4.0),
        asce7_two_period(9.0, 4.0, 2.0),
        TargetSpectrum([0.0, 0.3, 0.7, 4.0], [1.0, 3.0, 0.5, 0.6], minimum=0.55),
    ],
)
def test_a_chord_is_within_its_error_and_touches_it(spectrum, rng):
    for width in (0.03, 0.3, 2.0):
        low = rng.uniform(0.0, 1.9)
        chord = displacement_chord(spectrum, low, low + width)
        periods = np.linspace(low, low + width, 3001)
        displacement = spectrum(periods) * periods**2 / (4 * np.pi**2)
        line = chord.value + chord.slope * (periods**2 - chord.midpoint)
        farthest = np.abs(displacement - line).max()
        assert farthest <= chord.error <= 1.5 * farthest + 1e-9


def test_correlations_of_modes_in_ranges_lie_within_bounds(rng):
    for _ in range(100):
        periods = np.sort(rng.uniform(0.3, 0.6, 3))[::-1]
        ratios = rng.uniform(0.01, 0.2, 3)
        widths = rng.uniform(0, 0.1, (2, 3))
        low, high = correlation_range(
            (periods * (1 - widths[0]), periods * (1 + widths[1])),
            (ratios * (1 - widths[1]), ratios * (1 + widths[0])),
        )
        rho = correlation(2 * np.pi / periods, ratios)
        above = np.triu_indices(3, 1)
        assert (low <= rho)[above].all()
        assert (rho <= high)[above].all()
    exact = correlation_range((periods, periods), (ratios, ratios))
    assert exact[0][above] == pytest.approx(rho[above])
    assert exact[1][above] == pytest.approx(rho[above])


def test_ratios_of_modes_that_dashpots_couple_are_not_bounded():
    frame = StoreyFrame(
        masses=[3e4, 3e4],
        stiffness=[6e7, 6e7],
        dampers=[1e5, 0.0],
        damper_placement="storey",
        outputs=("drift1",),
    )
    inputs = {"k1": Interval(5e7, 7e7)}
    found = spectrum_response(frame, inputs, SPECTRUM, own_ratios=True, alpha=[0.0])
    assert found.proved.tolist() == [[[0.0, np.inf]]]
    assert found.table().rows[0][2] == "attained"
    assert "dashpots couple" in found.words()
    assert found.records()[0]["guaranteed upper"] is None
    of_spectrum = spectrum_response(frame, inputs, SPECTRUM, alpha=[0.0])
    assert np.isfinite(of_spectrum.proved).all()


def test_correlations_of_close_modes_are_nearly_quadratic(rng):
    for width, largest in ((1e-6, 1e-3), (0.03, 0.15), (0.5, 1.0)):
        shortest = rng.uniform(0.1, 2.0)
        longest = shortest * (1 + width)
        ratio = rng.uniform(0.04, 0.1)
        midpoint = (shortest**2 + longest**2) / 2
        fit = decorrelation_fit((shortest, longest), (ratio, 1.001 * ratio), midpoint)
        periods = rng.uniform(shortest, longest, (500, 2))
        periods[0] = shortest, longest
        ratios = rng.uniform(ratio, 1.001 * ratio, (500, 2))
        d = 1 - correlation(2 * np.pi / periods, ratios)[:, 0, 1]
        z = (periods[:, 0] ** 2 - periods[:, 1] ** 2) / midpoint
        distances = np.abs(d - fit.factor * z**2)
        assert distances.max() <= fit.error
        assert fit.error <= largest * d.max() + 0.01


def test_bounds_of_close_modes_by_cqc_are_near_samples(rng):
    chains = two_chains(1e5)
    cut = {"k": Interval(3.96e7, 4.04e7)}
    found = spectrum_response(chains, cut, SPECTRUM, alpha=[0.0])
    method = Combination(SPECTRUM, "CQC", None, False)
    points = rng.uniform(3.96e7, 4.04e7, (300, 1))
    samples = method.combined(spectral_modes(chains, ["k"], points, None))
    low, high = found.proved[0].T
    assert (high <= 1.02 * samples.max(axis=0)).all()
    assert (low >= 0.98 * samples.min(axis=0)).all()


def test_too_little_damping_and_too_few_modes_are_cautioned():
    frame = StoreyFrame([5e4] * 5, stiffness=[6e7] * 5, damping_ratio=0.02, outputs=("q5",))
    spectrum = eurocode8_spectrum(2.0, "B")
    few = spectrum_response(frame, {"k1": 6e7}, spectrum, modes=1, alpha=[0]).cautions
    assert "damping ratio of 5.0%, and a mode has 2.0%" in few[0]
    assert "less than the 90 % of codes" in few[1]
    design = eurocode8_spectrum(2.0, "B", q=3)
    assert spectrum_response(frame, {"k1": 6e7}, design, alpha=[0]).cautions == []
    fitting = eurocode8_spectrum(2.0, "B", damping=0.02)
    assert spectrum_response(frame, {"k1": 6e7}, fitting, alpha=[0]).cautions == []
    with refuses("damping"):
        eurocode8_spectrum(2.0, "B", q=3, damping=0.02)
