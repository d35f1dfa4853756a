"""What a run and its report say to someone with a case of their own: words, units, nothing of the
paper, no quick numbers in earnest.
"""

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from markupsafe import Markup

from alphacut.commands import run
from alphacut.commands.envelope import summary
from alphacut.entry import main
from alphacut.figures.captions import FIGURES, caption, core, figure_words
from alphacut.frame import Envelope
from alphacut.io.units import engineering, largest_by_unit
from alphacut.report import material
from alphacut.report.sections import differences
from alphacut.report.tables import citation
from alphacut.stages.summary import crisp_particles

CASES = Path(__file__).parents[3] / "cases"


@pytest.fixture(scope="module")
def porous(tmp_path_factory):
    folder = tmp_path_factory.mktemp("porous")
    assert (
        main(
            [
                "run",
                str(CASES / "porous.toml"),
                "--quick",
                "--set",
                "modulus.method=series",
                "--out",
                str(folder),
                "--quiet",
            ]
        )
        == 0
    )
    assert main(["report", str(folder), "--quiet"]) == 0
    return folder


def test_a_quick_run_says_at_the_top_that_its_numbers_mean_nothing(porous):
    page = (porous / "report.html").read_text(encoding="utf-8")
    banner = page[page.index('<p class="banner">') : page.index("<section>")]
    assert "these numbers mean nothing" in banner
    assert "modulus.plan = reduced, modulus.alpha = [0, 1]" in banner
    assert "envelope" not in banner
    assert (
        json.loads((porous / "summary.json").read_text(encoding="utf-8"))["quick"]["mesh.layers"]
        == 3
    )


def test_durations_are_in_the_banner_and_on_the_console(tmp_path, capfd):
    arguments = [
        "run",
        str(CASES / "pendulum.toml"),
        "--quick",
        "--out",
        str(tmp_path),
        "--no-figures",
    ]
    assert main(arguments) == 0
    assert "envelope.duration = 0.6 s; these numbers mean nothing" in capfd.readouterr().out


def test_a_case_of_ones_own_has_nothing_of_the_paper(porous):
    page = (porous / "report.html").read_text(encoding="utf-8")
    assert "Fig. " not in page
    assert "Figs. " not in page
    assert not list((porous / "figures").glob("fig*"))
    assert not (porous / "figures" / "radii.svg").exists()
    assert "hashin_shtrikman" not in page[: page.index("<h2>The case")]
    assert "Hashin–Shtrikman bounds" in page


def test_captions_are_words():
    assert caption("fig18-modulus", paper=True) == "Fig. 18: Fuzzy effective modulus"
    assert caption("fig18-modulus", paper=False) == "Fuzzy effective modulus"
    assert (
        caption("fig21-25-graph-follower", paper=True)
        == "Figs. 21 to 25: The Graph Follower, step by step"
    )
    assert (
        caption("06-07_neighbour_statistics", paper=True)
        == "Figs. 6 to 7: Statistics of the direct neighbours"
    )
    assert caption("fig34-envelope-m-30s-q3", paper=True) == "Fig. 34: Envelope of q3, study m-30s"
    assert figure_words("envelope-all-base_shear") == "Envelope of base_shear"


def test_every_figure_has_a_caption():
    from alphacut.figures import all as figures

    source = Path(figures.__file__).read_text(encoding="utf-8")
    names = re.findall(r'yield "([\w-]+)"', source)
    assert len(names) > 10
    assert all(re.sub(r"^fig[\d-]+-", "", name) in FIGURES for name in names)


@pytest.mark.parametrize(
    ("value", "unit", "text"),
    [
        (-3.59e6, "N", "−3.590 MN"),
        (0.0123, "m", "12.30 mm"),
        (0.99999, "m", "1.000 m"),
        (999.99, "N", "1.000 kN"),
        (0.0, "m", "0 m"),
        (-0.2933, "m", "−293.3 mm"),
        (2.5, "SI", "2.5 SI"),
    ],
)
def test_engineering_prefixes(value, unit, text):
    assert engineering(value, unit) == text


def test_a_column_has_one_prefix():
    column = [(0.5807, "m"), (-0.00214, "m"), (0.0, "m"), (12e3, "N"), (1e-12, "m")]
    largest = largest_by_unit(column)
    shown = [engineering(value, unit, beside=largest[unit]) for value, unit in column]
    assert shown == ["580.7 mm", "−2.140 mm", "0 mm", "12.00 kN", "1e−09 mm"]


def test_the_core_is_one_value_or_said_to_be_an_interval():
    ends = {
        "E_GPa": {"lower": [20.0, 24.0], "upper": [30.0, 26.0]},
        "alpha": [0.0, 1.0],
        "modal_GPa": 25.0,
    }
    assert core(ends) == "[24.0000, 26.0000] GPa at α = 1"
    assert core({**ends, "E_GPa": {"lower": [20.0, 25.0], "upper": [30.0, 25.0]}}) == "25.0000 GPa"


