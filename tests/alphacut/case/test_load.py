"""A case is read once; every problem has its key, value and cure.

Sections and changes come first, then structures from matrices, then forces.
"""

import re
from pathlib import Path

import numpy as np
import pytest

from alphacut.case.content import load
from alphacut.frame import Exact, LinearFlow, StoreyFrame
from alphacut.fuzzy import Interval, Triangular
from tests.alphacut.case import files
from tests.alphacut.small import FRAME, refusals, table_of, written

ROOT = Path(__file__).parents[3]


def read(folder, text, changes=()):
    path = folder / "case.toml"
    path.write_text(text, encoding="utf-8")
    return load(path, changes).content


def problems(folder, text, changes=()):
    path = folder / "case.toml"
    path.write_text(text, encoding="utf-8")
    return refusals(path, *changes)


def test_sections_hold_objects_in_si_and_change_from_the_command_line(tmp_path):
    changes = ["envelope.fuzzy=E,m1", "envelope.alpha=0,1", "frame.modulus=[20, 30] GPa"]
    changed = read(tmp_path, FRAME, changes)
    assert changed.envelope.fuzzy == ("E", "m1")
    assert changed.envelope.alpha == (0.0, 1.0)
    assert changed.frame.modulus == Interval(20e9, 30e9)
    content = read(tmp_path, FRAME)
    assert content.frame.modulus == Triangular(22e9, 24e9, 26e9)
    assert content.envelope.duration == 2.0
    assert content.envelope.tolerance.value == 1e-4
    assert content.structure.inputs(("E", "m")).keys() == {"E", "m1"}


def test_all_problems_come_at_once_with_their_file(tmp_path):
    text = FRAME.replace("10 mm", "10 q").replace("3 m", "3 q").replace('"2 s"', '"2 q"')
    every = problems(tmp_path, text)
    keys = "frame.lengths[1]", "frame.displacements[1]", "envelope.duration"
    for key, line in zip(keys, every, strict=True):
        assert re.match(rf"alphacut: {tmp_path}/case.toml(, line \d+)?: {re.escape(key)} is ", line)


FRACTION = """
title = "Particles of one size"
stages = ["modulus"]
[cell]
particles = "PARTICLES"
fraction = FRACTION
matrix_modulus = "20 GPa"
matrix_poisson = 0.2
inclusion_modulus = "60 GPa"
inclusion_poisson = 0.2
[modulus]
alpha = [0, 1]
"""


def fraction_case(particles, fraction):
    return FRACTION.replace("PARTICLES", particles).replace("FRACTION", str(fraction))


@pytest.mark.parametrize(
    ("particles", "factor", "power"), [("spheres", np.pi / 6, 3), ("cylinders", np.pi / 4, 2)]
)
def test_a_fraction_is_a_map_that_is_crisp_over_theta(tmp_path, particles, factor, power):
    radius, _ = read(tmp_path, fraction_case(particles, "[0.2, 0.3, 0.4]")).radius_and_cell
    radii = radius(np.linspace(-3, 3, 5))
    assert factor * radii**power == pytest.approx(np.full(5, 0.3), rel=1e-14)


@pytest.mark.parametrize(
    ("particles", "least", "most"),
    [("spheres", 0.5235, 0.5236), ("cylinders", "[0.7, 0.785]", "[0.7, 0.786]"),
     ("ellipses(4, 0)", 0.19, 0.2)],
)  # fmt: skip
def test_a_fraction_ends_where_particles_touch(tmp_path, particles, least, most):
    assert read(tmp_path, fraction_case(particles, least)).radius_and_cell
    found = problems(tmp_path, fraction_case(particles, most))
    assert any(" cell.fraction is " in line for line in found)


def test_damping_ratios_may_be_given_one_a_mode(tmp_path):
    floors = FRAME.replace('masses = ["[9, 10, 11] t"]', 'masses = ["[9, 10, 11] t", "9 t"]')
    ratios = 'frame.damping_ratio=["2 %", "[3, 4, 5] %"]'
    structure = read(tmp_path, floors, [ratios]).frame.structure()
    assert structure.model.damping_ratio == (0.02, 0.04)
    cuts = {name: number.cut(0) for name, number in structure.inputs(("zeta",)).items()}
    assert cuts["zeta2"] == pytest.approx((0.03, 0.05))
    assert set(cuts) == {"zeta2"}  # zeta1 is one number


def test_damage_states_take_the_place_of_limits_and_rise(tmp_path):
    """Each storey's limits belong to their state."""
    states = "{ slight = ['drift <= 0.5 %'], worse = ['drift <= 1 %', 'a4 <= 0.6 g'] }"
    changes = ["fragility.limits=[]", f"fragility.states={states}"]
    content = load(ROOT / "cases/suite.toml", changes).content
    limits = content.questions["fragility"].limits_of(content.structure)
    assert [(x.output, x.event) for x in limits] == [
        *((f"drift{storey}", "slight") for storey in (1, 2, 3, 4)),
        *((f"drift{storey}", "worse") for storey in (1, 2, 3, 4)),
        ("a4", "worse"),
    ]


