"""A case of spheres from the command line: choice, one radius, fuzzy modulus, words."""

import json
import re
from pathlib import Path
from time import process_time

import numpy as np
import pytest

from alphacut.case.load import load
from alphacut.entry import main
from alphacut.rve import Phase
from alphacut.rve.spheres.cubic import cubic_moduli, hill_average, young_along
from alphacut.rve.spheres.series.stiffness import cubic_stiffness
from alphacut.stochastic import HermiteMap, TruncatedNormal

PAPER = str(Path(__file__).parents[3] / "cases" / "paper.toml")
SPHERES = ["--set", 'cell.particles="spheres"', "--method", "series"]


def answer(capfd, *arguments):
    """The JSON that a command prints."""
    assert main([*arguments, "--json", "-"]) == 0
    return json.loads(capfd.readouterr().out)


def test_one_radius_gives_the_cubic_stiffness(capfd):
    found = answer(capfd, "cell", PAPER, *SPHERES, "--radius", "0.6")
    exact = cubic_stiffness([0.6], Phase(20e9), [Phase(80e9)], tolerance=1e-11).matrix[0, 0] / 1e9
    bulk, deviator, shear = cubic_moduli(exact)
    np.testing.assert_allclose(found["C_GPa"], exact, rtol=1e-9, atol=1e-12)
    assert found["K_GPa"] == pytest.approx(bulk, rel=1e-9)
    assert found["G_GPa"] == pytest.approx([shear, deviator], rel=1e-9)
    assert [found["E_GPa"], found["nu"]] == pytest.approx(hill_average(cubic_moduli(exact)))
    along = np.array([found["E_along_GPa"][name] for name in ("100", "111")])
    np.testing.assert_allclose(along, young_along(cubic_moduli(exact)), rtol=1e-9)
    compliance = np.linalg.inv(exact)
    assert along[0] == pytest.approx(1 / compliance[0, 0])
    # ⟨111⟩: S11 − 2 (S11 − S12 − S44/2)/3
    anisotropy = compliance[0, 0] - compliance[0, 1] - compliance[3, 3] / 2
    assert along[1] == pytest.approx(1 / (compliance[0, 0] - 2 / 3 * anisotropy))
    assert found["declared_error"]["E_GPa"] < 1e-7


def test_one_radius_of_a_cylinder_is_the_planar_cell(capfd):
    found = answer(capfd, "cell", PAPER, "--method", "series", "--radius", "0.5")
    assert found["stress_GPa"]["s11"] == pytest.approx(0.467852842132, abs=1e-11)


def test_the_certificate_of_spheres_covers_their_bounds(capfd):
    checks = answer(capfd, "cell", PAPER, *SPHERES)["checks"]
    assert set(checks) == {
        "symmetry", "reuss", "voigt", "hashin_shtrikman", "hashin_shtrikman_shear"
    }  # fmt: skip


def test_five_levels_of_the_fuzzy_modulus_to_1e_6_in_seconds(capfd):
    start = process_time()
    found = answer(capfd, "modulus", PAPER, *SPHERES, "--tolerance", "1e-6")
    seconds = process_time() - start
    exact = answer(capfd, "modulus", PAPER, *SPHERES, "--plan", "reduced", "--tolerance", "1e-9")
    assert found["samples"] == 225
    assert seconds <= 10  # of the processor; five on a quiet core
    for end in ("lower", "upper"):
        np.testing.assert_allclose(found["E_GPa"][end], exact["E_GPa"][end], rtol=1e-6)


def test_text_says_what_e_is(capfd):
    assert main(["cell", PAPER, *SPHERES, "--radius", "0.6"]) == 0
    out = capfd.readouterr().out
    assert "Hill's isotropic average" in out
    assert "E along 100 = 23.175375" in out
    assert "eq. 16" not in out


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--method", "prism"], "this model is one of cylinders"),
        (["--method", "slices"], "this model is one of cylinders"),
        (
            ["--method", "table", "--tolerance", "1e-7"],
            "cannot keep 1e-07; take 1.2e-05 or more, or method series",
        ),
        (["--method", "series", "--radius", "1.2"], "--radius = 1.2: out of range"),
        (["--method", "series", "--radius", "nan"], "--radius = nan: out of range"),
        (["--method", "series", "--radius", "0.5", "--a2", "0.2"], "no effect beside --radius"),
        (["--method", "auto", "--exclude", "slices"], "known models are series, table"),
        (["--method", "auto", "--exclude", "series,table"], "leave one of series, table"),
        (["--method", "series", "--set", 'cell.particles="cubes"'], "cylinders, spheres"),
        (["--method", "series", "--set", "modulus.average=isotropic"], "effect on cylinders alone"),
    ],
)
def test_what_spheres_cannot_have_is_one_line(arguments, words, capfd):
    chosen = [] if "cubes" in arguments[-1] else SPHERES[:2]
    assert main(["cell", PAPER, *chosen, *arguments]) == 2
    out, err = capfd.readouterr()
    assert not out
    assert words in err
    assert err.count("\n") == 1


