"""The JSON Schema beside the cases is the one that the table of keys makes, and the shipped cases
fulfil it.
"""

import tomllib
from pathlib import Path

import pytest

from alphacut.docs.json_schema import json_schema, text

CASES = Path(__file__).parents[3] / "cases"
SHIPPED = sorted(path for path in CASES.glob("*.toml") if not path.name.endswith(".quoted.toml"))


def test_the_stored_schema_is_up_to_date():
    stored = (CASES / "case.schema.json").read_text(encoding="utf-8")
    assert stored == text(), (
        "make it anew: python -m alphacut.docs.json_schema > cases/case.schema.json"
    )


@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.stem)
def test_a_shipped_case_fulfils_the_schema(path):
    jsonschema = pytest.importorskip("jsonschema")
    case = tomllib.loads(path.read_text(encoding="utf-8"))
    jsonschema.validate(case, json_schema())
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate({**case, "nonsense": 1}, json_schema())


@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.stem)
def test_a_shipped_case_opens_with_a_paragraph_and_passes_the_check(path, capfd):
    from alphacut.entry import main

    assert main(["check", str(path)]) == 0
    assert "no problems" in capfd.readouterr().out
    assert len(tomllib.loads(path.read_text(encoding="utf-8"))["about"].split()) > 20
