"""The keys of [microstructure] reach the study, and a value outside a half-open range is refused."""

from pathlib import Path

import pytest

from alphacut.entry import main
from alphacut.loading import load
from alphacut.microstructure import study_of
from alphacut.problem import BadInput

CONCRETE = Path(__file__).parent.parent / "cases" / "concrete.toml"


def test_a_cell_without_a_radius_map_tells_where_it_comes_from(capfd):
    assert main(["cell", str(CONCRETE), "--set", "modulus.method=series"]) == 2
    assert "alphacut microstructure concrete.toml --out FOLDER makes it from the particles" in capfd.readouterr().err


def test_band_and_sampling_reach_the_study():
    assert study_of(load(CONCRETE)).sampling is True
    found = study_of(load(CONCRETE, ["microstructure.sampling=false", "microstructure.band=0.01"]))
    assert (found.sampling, found.band) == (False, 0.01)
    assert study_of(load(CONCRETE)).band is None
    assert study_of(load(CONCRETE, ["microstructure.band=0"])).band == 0


@pytest.mark.parametrize("value", ["1", "-0.1", "nan"])
def test_a_band_outside_0_to_1_is_refused(value):
    with pytest.raises(BadInput, match=r"microstructure\.band"):
        load(CONCRETE, [f"microstructure.band={value}"])


def test_a_flag_is_true_or_false():
    with pytest.raises(BadInput, match="neither true nor false"):
        load(CONCRETE, ["microstructure.sampling=1"])
