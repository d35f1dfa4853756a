"""Cases with sizes and magnitudes that no case has are refused before they cost time or memory."""

import tracemalloc

import numpy as np

from alphacut.commands.motion_text import modes_document, modes_text
from alphacut.frame import read_spectrum
from alphacut.frame.structures.linear import NominalModes
from alphacut.report.page import render_template
from tests.alphacut.small import FRAME, refusals, written
from tests.refused import refuses


def test_a_key_of_thousands_of_parts_is_refused_before_it_is_parsed(tmp_path):
    for key in (".".join("a" * 20_000), " . ".join(['"a b"'] * 20_000), "a." * 20_000 + "b"):
        case = tmp_path / "case.toml"
        case.write_text(f'{FRAME}\n[other]\n{key} = "x"\n')
        tracemalloc.start()
        (told,) = refusals(case)
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        assert "of more than 30 parts" in told
        assert f"case.toml:{len(FRAME.splitlines()) + 3}" in told
        assert peak < 50e6


def test_thousands_of_unknown_keys_are_counted_and_not_listed(tmp_path):
    keys = "\n".join(f"unknown{k} = 1" for k in range(5000))
    case = tmp_path / "case.toml"
    case.write_text(FRAME + keys)
    told = refusals(case)
    assert len(told) == 51
    assert "4950 further problems" in told[-1]


def test_a_mode_without_stiffness_within_rounding_has_an_infinite_period():
    modes = NominalModes(
        frequencies=np.array([0.0, 10.0]),
        damping_ratios=np.array([1e300, 0.05]),
        effective_masses=np.array([1e3, 9e3]),
        moved_mass=1e4,
    )
    lines = modes_text(modes, is_shaken=True).splitlines()
    assert lines[0] == "first natural period: infinite, at the most plausible values"
    assert lines[1].startswith("warning: a mode has no stiffness within rounding")
    assert lines[3].split() == ["1", "infinite", "–", "10.0%"]
    assert not any("critical" in line or len(line) > 100 for line in lines)
    assert np.isfinite(modes_document(modes)["periods_s"]).all()


def test_an_eigenvalue_problem_without_solution_does_not_print_the_case(tmp_path, monkeypatch):
    def failing(*_, **__):
        raise np.linalg.LinAlgError("Eigenvalues did not converge")

    monkeypatch.setattr("alphacut.frame.structures.storey.StoreyFrame.__post_init__", failing)
    told = refusals(written(tmp_path))
    assert len(told) == 1
    assert "Eigenvalues did not converge" in told[0]
    assert "masses" not in told[0]


def test_the_head_of_a_spectrum_is_not_searched_for_long(tmp_path):
    path = tmp_path / "spectrum.csv"
    path.write_text("(" * 60_000 + "\n0.1,1\n0.2,1\n")
    with refuses("spectrum.csv, head"):
        read_spectrum(path)


def test_characters_that_a_terminal_executes_do_not_reach_the_page():
    page = render_template(
        "comparison.html", title="a\x1b[31mb\x9b1m\x00", name="c\x07", about="", comparison=[]
    )
    assert not any((ord(x) < 32 and x not in "\t\n") or 127 <= ord(x) < 160 for x in page)
    assert "[31mb" in page
