"""Cases with an interphase: solved by slices, refused by the series and where it does not fit."""

import pytest

pytest.importorskip("alphacut.rve.fenicsx")

from alphacut.entry import main
from alphacut.rve import Interphase, Phase, SlicesModel
from alphacut.stochastic import HermiteMap
from tests.alphacut.small import CELL, summary_of_run, written

RING = """interphase_thickness = [0.01, 0.02, 0.03]
interphase_modulus = "40 GPa"
interphase_poisson = 0.25
"""
CHANGES = {
    "[modulus]": f"{RING}[modulus]",
    "a1 = 0.3": "a1 = 0.6",
    "a2 = [0.1, 0.2, 0.3]": "a2 = 0",
    "a4 = 0.2": "a4 = 0",
    '"[75, 80, 85] GPa"': '"80 GPa"',
    'method = "series"': 'method = "auto"',
    "tolerance = 1e-6": "",
}


def case(folder):
    return written(folder, CELL, **CHANGES)


def test_a_fuzzy_thickness_is_solved_by_slices(tmp_path):
    cuts = summary_of_run(case(tmp_path), "--set", "mesh.size=0.6")["modulus"]
    assert not cuts["fibres"]
    ends = [cuts["E_GPa"][end][0] for end in ("lower", "upper")]
    radius, matrix, inclusion = HermiteMap(0.6, 0, 0.6, 0), Phase(20e9), Phase(80e9)
    for end, thickness in zip(ends, (0.01, 0.03), strict=True):
        ring = Interphase(thickness, Phase(40e9, 0.25))
        right = SlicesModel(mesh_size=0.6).solve(radius, matrix, [inclusion], ring)[0]
        assert end == pytest.approx(right.with_average("isotropic").modulus / 1e9, rel=1e-9)


def test_the_cell_exports_its_ring(tmp_path):
    words = ["--export", str(tmp_path / "a.msh"), "--json", str(tmp_path / "a.json"), "--quiet"]
    sizes = ["--set", "mesh.size=0.5", "--set", "mesh.layers=2"]
    assert main(["cell", str(case(tmp_path)), *words, *sizes]) == 0
    text = (tmp_path / "a.msh").read_bytes()
    assert all(f'"{name}"'.encode() in text for name in ("matrix", "inclusion", "interphase"))


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('method = "auto"', 'method = "series"', "allowed: auto, slices, prism"),
        ("[0.01, 0.02, 0.03]", "0.4", "interphase_thickness is 0.4; allowed: values below 0.3"),
        ("[0.01, 0.02, 0.03]", "1e-5", "from 0.0001"),
        ("interphase_poisson = 0.25\n", "", "cell.interphase_poisson"),
        ("[cell]", '[cell]\nparticles = "ellipses(2, 0)"', "a ring around cylinders"),
        ("[cell]", "[cell]\nmatrix_loss = 0.01\ninclusion_loss = 0", "beside a ring"),
    ],
)
def test_rings_that_do_not_fit_are_refused(tmp_path, capsys, old, new, message):
    text = case(tmp_path).read_text(encoding="utf-8")
    assert main(["check", str(written(tmp_path, text, **{old: new}))]) == 2
    assert message in capsys.readouterr().err
