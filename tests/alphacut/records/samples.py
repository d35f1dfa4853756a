"""Files of one record in every format, written from its samples by the formats' own rules."""

import numpy as np

G = 9.80665
COUNT, STEP = 2000, 0.005


def samples() -> np.ndarray:
    """A damped oscillation with a peak of some 0.6 g, in g, as printed with seven digits."""
    t = STEP * np.arange(COUNT)
    values = 0.645 * np.exp(-0.4 * t) * np.sin(7.3 * t + 0.2) + 1e-3
    return np.array([float(f"{x:.7E}") for x in values])


def lines(values, form: str, per_line: int) -> str:
    rows = [values[k : k + per_line] for k in range(0, len(values), per_line)]
    return "\n".join("".join(format(x, form) for x in row) for row in rows) + "\n"


def at2(step_line: str, unit: str = "ACCELERATION TIME SERIES IN UNITS OF G", **changes) -> str:
    numbers = changes.get("numbers", lines(samples(), "15.7E", 5))
    return f"PEER NGA STRONG MOTION DATABASE RECORD\nTest, 1/1/2020, S 0\n{unit}\n{step_line}\n{numbers}"


KNET_HEAD = """Origin Time       2011/03/11 14:46:00
Lat.              38.103
Long.             142.860
Depth. (km)       24
Mag.              9.0
Station Code      MYG004
Station Lat.      38.7292
Station Long.     141.0217
Station Height(m) 40
Record Time       2011/03/11 14:46:36
Sampling Freq(Hz) 200Hz
Duration Time(s)  10
Dir.              N-S
Scale Factor      980.665(gal)/10000000
Max. Acc. (gal)   632.226
Last Correction   2011/03/11 14:46:21
Memo.
"""


def knet() -> str:
    return KNET_HEAD + lines(np.round(samples() * 1e7).astype(int), "9d", 8)


def esm(unit: str = "cm/s^2") -> str:
    size = {"cm/s^2": 100 * G, "m/s^2": G, "g": 1.0}[unit]
    head = (
        "EVENT_NAME: TEST\nSTATION_CODE: MRN\nSTREAM: HNE\nSTATION_ELEVATION_M: 17\n"
        f"SAMPLING_INTERVAL_S: {STEP:.6f}\nNDATA: {COUNT}\nDURATION_S: 9.995\nUNITS: {unit}\n"
        "DATE_TIME_FIRST_SAMPLE_YYYYMMDD_HHMMSS: 20120529_070000.000\nDATA_TYPE: ACCELERATION\nUSER5:\n"
    )
    return head + lines(size * samples(), "20.10E", 1)


def cosmos(step: float = STEP, names=("1: 90 deg", "2: Up"), width: int = 15) -> str:
    reals = [-999.0] * 100
    reals[33] = step
    blocks = []
    for number, name in enumerate(names, 1):
        values = 100 * G * samples() * (1 if number == 1 else 0.5)
        blocks.append(
            "Corrected acceleration   (Format v01.20 with 13 text lines)\n"
            f"Sta Chan   {name} (Rcrdr Chan  {number}) Location:Free Field\n"
            " 100 Integer-header values follow on  10 lines, Format= (10I8)\n"
            + lines([7] * 100, "8d", 10)
            + " 100 Real-header values follow on  17 lines, Format= (6F13.6)\n"
            + lines(reals, "13.6f", 6)
            + '   1 Comment line(s) follow, each starting with a "|":\n|\n'
            f"    2000 acceleration pts, approx   10 secs, units=cm/sec2 (4), Format=(5E{width}.{width - 8})\n"
            + lines(values, f"{width}.{width - 8}E", 5)
            + f"End-of-data for ChanHN{'EZ'[number - 1]} acceleration\n"
            f"    2000 velocity pts, approx   10 secs, units=cm/sec (5), Format=(5E{width}.{width - 8})\n"
            + lines(0 * values, f"{width}.{width - 8}E", 5)
            + f"End-of-data for ChanHN{'EZ'[number - 1]} velocity\n"
        )
    return "".join(blocks)


def csv_text(unit: str = "g", mark: str = ",") -> str:
    size = {"g": 1.0, "gal": 100 * G, "m/s^2": G, "cm/s^2": 100 * G}[unit]
    rows = [f"{k * STEP:.3f}{mark}{x:.10g}" for k, x in enumerate(size * samples())]
    return f"time [s]{mark}acceleration [{unit}]\n" + "\n".join(rows) + "\n"
