"""Measured numbers of README.md and docs against what their commands print.

    ./enter python -m benchmarks.numbers             each number, what was printed, the command
    ./enter python -m benchmarks.numbers --check     runs the commands and compares (an hour)
    ./enter python -m benchmarks.numbers --check cells --keep   one command; keeps what it prints

A paragraph with measured numbers has a comment `<!-- measured: NAME … -->` that names its entries
in numbers.toml. An entry is a phrase of the paragraph with `{}` for each number, the command that
prints them, and regular expressions whose groups find them in what it prints. What the commands
printed last is kept in results/printed. Exit status 1 where a number differs by more than its last
digit, or what the entry allows.
"""

from __future__ import annotations

import argparse
import math
import re
import shlex
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from time import perf_counter
from typing import Any

ROOT = Path(__file__).parents[1]
PRINTED = Path(__file__).parent / "results" / "printed"
GENERATED = ("case-format.md", "commands.md", "library.md")
_LOW = ["one", "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten", "eleven"]
_HIGH = {"twelve": 12, "fifteen": 15, "twenty": 20, "thirty": 30, "fifty": 50, "hundred": 100}
WORDS = {word: number for number, word in enumerate(_LOW, 1)} | _HIGH
_DIGITS = r"[−+-]?\d+(?:[.,]\d+)*(?:e[+-]?\d+)?"
NUMBER = rf"(?:{_DIGITS}|{'|'.join(WORDS)})"
_COUNTED = "times|minutes?|seconds?|hours?|samples|runs|iterations|solves|analyses"
TOKEN = re.compile(
    rf"(?<![\w.^]){_DIGITS}(?![\w⁻])|\b(?:{'|'.join(WORDS)})(?: to (?:{'|'.join(WORDS)}))?"
    rf" (?:{_COUNTED})\b",
    re.IGNORECASE,
)
MARKER = re.compile(r"<!-- measured: ([\w -]+) -->")
NOTHING = re.compile(  # code, formulas, targets of links, comments, names with a number
    r"`[^`]*`|\$\$.*?\$\$|\$[^$]*\$|\]\([^)]*\)|<!--.*?-->|^ *\d+\. |^#+ \d+\. "
    r"|\b(?:eqs?\.|sections?|Figs?\.|Table|Debian|Hill's relations) \(?\d[\d.]*"
)


@dataclass(frozen=True)
class Entry:
    """Numbers of one phrase.

    Args:
        name: Name that markers give.
        text: The phrase, `{}` for each number.
        command: Name of the command that prints them.
        printed: Regular expressions with a group for each number, in the order of the text.
        scale: Factor from what is printed to what is written.
        within: Difference that is allowed, in the units of the text; the last digit if 0.
    """

    name: str
    text: str
    command: str
    printed: Sequence[str]
    scale: float = 1.0
    within: float = 0.0

    def written(self, block: str) -> re.Match[str] | None:
        """The phrase in a block, its numbers as groups."""
        parts = [re.escape(part).replace(r"\ ", " ") for part in self.text.split("{}")]
        return re.search(f"({NUMBER})".join(parts), block)

    def differences(self, block: str, output: str) -> list[str]:
        """A sentence for each number of the block that the output contradicts."""
        phrase = self.written(block)
        if phrase is None:
            return [f"{self.name}: the paragraph has no {self.text!r}"]
        found = [re.search(one, output, re.DOTALL) for one in self.printed]
        numbers = [number for one in found if one for number in one.groups()]
        if None in found or len(numbers) != len(phrase.groups()):
            return [f"{self.name}: what {self.command} prints has no {self.printed}"]
        return [
            f"{self.name}: the text says {text}, {self.command} prints {number}"
            for text, number in zip(phrase.groups(), numbers, strict=True)
            if not self._agree(text, value(number) * self.scale)
        ]

    def _agree(self, text: str, computed: float) -> bool:
        return abs(value(text) - computed) <= (self.within or 0.5001 * last_digit(text))


@dataclass(frozen=True)
class Block:
    """A paragraph, table or list item of a page, on one line."""

    page: str
    text: str

    @property
    def names(self) -> list[str]:
        """Names that its markers give."""
        return [name for found in MARKER.findall(self.text) for name in found.split()]


def value(text: str) -> float:
    """A number as it is written."""
    plain = text.replace("−", "-").replace(",", "").lower()
    return float(WORDS.get(plain, plain))


def last_digit(text: str) -> float:
    """Weight of the last digit that is written."""
    if text.lower() in WORDS:
        return 1.0
    digits, _, power = text.replace("−", "-").partition("e")
    return math.pow(10, int(power or 0) - len(digits.partition(".")[2]))


