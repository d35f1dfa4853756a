"""What `check` passes `run` takes, and what is mutated is refused in lines: by printed seeds."""

import os
import random
import re

import numpy as np
import pytest

from alphacut import main
from tests.alphacut.small import CELL, FRAME, told_by, written

QUESTIONS = """
[tolerances]
limits = ["q1 <= 20 mm"]
[decision]
limits = ["q1 <= 12 mm"]
[probability]
limits = ["q1 <= 12 mm"]
random = ["E"]
samples = 10
"""
BOTH = CELL.replace('["modulus"]', '["modulus", "envelope"]') + re.sub(
    r'modulus = "\[22.*\n', "", "[frame]" + FRAME.partition("[frame]")[2]
)
IDENTIFY = FRAME.replace("alpha = [0, 0.5, 1]", "alpha = [0.2, 1]") + (
    '[identify]\nmeasured = "modes.csv"\nlearn = ["E"]\n'
)
IMAGE = """
title = "Image"
stages = ["modulus"]
[cell]
image = "image.npy"
pixel = "1 µm"
threshold = [100]
modulus = ["20 GPa", "[75, 80, 85] GPa"]
poisson = 0.3
[modulus]
alpha = [0, 1]
"""
PARTICLES = """
title = "Particles"
stages = ["microstructure"]
[microstructure]
seed = 1
[microstructure.circles]
file = "circles.csv"
size = ["10 mm", "10 mm"]
"""
SHORT = '"0.6 s"'  # motions
TEXTS = {
    "frame": FRAME.replace('"2 s"', SHORT) + QUESTIONS,
    "both": BOTH.replace('"2 s"', SHORT),
    "identify": IDENTIFY,
    "image": IMAGE,
    "circles": PARTICLES,
}
CHANGES = {
    "frame": [
        "tolerances.most=1.5", "tolerances.most=20", "envelope.method=proof",
        "envelope.method=search", "envelope.method=quasi-monte-carlo", "envelope.alpha=[0.5, 1]",
        "envelope.alpha=[1]", "envelope.integrator=midpoint",
        "envelope.tolerance=0.1 N", "envelope.tolerance=1 %", 'frame.outputs=["q1", "a1"]',
        'frame.outputs=["base_shear"]', 'frame.outputs=["q1", "q1"]', "frame.damping_ratio=[2, 3, 4] %",
        'decision.limits=["a1 <= 1 m/s^2"]', 'probability.random=["E", "m1"]', "frame.masses=[0.1, 9, 9] t",
        "envelope.step=0.03 s", "frame.accelerogram=record.csv", 'probability.random=["d"]',
        "frame.modulus=24 GPa", "frame.displacements=0 mm",
    ],
    "both": [
        "modulus.alpha=[1]", "modulus.alpha=[0.5, 1]", "cell.inclusion_modulus=80 GPa",
        "cell.particles=spheres", "modulus.method=auto", "radius.a2=0.2", "modulus.plan=signed",
        "modulus.plan=general", 'envelope.fuzzy=["m"]', "frame.lengths=40 m",
    ],
    "identify": [
        'identify.learn=["m"]', "identify.held_out=[1]", "identify.held_out=[4]",
        "envelope.alpha=[0, 1]", "identify.shape_deviation=0.02", 'identify.learn=["E", "m"]',
        "identify.frequency_deviation=0.03", 'envelope.fuzzy=["m"]', 'identify.learn=["l"]',
    ],
    "image": [
        "cell.threshold=[300]", "cell.threshold=[130]",
        "modulus.alpha=[1]", 'cell.pixel=["1 µm", "2 µm"]', "cell.remove=noise",
    ],
    "circles": [
        "microstructure.limits=[0.1, 0.9]", 'microstructure.circles.size=["1 mm", "1 mm"]',
        'microstructure.circles.size=["20 mm", "20 mm"]', "microstructure.seed=2",
    ],
}  # fmt: skip