def test_the_bounds_of_the_stated_nature_are_printed():
    low, high = (
        np.array([[[-0.1], [-0.2]], [[-0.05], [-0.1]]]),
        np.array([[[0.1], [0.3]], [[0.05], [0.1]]]),
    )
    at, ends = np.zeros((2, 2, 1, 1)), np.array([0.0, 1.0])
    found = Envelope(ends, ends, ("q1",), ("E",), low, high, at, at, "modal", "inner", 7, 0.1)
    assert "−200.0 mm      300.0 mm" in summary(found)
    told = summary(found, np.array([0.25]))
    assert "300.0 mm; least peak of motions tried 250.0 mm" in told
    assert "…" not in told
    certified = replace(
        found,
        lower=low - 1e-3,
        upper=high + 2e-3,
        inner_lower=low,
        inner_upper=high,
        nature="guaranteed",
    )
    assert "−201.0 mm      302.0 mm" in summary(certified)
    assert "−200.0" not in summary(certified)
    facts = {"gap": 1e-3, "gap_output": "q1", "proof": "rigorous"}
    line = summary(replace(certified, facts=facts), own_gap=True)
    assert "within 1.000 mm of q1 (asked of the proof by the program itself); rigorous" in line


def test_only_what_a_run_used_differs_from_the_paper():
    series = {"modulus": {"method": "series"}, "envelopes": {"all": {"method": "modal"}}}
    found = [subject for subject, _ in differences(series)]
    assert len(found) == 1
    assert len(list(differences({**series, "modulus": {"method": "prism"}}))) == 2
    assert len(list(differences({"envelopes": {"all": {"method": "graph-follower"}}}))) == 1
    assert len(list(differences({"microstructure": {}}))) > 1
    assert list(differences({})) == []


def test_citations_have_authors_years_and_places():
    out = citation()
    assert re.search(
        r"@software\{alphacut,\n  author = \{\{.+\}\},\n  title = .+\n  version = \{[\d.]+\},\n "
        r" year = \{20\d\d\},",
        out,
    )
    assert re.search(
        r"@article\{.*\n  title = \{Fuzzy dynamics.*\n  journal = .*\n  year = .*\n  doi ="
        r" \{10\.\d+/",
        out,
    )


def test_nu_has_its_support_and_the_three_inputs_that_matter_most_are_named(monkeypatch):
    cell = {"modal_GPa": 6.2, "E_GPa": {"lower": [5.8, 6.2], "upper": [6.6, 6.2]}, "nu": 0.3295}
    cell |= {"lower_GPa": 5.8, "upper_GPa": 6.6, "outside": "", "publish": "P", "alpha": [0, 1]}
    cell |= {"nu_cuts": {"lower": [0.309, 0.3295], "upper": [0.351, 0.3295]}, "beside": {}}
    cell |= {"nature": "inner", "crisp": "The support of E holds the phases only."}
    shares = {"a2": 0.6, "matrix_modulus": 0.3, "a4": 0.07, "matrix_poisson": 0.03}
    monkeypatch.setattr(run, "lines", lambda *_: [])
    found = {"modulus": cell | {"particles": "cylinders"}, "shares": {"E": shares}}
    first, crisp, second, _ = run.modulus_lines(found)
    assert crisp == cell["crisp"]
    assert first.endswith("GPa, bounds inner; nu = 0.3295, support [0.3090, 0.3510]")
    assert "smaller (slope a2) 60%; modulus of the matrix 30%; spread" in second
    assert "Poisson" not in second
    assert second.startswith("the width of E shrinks by this share if the input were known (the")
    assert "the first 3 of 4): " in second
    found["modulus"]["nu_cuts"] = {"lower": [0.309, 0.32], "upper": [0.351, 0.339]}
    first, *_ = run.modulus_lines(found)
    assert first.endswith("; nu = [0.3200, 0.3390] at α = 1, support [0.3090, 0.3510]")
    found["modulus"]["alpha"] = [0.5, 1]
    first, *_ = run.modulus_lines(found)
    assert first.startswith("E = 6.2000 GPa, at α = 0.5 [5.8000, 6.6000] GPa, bounds")


def test_a_support_that_holds_no_scatter_of_the_particles_says_so():
    slopes = {"a2": [0.2, 0.2, 0.2], "a4": [0.1, 0.1, 0.1]}
    told = crisp_particles(slopes)
    assert told == "The support of E holds the phases only: a2 and a4 of the particles are crisp."
    assert "other slope and the phases only: a4 of" in crisp_particles(slopes | {"a2": [1, 2, 3]})
    assert crisp_particles({"a2": [1, 2, 3], "a4": [1, 2, 3]}) == crisp_particles({}) == ""
    found = {"E_GPa": {"lower": [5.0], "upper": [6.0]}, "alpha": [0.0], "crisp": told, "nu": 0.3}
    found |= {"lower_GPa": 5.0, "upper_GPa": 6.0, "samples": 1, "solves": 0, "seconds": 0.0}
    found |= {"nature": "inner", "plan": "general", "modal_GPa": 5.5}
    assert told in material.modulus(found, Markup(""))
