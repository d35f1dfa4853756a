"""Published numbers beside those of this program.

    make benchmarks
    ./enter python -m benchmarks.public NAME ...

Prints each benchmark in Markdown as soon as it is computed: the problem, its source, and a table.
Exit status 1 where a number here does not agree with the published one.
"""

from __future__ import annotations

import argparse
import importlib
import inspect
import pkgutil
import sys
from collections.abc import Iterable, Sequence

import benchmarks.public
from benchmarks.public.row import Row

NAMES = sorted(
    module.name
    for module in pkgutil.iter_modules(benchmarks.public.__path__)
    if module.name not in ("__main__", "data", "row")
)


class Benchmark:
    """A module of this folder, by its name: what it states, and its rows."""

    def __init__(self, name: str) -> None:
        self._module = importlib.import_module(f"benchmarks.public.{name}")

    def rows(self) -> list[Row]:
        """Compute every row."""
        return list(self._module.rows())

    def text(self, rows: Iterable[Row]) -> str:
        """The problem, its source and the rows in Markdown."""
        table = ["| quantity | published | here | remark |", "|---|---|---|---|"]
        table += [f"| {' | '.join(row.cells())} |" for row in rows]
        return "\n\n".join(
            (
                f"## {self._module.NAME}",
                inspect.getdoc(self._module) or "",
                f"*Source*: {self._module.SOURCE}.",
                "\n".join(table),
            )
        )


def main(arguments: Sequence[str] | None = None) -> int:
    """Prints each benchmark."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"of {', '.join(NAMES)}")
    names = parser.parse_args(arguments).names or NAMES
    if unknown := sorted(set(names) - set(NAMES)):
        parser.error(f"no benchmark {unknown[0]!r}: one of {', '.join(NAMES)}")
    do_agree = True
    for name in names:
        benchmark = Benchmark(name)
        rows = benchmark.rows()
        print(benchmark.text(rows), end="\n\n", flush=True)
        for row in rows:
            if not row.agrees:
                do_agree = False
                print(f"{name}: {row.quantity} does not agree", file=sys.stderr)
    return 0 if do_agree else 1


if __name__ == "__main__":
    sys.exit(main())
