#!/usr/bin/env bash
# sdyPy-EMA 0.31.0 (pyEMA's successor): the real parts of modal constants are no mode shape.
# Guess: of a structure with proportional damping the modal constants are the real shapes times a factor.
# Seen: they are residues of poles, so imaginary for receptances and accelerances alike: the real parts are a
#   thousandth of them and noise, with signs of their own. Their imaginary parts, and normal_mode(), are the shapes to
#   1e-3.
# Why it matters here: a table of measured modes has real amplitudes: take normal_mode(), or write the complex A as data
#   set 55, whose shapes are turned before they are read.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv environment
environment/bin/pip install --quiet --disable-pip-version-check sdypy-EMA==0.31.0 numpy==2.4.6 scipy==1.17.1 2>/dev/null
environment/bin/python -W ignore - 2>/dev/null <<'PROGRAM'
import numpy as np
from sdypy import EMA
squared, modes = np.linalg.eigh(2e4 * np.array([[2.0, -1, 0], [-1, 2, -1], [0, -1, 1]]))  # of a chain of masses of 1 kg
omega, frequencies = np.sqrt(squared), np.arange(0, 60, 0.02)
circular = 2 * np.pi * frequencies
receptance = sum(
    np.outer(modes[:, k], modes[2, k] / (omega[k] ** 2 - circular**2 + 0.02j * omega[k] * circular)) for k in range(3)
)
def ratios(shapes):
    return shapes / shapes[2]
for form, response in (("receptance", receptance), ("accelerance", -(circular**2) * receptance)):
    model = EMA.Model(frf=response, freq=frequencies, lower=2, upper=59, pol_order_high=20, frf_form=form)
    model.get_poles(method="lscf", show_progress=False)
    model.select_closest_poles(list(omega / 2 / np.pi), f_window=5)
    model.get_constants()
    print(form, "real parts", ratios(model.A.real)[0], "imaginary parts", ratios(model.A.imag)[0], "right", ratios(modes)[0])
    assert np.allclose(model.nat_freq, omega / 2 / np.pi, rtol=1e-3)
    assert (abs(model.A.real) < 5e-3 * abs(model.A)).all()
    assert abs(ratios(model.A.real) - ratios(modes)).max() > 0.1
    assert np.allclose(ratios(model.A.imag), ratios(modes), atol=5e-3)
    assert np.allclose(ratios(model.normal_mode()), ratios(modes), atol=5e-3)
PROGRAM
