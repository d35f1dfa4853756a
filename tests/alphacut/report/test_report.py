"""The report is one file that asks for nothing else, and its α slider moves the drawn band."""

import html
import json
import re
import shutil
import signal
import subprocess
from pathlib import Path

import pytest
from markupsafe import Markup

from alphacut.entry import main
from alphacut.io.netcdf import own_files
from alphacut.io.problem import BadInput
from alphacut.io.provenance import door
from alphacut.report.envelopes import peaks
from alphacut.report.key_results import key_results
from alphacut.report.key_results import peaks as key_peaks
from alphacut.report.sections import shares
from alphacut.report.tables import sentence
from alphacut.stages.vibration import decision
from tests.alphacut.one_floor import one_floor

PAPER = Path(__file__).parents[3] / "cases" / "paper.toml"
CHROMIUM = (
    shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
)
PROBE = """
<script>
const seen = { errors: [], resources: 0, before: "", after: "", zoomed: "", tick: "" };
window.addEventListener("error", (event) => seen.errors.push(String(event.message)));
window.addEventListener("securitypolicyviolation", (event) => seen.errors.push(event.blockedURI));
window.addEventListener("load", () => {
  const band = () => document.getElementById("band").getAttribute("d");
  const slider = document.getElementById("alpha");
  slider.value = 0; slider.dispatchEvent(new Event("input")); seen.before = band();
  slider.value = 0.5; slider.dispatchEvent(new Event("input")); seen.after = band();
  const plot = document.getElementById("plot");
  const box = plot.getBoundingClientRect();
  plot.dispatchEvent(new WheelEvent("wheel", { deltaY: -1, clientX: box.left + box.width / 2, clientY: box.top + 50, cancelable: true }));
  seen.zoomed = band();
  const term = document.querySelector("a.term");
  term.focus();
  seen.tip = getComputedStyle(term, "::after").content;
  seen.term = document.activeElement === term && document.getElementById(term.hash.slice(1)) !== null;
  seen.wide = document.documentElement.scrollWidth - window.innerWidth;
  seen.resources = performance.getEntriesByType("resource").length;
  document.body.dataset.seen = JSON.stringify(seen);
});
</script>
"""


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    folder = tmp_path_factory.mktemp("results")
    arguments = [
        "run",
        str(PAPER),
        "--quick",
        "--set",
        "modulus.method=series",
        "--out",
        str(folder),
        "--quiet",
    ]
    assert main(arguments) == 0
    assert main(["report", str(folder), "--quiet"]) == 0
    return folder


def test_the_page_asks_for_nothing_outside(results):
    page = (results / "report.html").read_text(encoding="utf-8")
    links = re.findall(r'(?:src|href)="([^"]*)"', page)
    assert all(link.startswith(("data:", "#")) for link in links), [link[:60] for link in links]
    assert "default-src 'none'" in page


def test_the_page_holds_what_a_colleague_asks_for(results):
    page = (results / "report.html").read_text(encoding="utf-8")
    for title in (
        "Fuzzy modulus",
        "Envelopes",
        "Paper and here",
        "Methods and cost",
        "The case",
        "Differences from the paper",
        "Versions and citation",
    ):
        assert f"<h2>{title}</h2>" in page
    summary = json.loads((results / "summary.json").read_text(encoding="utf-8"))
    assert f"{summary['modulus']['modal_GPa']:.4f} GPa" in page


def test_key_results_come_first_and_each_term_is_explained_once(results):
    page = (results / "report.html").read_text(encoding="utf-8")
    assert re.findall(r"<h2>([^<]*)</h2>", page)[0] == "Key results"
    linked = re.findall(r'class="term" href="#([^"]*)"', page)
    assert {"term-inner", "term-nature", "term-support"} <= set(linked)
    assert len(set(linked)) == len(linked)
    assert all(f'<dt id="{name}"' in page for name in linked)
    assert "<th></th>" not in page


