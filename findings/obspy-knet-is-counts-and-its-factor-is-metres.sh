#!/usr/bin/env bash
# ObsPy 1.5.1: a K-NET record is read as counts with their offset, and calib is in m/s2 although the head's scale
# factor is in gal.
# Guess: the reader scales by the head's "3920(gal)/6182761", so that samples are gal; or calib is that quotient.
# Seen: samples are counts; calib is a hundredth of the quotient (m/s2); the offset stays in both; the start is 15 s
#   before the head's record time. Written to miniSEED the counts stay and calib is 1: the factor is lost.
# Why it matters here: counts taken for m/s2 are a thousand earthquakes; the project's own reader scales, and
#   `baseline = "mean"` takes the offset off.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv environment
environment/bin/pip install --quiet --disable-pip-version-check obspy==1.5.1 numpy==2.4.6 setuptools==80.9.0 2>/dev/null
environment/bin/python -W ignore - <<'PROGRAM'
import numpy as np, obspy
counts = 1000 + np.round(500 * np.sin(0.3 * np.arange(304))).astype(int)
names = {"Origin Time": "2011/03/11 14:46:00", "Lat.": "38.103", "Long.": "142.860", "Depth. (km)": "24", "Mag.": "9.0",
    "Station Code": "TST001", "Station Lat.": "36.0000", "Station Long.": "140.0000", "Station Height(m)": "10",
    "Record Time": "2011/03/11 14:46:36", "Sampling Freq(Hz)": "100Hz", "Duration Time(s)": "3", "Dir.": "N-S",
    "Scale Factor": "3920(gal)/6182761", "Max. Acc. (gal)": "1.000", "Last Correction": "2011/03/11 14:46:21", "Memo.": ""}
rows = ["".join(f"{count:9d}" for count in counts[k : k + 8]) for k in range(0, 304, 8)]
open("record.NS", "w").write("\n".join([*(f"{key:18}{value}" for key, value in names.items()), *rows, ""]))
trace, gal = obspy.read("record.NS")[0], 3920 / 6182761
print(trace.data[:3], trace.stats.calib, gal, trace.stats.starttime)
assert trace.data[:3].tolist() == counts[:3].tolist()
assert np.isclose(trace.stats.calib, gal / 100)
assert np.allclose(obspy.read("record.NS", apply_calib=True)[0].data, counts * gal / 100)
assert str(trace.stats.starttime) == "2011-03-11T05:46:21.000000Z"  # 14:46:36 in Japan, less 15 s
trace.write("record.ms", format="MSEED")
again = obspy.read("record.ms")[0]
assert again.stats.calib == 1.0 and again.data[0] == counts[0]
PROGRAM
