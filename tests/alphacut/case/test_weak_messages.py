"""`check` says what the model of a case leaves out."""

import pytest

from tests.alphacut.small import table_of, told_by

CASE = table_of("storeys")["case"]
YIELDS = 'yield_force = ["50 kN", "50 kN"]\noutputs'


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        (
            'outputs = ["drift1"]',
            'dampers = "1 MN s/m"\ndamper_placement = "storey"\noutputs = ["shear2"]',
            "warning: shear2: forces of the columns, without those of the dampers",
        ),
        (
            "outputs",
            f'lengths = ["3 m", "3 m"]\nhardening = ["0 %", "5 %"]\n{YIELDS}',
            "warning: storey 1 yields to 0 of its stiffness, and its weight takes up to 0.022",
        ),
    ],
)
def test_check_warns_of_what_a_model_leaves_out(tmp_path, old, new, words):
    case = tmp_path / "case.toml"
    case.write_text(CASE, encoding="utf-8")
    assert words not in " ".join(told_by("check", case).split())
    case.write_text(CASE.replace(old, new, 1), encoding="utf-8")
    assert words in " ".join(told_by("check", case).split())
