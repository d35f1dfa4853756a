#!/usr/bin/env bash
# ObsPy 1.5.1: Trace.resample() to twice the rate halves a sine at half the Nyquist frequency.
# Guess: resampling by FFT to a higher rate keeps every sample and adds one between each two.
# Seen: by default the spectrum is multiplied by a Hann window over all frequencies: at 100 Hz a sine of 10 Hz loses
#   9.5 %, one of 25 Hz half of its amplitude. With window=None both come back to 1e-12.
# Why it matters here: records are brought to one step before they come here, and peaks of stiff structures live at
#   10 to 25 Hz: resample with window=None, or bring the record at its own step.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv environment
environment/bin/pip install --quiet --disable-pip-version-check obspy==1.5.1 numpy==2.4.6 "setuptools<81" 2>/dev/null
environment/bin/python -W ignore - <<'PROGRAM'
import numpy as np
from obspy import Trace
times = 0.01 * np.arange(1000)
def amplitude(frequency, **options):
    sine = np.sin(2 * np.pi * frequency * times)
    trace = Trace(sine, {"delta": 0.01})
    trace.resample(200, **options)
    return trace.data.max(), abs(trace.data[::2] - sine).max()

for frequency, expected in ((10, 0.9045), (25, 0.5)):
    print(frequency, amplitude(frequency), amplitude(frequency, window=None))
    assert abs(amplitude(frequency)[0] - expected) < 1e-3
    assert amplitude(frequency, window=None)[1] < 1e-10
PROGRAM
