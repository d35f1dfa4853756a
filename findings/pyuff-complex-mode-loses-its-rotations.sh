#!/usr/bin/env bash
# pyuff 2.5.8: a complex mode with six components a node is written with three, and the file cannot be read again.
# Guess: six complex components are twelve numbers a node, as data set 55 asks for, and come back.
# Seen: the head says six components, the rows have six numbers (real and imaginary parts of the three translations):
#   rotations are dropped without a word. Reading it raises Error when reading data-set(s). Real modes with six and
#   complex ones with three components come back.
# Why it matters here: measured modes come as data set 55; those of structures with rotations cannot pass through this
#   writer.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv environment
environment/bin/pip install --quiet --disable-pip-version-check pyuff==2.5.8 numpy==2.4.6 2>/dev/null
environment/bin/python -W ignore - <<'PROGRAM'
import numpy as np, pyuff
random = np.random.default_rng(1)
def write(components, is_complex):
    kind = 5 if is_complex else 2
    mode = dict(type=55, model_type=1, id1="NONE", id2="NONE", id3="NONE", id4="NONE", id5="NONE", load_case=0, mode_n=1,
        analysis_type=3 if is_complex else 2, data_ch=3 if components == 6 else 2, spec_data_type=8, data_type=kind, n_data_per_node=components,
        node_nums=np.arange(1, 5), load_case_id=0, eig=2 + 3j, modal_a=1 + 1j, modal_b=1 + 2j, freq=5.0, modal_m=1.0,
        modal_damp_vis=0.01, modal_damp_his=0.0)
    for k in range(components):
        mode[f"r{k + 1}"] = random.normal(size=4) + (1j * random.normal(size=4) if is_complex else 0)
    pyuff.UFF("mode.uff").write_sets(mode, mode="overwrite")
    return mode
for components, is_complex in ((3, True), (6, False)):
    mode, again = write(components, is_complex), pyuff.UFF("mode.uff").read_sets()
    again = again if isinstance(again, dict) else again[0]
    assert all(np.allclose(again[f"r{k + 1}"], mode[f"r{k + 1}"], atol=1e-4) for k in range(components))
mode = write(6, True)
rows = open("mode.uff").read().splitlines()
numbers = [float(x) for x in rows[rows.index("         1") + 1].split()]
print(len(numbers), "numbers of 12 for node 1:", numbers)
assert np.allclose(numbers, [part for k in (1, 2, 3) for part in (mode[f"r{k}"][0].real, mode[f"r{k}"][0].imag)], atol=1e-4)
try:
    pyuff.UFF("mode.uff").read_sets()
except Exception as error:
    print(error)
    assert "Error when reading" in str(error)
else:
    raise AssertionError
PROGRAM
