"""Figures that show what they showed are not drawn again; studies side by side are the same."""

import json
import re
from pathlib import Path

import pytest

from alphacut.figures.all import keep, kept, sweep
from alphacut.stages.material.microstructure import PICTURES, pictures

CASES = Path(__file__).parents[3] / "cases"


def test_figures_are_kept_while_all_are_there_and_their_fingerprint_is_the_same(tmp_path):
    (tmp_path / "figures").mkdir()
    names = ["figures/one.svg", "figures/two.png"]
    for name in names:
        (tmp_path / name).write_text("drawn", encoding="utf-8")
    assert kept(tmp_path, "key") is None
    keep(tmp_path, "key", names)
    assert kept(tmp_path, "key") == names
    assert kept(tmp_path, "other") is None
    (tmp_path / names[0]).write_text("", encoding="utf-8")
    assert kept(tmp_path, "key") is None
    (tmp_path / names[0]).unlink()
    assert kept(tmp_path, "key") is None


def test_pictures_of_ones_own_are_not_those_of_the_particles(tmp_path):
    (tmp_path / "figures").mkdir()
    own = ("12_beam_test.png", "03-04_site_photo.png", "radius_measured_by_me.png", "99_plot.svg")
    for name in (*own, "10_cells.svg", "10_cells.toml"):
        (tmp_path / "figures" / name).touch()
    assert [path.name for path in pictures(tmp_path)] == ["10_cells.svg"]
    drawing = (CASES.parent / "stochastic" / "figures" / "all.py").read_text(encoding="utf-8")
    assert {*re.findall(r'"([\w-]+)"(?:: lambda|\] = lambda)', drawing)} == PICTURES


def test_a_name_that_is_none_is_not_removed(tmp_path):
    names = {"figures": ["figures/joint\0.svg", "figures/joint.svg"]}
    (tmp_path / "summary.json").write_text(json.dumps(names), encoding="utf-8")
    sweep(tmp_path, [])


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"fingerprint": "key", "figures": 3}'])
def test_a_damaged_list_of_figures_draws_them_again(text, tmp_path):
    (tmp_path / "figures").mkdir()
    (tmp_path / "figures" / ".kept.json").write_text(text, encoding="utf-8")
    assert kept(tmp_path, "key") is None


def test_only_files_that_a_run_has_drawn_are_removed(tmp_path):
    """Older programs wrote down every file of the folder whose name begins with a digit."""
    (tmp_path / "figures").mkdir()
    names = ["figures/10_cells.png", "figures/envelope-all-q1.svg", "figures/fig26-frame.png"]
    own = ["figures/2024-notes.png", "figures/1.png", "frame.png", "figures/frame.csv"]
    for name in names + own:
        (tmp_path / name).write_text("some", encoding="utf-8")
    told = [*names, *own, "figures/../frame.png", str(tmp_path / "frame.png"), "figures"]
    (tmp_path / "summary.json").write_text(json.dumps({"figures": told}), encoding="utf-8")
    sweep(tmp_path, names[:1])
    left = {path.relative_to(tmp_path).as_posix() for path in tmp_path.glob("**/*.*")}
    assert left == {names[0], *own, "summary.json"}


@pytest.mark.parametrize(
    "text", ["[" * 100_000, '{"figures": {"figures/joint.svg": 1}}', '{"figures": 3}', "{"]
)
def test_a_damaged_summary_removes_nothing(text, tmp_path):
    (tmp_path / "figures").mkdir()
    (tmp_path / "figures/joint.svg").write_text("some", encoding="utf-8")
    (tmp_path / "summary.json").write_text(text, encoding="utf-8")
    sweep(tmp_path, [])
    assert (tmp_path / "figures/joint.svg").is_file()
    long = {"figures": ["figures/envelope-" + "a" * 300 + ".svg", "figures/joint.svg"]}
    (tmp_path / "summary.json").write_text(json.dumps(long), encoding="utf-8")
    sweep(tmp_path, [])
    assert not (tmp_path / "figures/joint.svg").is_file()
