"""Mistakes in cases, one file of tables for each base case: each is told in lines with its key."""

import pytest

from tests.alphacut.case import files
from tests.alphacut.small import TABLES, refusals, table_of, written

MISTAKES = [
    (path.stem, number)
    for path in sorted(TABLES.glob("*.toml"))
    for number in range(len(table_of(path.stem)["refused"]))
]


@pytest.mark.parametrize(("name", "number"), MISTAKES)
def test_a_mistake_is_told_with_its_key_and_what_is_allowed(tmp_path, name, number):
    table = table_of(name)
    mistake = table["refused"][number]
    for writer in table.get("files", ()):
        getattr(files, writer)(tmp_path)
    lines = refusals(written(tmp_path, table["case"], **dict(mistake["changes"])))
    assert len(lines) == mistake.get("lines", 1), lines
    assert any(all(words in line for words in mistake["words"]) for line in lines), lines
    assert all(len(line) <= 1010 for line in lines)
