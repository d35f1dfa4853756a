"""A run whose inputs are learned from measured modes: its envelopes, files and report."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
import xarray

from alphacut.entry import main

CASES = Path(__file__).parents[4] / "cases"
SHORT = ["--set", "envelope.duration=1 s", "--set", "frame.outputs=['q4']"]
FEW = ["--set", "update.alpha=[0.05, 1]", "--set", "envelope.alpha=[0.05, 1]"]


def copied(folder: Path, **changes: str) -> Path:
    """The case and its modes in a folder, with other values of some keys, or without them."""
    shutil.copy(CASES / "laboratory-frame.modes.csv", folder)
    lines = (CASES / "laboratory-frame.toml").read_text(encoding="utf-8").splitlines()
    for key, value in changes.items():
        new = [f"{key} = {value}"] if value else []
        lines = [x for line in lines for x in (new if line.startswith(f"{key} =") else [line])]
    path = folder / "frame.toml"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def learned(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("learned")
    path = copied(folder)
    assert main(["run", str(path), "--out", str(folder / "out"), "--quiet", *SHORT, *FEW]) == 0
    return folder / "out"


def test_the_envelope_rests_on_what_was_learned(learned: Path) -> None:
    with xarray.open_dataset(learned / "envelope_all.nc") as found:
        own = np.stack([found[side].isel(alpha=0, output=0) for side in ("lower", "upper")])
    with xarray.open_dataset(learned / "update.nc") as found:
        shown = found.isel(alpha=0, output=0)
        after, before = (
            np.stack([shown[side].sel(knowledge=name) for side in ("lower", "upper")])
            for name in ("posterior", "prior")
        )
        ends = found["inputs"].isel(alpha=0)
        assert (ends.sel(bound="lower", knowledge="posterior") >= 1.4).all()
        assert (ends.sel(bound="upper", knowledge="posterior") <= 3).all()
        assert (ends.sel(bound="upper", knowledge="prior") == 3).all()
    np.testing.assert_allclose(own, after, rtol=1e-12, atol=1e-15)
    share = np.ptp(after, axis=0).mean() / np.ptp(before, axis=0).mean()
    told = json.loads((learned / "summary.json").read_text(encoding="utf-8"))["update"]
    assert told["envelope_width"]["q4"] == pytest.approx(share)
    assert share < 0.5


def test_the_report_says_what_was_learned_and_draws_both(learned: Path) -> None:
    assert main(["report", str(learned), "--quiet"]) == 0
    page = (learned / "report.html").read_text(encoding="utf-8")
    assert "<h2>Learned from measured modes</h2>" in page
    assert "Every combination of the inputs is learned." in page
    assert page.count("Envelope of q4 before and after the measurement</figcaption>") == 1
    assert "mode 3 was held out" in page.lower()


def test_inputs_that_are_not_identifiable_are_told(tmp_path: Path) -> None:
    masses = '["[4, 7] kg", "[4, 7] kg", "[4, 7] kg", "[4, 7] kg"]'
    noise = {"shape_deviation": "0.01", "frequency_deviation": "0.02"}
    path = copied(tmp_path, masses=masses, learn='["c", "m"]', fuzzy='["c", "m"]', **noise)
    out = ["--out", str(tmp_path / "out"), "--quiet", "--no-figures"]
    levels = ["--set", "update.alpha=[0.01]", "--set", "envelope.alpha=[0.01]"]
    assert main(["run", str(path), *out, *SHORT, *levels]) == 0
    assert main(["report", str(tmp_path / "out"), "--quiet"]) == 0
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert "Not learned: " in page


def test_a_refuted_frame_keeps_its_priors_and_the_report_says_so(tmp_path: Path) -> None:
    path, out = copied(tmp_path, held_out=""), tmp_path / "out"
    asked = ["--out", str(out), "--quiet", "--no-figures", *SHORT, *FEW]
    assert main(["run", str(path), *asked]) == 0
    assert main(["report", str(out), "--quiet"]) == 0
    page = (out / "report.html").read_text(encoding="utf-8")
    assert "is refuted" in page
    assert "The envelopes rest on the priors." in page
    plain = tmp_path / "plain"
    plain.mkdir()
    text = path.read_text(encoding="utf-8")
    start, end = text.index("[update]"), text.index("[envelope]")
    other = plain / "frame.toml"
    other.write_text(text[:start] + text[end:], encoding="utf-8")
    asked = ["--out", str(plain / "out"), "--quiet", "--no-figures", *SHORT, *FEW[2:]]
    assert main(["run", str(other), *asked]) == 0
    with (
        xarray.open_dataset(out / "envelope_all.nc") as one,
        xarray.open_dataset(plain / "out" / "envelope_all.nc") as two,
    ):
        np.testing.assert_array_equal(one["upper"], two["upper"])


@pytest.mark.parametrize(
    ("changes", "pattern"),
    [
        ({"fuzzy": '["c1", "c2"]'}, "c3, c4 of [update] learn are missing"),
        ({"learn": '["rayleigh_mass"]'}, "update.learn"),
        ({"learn": '["k"]'}, "the frame has no input k"),
    ],
)
def test_inputs_that_make_no_sense(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], changes: dict[str, str], pattern: str
) -> None:
    out = tmp_path / "out"
    assert main(["run", str(copied(tmp_path, **changes)), "--out", str(out)]) == 2
    told = capsys.readouterr().err.strip()
    assert pattern in told
    assert len(told.splitlines()) == 1
    assert not out.exists()
