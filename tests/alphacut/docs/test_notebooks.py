"""The notebooks run as they stand, and results show themselves in them."""

from pathlib import Path

import nbclient
import nbformat
import pytest

from alphacut.frame import StoreyFrame, envelope
from alphacut.fuzzy import Crisp, Interval, Triangular, propagate
from alphacut.rve import Phase, named
from alphacut.stochastic import HermiteMap

NOTEBOOKS = sorted((Path(__file__).parents[3] / "docs" / "notebooks").glob("*.ipynb"))


def test_there_are_three_notebooks_without_stored_output():
    assert [path.stem for path in NOTEBOOKS] == ["frame", "material", "own-function"]
    for path in NOTEBOOKS:
        assert '"outputs": []' in path.read_text(encoding="utf-8")
        assert "image/png" not in path.read_text(encoding="utf-8")


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_runs_and_shows_tables_and_figures(path, tmp_path):
    notebook = nbformat.read(path, as_version=4)
    nbclient.NotebookClient(
        notebook, timeout=120, resources={"metadata": {"path": tmp_path}}
    ).execute()
    shown = [out for cell in notebook.cells for out in cell.get("outputs", ())]
    kinds = {kind for out in shown for kind in out.get("data", {})}
    assert {"text/html", "image/png"} <= kinds
    assert not any(out.output_type == "stream" and out.name == "stderr" for out in shown)
    answers = [out["data"]["text/plain"] for out in shown if "data" in out]
    assert not {"False", "np.False_"} & set(answers)


def test_a_fuzzy_number_draws_its_membership():
    axes = Triangular(1, 2, 4).plot(quantity="load in N", name="load")
    assert axes.get_xlabel() == "load in N"
    x, grade = axes.lines[0].get_data()
    assert (min(x), max(x)) == (1, 4)
    assert x[list(grade).index(1)] == 2
    assert "points=" in Triangular(1, 2, 4)._repr_html_()
    assert "nan" not in Crisp(2.0)._repr_html_()


def test_a_result_shows_every_level_and_escapes_names():
    result = propagate(lambda a: {"<b>": a, "c": 2 * a}, {"a": Interval(1, 2)}, alpha=[0, 1])
    assert repr(result) == str(result)
    page = result._repr_html_()
    assert "&lt;b&gt;" in page
    assert "<b>" not in page
    assert page.count("<tr>") == 1 + 4
    assert result.plot("c").get_xlabel() == "c"
    with pytest.raises(ValueError, match="no output 'd'"):
        result.plot("d")


def test_an_envelope_draws_a_band_for_each_level():
    frame = StoreyFrame(masses=[2e4], lengths=[3.0], modulus=25e9, second_moment=1e-6, q0=[0.01])
    found = envelope(frame, {"E": Interval(24e9, 26e9)}, duration=1.0, step=0.02, alpha=[0, 1])
    axes = found.plot()
    assert len(axes.collections) == 2
    assert axes.get_ylabel() == "q1 in m"
    assert "<table>" in found._repr_html_()
    with pytest.raises(ValueError, match="no output 'q9'"):
        found.plot("q9")


def test_a_cell_shows_its_modulus_and_error_and_draws_stress_over_theta():
    radius = HermiteMap(0.1337, 0.1, 0.8663, 0.1692)
    (cell,) = named("series").solve(radius, Phase(20e9), [Phase(80e9)])
    assert f"{cell.modulus:.7g} Pa" in repr(cell)
    assert f"{cell.modulus:.7g} Pa" in cell._repr_html_()
    axes = cell.plot()
    assert len(axes.lines) == 2
    assert list(axes.lines[0].get_xdata()) == list(cell.curve.theta)
