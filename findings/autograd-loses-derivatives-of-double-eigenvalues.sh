#!/usr/bin/env bash
# autograd 1.9.1: at a double eigenvalue derivatives are silently 0 or nan.
# Guess: eigenvalues of diag(1, 1, 3) + t B, B = offdiag(1), have one-sided derivatives -1 and 1; the sum of their
#   squares is smooth, with second derivative 4.
# Seen: the Jacobian of the eigenvalues is (0, 0, 0) without a warning, and the second derivative of the smooth sum is
#   nan.
# Why it matters here: a building alike in x and y has double modes: its derivatives have to be taken by blocks.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv environment
environment/bin/pip install --quiet --disable-pip-version-check autograd==1.9.1 numpy==2.4.6 2>/dev/null
environment/bin/python -W ignore - <<'PROGRAM'
import autograd, autograd.numpy as np
A, B = np.diag([1.0, 1.0, 3.0]), np.array([[0.0, 1, 0], [1, 0, 0], [0, 0, 0]])
values = lambda t: np.linalg.eigh(A + t * B)[0]
smooth = lambda t: np.sum(values(t)[:2] ** 2)  # (1 - t)^2 + (1 + t)^2
jacobian, second = autograd.jacobian(values)(0.0), autograd.grad(autograd.grad(smooth))(0.0)
print(jacobian, second, "near by:", autograd.jacobian(values)(1e-6))
assert np.allclose(jacobian, 0) and np.isnan(second)
assert np.allclose(autograd.jacobian(values)(1e-6), (-1, 1, 0))
PROGRAM
