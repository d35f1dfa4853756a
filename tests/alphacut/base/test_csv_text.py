"""Cells of CSV files: texts that spreadsheets would execute."""

import csv
import io

import pytest

from alphacut.base.csv_text import csv_cell, csv_text


@pytest.mark.parametrize("text", ["=1+1", "+SUM(A1)", "-2+3", "@A1", "\t=1", "- 5 mm", "-", "--1"])
def test_a_text_that_begins_as_a_formula_gets_an_apostrophe(text):
    assert csv_cell(text) == f"'{text}"


@pytest.mark.parametrize("text", ["-1", "+2.5e-3", "-.5", "1-2", "drift = 1", "", "−3"])
def test_numbers_and_other_texts_stay(text):
    assert csv_cell(text) == text


def test_what_is_read_again_is_what_was_written():
    rows = [("a,b", "-1.5"), ('say "x"', "two\nlines"), ("=A1", "1")]
    read = [*csv.reader(io.StringIO(csv_text(("what", "value"), rows)))]
    assert read == [["what", "value"], ["a,b", "-1.5"], ['say "x"', "two\nlines"], ["'=A1", "1"]]
