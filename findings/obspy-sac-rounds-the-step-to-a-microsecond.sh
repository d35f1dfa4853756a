#!/usr/bin/env bash
# ObsPy 1.5.1: a SAC file comes back with its step rounded to six decimals.
# Guess: the head's 32 bit float keeps seven digits, and 1/256 s is exact in binary.
# Seen: a step of 1/256 s = 0.00390625 s comes back as 0.003906 s (64 millionths short), 1/512 s as 0.001953 s (160
#   millionths); miniSEED keeps both.
# Why it matters here: after 60 s the record is 3.8 or 9.6 ms early, one to two of its own steps; the step of a SAC
#   record is read beside its duration.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv environment
environment/bin/pip install --quiet --disable-pip-version-check obspy==1.5.1 numpy==2.4.6 setuptools==80.9.0 2>/dev/null
environment/bin/python -W ignore - <<'PROGRAM'
import numpy as np, obspy
trace = obspy.Trace(np.sin(0.05 * np.arange(512)))
for rate, rounded in ((256, 0.003906), (512, 0.001953), (100, 0.01)):
    trace.stats.sampling_rate = rate
    steps = []
    for form in ("SAC", "MSEED"):
        trace.write("record", format=form)
        steps.append(obspy.read("record")[0].stats.delta)
    print(rate, steps)
    assert steps == [rounded, 1 / rate]
PROGRAM
