"""The register of figures: whoever forgets an entry, a section or a caption sees one of these red."""

import inspect
import re
from pathlib import Path

from alphacut.case.analyses import ANALYSES
from alphacut.figures import all as of_run
from alphacut.figures import microstructure
from alphacut.figures.all import FIGURES
from alphacut.report import page

TEMPLATE = Path(page.__file__).with_name("report.html").read_text(encoding="utf-8")


def test_each_function_that_draws_results_is_registered():
    functions = inspect.getmembers(of_run, inspect.isfunction)
    drawing = {f for _, f in functions if f.__module__ == of_run.__name__ and _draws(f)}
    assert drawing <= {figure.draw for figure in FIGURES.values()}


def _draws(function):
    """Whether a function returns one figure of results."""
    returned = inspect.signature(function).return_annotation
    return returned in ("Figure", "Figure | None")


def test_each_figure_that_a_stage_draws_is_registered():
    saved = re.findall(r'folder / "(\w+)"', inspect.getsource(microstructure.draw))
    assert saved
    assert set(saved) == {name for name, figure in FIGURES.items() if not figure.draw}


def test_each_figure_has_a_caption():
    assert all(figure.caption for figure in FIGURES.values())


def test_the_sections_of_figures_are_those_of_the_page():
    named = {figure.section for figure in FIGURES.values()} - {""}
    assert named == set(re.findall(r'figures\.of\("(\w+)"', TEMPLATE))


def test_each_function_that_draws_an_answer_is_registered():
    from alphacut.figures import answers

    registered = {p.draw for analysis in ANALYSES.values() for p in analysis.pictures.values()}
    registered |= {"alphacut.figures.answers:draw_bars", "alphacut.figures.answers:draw_spectra"}
    for name, function in inspect.getmembers(answers, inspect.isfunction):
        if name.startswith("draw_") and _draws(function):
            assert f"{answers.__name__}:{name}" in registered
