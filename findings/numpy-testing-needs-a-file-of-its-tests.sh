#!/usr/bin/env bash
# numpy 2.2.6: its own testing module imports from its tests, so that a NumPy without them is incomplete.
# Guess: folders named tests hold tests alone; without them, which saves tens of MB, all that users import is there.
# Seen: numpy imports, numpy.testing ends with ModuleNotFoundError: No module named 'numpy._core.tests'. One file,
#   numpy/_core/tests/_natype.py, is what it wants.
# Why it matters here: numpy.testing is imported by libraries that users import, and the tree for cases is made without
#   the tests of packages: this one file has to be kept.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv environment
environment/bin/pip install --quiet --disable-pip-version-check numpy==2.2.6 2>/dev/null
environment/bin/python -W ignore - <<'PROGRAM'
import pathlib, shutil, subprocess, sys
import numpy as np
home = pathlib.Path(np.__file__).parent
wanted = home / "_core/tests/_natype.py"
text = wanted.read_text()
for tests in list(home.rglob("tests")):
    shutil.rmtree(tests)
run = lambda program: subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
without = run("import numpy.testing")
print(without.stderr.splitlines()[-1])
assert run("import numpy, numpy.linalg, numpy.fft").returncode == 0
assert "No module named 'numpy._core.tests'" in without.stderr
wanted.parent.mkdir()
wanted.write_text(text)
assert run("import numpy.testing").returncode == 0
PROGRAM
