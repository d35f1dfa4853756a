"""Mistakes in cases and what `check` tells of others, one file of tables for each base case."""

import pytest

from tests.alphacut.case.files import prepared
from tests.alphacut.small import TABLES, refusals, table_of, told_by


def numbered(kind):
    """Name of the table and number of each entry of a kind."""
    every = {path.stem: table_of(path.stem).get(kind, ()) for path in sorted(TABLES.glob("*.toml"))}
    return [(name, number) for name, entries in every.items() for number in range(len(entries))]


@pytest.mark.parametrize(("name", "number"), numbered("refused"))
def test_a_mistake_is_told_with_its_key_and_what_is_allowed(tmp_path, name, number):
    if needed := table_of(name).get("needs"):
        pytest.importorskip(needed)
    mistake = table_of(name)["refused"][number]
    lines = refusals(prepared(tmp_path, name, mistake["changes"], mistake.get("texts")))
    assert len(lines) == mistake.get("lines", 1), lines
    assert any(all(words in line for words in mistake["words"]) for line in lines), lines
    assert all(len(line) <= 1010 for line in lines)


def test_a_run_tells_doubts_about_files_as_well(tmp_path):
    entry = table_of("cut_off")["told"][0]
    case = prepared(tmp_path, "cut_off", texts=entry["texts"])
    told = told_by("run", case, f"--out={tmp_path}/out", "--no-figures", "--quiet")
    assert entry["words"][0] in told


@pytest.mark.parametrize(("name", "number"), numbered("told"))
def test_what_is_doubtful_is_told_and_nothing_else(tmp_path, name, number):
    entry = table_of(name)["told"][number]
    case = prepared(tmp_path, name, entry["changes"], entry.get("texts"))
    said = " ".join(told_by("check", case).split())
    assert all(words in said for words in entry.get("words", ())), said
    assert not any(words in said for words in entry.get("never", ())), said
