"""What was learned, as a table and as rows of numbers."""

import csv
import io

import numpy as np

from alphacut.frame import LearnedInputs, Prediction
from alphacut.fuzzy.result import Ends

LEARNED = LearnedInputs(
    alpha=np.array([0.05, 1.0]),
    inputs={"k1": Ends(np.array([1.23456e6, 1.4e6]), np.array([1.65432e6, 1.5e6]))},
    narrowed={"k1": 0.21},
    units={"k1": "N/m"},
    claim="the parameter lies in its cut",
    held_out=(Prediction(3, 4.3, (4.1111, 4.5222), inside=True),),
    prior={"k1": (1e6, 3e6)},
)
REFUTED = LearnedInputs(np.array([0.05]), {}, {}, {}, "", (), {}, refuted="refuted, since …")


def test_ends_are_rounded_outwards_in_the_table():
    head, rows = LEARNED.table()
    assert head[:2] == ("input or mode", "before, measured")
    first, second = rows
    assert first == ("k1", "1.000 MN/m … 3.000 MN/m", "1.234 MN/m … 1.655 MN/m", "21% of the width")
    assert second == ("mode 3", "4.3 Hz", "4.111 Hz … 4.523 Hz", "inside")
    assert "the parameter lies in its cut" in str(LEARNED)
    assert str(REFUTED) == "refuted, since …"


def test_records_have_exact_numbers():
    parameter, mode = LEARNED.records()
    assert [parameter[x] for x in ("from", "to", "fraction of the width")] == [
        1.23456e6,
        1.65432e6,
        0.21,
    ]
    assert [mode[x] for x in ("from", "to", "inside")] == [4.1111, 4.5222, "inside"]
    assert parameter.keys() == mode.keys()
    rows = io.StringIO()
    csv.DictWriter(rows, [*parameter]).writerow(parameter)
    assert "1234560.0" in rows.getvalue()


def test_a_csv_file_has_the_rows_and_none_of_a_refuted_frame(tmp_path):
    for answer in (LEARNED, REFUTED):
        answer.to_csv(tmp_path / "learned.csv")
        with (tmp_path / "learned.csv").open(encoding="utf-8", newline="") as file:
            _, *rows = csv.reader(file)
        assert [row[0] for row in rows] == [row["input or mode"] for row in answer.records()]
        assert answer.to_dataset().sizes.get("row", 0) == len(answer.records())
