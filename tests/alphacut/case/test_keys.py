"""The schema and the page of the case format come from the models."""

import json
import tomllib
from pathlib import Path

import jsonschema
import pytest

from alphacut.case.keys import every_key, json_schema, page, quantity_of

ROOT = Path(__file__).parents[3]
CASES = sorted((ROOT / "cases").glob("*.toml"))


def test_keys_are_few_and_each_says_what_it_is():
    assert len(every_key()) <= 90
    assert all(info.description for info in every_key().values())


def test_the_schema_is_that_of_the_models():
    text = (ROOT / "cases/case.schema.json").read_text(encoding="utf-8")
    assert text == json_schema(), "python -m alphacut.case.keys schema > cases/case.schema.json"


@pytest.mark.parametrize("path", CASES, ids=lambda path: path.stem)
def test_shipped_cases_fit_the_schema(path):
    jsonschema.validate(tomllib.loads(path.read_text(encoding="utf-8")), json.loads(json_schema()))


def test_the_schema_refuses_an_unknown_key():
    case = {"title": "x", "stages": ["modulus"], "nothing": 1}
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate(case, json.loads(json_schema()))


def test_the_page_has_every_key():
    text = page()
    for name, info in every_key().items():
        assert f"| `{name.rpartition('.')[2]}` |" in text
        if quantity := quantity_of(info):
            assert quantity.allowed in text