def test_a_table_of_elements_and_the_series_agree(capfd):
    case = str(Path(PAPER).with_name("paper-3d.toml"))
    one = ["--radius", "0.6", "--tolerance", "1e-2"]
    table = answer(capfd, "cell", case, "--method", "table", *one)
    exact = answer(capfd, "cell", case, "--method", "series", *one)
    off = abs(table["E_GPa"] - exact["E_GPa"])
    assert 1e-5 < off <= table["declared_error"]["E_GPa"] <= 1e-2 * exact["E_GPa"]
    assert table["method"] == "table"
    assert set(table["checks"]) == set(exact["checks"])


def test_two_models_of_spheres_keep_the_tolerance_that_is_asked_for(capfd):
    case = str(Path(PAPER).with_name("paper-3d.toml"))
    arguments = ["--cross-check", "table,series", "--radius", "0.6", "--tolerance", "1e-2"]
    found = answer(capfd, "cell", case, *arguments)
    assert found["method"] == "table"
    assert 1e-5 < found["difference"] <= 1e-2
    assert found["declared_error"]["E_GPa"] > 1e-4 * found["E_GPa"]  # no needless digits


def test_auto_takes_elements_where_there_is_no_series(capfd):
    case = str(Path(PAPER).with_name("paper-3d.toml"))
    one = ["--radius", "0.6", "--tolerance", "1e-2"]
    found = answer(capfd, "cell", case, "--method", "auto", "--exclude", "series", *one)
    exact = answer(capfd, "cell", case, "--method", "auto", *one)
    assert (found["method"], exact["method"]) == ("table", "series")
    assert abs(found["E_GPa"] - exact["E_GPa"]) <= found["declared_error"]["E_GPa"]


def test_two_models_of_spheres_are_compared(capfd):
    case = str(Path(PAPER).with_name("paper-3d.toml"))
    assert main(["cell", case, "--cross-check", "series,auto"]) == 2
    assert "method auto takes series here" in capfd.readouterr().err


def test_models_of_cylinders_are_no_second_model_of_spheres(capfd):
    case = str(Path(PAPER).with_name("paper-3d.toml"))
    assert main(["cell", case, "--cross-check", "series,prism"]) == 2
    (line,) = capfd.readouterr().err.splitlines()
    assert "--cross-check = series,prism: one of these models is of cylinders alone" in line


def test_the_shipped_spheres_fill_what_the_papers_circles_cover(capfd):
    """Mean of π r³/6 over θ beside the paper's mean of π r²/4."""
    shares = []
    for name, power in (("paper", 2), ("paper-3d", 3)):
        case = str(Path(PAPER).with_name(f"{name}.toml"))
        curve = answer(capfd, "cell", case, "--method", "series")["curve"]
        radius = load(case).radius
        values = HermiteMap(*(one.modal for one in radius.numbers.values()))(curve["theta"])
        shares.append(np.pi / (4 if power == 2 else 6) * np.dot(curve["weights"], values**power))
    assert shares[1] == pytest.approx(shares[0], rel=5e-3)


SPACE = str(Path(PAPER).with_name("paper-3d.toml"))
EDGES = [
    (0, 1),
    (1, 2),
    (0, 2),
    (0, 3),
    (1, 3),
    (2, 3),
]  # of a quadratic tetrahedron in VTK's order


def jacobians(points, cells):
    """Determinants at the centroid and four more points of a rule of degree 3, shape (m, 5)."""
    spots = np.vstack([np.full(4, 1 / 4), np.full((4, 4), 1 / 6) + np.eye(4) / 3])
    slopes = np.zeros((5, 10, 4))  # of the shape functions by the barycentric coordinates
    for vertex in range(4):
        slopes[:, vertex, vertex] = 4 * spots[:, vertex] - 1
    for number, (a, b) in enumerate(EDGES, start=4):
        slopes[:, number, a], slopes[:, number, b] = 4 * spots[:, b], 4 * spots[:, a]
    slopes = slopes[..., 1:] - slopes[..., :1]
    return np.linalg.det(np.einsum("qna,mni->mqai", slopes, points[cells]))


