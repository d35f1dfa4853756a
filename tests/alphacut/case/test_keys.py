"""The schema of the case format comes from the models, and its page names all of them."""

import json
import tomllib
from pathlib import Path

import jsonschema
import pytest

from alphacut.case.content import Content, json_schema
from alphacut.case.parse import allowed_values, keys_of

ROOT = Path(__file__).parents[3]
CASES = sorted((ROOT / "cases").glob("*.toml"))
SCHEMA = json_schema()
VALIDATOR = jsonschema.Draft202012Validator(json.loads(SCHEMA))


def test_each_key_says_what_it_is():
    assert all(info.description for info in keys_of(Content).values())


def test_the_schema_is_that_of_the_models():
    text = (ROOT / "cases/case.schema.json").read_text(encoding="utf-8")
    assert text == SCHEMA, "python -m alphacut.case.content > cases/case.schema.json"


@pytest.mark.parametrize("path", CASES, ids=lambda path: path.stem)
def test_shipped_cases_fit_the_schema(path):
    VALIDATOR.validate(tomllib.loads(path.read_text(encoding="utf-8")))


def test_the_page_has_every_section_of_the_models():
    page = (ROOT / "docs/case-format.md").read_text(encoding="utf-8")
    for name in ("Content", *json.loads(SCHEMA)["$defs"]):
        assert f".{name}\n" in page


def test_allowed_values_of_a_key_are_told_in_words():
    keys = keys_of(Content)
    assert allowed_values(keys["mesh.layers"]).startswith("whole number from 1")
    assert "midpoint" in allowed_values(keys["envelope.integrator"])
    assert allowed_values(keys["title"]) == ""
