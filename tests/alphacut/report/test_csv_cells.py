"""CSV files of results: exact numbers, plain signs, and no formulas for spreadsheets."""

import pandas as pd

from alphacut.report.tables import write_csv


def test_numbers_are_exact_and_texts_are_no_formulas(tmp_path):
    frame = pd.DataFrame(
        {"what": ["=1+1", "−3 … 4", "max a,b"], "value": [-1.5, 0.1 + 0.2, float("nan")]}
    )
    (path,) = write_csv({"answers": frame}, tmp_path)
    lines = path.read_text(encoding="utf-8").splitlines()
    assert lines[1:] == ["'=1+1,-1.5", "'-3 … 4,0.30000000000000004", '"max a,b",']
