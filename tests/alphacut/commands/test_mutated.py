"""Mutated inputs: one line for each problem, status 0 or 2, nothing left but what was asked for."""

import random

import pytest

from alphacut.entry import main
from tests.alphacut.small import CELL, FRAME, written

EACH = 100
ODD = [
    "", "nan", "-inf", "1e309", "1_0", "٣", "[[", "]", '"', "\u0000", "\u001b[2J", "x" * 10_000,
    "{a = 1}", "true", "9" * 400, "../..", "−", "1e-320", "[1, [2, [3]]]", "\ud83d",
    "[1, 2, 3]", "[[1], [2], [3]]", "[{}]", "'ellipses(1.2.3, inf)'", "'[1, 2, 3] GPa'", "'E'",
]  # fmt: skip


def mutated(text, draw):
    """A case with one to three places changed."""
    for _ in range(draw.randint(1, 3)):
        lines = text.splitlines() or [""]
        at = draw.randrange(len(lines))
        kind = draw.randrange(5)
        if kind == 0:
            lines[at] = ""
        elif kind == 1:
            lines.insert(at, draw.choice(lines))
        elif kind == 2 and "=" in lines[at]:
            lines[at] = f"{lines[at].partition('=')[0]}= {draw.choice(ODD)}"
        elif kind == 3 and lines[at]:
            place = draw.randrange(len(lines[at]))
            lines[at] = lines[at][:place] + draw.choice(ODD)[:20] + lines[at][place + 1 :]
        else:
            words = lines[at].split()
            draw.shuffle(words)
            lines[at] = " ".join(words)
        text = "\n".join(lines)
    return text


@pytest.mark.parametrize("text", [FRAME, CELL], ids=["frame", "cell"])
def test_a_mutated_case_is_read_or_refused_in_lines(tmp_path, capfd, text):
    seed = random.randrange(10**9)
    for trial in range(EACH):
        draw = random.Random(seed + trial)
        case = written(tmp_path, "")
        case.write_bytes(mutated(text, draw).encode("utf-8", "surrogatepass"))
        status = main(["check", str(case)])
        _, err = capfd.readouterr()
        label = f"seed {seed + trial}: {err[:300]}"
        assert status in (0, 2), label
        assert bool(err) == (status == 2), label
        assert all(len(line) < 1100 and line.isprintable() for line in err.splitlines()), label
        assert "Traceback" not in err, label
        assert [path.name for path in tmp_path.iterdir()] == ["case.toml"], label