@pytest.fixture
def place(tmp_path):
    """A folder with the files that the cases name."""
    rng = np.random.default_rng(3)
    (tmp_path / "modes.csv").write_text("mode,frequency [Hz]\n1,0.73\n1,0.74\n1,0.735\n")
    (tmp_path / "record.csv").write_text(
        "time [s],acceleration [m/s^2]\n" + "".join(f"{0.1 * k:g},{k % 3}\n" for k in range(60))
    )
    y, x = np.mgrid[:24, :24]
    inside = (x - 12) ** 2 + (y - 12) ** 2 < 49
    np.save(tmp_path / "image.npy", np.where(inside, 150.0, 50.0) + rng.normal(0, 2, (24, 24)))
    places = [(a, b) for a in range(10) for b in range(10)]
    rows = (f"{a + 0.5},{b + 0.5},{0.2 + 0.02 * ((3 * a + b) % 8)}\n" for a, b in places)
    (tmp_path / "circles.csv").write_text("x [mm],y [mm],r [mm]\n" + "".join(rows))
    return tmp_path


def test_what_check_passes_run_takes(place, capfd, rng):
    seed = int(rng.integers(10**9))
    for trial in range(seed, seed + int(os.environ.get("TRIALS", "1"))):
        draw = random.Random(trial)
        kind = draw.choice(sorted(TEXTS))
        changes = draw.sample(CHANGES[kind], draw.choice([1, 1, 2]))
        words = [str(written(place, TEXTS[kind])), *(f"--set={change}" for change in changes)]
        if main(["check", *words, "--quiet"]) == 0:
            capfd.readouterr()
            ran = main(["run", *words, "--quiet", "--no-figures", f"--out={place}/{trial}"])
            assert ran != 2, (trial, kind, changes, capfd.readouterr().err)


def test_a_record_longer_than_the_motion_is_said(place):
    words = [str(written(place, FRAME)), "--set", "frame.accelerogram=record.csv"]
    sentence = "the record lasts 5.9 s, and the motion is computed for 2 s"
    assert sentence in told_by("check", *words)
    assert sentence in told_by("run", *words, "--no-figures", "--quiet", f"--out={place}/out")


EACH = 60
ODD = [
    "", "nan", "-inf", "1e309", "1_0", "٣", "[[", "]", '"', "\u0000", "\u001b[2J", "x" * 10_000,
    "{a = 1}", "true", "9" * 400, "../..", "−", "1e-320", "[1, [2, [3]]]", "\ud83d",
    "[1, 2, 3]", "[[1], [2], [3]]", "[{}]", "'ellipses(1.2.3, inf)'", "'[1, 2, 3] GPa'", "'E'",
]  # fmt: skip


def mutated(text, draw):
    """A case with one to three places changed."""
    for _ in range(draw.randint(1, 3)):
        lines = text.splitlines() or [""]
        at = draw.randrange(len(lines))
        kind = draw.randrange(5)
        if kind == 0:
            lines[at] = ""
        elif kind == 1:
            lines.insert(at, draw.choice(lines))
        elif kind == 2 and "=" in lines[at]:
            lines[at] = f"{lines[at].partition('=')[0]}= {draw.choice(ODD)}"
        elif kind == 3 and lines[at]:
            place = draw.randrange(len(lines[at]))
            lines[at] = lines[at][:place] + draw.choice(ODD)[:20] + lines[at][place + 1 :]
        else:
            words = lines[at].split()
            draw.shuffle(words)
            lines[at] = " ".join(words)
        text = "\n".join(lines)
    return text


@pytest.mark.parametrize("text", [FRAME, CELL], ids=["frame", "cell"])
def test_a_mutated_case_is_read_or_refused_in_lines(tmp_path, capfd, text, rng):
    seed = int(rng.integers(10**9))
    for trial in range(EACH):
        draw = random.Random(seed + trial)
        case = written(tmp_path, "")
        case.write_bytes(mutated(text, draw).encode("utf-8", "surrogatepass"))
        status = main(["check", str(case), "--quiet"])
        _, err = capfd.readouterr()
        label = f"seed {seed + trial}: {err[:300]}"
        assert status in (0, 2), label
        refusals = [line for line in err.splitlines() if "warning: " not in line]
        assert bool(refusals) == (status == 2), label
        assert all(len(line) < 1100 and line.isprintable() for line in err.splitlines()), label
        assert "Traceback" not in err, label
        assert [path.name for path in tmp_path.iterdir()] == ["case.toml"], label
