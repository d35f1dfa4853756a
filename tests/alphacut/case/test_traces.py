"""Digests by which a report knows whether two results are of the same case."""

import shutil
from pathlib import Path

import pytest

from alphacut.case.load import load

CASES = Path(__file__).parents[3] / "cases"


@pytest.fixture
def building(tmp_path):
    for name in ("building.toml", "building.record.csv"):
        shutil.copy(CASES / name, tmp_path)
    return tmp_path / "building.toml"


def test_another_record_under_the_same_name_is_another_frame(building):
    before = load(building, ()).traces()
    record = building.with_name("building.record.csv")
    text = record.read_text(encoding="utf-8")
    record.write_text(text.replace(text.splitlines()[-1], "", 1), encoding="utf-8")
    after = load(building, ()).traces()
    assert {name for name in before if before[name] != after[name]} == {"frame"}


def test_a_section_that_the_case_lacks_is_empty_and_a_change_of_one_is_of_it_alone(building):
    before = load(building, ()).traces("envelope", "frame", "pendulum")
    after = load(building, ["envelope.duration=3 s"]).traces("envelope", "frame", "pendulum")
    assert before["pendulum"] == after["pendulum"] == ""
    assert before["frame"] == after["frame"]
    assert before["envelope"] != after["envelope"]
