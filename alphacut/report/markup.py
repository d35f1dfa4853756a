"""Tables in Markdown and in LaTeX, for reports and papers."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from alphacut.io.files import write_text
from alphacut.report.results import Table

SPECIAL = str.maketrans(
    {
        **{x: f"\\{x}" for x in "&%$#_{}"},
        "\\": r"\textbackslash{}",
        "~": r"\textasciitilde{}",
        "^": r"\textasciicircum{}",
        "−": "$-$",
        "…": r"\dots{}",
        "≤": r"$\leq$",
        "≥": r"$\geq$",
        "±": r"$\pm$",
        "²": r"$^2$",
        "µ": r"\textmu{}",
        **{x: f"${name}$" for x, name in (("α", r"\alpha"), ("ν", r"\nu"), ("ζ", r"\zeta"))},
    }
)
"""What LaTeX reads otherwise, or fonts do not have."""


def write_markup(tables: Mapping[str, Table], folder: Path) -> list[Path]:
    """Writes each table as a file of Markdown and one of LaTeX; returns the files."""
    files = list[Path]()
    for name, table in tables.items():
        if table[1]:
            for ending, text in ((".md", markdown(table)), (".tex", latex(table))):
                write_text(folder / f"{name}{ending}", text, follow_links=False)
                files.append(folder / f"{name}{ending}")
    return files


def markdown(table: Table) -> str:
    """A table in Markdown; the first column to the left, the others to the right."""
    head, rows = table
    lines = [head, ("---", *["---:"] * (len(head) - 1)), *rows]
    cells = ([cell.replace("|", "\\|") for cell in row] for row in lines)
    return "".join(f"| {' | '.join(row)} |\n" for row in cells)


def latex(table: Table) -> str:
    """A tabular environment, with rules of the package booktabs."""
    head, rows = table
    lines = [" & ".join(cell.translate(SPECIAL) for cell in row) + r" \\" for row in (head, *rows)]
    columns = "l" + "r" * (len(head) - 1)
    body = [rf"\begin{{tabular}}{{{columns}}}", r"\toprule", lines[0], r"\midrule", *lines[1:]]
    return "\n".join([*body, r"\bottomrule", r"\end{tabular}", ""])
