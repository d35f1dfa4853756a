"""A tolerance is a contract: kept, or exit status 1 in one line, or taken on request."""

import json
import re
from pathlib import Path

import pytest
import xarray

from alphacut.case.limits import asked_tolerance
from alphacut.case.load import load
from alphacut.case.quick import quick
from alphacut.entry import main
from alphacut.io.problem import BadInput
from alphacut.stages.contract import ToleranceMissedError, keep, keep_modulus
from alphacut.stages.vibration.envelope import keep_tolerance, method_options
from alphacut.stages.vibration.envelope_task import task_of

PAPER = str(Path(__file__).parents[3] / "cases" / "paper.toml")
COARSE = ["--method", "prism", "--mesh-size", "0.5", "--layers", "3"]
SHORT = ["envelope", PAPER, "--fuzzy", "E", "--duration", "1", "--alpha", "0"]


def lines(capfd):
    """What was said on standard error."""
    return capfd.readouterr().err.splitlines()


@pytest.mark.parametrize("best_effort", [False, True])
def test_a_tolerance_is_kept_to_rounding(best_effort, capfd):
    for reached, kept in ((0.5, True), (1.0, True), (1.001, False), (1.4, False)):
        if kept or best_effort:
            keep(reached, 1.0, of="the error", cure="a cure", best_effort=best_effort)
        else:
            with pytest.raises(ToleranceMissedError, match=r"the error is up to .*; a cure, or"):
                keep(reached, 1.0, of="the error", cure="a cure", best_effort=False)
    assert len(lines(capfd)) == 2 * best_effort


def test_all_parts_of_an_error_count():
    case = load(PAPER, ["modulus.tolerance=1e-3"])
    keep_modulus(case, "series", {"space": 4e-4, "theta": 5e-4}, best_effort=False)
    with pytest.raises(ToleranceMissedError, match=r"series is up to 0\.0011, 0\.001 is asked"):
        keep_modulus(case, "series", {"space": 6e-4, "theta": 5e-4}, best_effort=False)


def test_a_named_resolution_that_misses_the_tolerance_fails_in_one_line(capfd):
    pytest.importorskip("dolfinx")
    assert main(["cell", PAPER, *COARSE, "--tolerance", "1e-6"]) == 1
    (line,) = lines(capfd)
    assert "1e-06 is asked for" in line
    assert "modulus.method=auto in its place reaches it" in line
    assert main(["cell", PAPER, *COARSE, "--tolerance", "1e-6", "--best-effort"]) == 0
    assert any(line.startswith("alphacut: warning:") for line in lines(capfd))
    assert main(["cell", PAPER, *COARSE, "--tolerance", "0.1"]) == 0


def test_a_campaign_of_a_named_resolution_is_held_to_every_sample(capfd, tmp_path):
    pytest.importorskip("dolfinx")
    coarse = ["--set", "mesh.size=0.5", "--set", "mesh.layers=3", "--alpha", "0", "--json", "-"]
    asked = ["modulus", PAPER, "--method", "prism", "--plan", "reduced", *coarse]
    out = ["--out", str(tmp_path / "modulus.nc")]
    assert main([*asked, *out, "--tolerance", "1e-6"]) == 1
    assert not list(tmp_path.iterdir())
    capfd.readouterr()
    assert main([*asked, "--tolerance", "0.1"]) == 0
    found = json.loads(capfd.readouterr().out)
    assert found["tolerance"]["asked"] == 0.1
    assert 0 < found["tolerance"]["reached"] <= 0.1


@pytest.mark.parametrize("method", ["series", "slices", "prism"])
def test_a_model_without_a_named_resolution_is_steered(method, capfd, tmp_path):
    pytest.importorskip("dolfinx")
    text = Path(PAPER).read_text(encoding="utf-8")
    start, end = text.index("[mesh]"), text.index("[modulus]")
    case = tmp_path / "case.toml"
    case.write_text(text[:start] + text[end:], encoding="utf-8")
    assert main(["cell", str(case), "--method", method, "--tolerance", "2e-2", "--json", "-"]) == 0
    found = json.loads(capfd.readouterr().out)
    assert found["tolerance"]["reached"] <= 2e-2
    assert found["method"] == method


def test_an_envelope_that_misses_its_tolerance_fails_in_one_line(capfd):
    asked = [*SHORT, "--method", "improved-graph-follower", "--tolerance", "1e-6"]
    assert main(asked) == 1
    assert "; envelope.method=auto in its place reaches it" in lines(capfd)[-1]
    assert main([*asked, "--best-effort"]) == 0


