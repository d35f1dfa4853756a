"""Guards against what other programs do, with harmless input: rows of docs/tools.md that no room tests."""

import os
import struct
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import scipy.io

from alphacut.frame import read_matrix
from alphacut.rve import read_image
from tests.refused import refuses

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "tools.md"


@pytest.mark.parametrize("rows", [99, 100])
def test_matrix_market_files_say_symmetric_or_general_and_give_the_same_matrix(tmp_path, rows):
    stiffness = scipy.sparse.diags([2.0, -1.0, -1.0], [0, 1, -1], shape=(rows, rows))
    scipy.io.mmwrite(tmp_path / "k.mtx", stiffness)
    assert ("symmetric" in (tmp_path / "k.mtx").read_text().split("\n")[0]) == (rows < 100)
    assert np.array_equal(read_matrix(tmp_path / "k.mtx"), stiffness.toarray())


def test_a_thin_volume_saved_as_colour_or_as_pages_is_refused(tmp_path):
    from PIL import Image

    slices = np.arange(192, dtype=np.uint8).reshape(8, 8, 3)
    Image.fromarray(slices).save(tmp_path / "three.tif")
    first, *others = (Image.fromarray(np.full((8, 8), k, np.uint8)) for k in range(5))
    first.save(tmp_path / "five.tif", save_all=True, append_images=others)
    for name, key in (("three.tif", "three.tif"), ("five.tif", "five.tif")):
        with refuses(key):
            read_image(tmp_path / name, spacing=(1.0, 1.0))


def test_pixels_that_the_file_says_are_not_square_are_refused(tmp_path):
    from PIL import Image

    picture = Image.fromarray(np.arange(64, dtype=np.uint8).reshape(8, 8))
    picture.save(tmp_path / "a.tif", dpi=(100, 300))
    with refuses("a.tif"):
        read_image(tmp_path / "a.tif", spacing=1.0)


def test_a_bmp_whose_resolution_is_zero_has_square_pixels(tmp_path):
    """Many programs leave the pixels per metre, bytes 38 to 45 of the file, at 0."""
    from PIL import Image

    values = np.arange(64, dtype=np.uint8).reshape(8, 8)
    Image.fromarray(values).save(tmp_path / "a.bmp")
    content = bytearray((tmp_path / "a.bmp").read_bytes())
    content[38:46] = bytes(8)
    (tmp_path / "a.bmp").write_bytes(content)
    assert np.array_equal(read_image(tmp_path / "a.bmp", spacing=1.0).values, values[::-1])


def test_a_tiff_whose_resolution_is_over_zero_states_no_pixels(tmp_path):
    from PIL import Image, TiffImagePlugin

    values = np.arange(64, dtype=np.uint8).reshape(8, 8)
    tags = TiffImagePlugin.ImageFileDirectory_v2()
    x_resolution, y_resolution, unit = 282, 283, 296
    tags[x_resolution] = TiffImagePlugin.IFDRational(0, 0)
    tags[y_resolution] = TiffImagePlugin.IFDRational(72, 1)
    tags[unit] = 2  # inch
    Image.fromarray(values).save(tmp_path / "a.tif", tiffinfo=tags)
    assert np.array_equal(read_image(tmp_path / "a.tif", spacing=1.0).values, values[::-1])


@pytest.mark.parametrize("kind", [np.uint32, np.int8])
def test_integers_whose_sign_pillow_changes_are_refused(tmp_path, kind):
    from PIL import Image

    values = np.tile(np.array([[-5, 1]]).astype(kind), (4, 2))
    picture = Image.fromarray(values.view(np.int32 if kind is np.uint32 else np.uint8))
    picture.save(tmp_path / "labels.tif", tiffinfo={339: 2})  # tag of the sample format: signed
    if kind is np.uint32:
        content = (tmp_path / "labels.tif").read_bytes()
        signed, unsigned = (struct.pack("<HHIHH", 339, 3, 1, x, 0) for x in (2, 1))
        (tmp_path / "labels.tif").write_bytes(content.replace(signed, unsigned))
    with refuses("labels.tif"):
        read_image(tmp_path / "labels.tif", spacing=1.0)


def test_gmsh_takes_no_settings_of_the_caller(tmp_path):
    (tmp_path / ".gmshrc").write_text("Mesh.ElementOrder = 3;\nGeometry.Tolerance = 0.1;\n")
    program = """
from alphacut.rve.mesh import square
with square.open_gmsh() as gmsh:
    print(gmsh.option.getNumber("Mesh.ElementOrder"), gmsh.option.getNumber("Geometry.Tolerance"))
"""
    variables = os.environ | {"HOME": str(tmp_path)}
    command = [sys.executable, "-c", program]
    done = subprocess.run(command, env=variables, capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["1.0", "1e-08"]


def test_every_row_names_a_test_or_a_script_that_exists():
    rows = [line for line in PAGE.read_text(encoding="utf-8").splitlines() if line.startswith("| ")]
    holders = {row.split("|")[-2].strip(" `") for row in rows} - {"held by"}
    tests = "".join(path.read_text(encoding="utf-8") for path in (ROOT / "tests").rglob("*.py"))
    assert len(holders) >= 30
    lost = [x for x in holders if f"def {x}(" not in tests and not (ROOT / x).is_file()]
    assert not lost
