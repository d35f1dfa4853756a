"""A case whose stiffness follows from exports of a program for several parameters."""

import pytest

from alphacut.case.content import load
from tests.alphacut.case.files import prepared
from tests.alphacut.small import table_of, told_by
from tests.frame.structures.test_affine import NOMINAL, beam

CASE = table_of("exports")["case"]


def test_terms_of_exports_stand_in_the_structure(tmp_path):
    model = load(prepared(tmp_path, "exports")).content.structure.model
    assert [factor for factor, _ in model.stiffness] == ["E", "k"]
    for values in (NOMINAL, {"E": 1.9e11, "k": 4.4e6}):
        total = sum(values[factor] * array for factor, array in model.stiffness)
        assert total == pytest.approx(beam(*values.values()), rel=1e-6, abs=1.0)


def test_two_exports_are_enough_where_the_case_says_that_they_are_affine(tmp_path):
    others = CASE[CASE.index('{ file = "k2.mtx"') : CASE.index("]\n\n[matrices.parameters]")]
    changes = {others: "", ", k = 3.7e6": "", 'k = "3.7e6 ± 20 %"\n': "", '["E", "k"]': '["E"]'}
    told = told_by("check", prepared(tmp_path, "exports", changes), status=2)
    assert "affine = true" in told
    changes["[matrices]"] = "[matrices]\naffine = true"
    structure = load(prepared(tmp_path, "exports", changes)).content.structure.model
    for modulus in (210e9, 500e9, 1.9e11):
        total = sum((modulus if f == "E" else 1.0) * k for f, k in structure.stiffness)
        assert total == pytest.approx(beam(modulus, 3.7e6), rel=1e-6, abs=1.0)
