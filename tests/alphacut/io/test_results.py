"""A folder of results: nothing there is believed, followed or removed that no manifest vouches for.

Damages are drawn by a printed seed. Each ends in the numbers of the undamaged run, or in a line.
"""

import json
import os
import random
import shutil
import sqlite3

import pytest

from alphacut import main
from alphacut.io.results import Listed, ResultsFolder
from tests.alphacut.small import CELL, summary_of, told_by, written
from tests.refused import refuses


def run(case, folder, *options):
    return main(["run", str(case), "--out", str(folder), "--quiet", *options])


def numbers(folder):
    """Numbers of a summary, without what differs between two runs."""
    summary = summary_of(folder)
    parts = ("modulus", "envelopes", "shares", "figures", "microstructure")
    kept = {key: part for key, part in summary.items() if key in parts}

    def without_seconds(part):
        return {key: value for key, value in part.items() if key != "seconds"}

    return json.loads(json.dumps(kept), object_hook=without_seconds)


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    """A case, its results with figures and page, and results of the case before a change."""
    folder = tmp_path_factory.mktemp("finished")

    case = written(folder, CELL)
    older, out = folder / "older", folder / "out"
    assert run(case, older, "--set", "cell.matrix_poisson=0.2", "--no-figures") == 0
    told_by("report", older)
    assert run(case, out) == 0
    told_by("report", out)
    return case, out, older


@pytest.fixture
def copied(finished, tmp_path):
    """The case, and a copy of its results."""
    case, out, _ = finished
    return case, shutil.copytree(out, tmp_path / "out")


def flip(file, draw, _):
    content = bytearray(file.read_bytes())
    for _ in range(draw.choice([1, 1, 30])):
        content[draw.randrange(len(content))] ^= 1 << draw.randrange(8)
    file.write_bytes(content)


def cut(file, draw, _):
    content = file.read_bytes()
    file.write_bytes(content[: draw.choice([0, 1, draw.randrange(len(content))])])


def swap(file, draw, _):
    other = draw.choice([x for x in files_of(file.parent) if x != file])
    content = file.read_bytes()
    file.write_bytes(other.read_bytes())
    other.write_bytes(content)


def older_copy(file, draw, older):
    source = next((x for x in older.rglob(file.name)), None)
    if source is not None:
        shutil.copyfile(source, file)


def link(file, draw, _):
    outside = file.parents[1] / f"outside-{file.name}"
    outside.write_bytes(file.read_bytes() if draw.random() < 0.5 else b"precious")
    special = ["/dev/null", "/dev/zero", "/proc/self/mem"]
    file.unlink()
    file.symlink_to(outside if draw.random() < 0.7 else draw.choice(special))


def other_kind(file, draw, _):
    """A pipe, a database of others, a folder, or nothing in place of a file."""
    file.unlink()
    match draw.randrange(4):
        case 0:
            os.mkfifo(file)
        case 1:
            with sqlite3.connect(file) as base:
                base.execute("create table book (title text)")
            base.close()
        case 2:
            file.mkdir()
            (file / "precious").write_text("precious")


CHANGES = (flip, flip, cut, swap, older_copy)
STRANGE = (link, other_kind)


def files_of(folder):
    return [x for x in sorted(folder.rglob("*")) if x.is_file() and not x.is_symlink()]


def strange_state(folder):
    """Everything that a run has to leave as it is."""
    paths = [x for x in sorted(folder.rglob("*")) if "out" not in x.relative_to(folder).parts[:1]]
    pipes = [x for x in (folder / "out").rglob("*") if x.is_fifo() or x.name == "precious"]
    return [
        (str(x), x.lstat().st_ino, x.lstat().st_mode, x.read_bytes() if x.is_file() else b"")
        for x in (*paths, *pipes)
    ]


def check_damage(finished, place, seed, kinds, capfd):
    """Damages a copy of the results; checks what a report and a run make of it."""
    case, out, older = finished
    draw, copy = random.Random(seed), place / "out"
    shutil.copytree(out, copy)
    kind = draw.choice(kinds)
    ending = draw.choice(sorted({x.suffix for x in files_of(copy)}))
    file = draw.choice([x for x in files_of(copy) if x.suffix == ending])
    kind(file, draw, older)
    label = f"seed {seed}: {kind.__name__} of {file.relative_to(copy)}"
    before = strange_state(place)
    for words in (["report", str(copy)], ["run", str(case), "--out", str(copy)]):
        capfd.readouterr()
        status = main(words)
        _, err = capfd.readouterr()
        assert status in (0, 1, 2), label
        assert "Traceback" not in err, label
        told = [line for line in err.splitlines() if line.startswith("alphacut: ")]
        assert status == 0 or len(told) >= 1, label
        assert all(len(line) <= 320 for line in told), label
    assert strange_state(place) == before, label
    if status == 0:
        assert numbers(copy) == numbers(out), label
        listed = ResultsFolder.read(copy)
        assert not listed.is_damaged, label
        made = [name for name, entry in listed.files.items() if entry.source]
        assert made, label
        assert all(map(listed.content, made)), label
    print(status, label)


