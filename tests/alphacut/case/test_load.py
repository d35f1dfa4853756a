"""A case is read once; every problem has its key, value and cure.

Sections and changes come first, then structures from matrices, then forces.
"""

import re
from pathlib import Path

import numpy as np
import pytest
import scipy.io
import scipy.sparse

from alphacut import main
from alphacut.case.content import load
from alphacut.frame import Exact, LinearFlow, StoreyFrame, envelope, peaks
from alphacut.fuzzy import Interval, Triangular
from tests.alphacut.small import CELL, FRAME, refusals, written

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


def test_a_cell_is_round_or_an_image(tmp_path):
    assert read(tmp_path, CELL).particle_cell.particles == "cylinders"
    path = ROOT / "cases/composite.toml"
    assert load(path).content.image_cell.pairs[0][0] == Triangular(19e9, 20e9, 21e9)
    (line,) = refusals(path, "modulus.method=series")
    assert "modulus.method is series; allowed: auto for this cell" in line


WRONG = [  # text in the case, its replacement; key, and what the message says
    ('"10 mm"', '"10 q"', "frame.displacements[1]", 'unit "q"'),
    ('"3 m"', '"-3 m"', "frame.lengths[1]", "above 0"),
    ('"3 m"', "3", "frame.lengths[1]", "the unit is missing"),
    ("[22, 24, 26]", "[24, 22, 26]", "frame.modulus", "rise"),
    ("lengths", "lenghts", "frame.lenghts", "did you mean lengths?"),
    ("[frame]", "[frmae]", "frmae", "unknown section; did you mean frame?"),
    ('"graph-follower"', '"graph-folower"', "envelope.method", "did you mean graph-follower?"),
    ('"ground"', '"floor"', "frame.damper_placement", "ground"),
    ('fuzzy = ["E", "m"]', 'fuzzy = ["E", "n"]', "envelope.fuzzy", "n; allowed"),
    ('fuzzy = ["E", "m"]', 'fuzzy = ["E", "masses"]', "envelope.fuzzy", "did you mean m?"),
    ('fuzzy = ["E", "m"]', 'fuzzy = ["E", "E"]', "envelope.fuzzy", "each name once"),
    ("[0, 0.5, 1]", "[0.5, 0, 1]", "envelope.alpha", "rising order"),
    ("[0, 0.5, 1]", "0.5", "envelope.alpha", "write alpha = [0.5]"),
    ('"3 m"', '"2 kg"', "frame.lengths[1]", '"kg" is a unit of mass, and no unit of length'),
    ("[0, 0.5, 1]", "[0, 2]", "envelope.alpha[2]", "up to 1"),
    ('duration = "2 s"', "", "envelope.duration", "is missing"),
    ('step = "0.02 s"', 'step = "0.03 s"', "envelope.duration", "whole multiples"),
    ('displacements = "10 mm"', "", "frame.displacements", "nothing moves the frame"),
    ('step = "0.02 s"', 'step = "20 s"', "envelope.duration", "envelope.step is longer, 20 s"),
    ('step = "0.02 s"', "step = 0.02 s", "", 'quantities stand in quotes, as "0.01 s"'),
    ('stages = ["envelope"]', "stages = envelope", "", "texts stand in quotes"),
    ('tolerance = "0.1 mm"', 'tolerance = "1 kg"', "envelope.tolerance", "a fraction"),
    ('second_moment = "1e-5 m^4"', "", "frame.second_moment", "or stiffness"),
    ('stages = ["envelope"]', 'stages = ["modulus"]', "radius", "stage modulus needs"),
    ('stages = ["envelope"]', "stages = []", "stages", "one entry"),
    ('masses = ["[9, 10, 11] t"]', "masses = []", "masses", "one entry or more"),
    ('"[9, 10, 11] t"', '"9 t", "9 t"', "envelope.fuzzy", "fuzzy"),
    ("title", "tilte", "tilte", "did you mean title?"),
    ("[envelope]", "[envelope]\ncertify = 3", "envelope.certify", "is an unknown key"),
    ('"1e-5 m^4"', '"1e-5 m^4" "x"', "", "is not TOML"),
    ("[envelope]", "outputs = []\n[envelope]", "frame.outputs", "one entry or more"),
    (
        "[envelope]",
        '[decision]\nlimits = ["mean q1 <= 1 mm"]\n[envelope]',
        "decision.limits",
        "[records]",
    ),
]


