"""Messages: one line of at most 300 characters, the cure whole; odd values name what is allowed."""

import pickle
import sys

import numpy as np
import pytest

from alphacut.frame import Accelerogram, MatrixStructure, Proof, StoreyFrame, envelope
from alphacut.fuzzy import Crisp, FailedError, General, Interval, RefusedError, propagate
from alphacut.io.files import missing
from alphacut.rve import read_image
from alphacut.stochastic import read_particles
from tests.alphacut.small import FRAME, told_by, written

CURE = "take it from the head of the file"


def test_value_and_allowed_are_cut_and_never_the_cure():
    for value, allowed in (("v" * 9000, "a number"), ("v", "a" * 9000), ("v" * 9000, "a" * 9000)):
        message = str(RefusedError("key", value, allowed, CURE, "case.toml"))
        assert len(message) <= 300
        assert message.endswith(CURE)
        assert message.startswith("case.toml: key is v")
        assert "; allowed: a" in message
    failed = FailedError("w" * 9000, CURE)
    assert len(str(failed)) <= 300
    assert str(failed).endswith(CURE)


def test_a_missing_package_is_named_with_its_cure_here(monkeypatch):
    error = ImportError("No module named 'skimage'", name="skimage.measure")
    monkeypatch.setenv("ALPHACUT_INSIDE", "1")
    assert missing(error) == f"{error}; pip install 'alphacut[particles]'"
    assert missing(ImportError("no backend")) == "no backend; install what is missing"
    monkeypatch.delenv("ALPHACUT_INSIDE")
    assert missing(error).endswith("'alphacut[particles]', or run inside ./enter")


def test_a_missing_package_is_refused_once_and_by_the_extra_that_brings_it(monkeypatch):
    monkeypatch.setitem(sys.modules, "xarray", None)
    monkeypatch.setenv("ALPHACUT_INSIDE", "1")
    bounds = propagate(lambda x: 2 * x, {"x": Interval(1.0, 2.0)})
    with pytest.raises(RefusedError) as refused:
        bounds.to_dataset()
    assert str(refused.value) == "xarray is missing; pip install 'alphacut[cases]'"
    assert missing(refused.value) == str(refused.value)
    assert str(pickle.loads(pickle.dumps(refused.value))) == str(refused.value)


def test_a_missing_package_names_the_file_that_needs_it(monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, "tifffile", None)
    with pytest.raises(RefusedError) as refused:
        read_image(tmp_path / "a.tif", spacing=[1e-6] * 3)
    cure = "pip install 'alphacut[volumes]', or save the volume as .npy"
    assert str(refused.value) == f"a.tif: tifffile is missing; {cure}"


@pytest.mark.parametrize("digits", ["9" * 6000, "0x" + "f" * 6000])
def test_an_integer_of_thousands_of_digits_is_one_line(tmp_path, digits):
    case = written(tmp_path, FRAME.replace('"10 mm"', digits))
    err = told_by("check", case, status=2)
    assert len(err.splitlines()) == 1
    assert len(err) < 320
    assert "case.toml: " in err
    assert "envelope.gain" in told_by(
        "check", written(tmp_path), "--set", f"envelope.gain={digits}", status=2
    )
    with pytest.raises(RefusedError, match="thousands of digits"):
        Crisp(int(digits, 16))


@pytest.mark.parametrize("head", ["time [s],acceleration [m/s^2]", "x [mm],y [mm],r [mm]"])
def test_a_field_of_200_kb_is_one_line(tmp_path, head):
    (tmp_path / "a.csv").write_text(f"{head}\n0,0,1\n0.1,{'1' * 200_000},1\n")
    text = FRAME.replace('displacements = "10 mm"', 'accelerogram = "a.csv"')
    if "r [mm]" in head:
        with pytest.raises(RefusedError, match=r"a.csv, row 3.* 200,006 letters"):
            read_particles(tmp_path / "a.csv", size=(0.1, 0.1))
        return
    assert "letters" in told_by("check", written(tmp_path, text), status=2)


FLOOR = StoreyFrame((1e4,), (3.0,), 2e10, (1e-5,), dampers=(50.0,), q0=(0.01,))
TIMES = {"duration": 0.1, "step": 0.02, "progress": False}
MISUSES = {
    "a class as method": lambda: envelope(FLOOR, {"E": Crisp(2e10)}, method=Proof, **TIMES),
    "a number as method": lambda: envelope(FLOOR, {"E": Crisp(2e10)}, method=3, **TIMES),
    "a record of text": lambda: Accelerogram(0.01, ["a", "b"]),
    "ground of matrices that is no record": lambda: MatrixStructure(
        {"k": 1.0}, [(1.0, np.eye(1))], [("k", np.eye(1))], {"x": np.ones(1)}, ground=[1.0, 2.0]
    ),
    "no output": lambda: MatrixStructure({"k": 1.0}, [(1.0, np.eye(1))], [("k", np.eye(1))], {}),
    "a class as method of propagate": lambda: propagate(abs, {"x": Crisp(1.0)}, General),
}


@pytest.mark.parametrize("misuse", MISUSES.values(), ids=MISUSES)
def test_a_misuse_in_python_is_refused_by_name(misuse):
    with pytest.raises(RefusedError) as refused:
        misuse()
    assert refused.value.key
    assert refused.value.allowed
    assert len(str(refused.value)) <= 300
