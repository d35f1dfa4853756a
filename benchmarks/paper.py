"""The paper's numbers beside those of this program.

    make run
    ./enter python -m benchmarks.paper

Reads results/paper/summary.json and benchmarks/paper.csv, which says where each number stands in
the paper. Prints a table in Markdown; exit status 1 where a difference passes a twentieth.
"""

from __future__ import annotations

import argparse
import csv
import json
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[1]
REFERENCE = Path(__file__).with_name("paper.csv")
MOST = 0.05
MINUS = "\N{MINUS SIGN}"


@dataclass(frozen=True)
class Row:
    """A number of the paper.

    Args:
        quantity: Its name.
        place: Place in the paper.
        paper: The paper's value.
        here: The value here, in the same unit.
        unit: Unit of both.
    """

    quantity: str
    place: str
    paper: float
    here: float
    unit: str

    @property
    def difference(self) -> float:
        """Relative difference of the size."""
        return abs(self.here) / abs(self.paper) - 1

    def __str__(self) -> str:
        here = f"{self.here:.6g}" if self.unit == "GPa" else f"{self.here:.4f}"
        cells = (
            self.quantity,
            self.place,
            f"{self.paper:g} {self.unit}",
            f"{here} {self.unit}",
            f"{100 * self.difference:+.2f} %",
        )
        return f"| {' | '.join(cells)} |".replace(" -", f" {MINUS}")


def rows(summary: Path) -> Iterator[Row]:
    """Every number of the paper that a summary of its case holds."""
    document = json.loads(summary.read_text(encoding="utf-8"))
    with REFERENCE.open(encoding="utf-8", newline="") as file:
        for line in csv.DictReader(file):
            value = document
            for part in line["key"].split("."):
                value = value[int(part)] if isinstance(value, list) else value[part]
            yield Row(
                line["quantity"], line["place"], float(line["paper"]), float(value), line["unit"]
            )


def main(arguments: Sequence[str] | None = None) -> int:
    """Prints the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    default = ROOT / "results" / "paper" / "summary.json"
    parser.add_argument("summary", type=Path, nargs="?", default=default)
    table = list(rows(parser.parse_args(arguments).summary))
    print("| quantity | place | paper | here | difference |\n|---|---|---|---|---|")
    print("\n".join(map(str, table)))
    return int(any(abs(row.difference) > MOST for row in table))


if __name__ == "__main__":
    sys.exit(main())
