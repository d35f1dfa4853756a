"""Numbers of README.md and docs: each is measured by a command, given, or told as information."""

import re
from importlib.util import find_spec

import pytest

from benchmarks import numbers
from benchmarks.numbers import ROOT, Block, Entry, blocks, compared, entries, kept, main, registry

COMMANDS = list(registry()["command"])


def test_every_number_is_measured_or_given():
    assert {block: left for block in blocks() if (left := numbers.unclassified(block))} == {}


def test_markers_and_entries_name_each_other():
    named = {name: block.page for block in blocks() for name in block.names}
    assert set(named) == set(entries())
    for kind in ("given", "information"):
        for page, phrases in registry()[kind].items():
            text = " ".join(block.text for block in blocks() if block.page == page)
            assert [phrase for phrase in phrases if phrase not in text] == []


def test_every_entry_names_a_command_that_exists():
    used = {entry.command for many in entries().values() for entry in many}
    assert used == set(COMMANDS)
    for words in registry()["command"].values():
        kind, *rest = words.split()
        if kind == "block":
            assert len(numbers.python_blocks(ROOT / rest[0])) > int(rest[1])
        else:
            assert find_spec(rest[1])


@pytest.mark.parametrize("command", COMMANDS)
def test_the_text_agrees_with_what_was_printed_last(command):
    assert compared({command: kept(command)}) == []


@pytest.mark.slow
@pytest.mark.parametrize("command", COMMANDS)
def test_the_text_agrees_with_what_is_printed_now(command):
    assert main(["--check", command]) == 0


SHORT = Entry("e", "E = {} GPa, {} % low", "cells", [r"E = ([\d.]+)", r"(\S+) low"])


@pytest.mark.parametrize(
    ("text", "wrong"),
    [
        ("E = 24.79 GPa, −1.3 % low", 0),
        ("E = 24.80 GPa, −1.3 % low", 1),
        ("E = 24.79 GPa, 1.3 % low", 1),
        ("E = 24.8 GPa, −1.34 % low", 1),
        ("E is 24.79 GPa, −1.3 % low", 1),
    ],
)
def test_a_number_that_differs_by_more_than_its_last_digit_is_told(text, wrong):
    assert len(SHORT.differences(text, "E = 24.7912 GPa, -1.33 low")) == wrong


def test_a_number_without_an_entry_is_seen():
    text = "E is 24.79 GPa (eq. 16, `--size 0.2`, $10^3$) after ten iterations of C66."
    assert numbers.unclassified(Block("README.md", text)) == ["24.79", "ten iterations"]


def test_the_list_of_benchmarks_names_programs_that_exist():
    table = (ROOT / "benchmarks" / "README.md").read_text(encoding="utf-8")
    cells = [row.split("|")[2] for row in table.splitlines() if row.startswith("|")][2:]
    named = re.findall(r"`([\w.]+)`", " ".join(cells))
    assert len(named) > 20
    assert [name for name in named if find_spec(f"benchmarks.{name}") is None] == []