@pytest.mark.parametrize("kinds", [CHANGES, STRANGE], ids=["changes", "strange"])
def test_damaged_results_are_computed_anew_or_refused(finished, tmp_path, kinds, capfd, rng):
    seed = int(rng.integers(10**9))
    for trial in range(int(os.environ.get("TRIALS", "2"))):
        place = tmp_path / str(trial)
        place.mkdir()
        check_damage(finished, place, seed + trial, kinds, capfd)


def test_fresh_removes_what_is_listed_and_nothing_else(copied):
    case, copy = copied
    others = ["samples.db.mine", "notes.nc", "figures/photo.png", "summary.json~"]
    for name in others:
        (copy / name).write_text("precious")
    before = {x.name for x in copy.iterdir()}
    assert run(case, copy, "--fresh", "--no-figures") == 0
    assert [(copy / name).read_text() for name in others] == ["precious"] * len(others)
    assert {x.name for x in (copy / "figures").iterdir()} == {"photo.png"}
    assert {x.name for x in copy.iterdir()} == before - {"report.html", "figures.json"}


def test_what_was_changed_or_is_no_file_is_not_removed(tmp_path):
    source, out = tmp_path / "source", tmp_path / "out"
    source.mkdir()
    names = ("changed", "pipe", "same")
    for name in names:
        (source / name).write_text(name)
    folder = ResultsFolder(out)
    folder.put_files("1", source)
    (out / "changed").write_text("precious")
    (out / "pipe").unlink()
    os.mkfifo(out / "pipe")
    for name in names:
        (source / name).unlink()
    (source / "other").write_text("other")
    folder.put_files("2", source, before="1")
    assert sorted(x.name for x in out.iterdir()) == ["changed", "manifest.json", "other", "pipe"]
    folder.add_to_list({"pipe": Listed("", "3")})
    folder.clear()
    assert (out / "pipe").is_fifo()


def test_a_manifest_lists_no_file_outside(tmp_path):
    (tmp_path / "precious").write_text("precious")
    (tmp_path / "out").mkdir()
    ResultsFolder(tmp_path / "out").add_to_list({"../precious": Listed("", "1")})
    folder = ResultsFolder.read(tmp_path / "out")
    folder.clear()
    assert (tmp_path / "precious").exists()


def test_fresh_does_not_use_a_store_that_it_may_not_remove(finished, tmp_path, capfd):
    case, out, _ = finished
    copy = tmp_path / "out"
    ResultsFolder(copy).add_to_list({})
    shutil.copy(out / "samples.db", copy)
    assert run(case, copy, "--fresh") == 2
    assert "listed in no manifest" in capfd.readouterr().err


def test_a_file_that_no_manifest_lists_is_not_replaced(tmp_path):
    file = tmp_path / "out" / "figures" / "modulus.png"
    file.parent.mkdir(parents=True)
    file.write_text("precious")
    (tmp_path / "out" / "notes.json").write_text("precious")
    words = ("run", written(tmp_path, CELL), "--out", tmp_path / "out")
    assert "with other files; allowed: an empty folder" in told_by(*words, status=2)
    assert {x.name for x in (tmp_path / "out").iterdir()} == {"figures", "notes.json"}
    ResultsFolder(tmp_path / "out").add_to_list({})
    assert "no manifest lists" in told_by(*words, status=2)
    assert file.read_text() == "precious"
    with refuses("notes.json"):
        ResultsFolder(tmp_path / "out").put_text("notes.json", "text")


def test_a_manifest_of_another_program_is_left_alone(tmp_path):
    folder = tmp_path / "out"
    folder.mkdir()
    (folder / "manifest.json").write_text('{"name": "a web page"}')
    assert run(written(tmp_path, CELL), folder) == 2
    assert (folder / "manifest.json").read_text() == '{"name": "a web page"}'
    assert [x.name for x in folder.iterdir()] == ["manifest.json"]


def test_a_folder_of_figures_that_is_a_link_is_refused(copied, tmp_path):
    (case, copy), elsewhere = copied, tmp_path / "elsewhere"
    (copy / "figures").rename(elsewhere)
    (copy / "figures").symlink_to(elsewhere)
    before = {x.name: x.read_bytes() for x in elsewhere.iterdir()}
    assert run(case, copy, "--set", "title=other") == 2
    told_by("report", copy)
    assert "data:image/png" not in (copy / "report.html").read_text()
    assert run(case, copy, "--fresh", "--no-figures") == 0
    assert {x.name: x.read_bytes() for x in elsewhere.iterdir()} == before


def test_the_page_does_not_embed_or_write_through_links(copied, tmp_path):
    (_, copy), secret = copied, tmp_path / "secret.png"
    secret.write_bytes((copy / "figures" / "modulus.png").read_bytes())
    (copy / "figures" / "modulus.png").unlink()
    (copy / "figures" / "modulus.png").symlink_to(secret)
    whole = (copy / "report.html").read_text().count("data:image/png")
    (copy / "report.html").unlink()
    (copy / "report.html").symlink_to(tmp_path / "outside.html")
    (tmp_path / "outside.html").write_text("precious")
    told_by("report", copy)
    assert (copy / "report.html").read_text().count("data:image/png") == whole - 1
    assert (tmp_path / "outside.html").read_text() == "precious"


def test_json_goes_to_standard_output_by_its_device(tmp_path, capfd):
    assert main(["check", str(written(tmp_path)), "--json", "/dev/stdout", "--quiet"]) == 0
    assert "period_s" in json.loads(capfd.readouterr().out)
