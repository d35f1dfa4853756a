"""The chapter on proofs names functions that exist, in few enough files to be read in a row."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
CHAPTER = (ROOT / "docs/theory/proofs.md").read_text(encoding="utf-8")
ROWS = [
    re.findall(r"`([\w./]+)`", line)
    for line in CHAPTER.splitlines()
    if line.startswith("|") and ".py`" in line
]


def is_defined(name, text):
    """Whether a file's text has the function, class, or Class.method of this name."""
    return all(re.search(rf"(def|class) {part}\b", text) for part in name.split("."))


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row[0])
def test_each_name_of_the_chapter_stands_in_its_file(row):
    files = [word for word in row if word.endswith(".py")]
    folders = [ROOT if re.match("rve/|frame/", file) else ROOT / "frame" for file in files]
    paths = [folder / file for folder, file in zip(folders, files, strict=True)]
    text = "".join(path.read_text(encoding="utf-8") for path in paths)
    words = [word for word in row if not word.endswith(".py")]
    missing = [word for word in words if not is_defined(word, text)]
    assert not missing


@pytest.mark.parametrize(("other", "most"), [("*p*", 17), ("*a*", 26)])
def test_a_proof_is_read_in_few_files(other, most):
    """All rows but those of the other range bound."""
    section = CHAPTER.split("## In which order to read\n")[1].split("\n## ")[0]
    rows = [line for line in section.splitlines() if line.startswith("|") and other not in line]
    files = set(re.findall(r"`([\w/]+\.py)`", "\n".join(rows)))
    assert 10 <= len(files) <= most
