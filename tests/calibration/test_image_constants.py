"""Proved constants of images against an FFT scheme that shares nothing with the proof.

Rotated scheme (Willot, C. R. Mécanique 343, 232, 2015) on pixels divided 4, 8 and 16 times, whose
values are extrapolated to pixels divided for ever.
"""

import numpy as np
import pytest

from alphacut.rve.cell import Phase
from alphacut.rve.engineering_constants import EngineeringConstants
from alphacut.rve.image.fields.conjugate_gradient import ConjugateGradient
from alphacut.rve.image.solve import solve_image

pytestmark = pytest.mark.slow
PIXELS, IMAGES = 16, 20


def random_image(rng):
    """K + G/3 and G of two phases by smooth noise, shape (16, 16) each."""
    waves = np.fft.fftfreq(PIXELS) * PIXELS
    damping = np.exp(-((np.hypot(waves[:, None], waves) / 4) ** 2))
    noise = np.fft.ifft2(np.fft.fft2(rng.normal(size=(PIXELS, PIXELS))) * damping).real
    inside = noise > np.quantile(noise, rng.uniform(0.3, 0.8))
    stiff = Phase(20e9 * rng.uniform(2, 8), float(rng.uniform(0, 0.4)))
    phases = [Phase(20e9, float(rng.uniform(0, 0.4))), stiff]
    tables = np.array([[(c[0, 0] + c[0, 1]) / 2, c[2, 2]] for c in (p.stiffness for p in phases)])
    return tables[inside.astype(int)].transpose(2, 0, 1)


def stiffness_by_fft(bulk, shear, division):
    """Effective C, (3, 3), by conjugate gradients in Fourier space on the rotated grid."""
    k, g = (np.kron(x, np.ones((division, division))) for x in (bulk, shear))
    n = len(k)
    angle = 2 * np.pi * np.fft.fftfreq(n)
    shift = [np.exp(1j * angle)[:, None], np.exp(1j * angle)[None]]
    wave = np.stack([(shift[1] - 1) * (shift[0] + 1), (shift[0] - 1) * (shift[1] + 1)]) / 4
    wave[:, abs(np.abs(wave) ** 2).sum(axis=0) < 1e-28] = 0
    square = (abs(wave) ** 2).sum(axis=0)
    safe = np.where(square > 0, square, 1)
    k0, g0 = np.sqrt(k.min() * k.max()), np.sqrt(g.min() * g.max())

    def stress(e):  # 11, 22, 12 with tensor shears
        trace = e[0] + e[1]
        return np.stack(
            [(k - g) * trace + 2 * g * e[0], (k - g) * trace + 2 * g * e[1], 2 * g * e[2]]
        )

    def strain_of(s):
        """Compatible strain of the reference material under a stress that is not balanced."""
        t = np.fft.fft2(s)
        c = wave.conj()
        force = np.stack([c[0] * t[0] + c[1] * t[2], c[0] * t[2] + c[1] * t[1]])
        along = (wave[0] * force[0] + wave[1] * force[1]) / safe
        u = (force / g0 - c * along * k0 / (g0 * (k0 + g0))) / safe
        u[:, square == 0] = 0
        e = np.stack([wave[0] * u[0], wave[1] * u[1], (wave[0] * u[1] + wave[1] * u[0]) / 2])
        return np.fft.ifft2(e).real

    weight = np.array([1, 1, 2.0])[:, None, None]
    columns = []
    for load in ([1, 0, 0], [0, 1, 0], [0, 0, 0.5]):
        mean = np.array(load, float)[:, None, None] * np.ones((3, n, n))
        e, r = np.zeros_like(mean), -strain_of(stress(mean))
        p, size = r.copy(), (weight * r * r).sum()
        first = size
        while size > 1e-18 * first:
            image = strain_of(stress(p))
            step = size / (weight * p * image).sum()
            e, r = e + step * p, r - step * image
            size, before = (weight * r * r).sum(), size
            p = r + size / before * p
        columns.append(stress(mean + e).mean(axis=(1, 2)))
    return np.array(columns).T


def constants(stiffness):
    return EngineeringConstants.of_stiffness(stiffness, np.zeros((3, 3))).values


@pytest.mark.parametrize("seed", range(IMAGES))
def test_intervals_hold_the_values_of_another_scheme(seed):
    bulk, shear = random_image(np.random.default_rng([631, seed]))
    solution = solve_image(bulk, shear, solver=ConjugateGradient(1e-5), division=1)
    coarse, middle, fine = (constants(stiffness_by_fft(bulk, shear, d)) for d in (4, 8, 16))
    slope = np.clip((coarse - middle) / (middle - fine), 1.5, 4)
    limit = fine + (fine - middle) / (slope - 1)
    lower, upper = solution.bounds.constants().T
    slack = abs(limit - fine)
    print(seed, (upper - lower) / limit, slack / limit, (limit - lower) / (upper - lower))
    assert (lower <= limit).all()
    assert (limit <= upper).all()
    assert (slack < upper - lower).all()  # else the test says little