@pytest.mark.parametrize(("old", "new", "key", "words"), WRONG)
def test_what_is_wrong_is_said_with_its_key(tmp_path, old, new, key, words):
    assert old in FRAME
    first, *_ = problems(tmp_path, FRAME.replace(old, new))
    assert key in first
    assert words in first
    assert len(first) <= 1010


def test_all_problems_come_at_once_with_their_file(tmp_path):
    text = FRAME.replace("10 mm", "10 q").replace("3 m", "3 q").replace('"2 s"', '"2 q"')
    every = problems(tmp_path, text)
    keys = "frame.lengths[1]", "frame.displacements[1]", "envelope.duration"
    for key, line in zip(keys, every, strict=True):
        assert re.match(rf"alphacut: {tmp_path}/case.toml(, line \d+)?: {re.escape(key)} is ", line)


CELLS = [
    ("a3 = 0.6", "a3 = 1.6", "radius.a3"),
    ("a2 = [0.1, 0.2, 0.3]", "a2 = 9", "radius"),
    ("a2 = [0.1, 0.2, 0.3]\n", "", "radius.a2"),
    ("matrix_poisson = 0.3", "matrix_poisson = 0.5", "cell.matrix_poisson"),
    ('method = "series"', 'method = "prism"\n[cell2]\n', "cell2"),
    ('"series"', '"slices"', "modulus.method"),
    ("a1 = 0.3\na2 = [0.1, 0.2, 0.3]\na3 = 0.6\na4 = 0.2", "theta = [-3, 3]", "radius.a1"),
]


@pytest.mark.parametrize(("old", "new", "key"), CELLS)
def test_what_is_wrong_with_a_cell(tmp_path, old, new, key):
    text = CELL.replace("[cell]", '[cell]\nparticles = "spheres"') if "slices" in new else CELL
    assert any(f" {key} is " in line for line in problems(tmp_path, text.replace(old, new)))


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


def test_a_fraction_stands_alone(tmp_path):
    radius = "[radius]\na1 = 0.3\na2 = 0\na3 = 0.4\na4 = 0\n"
    found = problems(tmp_path, fraction_case("spheres", 0.3) + radius)
    assert [" radius is " in line for line in found] == [True]


def test_damping_ratios_may_be_given_one_a_mode(tmp_path):
    floors = FRAME.replace('masses = ["[9, 10, 11] t"]', 'masses = ["[9, 10, 11] t", "9 t"]')
    key = "frame.damping_ratio"
    structure = read(tmp_path, floors, [f'{key}=["2 %", "[3, 4, 5] %"]']).frame.structure()
    assert structure.model.damping_ratio == (0.02, 0.04)
    cuts = {name: number.cut(0) for name, number in structure.inputs(("zeta",)).items()}
    assert cuts["zeta2"] == pytest.approx((0.03, 0.05))
    assert set(cuts) == {"zeta2"}  # zeta1 is one number
    (line,) = problems(tmp_path, floors, [f'{key}=["2 %", "3 %", "4 %"]'])
    assert key in line


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        (["nope=3"], "--set is nope=3, of an unknown key; allowed: KEY=VALUE"),
        (["duration=1 s"], "did you mean envelope.duration?"),
        (["envelope.durations=1 s"], "did you mean envelope.duration?"),
        (["duration"], "KEY=VALUE"),
        (["envelope.duration=1 s", "envelope.duration=2 s"], "each key once"),
        (["envelope.duration=1 q"], "command line: envelope.duration"),
    ],
)
def test_a_wrong_change_is_refused(tmp_path, changes, words):
    assert words in problems(tmp_path, FRAME, changes)[0]


def test_studies_have_names_of_files(tmp_path):
    study = '[[study]]\nname = "NAME"\nfuzzy = ["E"]\nduration = "1 s"\n'
    assert read(tmp_path, FRAME + study.replace("NAME", "E-1s")).study[0].name == "E-1s"
    for name in ("../x", "a/b", "", "x" * 65, "a..b", ".hidden", "a\\u0007"):
        (line,) = problems(tmp_path, FRAME + study.replace("NAME", name))
        assert " study[1].name is " in line
    both = study.replace("NAME", "E") * 2
    assert "a name of its own" in problems(tmp_path, FRAME + both)[0]