def test_terms_are_left_alone_in_code_drawings_headings_and_attributes():
    from alphacut.report.glossary import explained

    kept = '<h2>Nature</h2><pre>inner <b>x</b></pre><svg><text>inner</text></svg><p title="inner">'
    found = explained(Markup(kept + "an inner, INNER bound; inner-most</p>"))
    assert found.startswith(kept + 'an <a class="term" href="#term-inner" data-meaning="Of bounds')
    assert found.endswith(">inner</a>, INNER bound; inner-most</p>")


def test_the_report_explains_its_terms_as_the_documentation_does():
    from alphacut.report.glossary import TERMS

    docs = " ".join((PAPER.parents[1] / "docs" / "glossary.md").read_text(encoding="utf-8").split())
    assert [name for name, text in TERMS.items() if f"{name} {text}" not in docs] == []


@pytest.mark.skipif(CHROMIUM is None, reason="no Chromium on this machine")
@pytest.mark.parametrize("width", [400, 1280])
def test_the_slider_moves_the_band_in_a_browser(results, tmp_path, width):
    page = (results / "report.html").read_text(encoding="utf-8")
    probed = tmp_path / "probed.html"
    probed.write_text(page.replace("<style>", PROBE + "<style>", 1), encoding="utf-8")
    flags = [
        "--headless",
        "--no-sandbox",
        "--disable-gpu",
        "--disable-dev-shm-usage",
        f"--window-size={width},900",
        f"--user-data-dir={tmp_path / 'profile'}",
    ]
    command = [CHROMIUM, *flags, "--virtual-time-budget=5000", "--dump-dom", probed.as_uri()]
    dom = subprocess.run(command, capture_output=True, text=True, timeout=120, check=True).stdout
    seen = json.loads(html.unescape(re.search(r'data-seen="([^"]*)"', dom)[1]))
    assert seen["errors"] == []
    assert seen["resources"] == 0
    assert seen["wide"] <= 0
    assert seen["term"]
    assert len(seen["tip"]) > 20
    assert seen["before"].startswith("M")
    assert len({seen["before"], seen["after"], seen["zoomed"]}) == 3


def test_a_folder_without_results_is_named(tmp_path, capfd):
    assert main(["report", str(tmp_path)]) == 2
    assert "summary.json is missing" in capfd.readouterr().err
    assert not list(tmp_path.iterdir())
    (tmp_path / "envelope_all.nc").write_text("some", encoding="utf-8")
    assert main(["report", str(tmp_path)]) == 2
    (line,) = capfd.readouterr().err.splitlines()
    assert "the run here has not ended: summary.json is missing, and there are envelope_all" in line
    assert line.endswith(f"{door()} run CASE.toml --out {tmp_path}")


def test_results_of_two_runs_are_refused(tmp_path, capfd, monkeypatch):
    """A run of another case in the same folder, stopped once it has written its envelopes."""
    text = one_floor(fuzzy='["m1"]', duration=1, step=0.01, mass="1 t ± 5 %", moved="10 mm")
    case, out = tmp_path / "case.toml", tmp_path / "out"
    case.write_text(text + '[decision]\nlimits = ["q1 <= 1 m"]\n', encoding="utf-8")
    run = ["run", str(case), "--no-figures", "--quiet", "--out", str(out)]
    report = ["report", str(out), "--csv", str(tmp_path / "csv")]
    assert main(run) == 0
    with monkeypatch.context() as stopped:
        stopped.setattr(decision, "decision", lambda *_, **__: signal.raise_signal(signal.SIGINT))
        assert main([*run, "--set", "frame.masses=2 t ± 5 %"]) == 130
    capfd.readouterr()
    assert main(report) == 2
    (line,) = capfd.readouterr().err.splitlines()
    what = "not of the run that wrote summary.json, but of another run or command: envelope_all.nc"
    assert what in line
    assert line.endswith(f"{door()} run CASE.toml --out {out}")
    assert not (out / "report.html").exists()
    assert not (tmp_path / "csv").exists()
    assert main(run) == 0
    assert main(report) == 0
    summary = json.loads((out / "summary.json").read_text(encoding="utf-8"))
    assert sorted(summary["fingerprints"]) == ["decision.nc", "envelope_all.nc"]


