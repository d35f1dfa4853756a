"""Slips of the pen: values out of all proportion are refused or remarked on before a run."""

from pathlib import Path

import pytest

from alphacut.entry import main

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