def test_files_are_beside_the_case(tmp_path):
    text = FRAME.replace('displacements = "10 mm"', 'accelerogram = "record.csv"')
    assert "a file, from the folder" in problems(tmp_path, text)[0]
    (tmp_path / "record.csv").write_text("time [s],acceleration [g]\n0,0\n0.02,0.1\n0.04,0\n")
    assert read(tmp_path, text).frame.accelerogram.step == pytest.approx(0.02)


def test_questions_have_sections(tmp_path):
    text = FRAME + '[decision]\nlimits = ["q1 <= 9 mm"]\n'
    assert set(read(tmp_path, text).questions) == {"decision"}
    for wrong, words in (("q1 < 9 mm", "<="), ("q1 <= 9 kg", "no unit of"), ("q1 <= 0 mm", "<=")):
        (line,) = problems(tmp_path, text.replace("q1 <= 9 mm", wrong))
        assert " decision.limits[1] is " in line
        assert words in line
    (line,) = problems(tmp_path, text.replace("q1 <=", "q9 <="))
    assert " decision.limits is " in line


def test_columns_that_yield_refuse_proofs_and_midpoint_steps_by_key():
    for key, value in (("method", "dual"), ("integrator", "midpoint")):
        (line,) = refusals(ROOT / "cases/yielding.toml", f"envelope.{key}={value}")
        assert re.search(rf"envelope\.{key} is {value}; .* columns yield", line)


def test_fragility_of_columns_that_yield_is_of_magnitudes_and_has_a_largest_measure():
    changes = ["frame.yield_drift=9 mm", "fragility.most=3"]
    assert load(ROOT / "cases/suite.toml", changes).content.fragility.most == 3
    for refused in (["fragility.most=3"], [*changes, "fragility.limits=['max drift1 <= 9 mm']"]):
        (line,) = refusals(ROOT / "cases/suite.toml", *refused)
        assert re.search(r"fragility\.(most|limits)", line)


SLIGHT = "slight = ['drift <= 0.5 %']"


def test_damage_states_take_the_place_of_limits_and_rise(tmp_path):
    """Each storey's limits belong to their state; other states are refused in one line."""
    no_limits = "fragility.limits=[]"

    def states(*others):
        return f"fragility.states={{ {', '.join([SLIGHT, *others])} }}"

    content = load(
        ROOT / "cases/suite.toml",
        [no_limits, states("worse = ['drift <= 1 %', 'a4 <= 0.6 g']")],
    ).content
    limits = content.questions["fragility"].limits_of(content.structure)
    assert [(x.output, x.event) for x in limits] == [
        *((f"drift{storey}", "slight") for storey in (1, 2, 3, 4)),
        *((f"drift{storey}", "worse") for storey in (1, 2, 3, 4)),
        ("a4", "worse"),
    ]
    for changes, words in (
        ([states()], "fragility.limits is beside states"),
        ([no_limits], "fragility.limits is missing"),
        ([no_limits, states("worse = ['drift3 <= 0.4 %']")], "fragility.states is drift3"),
        ([no_limits, states("Slight = ['drift <= 1 %']")], "fragility.states is Slight"),
        ([no_limits, states("worse = ['drift9 <= 4 %']")], "drift9"),
        ([no_limits, states("worse = []")], "worse"),
    ):
        (line,) = refusals(ROOT / "cases/suite.toml", *changes)
        assert words in line
    text = (ROOT / "cases/suite.toml").read_text(encoding="utf-8")
    twice = tmp_path / "twice.toml"
    state = "x = ['drift <= 1 %']\n"
    twice.write_text(f"{text}[fragility.states]\n{state}{state}", encoding="utf-8")
    (line,) = refusals(twice)
    assert "twice.toml" in line


MATRICES = """
title = "Two storeys as matrices"
stages = ["envelope"]
[matrices]
unknowns = ["1.x", "2.x"]
mass = [["m", "masses.csv"]]
stiffness = [["12*E*I*l^-3", "lower.mtx"], ["2*k2", "upper.npz:springs"]]
damping_ratio = "2 %"
direction = "x"
accelerogram = "record.csv"
[matrices.parameters]
m = "20 t"
E = "30 GPa ± 5 %"
I = "2e-4 m^4"
l = "3 m"
k2 = "10 MN/m"
[matrices.outputs]
roof = { row = { "2.x" = 1.0 } }
shear = { row = { "1.x" = 1.0 }, unit = "N", factor = "12*E*I*l^-3" }
[envelope]
fuzzy = ["E"]
alpha = [0, 1]
duration = "1 s"
step = "0.02 s"
"""


