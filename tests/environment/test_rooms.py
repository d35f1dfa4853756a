"""CONTRIBUTING has one line for each room, and the checkout has each room of CONTRIBUTING."""

import re
from pathlib import Path

ROOT = Path(__file__).parents[2]
PACKAGES = ("stochastic", "rve", "fuzzy", "frame", "alphacut", "benchmarks")


def rooms() -> set[str]:
    """Folders that hold Python files, links aside."""
    files = (file for name in PACKAGES for file in (ROOT / name).rglob("*.py"))
    return {
        folder.relative_to(ROOT).as_posix()
        for folder in {file.parent for file in files}
        if not any(part.is_symlink() for part in (folder, *folder.parents))
    }


def test_every_room_has_its_line():
    text = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8").partition("## Rooms")[2]
    heads = re.findall(r"^(?:- )?((?:`[\w/]+/`(?:, )?)+): .", text, re.MULTILINE)
    listed = re.findall(r"`([\w/]+)/`", " ".join(heads))
    assert sorted(listed) == sorted(rooms())