@pytest.mark.parametrize("method", ["graph-follower", "modal"])
def test_a_fixed_method_is_held_to_the_tolerance_of_the_file(method, capfd, tmp_path):
    case, text = tmp_path / "case.toml", Path(PAPER).read_text(encoding="utf-8")
    old = 'method = "graph-follower"                   # section 5.3\norder = 2 '
    assert old in text
    text = text.replace(old, f'method = "{method}"\norder = 2 ')
    text = text.replace('tolerance = "1 mm" ', 'tolerance = "1e-10 m" ')
    if method == "modal":  # which has neither
        text = re.sub(r"(?m)^(order|gain) = .*\n", "", text)
    case.write_text(text, encoding="utf-8")
    words = [*SHORT, "--set", "envelope.step=0.05 s", "--set", "envelope.integrator=midpoint"]
    words[1] = str(case)
    assert main(words) == 1
    last = lines(capfd)[-1]
    assert f"by method {method}, in m, is up to" in last
    assert "1e-10 is asked for; " in last
    assert "--set envelope.method=auto" in last
    assert main([*words, "--best-effort"]) == 0


def test_a_graph_follower_takes_a_share_of_the_tolerance_for_its_gain():
    def gain(*changes):
        task = task_of(load(PAPER, list(changes)))
        return task.tolerance, method_options(task)["tolerance"]

    assert gain() == (1e-3, pytest.approx(1e-4))
    assert gain("envelope.gain=0.5") == (1e-3, pytest.approx(5e-4))
    assert gain("envelope.tolerance=2 mm") == (2e-3, pytest.approx(2e-4))
    for changes in (["envelope.method=modal", "envelope.gain=0.5"], ["envelope.gain=2"]):
        with pytest.raises(BadInput, match=r"envelope\.gain"):
            load(PAPER, changes)


def test_numbers_of_the_quick_form_are_held_to_no_tolerance():
    assert asked_tolerance(load(PAPER)) is not None
    assert asked_tolerance(quick(load(PAPER))) is None


def test_an_error_above_a_tolerance_that_no_one_asked_for_is_warned_of(capfd):
    case = load(PAPER.replace("paper.toml", "composite.toml"))
    assert asked_tolerance(case) is None
    for reached, warned in ((1.3e-4, True), (0.9e-4, False)):
        keep_tolerance(case, xarray.Dataset(attrs={"reached": reached}), best_effort=False)
        assert ("1.3 times the one wanted" in capfd.readouterr().err) is warned


@pytest.mark.parametrize("nature", ["guaranteed", "verified by sampling"])
def test_a_certificate_is_held_to_its_gap(nature, capfd):
    case = load(PAPER, ["envelope.certify=1 um", "envelope.method=modal"])
    attrs = {"method": "modal", "gap": 2e-6, "gap_output": "q3", "nature": nature}
    found = xarray.Dataset(attrs=attrs)
    with pytest.raises(
        ToleranceMissedError, match=f"gap of the {nature} bounds of q3, in m, is up to 2e-06"
    ):
        keep_tolerance(case, found, best_effort=False)
    keep_tolerance(case, found, best_effort=True)
    assert "warning: the gap" in lines(capfd)[-1]


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["cell", PAPER, "--method", "series", "--layers", "3"], "mesh.layers = 3: method series"),
        (["cell", PAPER, "--method", "table", "--interface", "sign"], "mesh.interface = sign"),
        (["cell", PAPER, "--method", "auto", "--mesh-size", "0.3"], "mesh.size = 0.3"),
        (["cell", PAPER, "--method", "auto", "--cross-check", "series,slices"], "modulus.method"),
        (["cell", PAPER, "--cross-check", "auto,series"], "method auto takes series here"),
        (["cell", PAPER, "--method", "series", "--stiffness"], "--stiffness: this has no effect"),
        (["cell", PAPER, "--set", "envelope.step=0.1 s"], "envelope.step"),
        (["cell", PAPER, "--a2", "0.3", "--set", "radius.a2=0.2"], "changed twice"),
        (["cell", PAPER, "--best-effort"], "no tolerance can be missed here"),
        (["modulus", PAPER, "--explain", "--out", "x.nc"], "--out = x.nc: this has no effect"),
        (["modulus", PAPER, "--explain", "--workers", "2"], "--workers = 2"),
        ([*SHORT, "--workers", "2"], "--workers = 2: this has no effect"),
        ([*SHORT, "--method", "vertex", "--tolerance", "1 mm"], "envelope.tolerance"),
        ([*SHORT, "--integrator", "exact"], "--set envelope.integrator=VALUE"),
        (["run", PAPER, "--best-effort", "--quick"], "--best-effort"),
    ],
)
def test_what_has_no_effect_is_refused_by_name(words, told, capfd, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(words) == 2
    assert told in "\n".join(lines(capfd))
    assert not list(tmp_path.iterdir())


def test_levels_that_no_structure_needs_are_not_asked_for(tmp_path, capfd):
    given = ["--set", 'stages=["modulus"]', "--set", "modulus.alpha=[0.5]", "--quick"]
    given += ["--set", "modulus.method=series", "--no-figures", "--quiet", "--out", str(tmp_path)]
    assert main(["run", PAPER, *given]) == 0, capfd.readouterr().err
    found = json.loads((tmp_path / "summary.json").read_text(encoding="utf-8"))
    assert found["modulus"]["alpha"] == [0.5]