@cache
def registry() -> Mapping[str, Any]:
    """Contents of numbers.toml."""
    return tomllib.loads(Path(__file__).with_suffix(".toml").read_text(encoding="utf-8"))


def entries() -> dict[str, list[Entry]]:
    """Entries by the name that markers give."""
    return {
        name: [Entry(name, **one) for one in many] for name, many in registry()["measured"].items()
    }


def blocks() -> Iterator[Block]:
    """Paragraphs of README.md and docs, without generated pages and code."""
    for path in [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]:
        if path.name in GENERATED:
            continue
        text = re.sub(r"^ *```.*?^ *```", "", path.read_text("utf-8"), flags=re.M | re.S)
        text = re.sub(r"^ *\d+\. ", "", text, flags=re.M)
        text = re.sub(r"\n\s*\n(?=\|)", "\n", text)  # a table belongs to what introduces it
        for part in re.split(r"\n\s*\n", text):
            yield Block(str(path.relative_to(ROOT)), " ".join(part.split()))


def unclassified(block: Block) -> list[str]:
    """Numbers of a block that are neither measured nor given nor information."""
    spans = [found.span() for found in NOTHING.finditer(block.text)]
    for kind in ("given", "information"):
        for phrase in registry()[kind].get(block.page, []):
            spans += [found.span() for found in re.finditer(re.escape(phrase), block.text)]
    for entry in (entry for name in block.names for entry in entries().get(name, [])):
        if phrase := entry.written(block.text):
            spans.append(phrase.span())
    return [
        found[0]
        for found in TOKEN.finditer(block.text)
        if not any(start <= found.start() < end for start, end in spans)
    ]


def kept(command: str) -> str:
    """What a command printed when it was last kept."""
    path = PRINTED / f"{command}.txt"
    return path.read_text(encoding="utf-8") if path.is_file() else ""


def printed(command: str) -> str:
    """What a command prints now.

    Raises:
        RuntimeError: It fails.
    """
    with tempfile.TemporaryDirectory() as folder:
        words = shlex.split(registry()["command"][command].replace("{folder}", folder))
        if words[0] == "block":
            words[1:] = ["-c", python_blocks(ROOT / words[1])[int(words[2])]]
        done = subprocess.run(
            [sys.executable, *words[1:]], cwd=ROOT, capture_output=True, text=True, check=False
        )
    if done.returncode > 1 or not done.stdout:  # 1 may be a verdict on times
        raise RuntimeError(f"{command} ends with {done.returncode}: {done.stderr[-500:]}")
    return done.stdout


def python_blocks(path: Path) -> list[str]:
    """Python of a page, block by block."""
    return re.findall(r"^```python\n(.*?)^```", path.read_text("utf-8"), re.MULTILINE | re.DOTALL)


def compared(outputs: Mapping[str, str]) -> list[str]:
    """Differences between the text and what commands print."""
    return [
        f"{block.page}: {difference}"
        for block in blocks()
        for name in block.names
        for entry in entries().get(name, [])
        if entry.command in outputs
        for difference in entry.differences(block.text, outputs[entry.command])
    ]


def listing() -> Iterator[str]:
    """A line for each phrase with measured numbers, and for each that is information."""
    for block in blocks():
        for entry in (entry for name in block.names for entry in entries()[name]):
            phrase = entry.written(block.text)
            yield f"{block.page}: {phrase[0] if phrase else '?'}  [{entry.command}]"
    for page, phrases in registry()["information"].items():
        yield from (f"{page}: {phrase}  [information]" for phrase in phrases)


def main(arguments: Sequence[str] | None = None) -> int:
    """List the numbers, or run the commands and compare."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--check", nargs="*", metavar="NAME", help="run these commands, all if none is named"
    )
    parser.add_argument("--keep", action="store_true", help="keep what they print")
    options = parser.parse_args(arguments)
    if options.check is None:
        print("\n".join(listing()))
        return 0
    outputs = {}
    for command in options.check or registry()["command"]:
        started = perf_counter()
        outputs[command] = printed(command)
        seconds = perf_counter() - started
        print(f"{seconds:6.0f} s  {command}: {registry()['command'][command]}", flush=True)
        if options.keep:
            PRINTED.mkdir(parents=True, exist_ok=True)
            (PRINTED / f"{command}.txt").write_text(outputs[command], encoding="utf-8")
    differences = compared(outputs)
    print("\n".join(differences) or "all numbers agree")
    return 1 if differences else 0


if __name__ == "__main__":
    raise SystemExit(main())
