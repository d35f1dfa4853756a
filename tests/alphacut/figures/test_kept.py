"""Figures that show what they showed are not drawn again; studies side by side are the same."""

import json
import re
from pathlib import Path

import pytest
from matplotlib.figure import Figure

from alphacut.entry import main
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


def test_a_second_run_draws_only_what_is_missing_or_asked_for(tmp_path, capfd, monkeypatch):
    """What figures show matters nothing here."""
    monkeypatch.setattr(Figure, "savefig", lambda _, path, **__: Path(path).write_bytes(b"drawn"))
    words = ["run", str(CASES / "pendulum.toml"), "--quick", "--out", str(tmp_path)]
    words += ["--set", "envelope.duration=1 s", "--set", "envelope.fuzzy=phi_0"]

    def drawn(*more):
        """Times of all figures after a run."""
        assert main([*words, *more]) == 0, capfd.readouterr().err
        told = json.loads((tmp_path / "summary.json").read_text(encoding="utf-8"))["figures"]
        return {name: (tmp_path / name).stat().st_mtime_ns for name in told}

    first = drawn()
    assert first
    assert drawn() == first
    (tmp_path / min(first)).unlink()
    third = drawn()
    assert third.keys() == first.keys()
    assert all(third[name] > first[name] for name in first)
    anew = drawn("--fresh")
    assert all(anew[name] > third[name] for name in first)


def test_figures_of_other_settings_do_not_stay(tmp_path, capfd, monkeypatch):
    """Those that still show what the case is stay, though a run without figures names none."""
    monkeypatch.setattr(Figure, "savefig", lambda _, path, **__: Path(path).write_bytes(b"drawn"))
    words = ["run", str(CASES / "pendulum.toml"), "--quick", "--out", str(tmp_path)]
    words += ["--set", "envelope.duration=1 s", "--set"]

    def there(*more):
        """Names in the folder of figures after a run, and those of its summary."""
        assert main([*words, *more]) == 0, capfd.readouterr().err
        told = json.loads((tmp_path / "summary.json").read_text(encoding="utf-8"))["figures"]
        found = {path.name for path in (tmp_path / "figures").iterdir()} - {".kept.json"}
        return found, {Path(name).name for name in told}

    fuzzy, every = "envelope.fuzzy=phi_0", 'envelope.fuzzy=["phi_0", "l"]'
    first, told = there(fuzzy)
    assert first == told
    own = {"measure-next.svg", "2024-notes.png", "my.svg"}
    for name in own:
        (tmp_path / "figures" / name).write_text("own", encoding="utf-8")
    assert there(fuzzy, "--no-figures") == (first | own, set())
    assert there("envelope.fuzzy=l", "--no-figures") == (own, set())
    more, told = there(every)
    assert more == told | own
    assert there(fuzzy) == (first | own, first)
    kept = [(tmp_path / "figures" / name).read_text(encoding="utf-8") for name in own]
    assert kept == ["own"] * 3


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


def test_a_lost_figure_does_not_make_the_others_stale(tmp_path, capfd):
    words = ["run", str(CASES / "pendulum.toml"), "--quick", "--quiet", "--out", str(tmp_path)]
    assert main(words) == 0, capfd.readouterr().err
    first, *others = sorted((tmp_path / "figures").iterdir())
    first.unlink()
    assert main([*words, "--no-figures"]) == 0, capfd.readouterr().err
    assert sorted((tmp_path / "figures").iterdir()) == others


def test_studies_side_by_side_give_what_they_give_one_by_one(tmp_path, capfd):
    words = ["run", str(CASES / "paper.toml"), "--quick", "--set", "modulus.method=series"]
    told = []
    for workers in "12":
        folder = tmp_path / workers
        more = ["--no-figures", "--workers", workers, "--out", str(folder)]
        assert main([*words, *more]) == 0, capfd.readouterr().err
        told.append(json.loads((folder / "summary.json").read_text(encoding="utf-8")))
    one, two = told
    assert len(one["envelopes"]) == 4
    for name, study in one["envelopes"].items():
        assert {**study, "seconds": 0} == {**two["envelopes"][name], "seconds": 0}
    assert one["shares"] == two["shares"]
