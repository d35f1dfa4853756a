"""Slips of the pen: values out of all proportion are refused or remarked on before a run."""

import warnings
from pathlib import Path

import pytest

from alphacut.entry import main
from alphacut.rve.cell import Phase

CASES = Path(__file__).parents[3] / "cases"


@pytest.mark.parametrize(
    ("change", "remark"),
    [
        ("cell.matrix_modulus=0.01 Pa", "cell.matrix_modulus: 10.00 mPa is unusual"),
        ("cell.matrix_poisson=-0.3", "cell.matrix_poisson: -0.3 is unusual"),
        ("cell.matrix_modulus=20 MPa", "the particle's modulus is 4e+03 times the matrix's"),
        ("cell.inclusion_modulus=[7, 8, 9] Pa", "cell.inclusion_modulus: 8.000 Pa is unusual"),
        ("radius.a1=0.9", "a1 is greater than a3"),
    ],
)
def test_an_odd_but_possible_value_is_remarked_on(change, remark, capfd):
    assert main(["check", str(CASES / "paper.toml"), "--set", change]) == 0
    assert remark in capfd.readouterr().err
    assert main(["check", str(CASES / "paper.toml")]) == 0
    assert "warning" not in capfd.readouterr().err


@pytest.mark.parametrize(
    ("title", "matrix", "inclusion", "remark"),
    [
        ("Glass beads in epoxy", "3 GPa", "70 MPa", "the case says 'Glass', of 30.00 GPa to"),
        ("Glass beads in epoxy", "70 GPa", "3 GPa", "are the phases swapped?"),
        ("Stahlfasern in Beton", "210 GPa", "30 GPa", "are the phases swapped?"),
        ("Epoxy with sand", "3 kPa", "1 MPa", "the case says 'Epoxy', of 100.0 MPa to"),
        ("Glass beads in epoxy", "3 GPa", "70 GPa", ""),
        ("Pores in a glass matrix", "70 GPa", "1 GPa", ""),
        ("Polymer drops in a glass matrix", "70 GPa", "1 GPa", ""),
        ("A steel frame of concrete", "20 GPa", "80 GPa", ""),
    ],
)
def test_moduli_unlike_the_words_and_swapped_phases_are_remarked_on(
    title, matrix, inclusion, remark, capfd
):
    changes = [f'title="{title}"', f"cell.matrix_modulus={matrix}"]
    changes.append(f"cell.inclusion_modulus={inclusion}")
    case = str(CASES / "paper.toml")
    assert main(["check", case, *(part for one in changes for part in ("--set", one))]) == 0
    told = capfd.readouterr().err
    assert remark in told
    assert remark or "the case says" not in told


def test_a_phase_in_gpa_is_warned_of():
    with pytest.warns(UserWarning, match=r"is 20 Pa, softer than any gel; .* 1 GPa is 1e9") as told:
        Phase(20, 0.3)
    assert told[0].filename == __file__
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert Phase(1e-6, 0.3).modulus < Phase(1e4, 0.3).modulus  # a void, a gel


@pytest.mark.parametrize(
    ("case", "change"),
    [
        ("paper.toml", "mesh.size=1e-9"),
        ("concrete.toml", "microstructure.seed=1" + 30 * "0"),
        ("concrete.toml", "microstructure.packing.discs=1" + 12 * "0"),
        ("concrete.toml", "microstructure.packing.packings=1" + 9 * "0"),
        ("concrete.toml", "microstructure.bootstrap=1" + 9 * "0"),
    ],
)
def test_what_no_machine_can_do_is_refused_and_nothing_is_written(case, change, tmp_path, capfd):
    out = tmp_path / "out"
    assert main(["run", str(CASES / case), "--set", change, "--out", str(out)]) == 2
    told = capfd.readouterr().err
    assert len(told.splitlines()) == 1
    assert change.partition("=")[0] in told
    assert not out.exists()
