"""Section [field]: storeys that are alike, in a run, its report and its bad input."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from alphacut.entry import main

CASE = """
schema = 1
title = "Three floors"
about = "Storeys that are alike"
stages = ["envelope"]
[frame]
masses = ["2 t", "1.5 t", "1 t"]
lengths = ["3 m"]
modulus = "25 GPa"
second_moment = "1e-6 m^4"
columns = ["[1.7, 2, 2.3]"]
rayleigh_mass = "0.1 1/s"
displacements = ["0 m"]
velocities = ["0.3 m/s"]
outputs = ["q3"]
[envelope]
fuzzy = ["c"]
duration = "1 s"
step = "20 ms"
"""


def run(
    folder: Path, name: str, more: str = "", *changes: str, figures: bool = False
) -> dict[str, float]:
    """The envelope's numbers of a run."""
    path, out = folder / f"{name}.toml", folder / name
    path.write_text(CASE + more, encoding="utf-8")
    asked = [word for change in changes for word in ("--set", change)]
    asked += [] if figures else ["--no-figures"]
    assert main(["run", str(path), "--out", str(out), "--quiet", *asked]) == 0
    found: dict[str, float] = json.loads((out / "summary.json").read_text())["envelopes"]["all"]
    return found


def test_the_envelope_lies_between_one_factor_and_free_storeys(tmp_path: Path) -> None:
    alike = run(tmp_path, "alike", '[field]\nof = "c"\nlength = "5 m"\n')
    free = run(tmp_path, "free")
    one = run(
        tmp_path, "one", "", "frame.columns=2", "frame.modulus=25 GPa ± 15 %", "envelope.fuzzy=E"
    )
    widths = [found["mean_width"]["q3"] for found in (one, alike, free)]  # type: ignore[index]
    assert widths[1] < 0.98 * widths[2]
    assert alike["nature"] == "guaranteed"
    long = run(tmp_path, "long", '[field]\nof = "c"\nlength = "1e6 km"\n')
    assert long["mean_width"]["q3"] == pytest.approx(widths[0], rel=1e-3)  # type: ignore[index]


def test_the_report_names_and_draws_the_field(tmp_path: Path) -> None:
    run(tmp_path, "alike", '[field]\nof = "m"\nlength = "5 m"\n[joint]\noutputs = ["q3"]\n'
        'times = ["0.5 s", "1 s"]\n[decision]\nlimits = ["q3 <= 1 m"]\n',
        "frame.masses=['[0.9, 1, 1.1] t', '[0.9, 1, 1.1] t', '[0.9, 1, 1.1] t']",
        "frame.columns=2", "envelope.fuzzy=m", figures=True)  # fmt: skip
    out = tmp_path / "alike"
    assert main(["report", str(out), "--quiet"]) == 0
    page = (out / "report.html").read_text(encoding="utf-8")
    assert "The masses of the storeys are alike but not equal, each in [900, 1100] kg" in page
    assert "Storeys that are alike: what each direction of their field does by itself" in page
    told = json.loads((out / "summary.json").read_text(encoding="utf-8"))
    assert told["decision"]["limits"]["q3"]["verdict"] == "safe"


@pytest.mark.parametrize(
    ("section", "change", "pattern"),
    [
        ('of = "l"\nlength = "5 m"', "", "there is no such choice"),
        ('of = "c"\nlength = "0 m"', "", "field.length"),
        ('of = "c"\nlength = "5 m"\nshare = 2', "", "field.share"),
        ('of = "c"\nlength = "5 m"', "frame.columns=2", "one fuzzy value"),
        ('of = "c"\nlength = "5 m"', "frame.columns=['[1.7, 2, 2.2]']", "symmetric"),
        ('of = "m"\nlength = "5 m"', "", "one fuzzy value"),
        ('of = "c"\nlength = "5 m"', "envelope.fuzzy=c1", "c1"),
    ],
)
def test_fields_that_make_no_sense(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], section: str, change: str, pattern: str
) -> None:
    path, out = tmp_path / "one.toml", tmp_path / "out"
    path.write_text(f"{CASE}[field]\n{section}\n", encoding="utf-8")
    asked = ["--set", change] if change else []
    assert main(["run", str(path), "--out", str(out), *asked]) == 2
    told = capsys.readouterr().err.strip()
    assert pattern in told
    assert len(told.splitlines()) == 1
    assert not out.exists()