def test_a_mesh_of_a_sphere_fills_the_periodic_cell(tmp_path, capfd):
    pytest.importorskip("dolfinx")
    meshio = pytest.importorskip("meshio")
    from alphacut.export.fields import write_mesh

    path = tmp_path / "cell.vtu"
    words = ("--radius", "0.6", "--mesh-size", "0.5", "--out", str(path))
    told = answer(capfd, "mesh", SPACE, *words)
    found = meshio.read(path)
    counts = {"nodes": len(found.points), "tetrahedra": len(found.cells_dict["tetra10"])}
    assert told == {"radius": 0.6, "radius_from": "--radius", **counts, "file": str(path)}
    inside = found.cell_data["phase"][0] == 1
    judge_sphere(found.points, found.cells[0].data, inside)
    for ending in (".vtk", ".xdmf", ".msh", ".inp"):
        write_mesh(found, tmp_path / f"cell{ending}")
        again = meshio.read(tmp_path / f"cell{ending}")
        assert again.points == pytest.approx(found.points, abs=1e-14)
        assert (again.cells_dict["tetra10"] == found.cells[0].data).all()
        if ending != ".inp":
            assert (again.cell_data["phase"][0] == inside).all()
            continue
        for name, wanted in (("MATRIX", ~inside), ("PARTICLE", inside)):
            assert (np.concatenate(again.cell_sets[name]) == np.flatnonzero(wanted)).all()


def judge_sphere(points, cells, inside):
    """No fold, volumes of both materials, the interface on the sphere, and opposite faces alike."""
    determinants = jacobians(points, cells)
    assert determinants.min() > 0
    volumes = determinants @ np.array([-4 / 5, *[9 / 20] * 4]) / 6
    assert volumes.sum() == pytest.approx(8, rel=1e-12)
    assert volumes[inside].sum() / 8 == pytest.approx(np.pi * 0.6**3 / 6, rel=1e-3)
    assert np.linalg.norm(points[cells[inside]], axis=-1).max() == pytest.approx(0.6, rel=1e-9)
    assert np.linalg.norm(points[cells[~inside]], axis=-1).min() == pytest.approx(0.6, rel=1e-9)
    for axis in range(3):
        faces = [points[points[:, axis] == end] for end in (-1, 1)]
        low, high = ({tuple(row) for row in np.delete(face, axis, 1)} for face in faces)
        assert len(low) > 50
        assert low == high


def test_a_mesh_of_a_sphere_has_the_radius_at_the_median(tmp_path, capfd):
    pytest.importorskip("dolfinx")
    words = ["--mesh-size", "0.9", "--set", "radius.theta=[-3, 1]"]
    words += ["--out", str(tmp_path / "cell.msh")]
    found = answer(capfd, "mesh", SPACE, *words)
    radius = HermiteMap(0.46988, 0.10171, 0.95, 0.00001, TruncatedNormal(-3, 1))
    draws = radius(radius.distribution.sample(100_000, np.random.default_rng()))
    assert found["radius"] == pytest.approx(np.median(draws), abs=5e-3)
    assert found["radius_from"].startswith("the map at the median θ = -0.1984")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--radius", "0.99"], "meshes of spheres end at 0.97"),
        (["--radius", "1.2"], "--radius = 1.2: out of range"),
        (["--radius", "0.5", "--set", "a1=0.4"], "a1=0.4: this has no effect beside --radius"),
        (["--layers", "3"], "mesh of spheres does not read this key"),
        (["--fields"], "fields are those of cylinders"),
        (["--mesh-size", "0.01"], "mesh.size = 0.01: a cell of a sphere"),
        (["--set", "modulus.method=table"], "modulus.method = table: command mesh of spheres"),
    ],
)
def test_what_a_mesh_of_a_sphere_cannot_be_is_one_line(arguments, words, tmp_path, capfd):
    pytest.importorskip("dolfinx")
    assert main(["mesh", SPACE, *arguments, "--out", str(tmp_path / "cell.vtu")]) == 2
    (line,) = capfd.readouterr().err.splitlines()
    assert words in line
    assert not list(tmp_path.iterdir())


def test_check_warns_of_cylinders_where_the_words_say_spheres(tmp_path, capfd):
    path = tmp_path / "own.toml"
    lines = Path(PAPER).read_text(encoding="utf-8").splitlines()
    text = "\n".join(line for line in lines if not line.startswith("particles"))
    path.write_text(text, encoding="utf-8")
    assert main(["check", str(path)]) == 0
    err = capfd.readouterr().err
    assert "the case says 'aggregates'" in err
    assert "25.78 GPa, of cylinders 24.92 GPa (+3.5 %)" in err
    for particles in ("spheres", "cylinders"):
        chosen = [f'cell.particles="{particles}"', "modulus.method=series"]
        assert main(["check", str(path), "--set", chosen[0], "--set", chosen[1]]) == 0
        assert "aggregates" not in capfd.readouterr().err


