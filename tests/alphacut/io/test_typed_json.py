"""Results pass through JSON as they are, and damaged documents are refused with their path."""

import json
from dataclasses import dataclass, field
from typing import Literal, NamedTuple

import numpy as np
import pytest

from alphacut.base.arrays import Array
from alphacut.frame import LearnedInputs, Peak
from alphacut.fuzzy import Nature
from alphacut.io.files import as_json
from alphacut.io.typed_json import from_document, to_document
from tests.frame.identification.test_learned import LEARNED, REFUTED


class Ends(NamedTuple):
    lower: Array
    upper: Array


@dataclass(frozen=True, eq=False)
class Part:
    ends: Ends
    count: int = 0


@dataclass(frozen=True, eq=False)
class Other:
    words: str


@dataclass(frozen=True, eq=False)
class Whole:
    name: str
    values: Array
    nature: Nature
    parts: dict[str, Part | Other]
    pair: tuple[float, float] = (0.0, 0.0)
    texts: tuple[str, ...] = ()
    share: float | None = None
    side: Literal["", "max"] = ""
    further: dict[str, float] = field(default_factory=dict)


WHOLE = Whole(
    name="one",
    values=np.array([[1.0, np.inf], [0.1, np.nan]]),
    nature=Nature.ESTIMATED,
    parts={"a": Part(Ends(np.zeros(2), np.ones(2)), 3), "b": Other("text")},
    pair=(1.0, np.inf),
    texts=("x", "y"),
    further={"z": 0.1},
)


def document():
    return json.loads(as_json(to_document(WHOLE)))


def test_a_result_passes_through_json():
    again = from_document(Whole, document())
    assert json.loads(as_json(to_document(again))) == document()
    np.testing.assert_array_equal(again.values, [[1.0, np.nan], [0.1, np.nan]])
    assert np.isnan(again.pair[1])
    assert (again.nature, again.texts) == (Nature.ESTIMATED, ("x", "y"))
    assert again.parts["a"].ends.upper.tolist() == [1.0, 1.0]
    assert type(again.parts["b"]) is Other


@pytest.mark.parametrize(
    ("keys", "value", "path"),
    [
        (("name",), 1, "name"),
        (("values",), [[1.0], [1.0, 2.0]], "values"),
        (("values",), ["text"], "values"),
        (("nature",), "sure", "nature"),
        (("parts", "a", "ends", "lower"), "text", "parts.a"),
        (("parts", "a", "more"), 1, "parts.a"),
        (("parts", "a", "count"), True, "parts.a"),
        (("pair",), [1.0], "pair"),
        (("pair", 0), "text", "pair.0"),
        (("texts",), [1], "texts.0"),
        (("side",), "min", "side"),
        (("share",), "much", "share"),
        (("further", "z"), [], "further.z"),
        (("unknown",), 1, "unknown"),
    ],
)
def test_what_is_damaged_is_named_by_its_path(keys, value, path):
    damaged = entry = document()
    for key in keys[:-1]:
        entry = entry[key]
    entry[keys[-1]] = value
    with pytest.raises(ValueError, match=rf"^{path}"):
        from_document(Whole, damaged)


def test_what_is_missing_is_named():
    damaged = document()
    del damaged["values"]
    with pytest.raises(ValueError, match=r"^values"):
        from_document(Whole, damaged)
    with pytest.raises(ValueError, match=r"^the document"):
        from_document(Whole, [])


@pytest.mark.parametrize("answer", [LEARNED, REFUTED])
def test_a_document_of_what_was_learned_gives_the_same_answer(answer):
    document = json.loads(as_json(to_document(answer)))
    again = from_document(LearnedInputs, document)
    assert as_json(to_document(again)) == as_json(to_document(answer))
    assert again.is_refuted == answer.is_refuted
    assert str(again) == str(answer)


def test_a_peak_passes_through_json_with_its_infinite_bounds():
    """An unknown bound never excludes a peak: of "max q1" the least one may be −∞."""
    ends = [np.array([x]) for x in (2.0, np.inf, 0.0, -np.inf, -np.inf, np.inf)]
    peak = Peak(np.zeros(1), *ends, Nature.ATTAINED, side="max")
    again = from_document(Peak, json.loads(as_json(to_document(peak))))
    assert {**vars(again)} == {**vars(peak)}