@pytest.fixture
def folder(tmp_path):
    np.savetxt(tmp_path / "masses.csv", np.diag([1.0, 0.5]), delimiter=",")
    scipy.io.mmwrite(tmp_path / "lower.mtx", scipy.sparse.coo_matrix([[1.0, 0.0], [0.0, 0.0]]))
    springs = np.array([[1.0, -1.0], [-1.0, 1.0]])
    np.savez(tmp_path / "upper.npz", springs=springs, other=np.eye(2))
    (tmp_path / "short.csv").write_text("1,0\n")
    np.save(tmp_path / "diagonal.npy", np.ones(2))
    (tmp_path / "upper.csv").write_text("9,3\n0,4\n")
    np.save(tmp_path / "zeros.npy", np.zeros((2, 2)))
    times = 0.02 * np.arange(40)
    rows = [f"{t:.2f},{np.sin(9 * t):.8f}" for t in times]
    (tmp_path / "record.csv").write_text("time [s],acceleration [m/s^2]\n" + "\n".join(rows))
    return tmp_path


def changed(folder, old="", new=""):
    path = folder / "case.toml"
    path.write_text(MATRICES.replace(old, new), encoding="utf-8")
    return path


def loaded(folder, old="", new=""):
    return load(changed(folder, old, new)).content


ROOF = '{ row = { "2.x" = 1.0 } }'
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


def with_limits(folder, limits):
    """A case with two drift ratios and an acceleration of unusual names, and limits of them."""
    outputs = """{ upper = "1.x", height = "2.5 m" }
drift1 = { upper = "1.x", height = "2.5 m" }
q1 = { row = { "1.x" = 1.0 }, of = "acceleration" }"""
    path = changed(folder, ROOF, outputs)
    path.write_text(path.read_text() + f"[decision]\nlimits = {limits}\n")
    return path


