"""Case format and commands as pages of the documentation.

python -m alphacut.docs.case_format > docs/case-format.md
python -m alphacut.docs.case_format commands > docs/commands.md
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator

from alphacut.case.key import Key, about_of, keys_of
from alphacut.case.schema import SECTIONS, VERSION
from alphacut.case.values import allowed
from alphacut.io.units import ACCEPTED, QUANTITIES

HEAD = f"""# The case format, version {VERSION}

A case is a TOML file. Quantities are text with their unit (`"80 GPa"`), numbers without a unit may stand bare. Fuzzy numbers:
`"80 GPa"` is crisp, `"[75, 85] GPa"` an interval, `"[75, 80, 85] GPa"` a triangle (lower, modal, upper),
`"[75, 78, 82, 85] GPa"` a trapezoid, `"80 GPa ± 5 %"` and `"80 ± 4 GPa"` intervals.
`alphacut check` prints what each was read as. Files that a case names are looked for from the case's own folder.

This page is made by `python -m alphacut.docs.case_format`; the same table makes `cases/case.schema.json` for editors.
"""
DOORS = """`python -m stochastic microstructure`, `python -m rve solve`, `python -m fuzzy modulus` and `python -m frame envelope`
are the commands `microstructure`, `cell`, `modulus` and `envelope` under other names.

From a checkout write `./enter python -m alphacut` where these pages write `alphacut`; after `pip install` it is `alphacut`.
"""


def page() -> str:
    """The case format in Markdown."""
    return "\n".join([HEAD, units(), *sections()])


def units() -> str:
    """The accepted units, by quantity."""
    rows = "\n".join(
        f"| {QUANTITIES[si][0]} | {', '.join(f'`{name}`' for name in names)} |"
        for si, names in ACCEPTED.items()
    )
    words = (
        "Any other unit of the same dimension that Pint knows is taken too; `mm2` and `cm4` mean"
        " `mm^2` and `cm^4`."
    )
    return (
        f"## Units\n\nNumbers have a decimal point, never a comma. {words}\n\n| quantity | units"
        f" |\n|---|---|\n{rows}\n"
    )


def sections() -> Iterator[str]:
    """Every section with its keys."""
    for name, section in SECTIONS.items():
        title = (
            f"`[[{name}]]`" if section.repeated else f"`[{name}]`" if name else "Top of the file"
        )
        rows = "\n".join(row(key, entry) for key, entry in keys_of(section).items())
        yield (
            f"## {title}\n\n{about_of(section)}\n\n| key | meaning | allowed | if left out"
            f" |\n|---|---|---|---|\n{rows}\n"
        )


def row(name: str, key: Key) -> str:
    """One key."""
    missing = (
        "required"
        if key.required
        else "none"
        if key.default in (None, "", ())
        else f"{shown(key.default)}"
    )
    return f"| `{name}` | {key.about} | {allowed(key)} | {missing} |"


def shown(value: object) -> str:
    """A default as a user would write it."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, tuple) and len(value) == 1:
        return shown(value[0])
    if isinstance(value, tuple):
        entries = (f"{entry:g}" if isinstance(entry, float) else str(entry) for entry in value)
        return f"[{', '.join(entries)}]"
    value = getattr(value, "value", value)
    return f"{value:g}" if isinstance(value, float) else str(value)


def commands() -> str:
    """Help of every command in Markdown."""
    from alphacut.entry import COMMANDS, STATUSES, parsers

    os.environ["COLUMNS"] = "100"
    _, made = parsers("alphacut", COMMANDS)
    head = f"# Commands\n\n{DOORS}\n```text\n{STATUSES}```\n"
    parts = [
        f"## alphacut {name}\n\n```text\n{parser.format_help()}```\n"
        for name, parser in made.items()
    ]
    return "\n".join([head, *parts]) + "\nMade by `python -m alphacut.docs.case_format commands`.\n"


if __name__ == "__main__":
    print(commands() if sys.argv[1:] == ["commands"] else page(), end="")
