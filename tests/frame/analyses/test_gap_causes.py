"""Peaks with a wide gap, or without a guarantee, say why and what would help."""

import numpy as np
import pytest

from alphacut import main
from alphacut.frame import StoreyFrame
from alphacut.frame.analyses.gap_causes import influence_of_inputs, main_modes
from alphacut.frame.analyses.peaks import close_peaks, peaks, with_causes
from alphacut.frame.methods.sampled import Sampled
from alphacut.frame.propagation import envelope
from alphacut.fuzzy import Interval
from tests.alphacut.small import summary_of

YIELDING = """
title = "Two storeys that yield"
stages = ["envelope"]
[frame]
masses = ["10 t", "10 t"]
stiffness = ["4 MN/m ± 5 %", "4 MN/m"]
yield_force = ["20 kN", "20 kN"]
hardening = ["5 %", "5 %"]
damping_ratio = "4 %"
outputs = ["drift1"]
[records]
files = ["a.AT2"]
[envelope]
fuzzy = ["k1"]
alpha = [0]
method = "METHOD"
duration = "1 s"
step = "0.02 s"
"""


def frame(**changes):
    return StoreyFrame(masses=[1e4, 1e4], stiffness=[4e6, 3e6], rayleigh=(0.2, 1e-3), **changes)


@pytest.fixture
def case(tmp_path, rng):
    """A case of a record that makes both storeys yield."""
    samples = 0.4 * np.sin(2 * np.pi * 1.5 * 0.02 * np.arange(51)) + 0.01 * rng.normal(size=51)
    head = "PEER\nmade\nACCELERATION TIME SERIES IN UNITS OF G\nNPTS= 51, DT= .0200 SEC\n"
    (tmp_path / "a.AT2").write_text(head + "\n".join(f"{x:.7E}" for x in samples) + "\n")
    return tmp_path / "case.toml"


@pytest.mark.parametrize("method", ["proof", "auto"])
def test_a_proof_with_records_is_an_answer_or_an_error(case, tmp_path, capsys, method):
    case.write_text(YIELDING.replace("METHOD", method))
    out = tmp_path / "out"
    status = main(["run", str(case), "--no-figures", "--out", str(out)])
    told = capsys.readouterr()
    if method == "proof":
        assert status == 1
        assert "drift1 under a is not proved; a structure reaches" in told.err
        return
    assert status == 0
    words = " ".join(told.out.split())
    cause = summary_of(out)["records"]["peak"]["drift1"]["cause"]
    assert cause
    assert f"Warning: drift1: not guaranteed: {cause}" in words
    assert main(["report", str(out)]) == 0
    page = (out / "report.html").read_text()
    assert "Warning: drift1: not guaranteed: " in page
    assert "quasi-monte-carlo" not in cause


def test_the_input_that_moves_an_output_most_is_named_first(rng):
    wide, narrow = rng.permutation(["k1", "m2"])
    sizes = {"k1": 4e6, "m2": 1e4}
    inputs = {}
    for name, fraction in ((wide, 0.05), (narrow, 0.0005)):
        inputs[str(name)] = Interval(sizes[name] * (1 - fraction), sizes[name] * (1 + fraction))
    model = frame(q0=[0.01, 0.02])
    options = {"duration": 2.0, "step": 0.02, "alpha": [0.0], "progress": False}
    band = envelope(model, inputs, "auto", **options)
    found = influence_of_inputs(model, band, "q2")
    assert found.names == (wide, narrow)
    # The change by the whole of the wide input, by trajectories alone, is of the same size.
    ends = envelope(model, {wide: inputs[wide]}, Sampled(8), **options)
    column = ends.column("q2")
    change = (ends.upper - ends.lower)[0, :, column].max() / np.abs(ends.upper[0, :, column]).max()
    assert 0.3 * change < found.changes[0] < 3 * change


def test_a_mode_alone_is_named(rng):
    model = frame()
    stiffness = np.array([[7e6, -3e6], [-3e6, 3e6]])
    squared, shapes = np.linalg.eigh(stiffness / 1e4)
    number = int(rng.integers(2))
    moving = frame(q0=list(0.01 * shapes[:, number]))
    period = 2 * np.pi / np.sqrt(squared[number])
    assert main_modes(moving, "q2") == f"mode {number + 1} ({period:.3g} s)"
    assert model.q0 != moving.q0


@pytest.mark.parametrize("step", [0.01, 0.2])
def test_a_wide_gap_is_told_with_its_cause(step):
    model = frame(q0=[0.01, -0.01])
    inputs = {"k1": Interval(2e6, 6e6), "k2": Interval(1.5e6, 4.5e6)}
    options = {"duration": 6.0, "step": step, "alpha": [0.0], "progress": False}
    found = close_peaks(model, inputs, ["q2", "v2"], error=0.3, **options)
    for name, peak in found.items():
        gap = float(peak.gaps[0])
        assert bool(peak.warning) == (gap > 0.1), name
        if peak.between_nodes > 0.3 * gap * float(peak.far_end[0]) and peak.warning:
            assert f"time nodes {step:g} s apart" in peak.warning
            assert "smaller step" in peak.warning
        elif peak.warning:
            assert "narrow" in peak.warning


WIDE = """
title = "Dashpots and wide inputs"
stages = ["envelope"]
shares = false
[frame]
masses = ["10 t", "10 t"]
stiffness = ["4 MN/m ± 40 %", "3 MN/m ± 40 %"]
dampers = ["30 kN s/m", "0 kN s/m"]
damper_placement = "storey"
displacements = ["10 mm", "-10 mm"]
outputs = ["q2"]
[envelope]
fuzzy = ["k"]
alpha = [0]
duration = "6 s"
step = "0.2 s"
"""


def test_a_wide_gap_is_a_warning_on_terminal_and_page_and_in_the_answer(tmp_path, capsys):
    case, out = tmp_path / "case.toml", tmp_path / "out"
    case.write_text(WIDE)
    assert main(["run", str(case), "--no-figures", "--out", str(out)]) == 0
    told = " ".join(capsys.readouterr().out.split())
    peak = summary_of(out)["envelopes"]["all"]["peak"]["q2"]
    assert peak["upper"][0] > 1.1 * peak["reached"][0]
    assert peak["nature"] == "guaranteed"
    assert peak["cause"]
    assert "Warning: q2: " in told
    assert f"of its bound is above what is attained: {peak['cause']}" in told
    assert main(["report", str(out)]) == 0
    assert "of its bound is above what is attained" in (out / "report.html").read_text()


def test_estimates_that_no_proof_was_tried_for_have_no_warning():
    band = envelope(
        frame(q0=[0.01, 0.0]), {"k1": Interval(3.9e6, 4.1e6)}, Sampled(4),
        duration=0.5, step=0.05, alpha=[0.0], progress=False,
    )  # fmt: skip
    found = with_causes(peaks(band), frame(q0=[0.01, 0.0]), band)
    assert not any(peak.warning for peak in found.values())