def test_limits_are_in_the_units_of_the_outputs_of_matrices(folder):
    """A drift ratio has no height beside it, and a name that means a floor has its own unit."""
    limits = ["roof <= 0.5 %", "drift1 <= 1 %", "max drift1 <= 1/200"]
    content = load(with_limits(folder, limits)).content
    found = content.questions["decision"].limits_of(content.structure)
    assert [limit.value for limit in found] == pytest.approx([0.005, 0.01, 0.005])
    (line,) = refusals(with_limits(folder, ["drift1 <= 10 mm"]))
    assert "decision.limits is drift1 <= 10 mm; allowed: number" in line
    (line,) = refusals(with_limits(folder, ["q1 <= 10 mm"]))
    assert "decision.limits is q1 <= 10 mm; allowed: acceleration" in line


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('"lower.mtx"', '"nothing.mtx"', "a file, from the folder"),
        ("upper.npz:springs", "upper.npz", "one of springs, other"),
        ("12*E*I*l^-3", "sin(E)", "a product of powers"),
        ("12*E*I*l^-3", "E*J", "factor"),
        ('row = { "2.x"', 'row = { "9.x"', "matrices.outputs.roof.row"),
        ('direction = "x"', 'direction = "y"', "matrices.direction"),
        ('.x"', '"', "name the unknowns NODE.DIRECTION, as 1.x"),
        ('direction = "x"', 'direction = ["x", "y"]', "of a list make a table"),
        ('"1.x", "2.x"]\nmass', '"1.x", "2.x", "3.x"]\nmass', "of shape"),
        ('"lower.mtx"', '"short.csv"', "short.csv is of shape (1, 2); allowed: (2, 2); the case"),
        ('"lower.mtx"', '"diagonal.npy"', "of a diagonal make a matrix, by numpy.diag"),
        ('"lower.mtx"', '"upper.csv"', "upper.csv is not symmetric: [1.x, 2.x] is 3, [2.x, 1.x]"),
        ('"lower.mtx"', '"zeros.npy"', "zeros.npy is zeros throughout"),
        ('m = "20 t"', 'm = "20 parsec fuzz"', "a quantity"),
        (
            "roof =",
            '"roof drift" =',
            "matrices.outputs is 'roof drift'; allowed: names of a letter",
        ),
        ("roof =", '"roof\\u001b[31m" =', "matrices.outputs is 'roof\\x1b[31m'"),
        ("roof =", '"2nd" =', "matrices.outputs is '2nd'"),
        ("roof =", '"" =', "matrices.outputs is ''"),
        ('m = "20 t"', 'm = "20 t"\n"k 3" = 1', "matrices.parameters is 'k 3'"),
        ('unit = "N"', 'unit = "N\\u001b[2J"', "unit of shear is 'N\\x1b[2J'"),
        ('unit = "N"', 'unit = "kN"', "unit is kN; allowed: SI units, as m, N or N*m; write N;"),
        (ROOF, "{ }", "matrices.outputs.roof.row is missing"),
        (ROOF, '{ lower = "1.x" }', "matrices.outputs.roof.row is missing; allowed: entries of"),
        (ROOF, ROOF[:-1] + ', upper = "2.x" }', "matrices.outputs.roof.row is beside upper"),
        (ROOF, ROOF[:-1] + ', height = "3 m" }', "matrices.outputs.roof.height is without upper"),
        (ROOF, '{ upper = "2.x", lower = "2.x" }', "matrices.outputs.roof.lower is 2.x; allowed"),
        (ROOF, '{ upper = "2.x", lower = "3.x" }', "roof.upper, lower is 3.x; allowed: unknowns"),
        (ROOF, '{ upper = "2.x", height = "0 m" }', "roof.height is 0 m; allowed: length above 0"),
        (ROOF, ROOF[:-1] + ', of = "jerk" }', 'matrices.outputs.roof.of is "jerk"; allowed: '),
        (
            'unit = "N", factor',
            'of = "acceleration", factor',
            "matrices: observed: shear is accelerations times a factor; allowed: accelerations",
        ),
    ],
)
def test_what_makes_no_structure_is_one_line(folder, old, new, message):
    lines = refusals(changed(folder, old, new))
    assert any(message in line for line in lines), lines


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
    lines = refusals(changed(folder, '["1.x", "2.x"]', '"lower.mtx"'))
    assert any("without names of unknowns" in line for line in lines)


def test_a_fuzzy_parameter_in_no_factor_is_doubted(folder):
    section = loaded(folder, 'm = "20 t"', 'm = "20 t"\nmr = "1 ± 10 %"').structure_section
    (doubt,) = section.warnings(None)
    assert doubt.startswith("matrices.parameters.mr is in no factor")


@pytest.mark.parametrize(
    ("limit", "words"),
    [
        ("roof <= 40 kN", "is a unit of force, and no unit of length"),
        ("roof <= 40", "the unit is missing"),
        ("shear <= 40 mm", "no unit of force"),
        ("roof <= 40 mm", ""),
    ],
)
def test_a_limit_is_in_the_unit_of_its_output(folder, limit, words):
    section = f'step = "0.02 s"\n[decision]\nlimits = ["{limit}"]\n'
    if words:
        (line,) = refusals(changed(folder, 'step = "0.02 s"\n', section))
        assert words in line
    else:
        content = loaded(folder, 'step = "0.02 s"\n', section)
        (found,) = content.decision.limits_of(content.structure)
        assert found.value == 0.04


WIND = "time [s],force [kN]\n0,2\n0.5,-4\n1,3\n"
IN_THE_WIND = """
title = "Two floors in the wind"
stages = ["envelope"]
[frame]
masses = ["10 t", "8 t"]
stiffness = "9 MN/m"
damping_ratio = "2 %"
[[force]]
history = "wind.csv, static"
amplitude = { 1 = "1", 2 = "1 ± 10 %" }
[[force]]
history = "harmonic, 2 Hz, 90 deg, from 0.3 s"
amplitude = { 2 = "[1, 2, 3] kN" }
[[force]]
history = "impulse"
amplitude = { 1 = "0.4 kN s" }
[envelope]
fuzzy = ["F", "F2_2"]
alpha = [0, 1]
duration = "1 s"
step = "0.02 s"
"""


def in_the_wind(folder, **changes):
    (folder / "wind.csv").write_text(WIND, encoding="utf-8")
    return written(folder, IN_THE_WIND, **changes)


