"""A frame of two floors that asks every question, run once for all tests that look at results."""

from pathlib import Path

from alphacut.entry import main

TEXT = """
title = "Two floors <script>alert(1)</script>"
about = "A frame that asks every question, made by `a <b> command`"
stages = ["envelope"]
[frame]
modulus = "[24, 25, 26] GPa"
second_moment = "1e-6 m^4"
masses = ["[8.5, 9, 9.5] t", "7 t"]
lengths = ["2.4 m", "3 m"]
dampers = ["90 N s/m", "60 N s/m"]
damper_placement = "storey"
displacements = ["50 mm", "0 mm"]
velocities = ["0 m/s", "0.4 m/s"]
outputs = ["q2", "drift1"]
[envelope]
fuzzy = ["E", "m1"]
alpha = [0, 0.5, 1]
duration = "2 s"
step = "0.02 s"
[probability]
limits = ["q2 <= 300 mm", "drift1 <= 5 %"]
random = ["m1"]
samples = 20
[decision]
limits = ["q2 <= 300 mm", "drift1 <= 5 %"]
[tolerances]
limits = ["q2 <= 280 mm"]
most = 3
"""


def run(folder: Path, *options: str) -> Path:
    """The folder of the results of the case."""
    case = folder / "two-floors.toml"
    case.write_text(TEXT, encoding="utf-8")
    assert main(["run", str(case), "--quiet", "--out", str(folder / "out"), *options]) == 0
    return folder / "out"
