"""Every key says what it is, and the page of the case format has all of them."""

import re
from pathlib import Path

from alphacut.case.content import Content
from alphacut.case.parse import allowed_values, keys_of
from alphacut.case.structures import with_structures
from alphacut.frame import METHODS
from tests.alphacut.small import told_by

CASE = with_structures(Content, built=True)
ROOT = Path(__file__).parents[3]


def test_each_key_says_what_it_is():
    assert all(info.description for info in keys_of(CASE).values())


def test_the_page_has_the_keys_of_the_models():
    """What `make keys` writes into it; every key of the models is there."""
    printed = told_by("keys")
    page = (ROOT / "docs/case-format.md").read_text(encoding="utf-8")
    assert page.partition("follows -->\n\n")[2] == printed
    found = set()
    section = ""
    for line in printed.splitlines():
        if heading := re.match(r"## (?:`\[(.*)\]`)?", line):
            section = heading[1]
        elif key := re.match(r"- `(\w+)`: (.+)", line):
            found.add(f"{section}.{key[1]}" if section else key[1])
    assert found == set(keys_of(CASE))


def test_keys_of_one_section_are_printed_and_no_other():
    printed = told_by("keys", "[records]")
    assert re.findall("^## (.*)", printed, re.MULTILINE) == ["`[records]`", "`[records.spectrum]`"]
    assert "- `unit`: " in printed
    assert 'default "none".' in printed


def test_allowed_values_of_a_key_are_told_in_words():
    keys = keys_of(CASE)
    assert allowed_values(keys["mesh.layers"]).startswith("whole number from 1")
    assert "midpoint" in allowed_values(keys["envelope.integrator"])
    assert allowed_values(keys["envelope.method"]).split(", ") == list(METHODS)
    assert allowed_values(keys["title"]) == ""


def test_entries_of_tables_with_free_names_are_changed():
    change = 'matrices.parameters.Ec="1.2 ± 5 %"'
    told = told_by("check", "cases/plane-frame.toml", "--set", change)
    assert "matrices.parameters.Ec 1.14 … 1.26" in " ".join(told.split())