def remarks_of(words, tmp_path, capfd):
    """What check warns of, of a planar case with these words."""
    lines = (Path(PAPER).parent / "porous.toml").read_text(encoding="utf-8").splitlines()
    kept = [line for line in lines if not line.startswith("particles")]
    text = (
        "\n".join(kept)
        .replace("aggregates", "particles")
        .replace("Porous matrix: soft inclusions", words)
    )
    path = tmp_path / "own.toml"
    path.write_text(text, encoding="utf-8")
    assert main(["check", str(path)]) == 0
    return [line for line in capfd.readouterr().err.splitlines() if "cell.particles" in line]


@pytest.mark.parametrize(
    ("words", "word"),
    [
        ("Epoxy with glass spheres", "spheres"),
        ("Harz mit Glaskugeln", "Glaskugeln"),
        ("Kugeln in einer Matrix", "Kugeln"),
        ("Mortar with aggregates", "aggregates"),
        ("Concrete by its sieve curve", "sieve"),
        ("Beton nach Sieblinie", "Sieblinie"),
        ("From the diameters of particles", "diameters of particles"),
        ("Gesteinskörnung 0/16", "Gesteinskörnung"),
    ],
)
def test_words_for_spheres_are_told_the_difference_in_one_line(words, word, tmp_path, capfd):
    (line,) = remarks_of(words, tmp_path, capfd)
    assert f"the case says {word!r}" in line
    bound = re.search(r"bound of E is (\S+) GPa, of cylinders (\S+) GPa \((\S+) %\)", line)
    space, plane, apart = (float(value) for value in bound.groups())
    assert apart == pytest.approx(100 * (space / plane - 1), abs=0.1)


@pytest.mark.parametrize(
    "words",
    [
        "Glass fibres in epoxy",
        "Carbon fiber, sand-blasted: sand",
        "Glasfasern mit Kugeln aus Luft",
        "Steel wires and gravel",
        "Bars of one diameter in a sandwich",
        "Round pores",
    ],
)
def test_fibres_raise_no_alarm(words, tmp_path, capfd):
    assert not remarks_of(words, tmp_path, capfd)


@pytest.mark.parametrize(
    ("words", "header", "told"),
    [
        ("Particles", "d [mm]", True),
        ("Particles", "d [mm],x [mm]", True),
        ("Fibres", "d [mm]", False),
        ("Particles", "d [mm],x [mm],y [mm]", False),
    ],
)
def test_sizes_without_places_say_spheres_before_they_are_packed(
    words, header, told, tmp_path, capfd
):
    lines = (Path(PAPER).parent / "concrete.toml").read_text(encoding="utf-8").splitlines()
    ends = ("particles", "smallest_radius", "largest_radius", "title", "about", "Twenty", "of the")
    kept = [line for line in lines if not line.startswith((*ends, "vibration of"))]
    at = kept.index("[microstructure.packing]") + 1
    text = "\n".join(
        [f'title = "{words}"', 'about = "-"', *kept[:at], 'file = "d.csv"', *kept[at:]]
    )
    (tmp_path / "own.toml").write_text(text, encoding="utf-8")
    rows = "".join(f"{','.join(k * header.count('['))}\n" for k in "345")
    (tmp_path / "d.csv").write_text(f"{header}\n{rows}", encoding="utf-8")
    assert main(["check", str(tmp_path / "own.toml")]) == 0
    err = capfd.readouterr().err
    assert ("d.csv has sizes without places" in err) == told
    assert ("of spheres at the same volume fraction 0.2000" in err) == told


@pytest.mark.parametrize("ending", [".inp", ".comm", ".mac", ".json"])
def test_a_material_card_of_spheres_is_cubic(ending, tmp_path):
    path = tmp_path / f"card{ending}"
    assert main(["cell", PAPER, *SPHERES, "--radius", "0.6", "--export", str(path)]) == 0
    text = path.read_text(encoding="utf-8")
    assert "Hill's average" in text
    assert "2.31753751" in text.replace("23175375191", "2.3175375191")  # E along the axes
    assert "plane" not in text.lower()


def test_discs_make_no_radii_of_spheres(capfd):
    case = str(Path(PAPER).with_name("concrete.toml"))
    changes = [*SPHERES[:2], "--set", 'modulus.method="series"']
    assert main(["check", case, *changes]) == 2
    (line,) = capfd.readouterr().err.splitlines()
    assert "cell.particles = spheres: stage microstructure measures discs" in line
    assert "section [microstructure.spheres] in place of [microstructure.packing]" in line


def test_a_contrast_that_elements_do_not_solve_is_left_to_the_series(capfd):
    pytest.importorskip("dolfinx")
    soft = ["--radius", "0.6", "--set", "cell.inclusion_modulus='1 MPa'", "--tolerance", "1e-3"]
    asked = ["cell", PAPER, "--set", 'cell.particles="spheres"', *soft]
    assert main([*asked, "--method", "table"]) == 1
    assert "take --method series" in capfd.readouterr().err
    assert main([*asked, "--method", "series"]) == 0
