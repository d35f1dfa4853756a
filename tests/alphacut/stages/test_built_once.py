"""A run builds its structure once and reads its record once."""

from pathlib import Path

import pytest

from alphacut.entry import main
from alphacut.stages import pipeline, readiness
from alphacut.stages.vibration import structure

CASES = Path(__file__).parents[3] / "cases"


SMALL = {
    "tower": ["--set", "tower.storeys=3", "--set", "tower.bays=1"],
    "building": ["--set", 'envelope.fuzzy=["E"]', "--set", "envelope.duration=1 s"],
}


@pytest.mark.parametrize("name", SMALL)
def test_a_run_builds_its_structure_once_and_reads_its_record_once(name, tmp_path, monkeypatch):
    counts = {"structure": 0, "record": 0}
    real, read = structure.structure, structure.accelerogram

    def built(*given):
        counts["structure"] += 1
        return real(*given)

    def record(*given):
        counts["record"] += 1
        return read(*given)

    for module in (pipeline, readiness):
        monkeypatch.setattr(module, "structure", built)
    monkeypatch.setattr(structure, "accelerogram", record)
    asked = ["run", str(CASES / f"{name}.toml"), *SMALL[name], "--quick", "--no-figures", "--quiet"]
    assert main([*asked, "--out", str(tmp_path / "out")]) == 0
    assert counts == {"structure": 1, "record": 1}
