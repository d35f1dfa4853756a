"""Terms of a stiffness by differences of what a program exports for several parameters."""

from itertools import pairwise

import numpy as np
import pytest

from alphacut.frame import MatrixStructure, affine_terms
from tests.refused import refuses

NOMINAL = {"E": 2.1e11, "k": 3.7e6}


def beam(modulus, spring, *, inertia=8.1e-6, length=2.7, elements=3):
    """Stiffness of a cantilever in bending with a spring at its end, by rows of (w, θ)."""
    stiffness = np.zeros((2 * elements + 2, 2 * elements + 2))
    h = length / elements
    element = np.array(
        [[12, 6 * h, -12, 6 * h], [6 * h, 4 * h**2, -6 * h, 2 * h**2],
         [-12, -6 * h, 12, -6 * h], [6 * h, 2 * h**2, -6 * h, 4 * h**2]]
    )  # fmt: skip
    for k, _ in pairwise(range(elements + 1)):
        stiffness[2 * k : 2 * k + 4, 2 * k : 2 * k + 4] += modulus * inertia / h**3 * element
    stiffness[-2, -2] += spring
    return stiffness[2:, 2:]


def printed(array, digits):
    """Numbers as a program prints them."""
    return np.vectorize(lambda x: float(f"{x:.{digits - 1}e}"))(array)


def exports(matrix, *, digits=17, nominal=NOMINAL):
    """Two exports for each parameter, at twice and one and a half of it, and one of all moved."""
    points = [nominal]
    for name, factor in ((name, factor) for name in nominal for factor in (2.0, 1.5)):
        points.append(nominal | {name: factor * nominal[name]})
    points.append({name: 1.7 * value for name, value in nominal.items()})
    return [(point, printed(matrix(*point.values()), digits)) for point in points]


@pytest.mark.parametrize("digits", [6, 8, 10, 14, 17])
def test_terms_give_the_matrix_elsewhere_to_the_digits_printed(digits, rng):
    terms = affine_terms(exports(beam, digits=digits))
    assert [factor for factor, _ in terms] == ["E", "k"]
    other = {name: value * rng.uniform(0.5, 3.0) for name, value in NOMINAL.items()}
    found = sum(other[factor] * array for factor, array in terms)
    expected = beam(*other.values())
    assert (
        np.abs(found - expected).max()
        < 30 * 10.0**-digits * expected.max() + 1e-12 * expected.max()
    )
    spring = dict(terms)["k"]
    assert np.count_nonzero(spring) == 1


def test_a_part_that_no_parameter_moves_is_a_term_of_its_own():
    terms = affine_terms(exports(lambda E, k: beam(E, k) + 1e5 * np.eye(6), digits=12))
    assert [factor for factor, _ in terms] == ["E", "k", 1.0]
    assert terms[2][1] == pytest.approx(1e5 * np.eye(6), rel=1e-3, abs=1.0)
    MatrixStructure(NOMINAL, [(1.0, np.eye(6))], terms, {"end": np.eye(6)[4]})


@pytest.mark.parametrize("digits", [7, 16])
def test_modulus_and_inertia_of_one_beam_multiply(digits):
    """Affine in each, and together not: by how much is what the joint export has beside the sum."""
    nominal = {"E": 2.1e11, "I": 8.1e-6}
    together = exports(lambda E, i: beam(E, 0.0, inertia=i), digits=digits, nominal=nominal)
    # The matrix is 1.7² = 2.89 times the nominal one, and the sum 1 + 2 · 0.7 = 2.4 times it: 0.49 / 2.89.
    with refuses("export 6") as caught:
        affine_terms(together)
    assert "0.17 of the entry" in str(caught.value)


@pytest.mark.parametrize("digits", [6, 9, 16])
@pytest.mark.parametrize("bend", [1e-1, 1e-4])
def test_what_bends_is_refused_with_its_size_and_place(digits, bend):
    def bent(E, k):
        stiffness = beam(E, k)
        stiffness[2, 2] *= 1 + bend * (E / NOMINAL["E"] - 1) ** 2
        return stiffness

    files = exports(bent, digits=digits)
    names = [f"{node}.{direction}" for node in (12, 13, 14) for direction in "wr"]
    with refuses("export 3"):
        affine_terms(files, unknowns=names)


def test_rounding_is_not_taken_for_a_bend(rng):
    """Random matrices with entries of many magnitudes, printed with any number of digits."""
    for _ in range(40):
        size = int(rng.integers(1, 8))
        signs = rng.choice([-1.0, 1.0], (3, size, size))
        parts = signs * rng.uniform(0.5, 2, (3, size, size)) * 10.0 ** rng.uniform(-3, 3, size)
        parts = parts.transpose(0, 2, 1) @ parts
        nominal = dict(zip("ab", 10.0 ** rng.uniform(-9, 9, 2), strict=True))
        parts[1:] /= np.array(list(nominal.values()))[:, None, None]
        digits = int(rng.integers(6, 18))
        affine_terms(
            exports(
                lambda a, b, p=parts: p[0] + a * p[1] + b * p[2], digits=digits, nominal=nominal
            )
        )


@pytest.mark.parametrize(
    ("change", "key"),
    [
        (lambda x: x[:2], "exports"),
        (lambda x: x[:2] + x[3:], "E"),
        (lambda x: x[:-1], "exports that move all parameters"),
        (lambda x: [*x, (NOMINAL, np.full((6, 6), np.nan))], "export 7"),
        (lambda x: [*x, (NOMINAL, np.triu(x[0][1]))], "export 7"),
        (lambda x: [*x, ({"E": 1.0}, x[0][1])], "export 7"),
        (lambda x: [(p, np.zeros((0, 0))) for p, _ in x], "export 1"),
        (lambda x: [(p | {"k": NOMINAL["k"] * (1 + 1e-3 * (p["k"] / NOMINAL["k"] - 1))}, a) for p, a in x],
         "k"),
    ],
)  # fmt: skip
def test_exports_that_tell_no_terms_are_refused_in_one_line(change, key):
    with refuses(key) as caught:
        affine_terms(change(exports(beam)))
    assert "\n" not in str(caught.value)
