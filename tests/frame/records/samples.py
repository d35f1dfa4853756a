"""Files of one record in every format, written from its samples by the formats' own rules."""

import re

import numpy as np

G = 9.80665
COUNT, STEP = 400, 0.005


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
Duration Time(s)  2
Dir.              N-S
Scale Factor      980.665(gal)/10000000
Max. Acc. (gal)   588.619
Last Correction   2011/03/11 14:46:21
Memo.
"""


def knet() -> str:
    return KNET_HEAD + lines(np.round(samples() * 1e7).astype(int), "9d", 8)


def esm(unit: str = "cm/s^2") -> str:
    size = {"cm/s^2": 100 * G, "m/s^2": G, "g": 1.0}[unit]
    head = (
        "EVENT_NAME: TEST\nSTATION_CODE: MRN\nSTREAM: HNE\nSTATION_ELEVATION_M: 17\n"
        f"SAMPLING_INTERVAL_S: {STEP:.6f}\nNDATA: {COUNT}\nDURATION_S: 1.995\nUNITS: {unit}\n"
        "TIME_PGA_S: 0.180000\n"
        "DATE_TIME_FIRST_SAMPLE_YYYYMMDD_HHMMSS: 20120529_070000.000\nDATA_TYPE: ACCELERATION\nUSER5:\n"
    )
    return head + lines(size * samples(), "20.10E", 1)


def cosmos(step=STEP, processed=-999.0, names=("1: 90 deg", "2: Up"), width=15, **marks) -> str:
    """Volume 2; `marks` are other spellings of the lines that announce reals and samples."""
    reals = [-999.0] * 100
    reals[33], reals[61] = step, processed
    real_mark = marks.get("reals", " 100 Real-header values follow on  17 lines, Format= (6F13.6)")
    unit = marks.get("unit", "cm/sec2 (4), ")
    size = G * 100 if unit.startswith("cm") else 1.0
    blocks = []
    for number, name in enumerate(names, 1):
        values = size * samples() * (1 if number == 1 else 0.5)
        title = f"Sta Chan   {name} (Rcrdr Chan  {number}) Location:Free Field\n" if name else ""
        blocks.append(
            f"Corrected acceleration   (Format v01.20 with 13 text lines)\n{title}"
            " 100 Integer-header values follow on  10 lines, Format= (10I8)\n"
            + lines([7] * 100, "8d", 10)
            + f"{real_mark}\n"
            + lines(reals, "13.6f", 6)
            + '   1 Comment line(s) follow, each starting with a "|":\n|\n'
            f"    {COUNT} acceleration pts, approx   2 secs, units={unit}Format=(5E{width}.{width - 8})\n"
            + lines(values, f"{width}.{width - 8}E", 5)
            + f"End-of-data for ChanHN{'EZ'[number - 1]} acceleration\n"
            f"    {COUNT} velocity pts, approx   2 secs, units=cm/sec (5), Format=(5E{width}.{width - 8})\n"
            + lines(0 * values, f"{width}.{width - 8}E", 5)
            + f"End-of-data for ChanHN{'EZ'[number - 1]} velocity\n"
        )
    return "".join(blocks)


def csmip(announced=True, names=("1: 90 Deg", "2: Up"), unit="cm/sec2", raw=False) -> str:
    """Volume 2, or volume 1 if `raw`; not `announced` is an old form of that."""
    blocks = []
    for number, name in enumerate(names, 1):
        size = {"g": 1.0, "g/10": 10.0}.get(unit.lower(), 100 * G) * (1 if number == 1 else 0.5)
        integers, reals = [0] * 112, [0.0] * 56
        integers[27], reals[2] = COUNT, STEP * (COUNT - 1)
        title = "UNCORRECTED ACCELEROGRAM DATA" if raw else "CORRECTED ACCELEROGRAM"
        text = f"{title}   00000-X0000      Chan  {name}     from\n"
        second = "text" if raw else "UNCORRECTED ACCELEROGRAM DATA PROCESSED: 01/01/00"
        text += f"{second}\n" + "text\n" * 9 + f"DURATION 10 SEC  UNITS ARE SEC AND {unit}\ntext\n"
        text += lines(integers, "5d", 16) + lines(reals, "10.4f", 8)
        series = (
            f" {COUNT} points of accel data equally spaced at  .0050 sec, in {unit}. (8f12.6)\n"
        )
        if announced:
            text += series + lines(size * samples(), "12.6f", 8)
        else:
            text += "ACCELEROGRAM DATA\n" + lines(size * samples(), "9.5f", 8)
        text += f" {COUNT} points of veloc data equally spaced at  .0050 sec, in cm/sec. (8f10.6)\n"
        blocks.append(text + lines(0 * samples(), "10.6f", 8) + "/& --- End of data ---\n")
    return "".join(blocks)


def smc(first="2 CORRECTED ACCELEROGRAM", angle=90, count=COUNT) -> str:
    integers, reals = [-32768] * 48, [1.7e38] * 50
    integers[12], integers[15], integers[16] = angle, 2, count
    reals[1] = 1 / STEP
    text = f"{first}\n" + "*\n" * 10 + lines(integers, "10d", 8) + lines(reals, "15.7E", 5)
    values = [f"{x:.4E}".replace("E-0", "E-").replace("E+0", "E+") for x in 100 * G * samples()]
    return text + "| a comment\n|\n" + lines(values, ">10s", 8)


PEAK = float(np.abs(samples()).max())
"""Of the samples, in g."""


def cosmos_with_peak(factor: float) -> str:
    """Volume 2 of one channel whose real header has a peak in entry 64, and another in its text."""
    text = cosmos(names=("1: 90 deg",))
    head, mark, body = text.partition("Format= (6F13.6)\n")
    rows = body.split("\n")
    row = rows[10]  # entries 61 to 66
    rows[10] = row[:39] + f"{factor * PEAK * 100 * G:13.6f}" + row[52:]
    return head + mark + "\n".join(rows)


def smc_with_peak(factor: float, entry: int) -> str:
    """SMC with the largest sample in entry 30, or the least in entry 32 of the real head."""
    rows = smc().split("\n")
    row, place = 17 + (entry - 1) // 5, 15 * ((entry - 1) % 5)
    value = f"{factor * PEAK * 100 * G:15.7E}"
    rows[row] = rows[row][:place] + value + rows[row][place + 15 :]
    return "\n".join(rows)


WITH_PEAK = {
    "PEER": lambda f: at2("NPTS=   400, DT=   .0050 SEC").replace("S 0", f"S 0, PGA= {f * PEAK:.4f} g"),
    "K-NET": lambda f: knet().replace("588.619", f"{f * PEAK * 100 * G:.3f}"),
    "ESM": lambda f: esm("m/s^2").replace("USER5:", f"PGA_CM/S^2: {f * PEAK * 100 * G:.6f}"),
    "COSMOS": cosmos_with_peak,
    "CSMIP V2": lambda f: csmip(names=("1: 90 Deg",)).replace(
        "text\n", f"PEAK ACCELERATION = {f * PEAK * 100 * G:10.3f} CM/SEC/SEC AT  .18 SEC\n"
        "PEAK VELOCITY = 900.1 CM/SEC AT 1.3 SEC\n", 1),
    "CSMIP V1": lambda f: csmip(False, ("1: 90 Deg",), "g/10", raw=True).replace(
        "AND g/10", f"AND G/10.   MAX  = {f * PEAK:7.3f} G, AT  0.180 SEC"),
    "SMC largest": lambda f: smc_with_peak(f, 30),
    "SMC least": lambda f: smc_with_peak(f, 32),
    "CSV": lambda f: f"# PGA = {f * PEAK * 1000:.2f} mg\n" + csv_text(),
}  # fmt: skip
"""A file of each format by the factor of the true peak that its head states."""


def csv_text(unit: str = "g", mark: str = ",", start: float = 0.0) -> str:
    size = {"g": 1.0, "gal": 100 * G, "m/s^2": G, "cm/s^2": 100 * G}[unit]
    rows = [f"{start + k * STEP:.3f}{mark}{x:.10g}" for k, x in enumerate(size * samples())]
    return f"time [s]{mark}acceleration [{unit}]\n" + "\n".join(rows) + "\n"


def uff58(
    values, *, kind=2, function=1, unit="m/s^2", spec=12, times=None, step=STEP, order=""
) -> bytes:
    """Data set 58 by the columns of its head; kind 2 has single reals, 4 doubles; `order` < or >: 58b."""
    single = kind == 2
    numbers = np.asarray(values, float)
    if times is not None:
        numbers = np.column_stack([times, numbers]).ravel()
    data = numbers.astype(f"{order or '<'}f{4 if single else 8}").tobytes()
    first = (
        f"    58b     {1 + (order == '>')}     2          11{len(data):12d}" if order else "    58"
    )
    head = [
        "    -1", first, "made up", "NONE", "01-Jan-20 00:00:00", "NONE", "NONE",
        f"{function:5d}{0:10d}{0:5d}{0:10d} {'NONE':<10}{7:10d}{1:4d} {'NONE':<10}{0:10d}{0:4d}",
        f"{kind:10d}{len(values):10d}{int(times is None):10d}{0:13.5E}{step:13.5E}{0:13.5E}",
        f"{17:10d}{0:5d}{0:5d}{0:5d} {'Time':<20} {'s':<20}",
        f"{spec:10d}{0:5d}{0:5d}{0:5d} {'Channel 1':<20} {unit:<20}",
        *[f"{0:10d}{0:5d}{0:5d}{0:5d} {'NONE':<20} {'NONE':<20}"] * 2,
    ]  # fmt: skip
    if not order:
        data = (lines(numbers, "13.5E", 6) if single else lines(numbers, "20.12E", 4)).encode()
    return "".join(f"{line:<80}\n" for line in head).encode() + data + b"    -1\n"


def uff55(number, shape, *, nodes=(11, 12, 13, 40), frequency=1.5, eigenvalue=None, size=3) -> str:
    """Data set 55: amplitudes of `shape` along x, 0 else; complex if it has an eigenvalue."""
    is_complex = eigenvalue is not None
    reals = (
        [eigenvalue.real, eigenvalue.imag, 1, 0, 1, 0] if is_complex else [frequency, 1, 0.01, 0]
    )
    kinds = (1, 3 if is_complex else 2, 2 if size == 3 else 3, 8, 5 if is_complex else 2, size)
    text = "    -1\n    55\n" + "NONE\n" * 5 + lines(kinds, "10d", 6)
    text += lines((2, len(reals), 0, number), "10d", 8) + lines(reals, "13.5E", 6)
    for node, amplitude in zip(nodes, shape, strict=True):
        values = np.zeros(size, complex)
        values[0] = amplitude
        values = values.view(float) if is_complex else values.real
        text += f"{node:10d}\n" + lines(values, "13.5E", 6)
    return text + "    -1\n"


def variant(name: str, number: int) -> tuple[bytes, str, float]:
    """Number 0 … 9 of the variants of a format: the file, unit of the case, rounding in g."""

    def pick(*options):
        return options[number % len(options)]

    values, plain = samples(), f"{COUNT}"
    unit, rounding, text = "", 1e-6, ""
    if name == "PEER":
        steps = (
            f"NPTS=   {plain}, DT=   .0050 SEC,",
            f"NPTS=  {plain}, DT= .0050",
            "DT= .0050 SEC",
        )
        steps += (f"NPTS={plain},DT=0.005SEC", f"NPTS = {plain} , DT = 5.0E-03 sec   ")
        steps += (f"NPTS=  {plain}, DT= .5D-02 SEC", f" {plain}    0.0050    NPTS, DT")
        plain = "ACCELERATION TIME SERIES IN UNITS OF G"
        heads = (plain, "Acceleration time history; units are (g)", "The units are (g)")
        heads += (
            "ACCELERATION TIME HISTORY IN G'S",
            plain + ". FILTER POINTS: HP=0.1 Hz LP=40.0 Hz",
        )
        numbers = lines(values, "15.7E", pick(5, 5, 1)).replace("E", pick("E", "D", "e"))
        text = at2(pick(*steps), pick(*heads), numbers=numbers)
        text += pick("", "*** End Data ***\n") if "NPTS" in pick(*steps) else ""
        text = text.replace("S 0", pick("S 0", "Cañón"))
    elif name == "K-NET":
        text = (
            knet()
            .replace("N-S", pick("N-S", "E-W", "U-D"))
            .replace("200Hz", pick("200Hz", "200 Hz"))
        )
        text = text.replace(
            "980.665(gal)/10000000", pick("980.665(gal)/10000000", "98.0665(gal)/1000000")
        )
    elif name == "ESM":
        text = esm(pick("cm/s^2", "g", "m/s^2")).replace("HNE", pick("HNE", "HNZ"))
    elif name == "COSMOS":
        marks = {"reals": pick(" 100 Real-header values follow on  17 lines, Format= (6F13.6)",
                               " 100 Real-header values follow on 17 lines , Format = (6F13.6)")}  # fmt: skip
        marks |= {"unit": pick("cm/sec2 (4), ", "cm/s2 (4),", "g.     (02)"), "width": pick(15, 16)}
        step, processed = pick((STEP, -999.0), (5.0, -999.0), (0.02, 5.0))
        text = cosmos(step, processed, pick(("1: 90 deg",), ("",)), **marks)
    elif name == "CSMIP V2":
        text = csmip(names=("1: 90 Deg",), unit=pick("cm/sec2", "g", "cm/sec/sec", "g/10"))
        text = text.upper() if number % 3 else text
    elif name == "CSMIP V1":
        announced, rounding = number % 2 == 0, 1e-6 if number % 2 == 0 else 1e-5
        text = csmip(announced, ("1: 90 Deg",), pick("g/10", "g", "cm/sec2", "g"), raw=True)
    elif name == "SMC":
        rounding = 1e-4
        text = smc(pick("2 CORRECTED ACCELEROGRAM", "1 UNCORRECTED ACCELEROGRAM"), pick(90, 0, 180))
    elif name == "CSV":
        start, first = pick(0.0, 10.0, STEP), pick("", "# a comment\n", "A title\n\n")
        text = first + csv_text(pick("g", "gal", "m/s^2", "cm/s^2"), pick(",", ";", "\t"), start)
    elif name == "columns":
        unit = pick("g", "gal", "m/s^2", "cm/s2")
        two = csv_text(unit.replace("s2", "s^2"), pick(" ", ",", ";")).partition("\n")[2]
        size = {"g": 1.0, "m/s^2": G}.get(unit, 100 * G)
        text = pick("", "# a comment\n") + (two if number % 3 else lines(size * values, "18.9E", 1))
    else:
        changes = {
            "order": pick("", "<", ">"),
            "kind": pick(2, 4),
            "unit": pick("m/s^2", "g", "m/s²"),
        }
        changes |= {"spec": pick(12, 0, 1, 15)}
        if number % 4 == 3:  # times are single reals
            changes |= {"times": STEP * np.arange(COUNT), "kind": 2}
        return uff58(values * (1 if changes["unit"] == "g" else G), **changes), "", 1e-5
    return text.replace("\n", pick("\n", "\r\n", "\n")).encode("latin-1"), unit, rounding


FORMATS = (
    "PEER",
    "K-NET",
    "ESM",
    "COSMOS",
    "CSMIP V2",
    "CSMIP V1",
    "SMC",
    "CSV",
    "columns",
    "UFF 58",
)


def mutated(content: bytes, rng) -> bytes:
    """A file with bytes dropped, lines cut, a number replaced, bytes written over, or an end cut."""
    at = int(rng.integers(min(len(content), 6000)))
    rows, row = content.split(b"\n"), int(rng.integers(content.count(b"\n") + 1))
    match rng.integers(5):
        case 0:
            return content[:at] + content[at + int(rng.integers(1, 40)) :]
        case 1:
            return b"\n".join(rows[:row] + rows[row + int(rng.integers(1, 4)) :])
        case 2:
            other = rng.choice(
                [b"0", b"-1", b"1e400", b"nan", b"9" * 400, b"x", b"1_0", b"\xd9\xa3"]
            )
            number = re.compile(rb"[-+.0-9eE]+").search(content, at)
            return content[: number.start()] + other + content[number.end() :] if number else b""
        case 3:
            return content[:at] + rng.bytes(int(rng.integers(1, 20))) + content[at + 9 :]
    return content[: int(rng.integers(len(content)))]