@pytest.mark.parametrize("text", ['{"share": 0.4}', "{"])
def test_particles_of_another_run_are_not_shown_beside_a_summary(text, tmp_path):
    """A run that is stopped while it draws has written its numbers, and no NetCDF file."""
    summary = {"microstructure": {"share": 0.2}}
    own_files(summary, tmp_path)
    (tmp_path / "microstructure.json").write_text('{"share": 0.2}', encoding="utf-8")
    own_files(summary, tmp_path)
    (tmp_path / "microstructure.json").write_text(text, encoding="utf-8")
    with pytest.raises(BadInput, match=r"of another run or command: microstructure.json"):
        own_files(summary, tmp_path)


def test_a_certificate_is_told_with_its_gap_and_what_it_rests_on():
    from alphacut.report.sections import methods

    study = {
        "method": "modal",
        "nature": "guaranteed",
        "trajectories": 52,
        "seconds": 3.0,
        "gap": 1e-6,
        "proof": "bounded by <energy>",
    }
    study |= {"gap_output": "q2"}
    page = methods({"envelopes": {"E": study}})
    assert "envelope E are proved at every node, and no wider than 1.0 µm of q2" in page
    assert "what is attained. Bounded by &lt;energy&gt;." in page
    assert "Guaranteed: proved to hold" in page
    sampled = study | {"nature": "verified by sampling"}
    assert "E are verified by sampling at every node" in methods({"envelopes": {"E": sampled}})
    assert "proved at" not in methods(
        {"envelopes": {"E": {k: v for k, v in study.items() if k not in ("gap", "proof")}}}
    )


def small_building(folder):
    """The building's case with one fuzzy input and one second, in a folder of its own."""
    cases = Path(__file__).parents[3] / "cases"
    folder.mkdir()
    shutil.copy(cases / "building.record.csv", folder)
    text = (cases / "building.toml").read_text(encoding="utf-8")
    for old, new in (('"m8", "l1", "rayleigh_mass", "rayleigh_stiffness"', ""), ("20 s", "1 s")):
        assert text.count(old) == 1
        text = text.replace(old, new)
    (folder / "building.toml").write_text(text, encoding="utf-8")
    return str(folder / "building.toml")


@pytest.fixture(scope="module")
def drawn(tmp_path_factory):
    """The case and the folder of a run with its figures."""
    folder = tmp_path_factory.mktemp("drawn")
    case = small_building(folder / "case")
    assert main(["run", case, "--quick", "--quiet", "--out", str(folder / "out")]) == 0
    return case, folder / "out"


def test_only_what_the_run_drew_is_shown_and_what_the_command_line_changed_is_told(drawn, tmp_path):
    case, out = drawn[0], shutil.copytree(drawn[1], tmp_path / "out")
    quick = ["run", case, "--quick", "--quiet", "--out", str(out)]
    assert (out / "figures" / "record.svg").is_file()
    assert main(["report", str(out), "--quiet"]) == 0
    page = (out / "report.html").read_text(encoding="utf-8")
    assert page.count("<figure") > 5
    assert "Acceleration of the ground" in page
    assert "Changed on the command line" not in page
    assert main([*quick, "--no-figures", "--set", "exceedance.limit=1 %"]) == 0
    assert main(["report", str(out), "--quiet"]) == 0
    page = (out / "report.html").read_text(encoding="utf-8")
    assert "<figure" not in page
    assert "<code>exceedance.limit=1 %</code>" in page


