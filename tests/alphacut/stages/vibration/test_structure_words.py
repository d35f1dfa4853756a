"""The report says in words what structure was computed: stiffness, damping, record, floors, with
fuzzy numbers as a case writes them.
"""

import json
from pathlib import Path

import numpy as np
import pytest

from alphacut.case.load import load
from alphacut.entry import main
from alphacut.frame.structures.linear import frequencies
from alphacut.fuzzy import PiecewiseLinear, Triangular
from alphacut.fuzzy.sets.stepwise import outer_steps
from alphacut.io.problem import BadInput
from alphacut.io.quantity import fuzzy
from alphacut.stages.vibration.structure import structure
from alphacut.stages.vibration.structure_words import in_unit, structure_words

CASES = Path(__file__).parents[4] / "cases"
MODULUS = Triangular(22e9, 25e9, 26e9)


@pytest.mark.parametrize(
    "text",
    ["30 t", "[28, 34] t", "[28, 30, 34] t", "[28, 28, 34] t", "[28, 34, 34] t", "[2, 3, 4, 5] t"],
)
def test_a_fuzzy_number_is_written_as_in_a_case(text):
    assert in_unit(fuzzy(text, "kg"), "t", "kg") == text


def test_many_cuts_are_told_by_support_and_core():
    assert (
        in_unit(PiecewiseLinear((0, 0.5, 1), (1e9, 2e9, 3e9), (9e9, 5e9, 3e9)), "GPa", "Pa")
        == "1 … 9 GPa, modal 3 GPa"
    )
    steps = outer_steps((0.0, 1.0), (1.0, 2.0), (9.0, 5.0))
    assert in_unit(steps, "", "") == "1 … 9, core 2 … 5"


def test_an_eight_storey_frame_in_words():
    case = load(CASES / "building.toml")
    found = structure_words(case, structure(case, MODULUS))
    first, damping, motion = found["sentences"]
    assert "8 rigid floors" in first
    assert f"E I = {25e9 * 3.2e-3 / 1e6:.0f} MN m²" in first
    assert damping == "Damping: a M + b K with a = [0.4, 0.5, 0.6] 1/s and b = [2, 2.5, 3] ms."
    record = np.loadtxt(
        (CASES / "building.record.csv")
        .read_text(encoding="utf-8")
        .partition("s^2]\n")[2]
        .splitlines(),
        delimiter=",",
    )
    assert f"{len(record)} values" in motion
    assert f"peak {np.abs(record[:, 1]).max():.3g} m/s²" in motion
    assert found["head"] == ["floor", "mass", "storey height", "stiffness"]
    assert found["rows"][0] == [
        "1",
        "40 t",
        "[3.92, 4, 4.08] m",
        f"{24e-6 * 25e9 * 3.2e-3 / 4**3:.4g} MN/m",
    ]
    assert found["rows"][7] == [
        "8",
        "[28, 30, 34] t",
        "3.2 m",
        f"{24e-6 * 25e9 * 3.2e-3 / 3.2**3:.4g} MN/m",
    ]


def test_dampers_and_starts_are_columns_where_there_are_any():
    case = load(CASES / "paper.toml")
    found = structure_words(case, structure(case, MODULUS))
    assert found["head"] == [
        "floor",
        "mass",
        "storey height",
        "damper",
        "displacement",
        "velocity",
        "stiffness",
    ]
    assert "dashpots from each floor to the ground" in found["sentences"][1]
    ratio = load(CASES / "paper.toml", ["frame.damping_ratio=[3, 5, 7] %"])
    assert (
        "[3, 5, 7] % of the critical damping of every mode; dashpots"
        in structure_words(ratio, structure(ratio, MODULUS))["sentences"][1]
    )


@pytest.mark.parametrize(("name", "row"), [("pendulum", "length"), ("tower", "E_beams")])
def test_other_structures_list_what_the_case_gives(name, row):
    case = load(CASES / f"{name}.toml")
    rows = {key: value for key, _, value in structure_words(case, structure(case, None))["rows"]}
    assert rows[row] == case.written[f"{name}.{row}"]
    assert not {"tolerance", "accelerogram"} & set(rows)


def test_the_report_tells_them(tmp_path, capfd):
    arguments = [
        "run",
        str(CASES / "pendulum.toml"),
        "--quick",
        "--no-figures",
        "--quiet",
        "--out",
        str(tmp_path),
    ]
    assert main(arguments) == 0, capfd.readouterr().err
    words = json.loads((tmp_path / "summary.json").read_text(encoding="utf-8"))["structure"][
        "words"
    ]
    assert main(["report", str(tmp_path), "--quiet"]) == 0
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "<h2>Structure</h2>" in page
    assert all(f"<td>{row[0]}</td>" in page for row in words["rows"])


@pytest.mark.parametrize(
    ("changes", "stiffness", "words"),
    [
        (["frame.columns=4"], [4] * 8, "4 in each storey: stiffness 48 E I / l³"),
        (["frame.columns=[4,4,4,4,2,2,2,1]"], [4, 4, 4, 4, 2, 2, 2, 1], "c in a storey"),
        (
            [f"frame.second_moment={['3.2e-3 m^4'] * 6 + ['1.6e-3 m^4'] * 2}"],
            [2] * 6 + [1] * 2,
            "24 E I / l³",
        ),
    ],
)
def test_storeys_may_differ_in_their_columns(changes, stiffness, words):
    case = load(CASES / "building.toml", changes)
    wanted = structure(case, MODULUS)
    moments = np.array(wanted.frame.moments) / wanted.frame.moments[0]
    assert moments * wanted.frame.columns == pytest.approx(stiffness)
    found = structure_words(case, wanted)
    assert words in found["sentences"][0]
    told = [float(row[-1].removesuffix(" MN/m")) for row in found["rows"]]
    lengths = [4, *[3.2] * 7]
    assert told == pytest.approx(
        [
            12e-6 * c * 25e9 * 3.2e-3 / length**3
            for c, length in zip(stiffness, lengths, strict=True)
        ],
        rel=1e-3,
    )
    assert ("columns c" in found["head"]) == ("columns=[" in changes[0])
    assert ("second moment" in found["head"]) == ("moment" in changes[0])
    alike = structure(load(CASES / "building.toml"), MODULUS).frame
    assert frequencies(wanted.frame)[0] != pytest.approx(frequencies(alike)[0], rel=1e-3)


@pytest.mark.parametrize(
    ("change", "pattern"),
    [
        ("frame.columns=[2, 2]", r"frame.columns: got 2 values for 8 floors"),
        ("frame.columns=0", r"frame.columns = 0: out of range|frame.columns"),
        ("frame.second_moment=['1 m^4', '2 m^4']", "second_moment.*got 2 values for 8 floors"),
        ("frame.second_moment=[]", "frame.second_moment.*empty"),
    ],
)
def test_columns_that_make_no_sense_are_refused(change, pattern):
    with pytest.raises(BadInput, match=pattern):
        load(CASES / "building.toml", [change])
