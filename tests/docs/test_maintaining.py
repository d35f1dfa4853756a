"""The page for maintainers names files, commands and names that exist; releases have one version."""

import re
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs/maintaining.md").read_text(encoding="utf-8")
TITLES = re.compile(r"^##+ ", re.MULTILINE)
SECTIONS = {text.partition("\n")[0]: text for text in TITLES.split(PAGE)[1:]}
ENDINGS = (".py", ".md", ".toml", ".cff", ".json", ".html")


def words_of(section):
    """What stands in backticks in a section."""
    return set(re.findall(r"`([^`\n]+)`", SECTIONS[section]))


def paths_of(section):
    """Files and folders that a section names, relative to the folder of the project."""
    named = {word for word in words_of(section) if re.fullmatch(r"[\w./-]+", word)}
    at_top = {"Makefile", "enter"}
    return {word for word in named if "/" in word or word in at_top or word.endswith(ENDINGS)}


def place(path):
    """Place of a path of the project, whose packages are within alphacut in the source archive."""
    return ROOT / path if (ROOT / path).exists() else ROOT / "alphacut" / path


@pytest.mark.parametrize("section", SECTIONS)
def test_each_path_exists(section):
    assert not [path for path in paths_of(section) if not place(path).exists()]


@pytest.mark.parametrize("section", SECTIONS)
def test_each_name_stands_in_a_file_that_its_section_names(section):
    files = [file for file in map(place, paths_of(section)) if file.is_file()]
    text = "\n".join(file.read_text(encoding="utf-8") for file in files)
    words = words_of(section) - paths_of(section)
    names = {word for word in words if re.fullmatch(r"\w+(\.\w+)*", word)}
    missing = [name for name in names if not re.search(rf"\b{re.escape(name)}\b", text)]
    assert not missing


def test_each_target_of_make_exists():
    commands = [word for section in SECTIONS for word in words_of(section) if word[:5] == "make "]
    targets = {word for command in commands for word in command.split()[1:] if "=" not in word}
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    assert "quick" in targets
    assert not [x for x in targets if not re.search(rf"^{x}:", makefile, re.MULTILINE)]


def test_the_version_and_its_date_are_the_same_everywhere():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    citation = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    stated = dict(re.findall(r"^(version|date-released): (.+)$", citation, re.MULTILINE))
    changes = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    entries = re.findall(r"^## \[([^\]]+)\](?: – (.+))?$", changes, re.MULTILINE)
    assert entries[0] == ("Unreleased", "")
    assert entries[1] == (project["version"], stated["date-released"])
    assert stated["version"] == project["version"]