def test_what_the_run_wrote_and_the_folder_lacks_is_named(drawn, tmp_path):
    case, out = drawn[0], shutil.copytree(drawn[1], tmp_path / "out")
    gone = json.loads((out / "summary.json").read_text(encoding="utf-8"))["figures"]
    shutil.rmtree(out / "figures")
    (out / "exceedance.nc").unlink()
    for missing in (True, False):
        assert main(["report", str(out), "--quiet"]) == 0
        page = (out / "report.html").read_text(encoding="utf-8")
        assert ("<h2>Missing files</h2>" in page) is missing
        more = f"exceedance.nc, {', '.join(gone[:3])} and {len(gone) - 3} more. The same run makes"
        assert (more in page) is missing
        if missing:
            assert main(["run", case, "--quick", "--quiet", "--out", str(out)]) == 0


def test_the_array_s_shear_ratio_is_told_where_it_is_known():
    from alphacut.report.material import isotropy

    assert "1.340 (1 in an isotropic plane); E of eq. 16" in isotropy({"shear_ratio": 1.34})
    assert isotropy({"shear_ratio": None}) == isotropy({}) == ""


def test_the_error_of_a_certified_envelope_is_said_to_be_within_its_bounds():
    from alphacut.report.envelopes import extremes

    study = {"min": {"q1": -0.2}, "max": {"q1": 0.3}, "error": {"q1": 1e-4}}
    assert extremes({"E": study}) == [("E", "q1", "−200.0 mm", "300.0 mm", "100 µm")]
    assert extremes({"E": {**study, "gap": 1e-4}}) == [
        ("E", "q1", "−200.0 mm", "300.0 mm", "100 µm (within the bounds)")
    ]


def test_text_is_escaped_wherever_it_stands():
    from alphacut.report.material import given
    from alphacut.report.sections import case_text
    from alphacut.report.tables import section, table

    wicked = "<script>alert('&')</script>"
    one = {"lower": [1.0], "upper": [2.0]}
    pieces = [
        section(wicked, table([wicked], [[wicked]])),
        given({"alpha": [0.0], "E_GPa": one, "of": wicked}),
        case_text({"case": wicked, "case_text": wicked, "changes": [wicked]}),
    ]
    for piece in pieces:
        assert "<script>" not in piece
        assert "&lt;script&gt;alert(&#39;&amp;&#39;)" in piece


def test_an_input_that_no_study_names_is_told_as_fixed(tmp_path, capfd):
    text = one_floor(fuzzy='["m1"]', duration=1, step=0.01, mass="1 t ± 5 %", moved="10 mm ± 1 mm")
    (tmp_path / "case.toml").write_text(text, encoding="utf-8")
    told = "ixed at the middle of the top cut, since no study names them: q1_0"
    for command in (["run", "--no-figures", "--out", str(tmp_path / "out")], ["envelope"]):
        assert main([command[0], str(tmp_path / "case.toml"), *command[1:]]) == 0
        assert f"f{told}\n" in capfd.readouterr().out
    assert main(["report", str(tmp_path / "out"), "--quiet"]) == 0
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    results, rest = page.split("<h2>Structure</h2>")
    assert f"F{told}." in results
    assert f"F{told}." in rest
    assert "<td>[9, 11] mm, fixed at 10 mm</td>" in re.sub("<td[^>]*>", "<td>", rest)
    assert "t, fixed at" not in rest


def test_peaks_are_told_between_their_bounds_and_those_tried_apart():
    """A motion of one's own may peak below the least of those tried, never below the bound."""
    peak = {"lower": [1.0, 2.0], "tried": [1.5, 2.2], "upper": [3.0, 2.5], "error": [0.1, 0.1]}
    study = {"alpha": [0, 1], "fuzzy": ["E"], "nature": "guaranteed", "peak": {"q1": peak}}
    page = re.sub("<[^>]*>", "|", str(peaks({"envelopes": {"all": study}})))
    assert "least of motions tried" in page
    assert "2.000 m … 2.500 m" in page
    (row,) = key_peaks({"envelopes": {"all": study}})
    assert row[1:3] == ("2.000 m … 2.500 m", "1.000 m … 3.000 m")
    for told in ("1.000 m", "1.500 m", "3.000 m", "2.000 m … 2.500 m"):
        assert f"|{told}|" in page


