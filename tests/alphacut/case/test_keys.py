"""Every key says what it is, and the page of the case format names all sections."""

from pathlib import Path

from alphacut import main
from alphacut.case.analyses import ANALYSES
from alphacut.case.content import Content
from alphacut.case.generated import GeneratedSection
from alphacut.case.parse import allowed_values, keys_of
from alphacut.case.structures import with_structures
from alphacut.case.types import Section
from alphacut.frame import METHODS

CASE = with_structures(Content, built=True)
ROOT = Path(__file__).parents[3]


def test_each_key_says_what_it_is():
    assert all(info.description for info in keys_of(CASE).values())


def sections(kind):
    for inner in kind.__subclasses__():
        yield inner
        yield from sections(inner)


def test_the_page_has_every_section_of_the_models():
    page = (ROOT / "docs/case-format.md").read_text(encoding="utf-8")
    bases = {
        "CellContent",
        "CellCase",
        "AnalysisSection",
        "QuestionSection",
        "CodeSpectrumSection",
        "StructureSection",
        "Structures",
    }
    made = {x.section.rpartition(":")[2] for x in ANALYSES.values() if x.section}
    written = {x for x in sections(Section) if not issubclass(x, GeneratedSection)}
    own = made | {x.__name__ for x in written if x.__module__.startswith("alphacut.")}
    for name in own - bases:
        assert f".{name}\n" in page


def test_allowed_values_of_a_key_are_told_in_words():
    keys = keys_of(CASE)
    assert allowed_values(keys["mesh.layers"]).startswith("whole number from 1")
    assert "midpoint" in allowed_values(keys["envelope.integrator"])
    assert allowed_values(keys["envelope.method"]).split(", ") == list(METHODS)
    assert allowed_values(keys["title"]) == ""


def test_entries_of_tables_with_free_names_are_changed_and_others_suggested(capfd):
    case = "cases/plane-frame.toml"
    assert main(["check", case, "--set", 'matrices.parameters.Ec="1.2 ± 5 %"']) == 0
    assert "matrices.parameters.Ec 1.14 … 1.26" in " ".join(capfd.readouterr().out.split())
    assert main(["check", case, "--set", "matrices.parametrs.Ec=1.2"]) == 2
    assert "did you mean matrices.parameters?" in capfd.readouterr().err