def test_amplitudes_are_parameters_and_courses_have_their_files_samples(tmp_path):
    structure = load(in_the_wind(tmp_path)).content.structure
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


MACHINE = """
title = "A machine below resonance"
stages = ["envelope"]
[frame]
masses = ["50 t"]
stiffness = ["10 MN/m ± 1 %"]
damping_ratio = "0 %"
outputs = ["q1"]
[[force]]
history = "harmonic, 1.5 Hz"
amplitude = { 1 = "10 kN" }
[envelope]
fuzzy = ["k1"]
alpha = [0, 1]
duration = "6 s"
step = "0.01 s"
"""


@pytest.mark.parametrize(
    "frequency", ["1.5 Hz", "9.42477796076938 rad/s", "90 rpm", "540 deg/s", "1.5 turn/s"]
)
def test_a_frequency_counts_turns_in_whatever_unit_it_is_given(tmp_path, capsys, frequency):
    case = written(tmp_path, MACHINE, **{"1.5 Hz": frequency})
    assert main(["check", str(case)]) == 0
    assert "1.5 Hz, period 0.6667 s" in capsys.readouterr().out
    (machine,) = load(case).content.structure.model.loads
    assert machine.history.frequency == pytest.approx(3 * np.pi, rel=1e-14)


def test_bounds_under_a_machine_in_turns_per_minute_hold_the_largest_displacement(tmp_path):
    structure = load(written(tmp_path, MACHINE, **{"1.5 Hz": "90 rpm"})).content.structure
    found = envelope(
        structure.model, structure.inputs(("k1",)), alpha=(1,), duration=6.0, step=0.01
    )
    # q(t) = F/(m (ω² - Ω²)) (sin Ω t - Ω/ω sin ω t), without damping, at rest at t = 0
    mass, force, turning, time = 50e3, 10e3, 2 * np.pi * 1.5, np.linspace(0.0, 6.0, 60001)
    omega = np.sqrt(np.linspace(9.9e6, 10.1e6, 41) / mass)[:, None]
    amplitude = force / (mass * (omega**2 - turning**2))
    shape = np.sin(turning * time) - turning / omega * np.sin(omega * time)
    largest = np.abs(amplitude * shape).max()
    assert largest == pytest.approx(3.0055e-3, rel=1e-4)
    assert largest <= peaks(found)["q1"].upper[0] <= 3.0095e-3
    attained = np.maximum(found.inner.upper, -found.inner.lower).max()
    assert 3.002e-3 <= attained <= largest


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('{ 2 = "[1, 2, 3] kN" }', '{ 3 = "1 kN" }', "force.amplitude is 3"),
        ('"impulse"', '"drum"', "a file, from the folder"),
        ('"impulse"', '"impulse, from 1 s"', "force[3].history is impulse, from 1 s"),
        ('"0.4 kN s"', '"0.4 kN"', "force.amplitude.1 is N"),
        (", 2 Hz, 90 deg", "", "force[2].history is harmonic"),
        ("2 Hz", "2 m", "2 m"),
        ("2 Hz", "2 s", "no unit of frequency"),
        ("from 0.3 s", "static", "force[2].history"),
        ("from 0.3 s", "from -1 s", "force[2]"),
        ("from 0.3 s", "from 1 s", "force[2].history is from 1 s"),  # at the end of the motion
        ('"wind.csv, static"', '"case.toml"', "case.toml, line"),
        ('"1 ± 10 %"', '"3 lb"', "3 lb; allowed: a force"),
        ('{ 1 = "0.4 kN s" }', "{}", "one floor or more"),
    ],
)
def test_what_is_wrong_with_a_force_is_said_in_one_line(tmp_path, old, new, words):
    (line,) = refusals(in_the_wind(tmp_path, **{old: new}))
    assert words in line


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("time [s],force [bar]\n0,1\n1,2\n", "line 1"),
        ("time [s],force\n0,1\n1,x\n", "line 3"),
        ("time [s],force\n0,0\n1,0\n", "zeros throughout"),
        ("time [s],force\n0,1\n1,2\n1.5,2\n", "even steps"),
    ],
)
def test_files_that_hold_no_force_are_refused_by_their_line(tmp_path, text, words):
    (tmp_path / "wind.csv").write_text(text, encoding="utf-8")
    (line,) = refusals(written(tmp_path, IN_THE_WIND))
    assert words in line