MATRICES = table_of("matrices")["case"]
FORCES = table_of("forces")["case"]


@pytest.fixture
def folder(tmp_path):
    files.matrices(tmp_path)
    return tmp_path


def changed(folder, old="", new=""):
    path = folder / "case.toml"
    path.write_text(MATRICES.replace(old, new), encoding="utf-8")
    return path


def loaded(folder, old="", new=""):
    return load(changed(folder, old, new)).content


ROOF = '{ row = { "2.x" = 1.0 } }'
RATIO = '{ upper = "1.x", height = "2.5 m" }'
MODULI = np.linspace(28.5e9, 31.5e9, 5)[:, None]


def test_matrices_and_the_storey_frame_move_alike(folder):
    """Accelerations are absolute, a drift over the height is a ratio, a force has its factor."""
    outputs = """{ row = { "2.x" = 1.0 }, of = "acceleration" }
speed = { row = { "2.x" = 1.0 }, of = "velocity" }
first = { upper = "1.x" }
second = { upper = "2.x", lower = "1.x", height = "2.5 m" }"""
    structure = loaded(folder, ROOF, outputs).structure
    model = structure.model
    assert [model.unit_of(name) for name in model.outputs[:4]] == ["m/s^2", "m/s", "m", ""]
    frame = StoreyFrame(
        masses=[20e3, 10e3],
        stiffness=[12 * 30e9 * 2e-4 / 27, 20e6],
        damping_ratio=0.02,
        ground=model.ground,
        outputs=("a2", "v2", "drift1", "drift2", "shear1"),
    )
    by_matrices = LinearFlow(model, ("E",), 1.0, 0.02, Exact()).values(MODULI)
    stiffness = 12 * MODULI * 2e-4 / 27
    by_storeys = LinearFlow(frame, ("k1",), 1.0, 0.02, Exact()).values(stiffness)
    by_storeys /= [1, 1, 1, 2.5, 1]
    size = abs(by_storeys).max((0, 1))
    assert (abs(by_matrices - by_storeys).max((0, 1)) < 1e-9 * size).all()
    assert (size[[0, 4]] > [1, 1e3]).all()
    assert structure.inputs(["E"])["E"].support == (28.5e9, 31.5e9)


def test_limits_are_in_the_units_of_the_outputs_of_matrices(folder):
    """A drift ratio has no height beside it."""
    limits = ["roof <= 0.5 %", "drift1 <= 1 %", "max drift1 <= 1/200"]
    path = changed(folder, ROOF, f"{RATIO}\ndrift1 = {RATIO}")
    path.write_text(path.read_text() + f"[decision]\nlimits = {limits}\n")
    content = load(path).content
    found = content.questions["decision"].limits_of(content.structure)
    assert [limit.value for limit in found] == pytest.approx([0.005, 0.01, 0.005])


def test_unknowns_come_with_the_file_that_names_them(folder):
    """Those that Abaqus holds are left out, and matrices come in the order of the names."""
    stiffness = "5,1, 5,1, 1.0e+36\n1,1, 1,1, 1.0\n2,1, 1,1, -1.0\n2,1, 2,1, 1.0\n"
    (folder / "upper_STIF1.mtx").write_text(stiffness)
    text = MATRICES.replace('["1.x", "2.x"]', '"upper_STIF1.mtx"')
    text = text.replace("upper.npz:springs", "upper_STIF1.mtx").replace(".x", ".1")
    content = read(folder, text.replace('"x"', '"1"'))
    assert content.structure_section.unknowns == ("1.1", "2.1")
    expected = loaded(folder).structure.model
    model = content.structure.model
    for (_, matrix), (_, other) in zip(model.stiffness, expected.stiffness, strict=True):
        assert np.array_equal(matrix, other)
    assert np.array_equal(model.pattern, [1, 1])
    other_order = text.replace('unknowns = "upper_STIF1.mtx"', 'unknowns = ["2.1", "1.1"]')
    [_, (_, springs)] = read(folder, other_order.replace('"x"', '"1"')).structure.model.stiffness
    assert np.array_equal(springs, expected.stiffness[1][1])


def test_amplitudes_are_parameters_and_courses_have_their_files_samples(tmp_path):
    files.wind(tmp_path)
    structure = load(written(tmp_path, FORCES)).content.structure
    assert structure.inputs(("F",)).keys() == {"F2", "F2_2"}
    numbers = {name: structure.numbers[name].support for name in structure.model.force_names}
    assert numbers == {"F1": (1.0, 1.0), "F2": (0.9, 1.1), "F2_2": (1e3, 3e3), "J1": (4e2, 4e2)}
    wind, _, machine, hammer = structure.model.loads
    np.testing.assert_allclose(wind.history.values([0.0, 0.25, 1.0, 9.0]), [2e3, -1e3, 0.0, 0.0])
    assert wind.history.is_static
    assert machine.history.values([0.29, 0.3]) == pytest.approx([0.0, 1.0])
    assert hammer.history is None
    units = {"F1": "", "F2": "", "F2_2": "N", "J1": "N*s", "m1": "kg"}  # no unit: factors of a file
    assert {name: structure.input_unit(name) for name in units} == units
