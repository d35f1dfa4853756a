"""The paper's numbers beside those of this program."""

import json
from pathlib import Path

from benchmarks.paper import main

GOLDEN = Path(__file__).parents[1] / "scenes" / "golden.json"


def test_the_table_has_every_number_and_fails_beyond_a_twentieth(tmp_path, capsys):
    paper = json.loads(GOLDEN.read_text(encoding="utf-8"))["paper"]
    summary = tmp_path / "summary.json"
    summary.write_text(json.dumps(paper), encoding="utf-8")
    assert main([str(summary)]) == 0
    table = capsys.readouterr().out.splitlines()
    assert len(table) == 2 + 11
    assert table[2].startswith("| E, most plausible | section 4.3 | 24.7561 GPa | 24.7733 GPa |")
    paper["envelopes"]["E-5s"]["min"]["q1"] *= 1.06
    summary.write_text(json.dumps(paper), encoding="utf-8")
    assert main([str(summary)]) == 1