def test_ranges_that_are_alike_on_every_level_are_told_once():
    peak = {"lower": [1.0, 1.0], "upper": [3.0, 3.0]}
    study = {"alpha": [0, 1], "fuzzy": ["E"], "nature": "guaranteed", "peak": {"q1": peak}}
    page = str(key_results({"envelopes": {"all": study}}))
    assert page.count("1.000 m … 3.000 m") == 1
    assert "all inputs are intervals" in page.lower()
    assert "most plausible" not in page
    peak["lower"] = [1.0, 2.0]
    assert "most plausible" in str(key_results({"envelopes": {"all": study}}))


def test_a_range_that_is_not_the_support_is_told_with_its_level():
    peak = {"lower": [1.0, 2.0], "upper": [3.0, 2.5]}
    study = {"alpha": [0.9, 1], "fuzzy": ["E"], "nature": "guaranteed", "peak": {"q1": peak}}
    found = {"envelopes": {"all": study}}
    found["given_modulus"] = {"alpha": [0, 1], "E_GPa": {"lower": [3, 4], "upper": [5, 4]}}
    page = re.sub("<[^>]*>", "|", str(key_results(found)))
    assert "|1.000 m … 3.000 m at α = 0.9|" in page
    assert "|3.000 … 5.000 GPa|" in page
    assert "whole range" not in page
    peak |= {"lower": [1.0], "upper": [3.0]}
    page = str(key_results({"envelopes": {"all": study}}))
    assert "1.000 m … 3.000 m at α = 0.9" in page
    assert "all inputs are intervals" in page.lower()


@pytest.mark.parametrize(
    "text",
    ["q3 at 3 s", "k1, k2: opinions", "c counts", "zeta: x", "base_shear", "frame.m is", "|q|"],
)
def test_a_symbol_at_the_head_of_a_sentence_stays_as_it_is(text):
    assert sentence(text) == f"{text}."


def test_a_sentence_has_a_capital_and_a_full_stop():
    told = ["a limit is", "mode 3 was.", "in 3 s", ""]
    assert [*map(sentence, told)] == ["A limit is.", "Mode 3 was.", "In 3 s.", ""]


def test_notes_on_shares_stand_above_their_table():
    found = {"shares": {"q1": {"k": 0.5, "m": 0.5}}, "shares_notes": ["shares are rough"]}
    found |= {"envelopes": {"all": {"alpha": [0.9, 1]}}, "modulus": {"alpha": [0.05, 1]}}
    page = str(shares(found))
    assert "Shares are rough" in page
    assert "input, at α = 0.9" in page
    assert "α = 0 " not in page
    found["shares"]["E"] = {"a1": 0.5, "a2": 0.5}
    assert "input, at α = 0.05" in str(shares(found))


def test_a_width_of_zero_has_no_shares(drawn, tmp_path):
    out = shutil.copytree(drawn[1], tmp_path / "out")
    summary = json.loads((out / "summary.json").read_text(encoding="utf-8"))
    summary["shares"] = {"q1": {"k": None, "m": None}, "q2": {"k": 0.25, "m": None}}
    (out / "summary.json").write_text(json.dumps(summary), encoding="utf-8")
    assert main(["report", str(out), "--quiet"]) == 0
    page = (out / "report.html").read_text(encoding="utf-8")
    row = '<td class="number">–</td>'
    assert f'<td>stiffnesses</td>{row}<td class="number">25.0%</td></tr>' in page
    assert f"<td>masses</td>{row}{row}</tr>" in page
