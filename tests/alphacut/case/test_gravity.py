"""P-Delta in a case: `frame.gravity` softens storeys, and `check` warns where it is left out."""

import json

import numpy as np
import pytest

from alphacut import main
from tests.alphacut.small import table_of, told_by

# weight over height of the storeys: 294.2 and 98.07 kN/m
CASE = table_of("gravity")["case"]


def written(folder, gravity):
    path = folder / "case.toml"
    path.write_text(CASE.replace("# GRAVITY", gravity), encoding="utf-8")
    return path


@pytest.mark.parametrize(
    ("text", "gravity"), [("1 g", 9.80665), ("9.81 m/s^2", 9.81), ("0 m/s^2", 0.0)]
)
def test_gravity_softens_storeys(tmp_path, text, gravity, capfd):
    """Frequencies are the roots of ω⁴ m₁ m₂ − ω² (m₁ s₂ + m₂ (s₁ + s₂)) + s₁ s₂ = 0."""
    case = written(tmp_path, f'gravity = "{text}"')
    assert main(["check", str(case), "--quiet", "--json", "-"]) == 0
    period = json.loads(capfd.readouterr().out)["period_s"]
    m1, m2, k2 = 60e3, 30e3, 5e6
    s1 = 2.03e6 - (m1 + m2) * gravity / 3
    s2 = k2 - m2 * gravity / 3
    half = (m1 * s2 + m2 * (s1 + s2)) / 2
    square = (half - (half**2 - m1 * m2 * s1 * s2) ** 0.5) / (m1 * m2)
    assert 2 * np.pi / period == pytest.approx(square**0.5, rel=1e-12)


def test_check_warns_of_a_weight_that_the_case_leaves_out(tmp_path):
    """Storey 1 has 294.2 / 1,960 = 0.15 at its softest, storey 2 has 98.07 / 5,000 = 0.02."""
    said = told_by("check", written(tmp_path, ""))
    assert "stiffness and height of storey 1 is up to 0.15: say frame.gravity" in said
    assert "storey 2" not in said
    assert "warning" not in told_by("check", written(tmp_path, 'gravity = "1 g"'))


@pytest.mark.parametrize(
    ("old", "new", "warning"),
    [
        ("2.1] MN/m", "2.1] kN/m", "the weight on storey 1 is up to 150 times its stiffness"),
        ('"3 m"', '"3000 m"', "frame.lengths has a storey of 3000 m: is its unit right"),
        ('"60 t", "30 t"', '"60 g", "30 g"', "storeys are below 1e-05: are the units"),
    ],
)
def test_check_asks_for_units_where_a_weight_is_far_from_a_storey(tmp_path, old, new, warning):
    path = written(tmp_path, "")
    text = path.read_text(encoding="utf-8").replace("5 MN/m", "[1.96, 2.1] MN/m")
    path.write_text(text.replace(old, new), encoding="utf-8")
    said = told_by("check", path)
    assert warning in said
    assert "say frame.gravity" not in said


def test_check_warns_of_a_storey_whose_unit_seems_wrong(tmp_path):
    path = written(tmp_path, 'gravity = "1 g"')
    path.write_text(path.read_text(encoding="utf-8").replace("5 MN/m", "5 GN/m"), encoding="utf-8")
    assert "frame.stiffness of two storeys differ 2,463-fold: is a unit wrong?" in (
        told_by("check", path)
    )
