"""Images and volumes from files: the same values from every format, or one line; their memory."""

import gzip
import itertools
import struct
import subprocess
import sys
import zlib

import numpy as np
import pytest
from PIL import Image
from PIL.PngImagePlugin import PngInfo

from alphacut.fuzzy import RefusedError
from alphacut.rve import read_image
from alphacut.rve.image.files import files_of
from alphacut.rve.image.memory import needed_memory, require_memory
from tests.refused import refuses

tifffile = pytest.importorskip("tifffile")
SHAPE = 12, 5, 7
HEAD = "ObjectType = Image\nNDims = 3\nDimSize = 7 5 12\n"
NRRD = "NRRD0004\n# comment\ntype: {}\ndimension: 3\nsizes: 7 5 12\nencoding: {}\n"


def voxels_of(path, sides=(1, 1, 1)):
    """Values of a volume whose voxels have sides along (z, y, x)."""
    return read_image(path, spacing=sides[::-1]).values


def pixels_of(path):
    return read_image(path, spacing=1.0).values


def stack(path, values, **options):
    tifffile.imwrite(path, values, **options)


def slices(path, values):
    path.mkdir()
    for k, page in enumerate(values):  # 1, 2, …, 10: as numbers, not as texts
        Image.fromarray(page).save(path / f"slice{k + 1}.png")


def meta_image(path, values, *, order="<", head=""):
    values.astype(values.dtype.newbyteorder(order)).tofile(path.with_suffix(".raw"))
    kind = {"u1": "MET_UCHAR", "u2": "MET_USHORT", "f4": "MET_FLOAT"}[values.dtype.str[1:]]
    is_big = order == ">"
    text = f"{HEAD}BinaryDataByteOrderMSB = {is_big}\n{head}ElementType = {kind}\n"
    path.write_text(f"{text}ElementDataFile = {path.stem}.raw\n")


def local_image(path, values):
    kind = {"u1": "MET_UCHAR", "u2": "MET_USHORT", "f4": "MET_FLOAT"}[values.dtype.str[1:]]
    head = f"{HEAD}ElementType = {kind}\nElementDataFile = LOCAL\n"
    path.write_bytes(head.encode() + values.tobytes())


def nrrd(path, values, *, attached):
    kind = {"u1": "uchar", "u2": "unsigned short", "f4": "float"}[values.dtype.str[1:]]
    head = NRRD.format(kind, "raw") + "endian: little\nspacings: 2 2 2\n"
    if attached:
        path.write_bytes(head.encode() + b"\n" + values.tobytes())
        return
    values.tofile(path.with_suffix(".raw"))
    path.write_text(f"{head}data file: {path.stem}.raw\n")


def nrrd_with(path, line, values=None):
    """NRRD of zeros, or of values along (z, y, x), with one more line in its head."""
    values = np.zeros(SHAPE, "u1") if values is None else values
    sizes = " ".join(map(str, values.shape[::-1]))
    head = NRRD.format("uchar", "raw").replace("7 5 12", sizes)
    path.write_bytes(f"{head}{line}\n\n".encode() + values.tobytes())


@pytest.mark.parametrize("kind", ["u1", "u2", "f4"])
def test_every_format_gives_the_same_voxels(tmp_path, kind, rng):
    values = rng.integers(0, 250, SHAPE).astype(kind)
    np.save(tmp_path / "a.npy", values)
    stack(tmp_path / "plain.tif", values)
    stack(tmp_path / "stack.tif", values, imagej=True, metadata={"axes": "ZYX"})
    stack(tmp_path / "channels.tif", values, imagej=True)  # so tifffile calls slices
    stack(tmp_path / "times.tif", values[None], imagej=True, metadata={"axes": "TZYX"})
    stack(tmp_path / "big.tif", values, bigtiff=True, compression="zlib")
    stack(tmp_path / "ome.ome.tif", values, metadata={"axes": "ZYX"})
    meta_image(tmp_path / "little.mhd", values)
    meta_image(tmp_path / "big.mhd", values, order=">")
    local_image(tmp_path / "local.mha", values)
    nrrd(tmp_path / "beside.nhdr", values, attached=False)
    nrrd(tmp_path / "whole.nrrd", values, attached=True)
    if kind != "f4":
        slices(tmp_path / "slices", values)
    for path in tmp_path.iterdir():
        if path.suffix != ".raw":
            assert np.array_equal(voxels_of(path), values), path.name


def test_endings_in_capitals_are_those_in_small_letters(tmp_path, rng):
    values = rng.integers(0, 250, SHAPE).astype("u1")
    meta_image(tmp_path / "HEAD.MHD", values)
    slices(tmp_path / "slices", values)
    for file in [*(tmp_path / "slices").iterdir()]:
        file.rename(file.with_suffix(".PNG"))
    for name in ("HEAD.MHD", "slices"):
        assert np.array_equal(voxels_of(tmp_path / name), values), name
    assert [file.name for file in files_of(tmp_path / "HEAD.MHD")] == ["HEAD.MHD", "HEAD.raw"]


STACKS = {
    "in colours": ((4, 5, 6, 3), {"photometric": "rgb"}),
    "axes CYX": ((3, 5, 6), {"imagej": True}),
    "axes ZCYX": ((2, 4, 5, 6), {"imagej": True}),
    "axes YX": ((5, 6), {}),
}


@pytest.mark.parametrize("message", STACKS)
def test_pages_that_are_no_volume_are_told(tmp_path, message):
    shape, options = STACKS[message]
    stack(tmp_path / "a.tif", np.arange(np.prod(shape), dtype="u2").reshape(shape), **options)
    with pytest.raises(RefusedError, match=message):
        voxels_of(tmp_path / "a.tif")


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("plane.npy", np.zeros((5, 6))),
        ("complex.npy", np.zeros((4, 5, 6), complex)),
        ("thin.npy", np.zeros((1, 5, 6))),
        ("nan.npy", np.full((2, 5, 6), np.nan)),
        ("v.vti", b"0"),
        ("noise.tif", b"II*\0nonsense"),
        ("folder", None),
    ],
)
def test_files_that_are_no_volume_of_numbers_are_refused(tmp_path, name, content):
    path = tmp_path / name
    if content is None:
        path.mkdir()
    elif isinstance(content, bytes):
        path.write_bytes(content)
    else:
        np.save(path, content)
    with refuses(name) as told:
        voxels_of(path)
    assert "\n" not in str(told.value)


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("DimSize = 7 5 11", "420 bytes; allowed: 385 for 7 × 5 × 11 of uint8; mend the sizes"),
        ("DimSize = -7 -5 12", "sizes -7 -5 12"),
        ("CompressedData = True", "gzip or zlib"),
        ("ElementSpacing = 1 1 2", "voxels of 1 × 1 × 2"),
        ("ElementSize = 1 1 3", "1 × 1 × 3 along"),
        ("ElementType = MET_LONG_LONG", "type"),
        ("ElementDataFile = x", "data in x, which is no file; allowed: a file, from the folder"),
        ("HeaderSize = 1", "allowed: 1 \\+ 420"),
        ("HeaderSize = -2", "−1 of raw data"),
        ("ElementNumberOfChannels = 3", "one"),
        ("encoding: hex", "raw or gzip"),
        ("spacings: 1 -1 1", "greater than 0"),
        ("spacings: 1 inf 1", "finite"),
        ("spacings: 1 nan 1.1", "1 × 1.1 along x, z"),
        ("space directions: (1,1,0) (1,-1,0) (0,0,1)", "along x, y and z"),
        ("space directions: (1,0,0) (1,0,0) (0,0,1)", "along x, y and z"),
        ("space directions: (0,0,3) (0,1,0) (1,0,0)", "1 × 1 × 3 along"),
    ],
)
def test_heads_that_are_not_read_tell_what_is(tmp_path, line, message):
    path = tmp_path / "a.mhd"
    if "=" in line:
        meta_image(path, np.zeros(SHAPE, "u1"))
        end = "ElementDataFile = a.raw\n"
        path.write_text(path.read_text().replace(end, f"{line}\n{end}"))
    else:
        path = tmp_path / "a.nrrd"
        nrrd_with(path, line)
    with pytest.raises(RefusedError, match=message) as told:
        voxels_of(path)
    assert "\n" not in str(told.value)


def test_slices_that_are_not_alike_and_bent_voxels_are_told(tmp_path):
    slices(tmp_path / "slices", np.zeros((3, 5, 6), np.uint8))
    Image.fromarray(np.zeros((5, 7), np.uint8)).save(tmp_path / "slices/slice4.png")
    with refuses("slice4.png"):
        voxels_of(tmp_path / "slices")
    meta_image(tmp_path / "c.mhd", np.zeros(SHAPE, "u1"), head="ElementSpacing = 1 1 2\n")
    assert voxels_of(tmp_path / "c.mhd", (2, 1, 1)).shape == SHAPE


@pytest.mark.parametrize(
    ("shape", "what"),
    [((10**4,) * 3, "10000 × 10000 × 10000 voxels"), ((10**6,) * 2, "1000000 × 1000000 pixels")],
)
def test_a_grid_too_large_is_told_what_fits(shape, what):
    with refuses("image"):
        require_memory(shape)


def test_memory_is_foreseen_within_a_third():
    program = """
import re, numpy as np
from alphacut.rve.image.model import solve_image
bulk = np.where(np.random.default_rng(1).random((128, 128)) < 0.5, 1e9, 5e9)
solve_image(bulk, bulk / 2)
print(1024 * int(re.search(r"VmHWM:\\s+(\\d+)", open("/proc/self/status").read())[1]))
"""
    found = subprocess.run([sys.executable, "-c", program], capture_output=True, check=True)
    assert 1 / 1.3 < needed_memory((128, 128)) / int(found.stdout) < 1.3


@pytest.mark.parametrize("kind", ["u1", "u2"])
def test_grey_values_are_read_as_they_are(tmp_path, rng, kind):
    values = rng.integers(0, 250, (5, 7)).astype(kind)
    np.save(tmp_path / "a.npy", values)
    for name in ("a.png", "a.tif"):
        Image.fromarray(values).save(tmp_path / name)
    for path in tmp_path.iterdir():
        assert np.array_equal(pixels_of(path), values[::-1])


def test_a_mask_whose_white_is_zero_is_refused_with_its_fraction(tmp_path):
    """Readers of such a TIFF disagree on which of both values is bright: tifffile writes masks so."""
    mask = Image.fromarray(np.arange(32 * 32).reshape(32, 32) < 256)
    for photometric in (1, 0):
        mask.save(tmp_path / "mask.tif", tiffinfo={262: photometric})
        if photometric:
            assert pixels_of(tmp_path / "mask.tif").mean() == 0.25
            continue
        with refuses("mask.tif"):
            pixels_of(tmp_path / "mask.tif")


BROKEN = {
    "colour.png": np.arange(48, dtype=np.uint8).reshape(4, 4, 3),
    "line.npy": np.arange(5.0),
    "text.png": b"no image",
    "header.npy": b"\x93NUMPY\x01\x00\x08\x00{'descr\n",  # NumPy's reader raises a TokenError
}


@pytest.mark.parametrize("name", BROKEN)
def test_files_that_are_no_plane_grey_image_are_refused(tmp_path, name):
    path, content = tmp_path / name, BROKEN[name]
    if isinstance(content, bytes):
        path.write_bytes(content)
    elif name.endswith("npy"):
        np.save(path, content)
    else:
        Image.fromarray(content).save(path)
    with refuses(name):
        pixels_of(path)


@pytest.mark.parametrize("word", ["true", "T", "1"])
def test_every_word_for_big_endian_is_read_so(tmp_path, rng, word):
    values = rng.integers(0, 60000, SHAPE).astype("u2")
    for key in ("BinaryDataByteOrderMSB", "ElementByteOrderMSB"):
        meta_image(tmp_path / "a.mhd", values, order=">")
        text = (tmp_path / "a.mhd").read_text()
        text = text.replace("BinaryDataByteOrderMSB = True", f"{key} = {word}")
        (tmp_path / "a.mhd").write_text(text)
        assert np.array_equal(voxels_of(tmp_path / "a.mhd"), values)


def test_compressed_volumes_and_those_at_the_end_of_a_file_are_read(tmp_path, rng):
    values = rng.integers(0, 250, SHAPE).astype("u1")
    meta_image(tmp_path / "end.mhd", values, head="HeaderSize = -1\n")
    (tmp_path / "end.raw").write_bytes(b"a head of another program" + values.tobytes())
    assert np.array_equal(voxels_of(tmp_path / "end.mhd"), values)
    for skip in ("byte skip: -1", "byteskip: 17", "byte skip: 17"):
        head = NRRD.format("uchar", "raw") + f"{skip}\ndata file: skip.raw\n"
        (tmp_path / "skip.nhdr").write_text(head)
        (tmp_path / "skip.raw").write_bytes(bytes(17) + values.tobytes())
        assert np.array_equal(voxels_of(tmp_path / "skip.nhdr"), values)
    meta_image(tmp_path / "zlib.mhd", values, head="CompressedData = True\n")
    (tmp_path / "zlib.raw").write_bytes(zlib.compress(values.tobytes()))
    assert np.array_equal(voxels_of(tmp_path / "zlib.mhd"), values)
    head = NRRD.format("uchar", "gzip").encode() + b"\n"
    (tmp_path / "gzip.nrrd").write_bytes(head + gzip.compress(values.tobytes()))
    assert np.array_equal(voxels_of(tmp_path / "gzip.nrrd"), values)
    for packed in (gzip.compress(bytes(10**7)), gzip.compress(b"few")):
        (tmp_path / "gzip.nrrd").write_bytes(head + packed)
        with refuses("gzip.nrrd"):
            voxels_of(tmp_path / "gzip.nrrd")


@pytest.mark.parametrize("order", list(itertools.permutations(range(3))))
def test_axes_in_any_order_and_direction_are_those_of_the_world(tmp_path, rng, order):
    """The file's axes run along ± x, y, z in some order; the values come back along z, y, x."""
    world = rng.integers(0, 250, (4, 5, 6)).astype("u1")  # along z, y, x
    signs = rng.choice([-1, 1], 3)
    along_file = world.transpose([2 - axis for axis in order[::-1]])
    flips = tuple(slice(None, None, int(signs[axis])) for axis in order[::-1])
    stored = np.ascontiguousarray(along_file[flips])
    sides = (2.0, 1.5, 1.0)  # of a voxel along z, y, x
    rows = [np.eye(3, dtype=int)[axis] * signs[axis] for axis in order]
    vectors = [row * sides[2 - axis] for row, axis in zip(rows, order, strict=True)]
    directions = " ".join(f"({x:g},{y:g},{z:g})" for x, y, z in vectors)
    nrrd_with(tmp_path / "a.nrrd", f"space directions: {directions}", stored)
    assert np.array_equal(voxels_of(tmp_path / "a.nrrd", sides), world)
    spacing = " ".join(f"{sides[2 - axis]:g}" for axis in order)
    matrix = " ".join(f"{x}" for row in rows for x in row)
    head = f"TransformMatrix = {matrix}\nElementSpacing = {spacing}\n"
    meta_image(tmp_path / "a.mhd", stored, head=head)
    text = (tmp_path / "a.mhd").read_text()
    sizes = " ".join(map(str, stored.shape[::-1]))
    (tmp_path / "a.mhd").write_text(text.replace("7 5 12", sizes))
    assert np.array_equal(voxels_of(tmp_path / "a.mhd", (2.0, 1.5, 1.0)), world)


SPACED = {
    "ImageJ": ("a.tif", {"imagej": True, "resolution": (1.0, 1.0), "metadata": {"axes": "ZYX", "spacing": 5.0, "unit": "um"}}),
    "ImageJ in pixels": ("a.tif", {"imagej": True, "metadata": {"axes": "ZYX", "spacing": 5.0}}),
    "ImageJ along x": ("a.tif", {"imagej": True, "resolution": (5.0, 1.0), "metadata": {"axes": "ZYX"}}),
    "TIFF": ("a.tif", {"resolution": (1.0, 5.0)}),
    "OME": ("a.ome.tif", {"metadata": {"axes": "ZYX", "PhysicalSizeX": 1.0, "PhysicalSizeY": 1.0, "PhysicalSizeZ": 5.0}}),
    "OME in units": ("a.ome.tif", {"metadata": {"axes": "ZYX", "PhysicalSizeX": 1.0, "PhysicalSizeY": 1.0,
                     "PhysicalSizeZ": 0.005, "PhysicalSizeZUnit": "mm"}}),
}  # fmt: skip
MICRO = (5e-6, 1e-6, 1e-6)
RIGHT = {"ImageJ along x": (5, 5, 1), "TIFF": (1, 1, 5), "ImageJ": MICRO, "OME in units": MICRO}
"""Sides of a voxel along z, y, x; else (5, 1, 1)."""


@pytest.mark.parametrize("name", SPACED)
def test_spacing_in_heads_of_tiff_is_that_of_the_case(tmp_path, rng, name):
    values = rng.integers(0, 250, SHAPE).astype("u1")
    file, options = SPACED[name]
    stack(tmp_path / file, values, **options)
    right = RIGHT.get(name, (5, 1, 1))
    assert np.array_equal(voxels_of(tmp_path / file, right), values)
    with pytest.raises(RefusedError, match=r"voxels of .* along x, y"):
        voxels_of(tmp_path / file)


@pytest.mark.parametrize("kind", ["u1", "u2"])
def test_white_as_zero_means_the_same_in_a_stack_a_folder_and_a_picture(tmp_path, rng, kind):
    values = rng.integers(0, 250, SHAPE).astype(kind)
    shown = np.iinfo(kind).max - values
    stack(tmp_path / "stack.tif", values, photometric="miniswhite")
    (tmp_path / "folder").mkdir()
    for k, page in enumerate(values):
        stack(tmp_path / f"folder/page{k}.tif", page, photometric="miniswhite")
    assert np.array_equal(voxels_of(tmp_path / "stack.tif"), shown)
    assert np.array_equal(voxels_of(tmp_path / "folder"), shown)
    assert np.array_equal(pixels_of(tmp_path / "folder/page0.tif"), shown[0, ::-1])


def test_a_stack_that_promises_more_than_its_file_holds_is_refused(tmp_path):
    stack(tmp_path / "a.tif", np.zeros((3, 40, 50), "u1"), photometric="minisblack")
    content = (tmp_path / "a.tif").read_bytes()
    with tifffile.TiffFile(tmp_path / "a.tif") as file:
        places = [page.tags["ImageLength"].valueoffset for page in file.pages]
    for place in places:
        content = content[:place] + (4000).to_bytes(4, "little") + content[place + 4 :]
    (tmp_path / "a.tif").write_bytes(content)
    with refuses("a.tif"):
        voxels_of(tmp_path / "a.tif")


def test_pages_of_pillow_are_a_stack_whatever_their_compression(tmp_path, rng):
    for kind in ("u1", "u2"):
        values = rng.integers(0, 250, SHAPE).astype(kind)
        pages = [Image.fromarray(page) for page in values]
        for compression in ("tiff_lzw", "tiff_deflate", "raw"):
            path = tmp_path / f"{kind}-{compression}.tif"
            pages[0].save(path, save_all=True, append_images=pages[1:], compression=compression)
            assert np.array_equal(voxels_of(path), values)
        with tifffile.TiffWriter(tmp_path / "pages.tif") as file:
            for page in values:
                file.write(page, contiguous=False)
        assert np.array_equal(voxels_of(tmp_path / "pages.tif"), values)
        with tifffile.TiffWriter(tmp_path / "unlike.tif") as file:
            for page in (values[0], values[1, 1:]):
                file.write(page, contiguous=False)
        with refuses("unlike.tif"):
            voxels_of(tmp_path / "unlike.tif")


def test_colours_that_are_equal_are_grey_values(tmp_path, rng):
    values = rng.integers(0, 250, SHAPE).astype("u1")
    stack(tmp_path / "rgb.tif", np.repeat(values[..., None], 3, axis=3), photometric="rgb")
    assert np.array_equal(voxels_of(tmp_path / "rgb.tif"), values)
    grey = Image.fromarray(values[0])
    for mode in ("RGB", "RGBA", "LA", "P"):
        grey.convert(mode).save(tmp_path / f"{mode}.png")
        assert np.array_equal(pixels_of(tmp_path / f"{mode}.png"), values[0, ::-1])
    clear = grey.convert("RGBA")
    clear.putpixel((0, 0), (7, 7, 7, 100))
    clear.save(tmp_path / "clear.png")
    with refuses("clear.png"):
        pixels_of(tmp_path / "clear.png")


@pytest.mark.parametrize("name", ["rec_{:04d}_8bit", "2024-01-02_s{}_x3", "{}"])
def test_the_number_that_changes_in_names_is_that_of_the_slice(tmp_path, rng, name):
    values = rng.integers(0, 250, SHAPE).astype("u1")
    for k, page in enumerate(values):
        Image.fromarray(page).save(tmp_path / f"{name.format(k)}.png")
    assert np.array_equal(voxels_of(tmp_path), values)


@pytest.mark.parametrize("spacing", [0, np.inf, "1", (), (1e-3, np.nan)])
def test_lengths_of_pixels_that_are_no_positive_numbers_are_refused(tmp_path, spacing):
    np.save(tmp_path / "a.npy", np.eye(4))
    with refuses("spacing"):
        read_image(tmp_path / "a.npy", spacing=spacing)


NM = 1e-9


def test_units_of_single_axes_are_compared_and_may_be_overridden(tmp_path, rng):
    values = rng.integers(0, 250, SHAPE).astype("u1")
    head = {"axes": "ZYX", "unit": "nm", "zunit": "\\u00B5m", "spacing": 0.025}
    path = tmp_path / "a.tif"
    stack(path, values, imagej=True, resolution=(1 / 16.5, 1 / 16.5), metadata=head)
    assert np.array_equal(voxels_of(path, (25 * NM, 16.5 * NM, 16.5 * NM)), values)
    wrong = (16.5 * NM, 16.5 * NM, 0.025 * NM)  # along x, y, z
    with refuses("a.tif"):
        read_image(path, spacing=wrong)
    with pytest.warns(UserWarning, match="of a.tif what it states of its voxel is overridden"):
        assert read_image(path, spacing=wrong, override=["voxel"]).lengths == wrong[::-1]


@pytest.mark.parametrize(
    ("form", "line", "micrometres"),
    [
        ("mhd", "ElementSpacing = 2 2 5\nDistanceUnits = um", (2, 2, 5)),
        ("mhd", "Comment = voxel size 2 x 2 x 5 um", (2, 2, 5)),
        ("mhd", "ElementSize = 0.002 0.002 0.005\nDistanceUnits = mm", (2, 2, 5)),
        ("mhd", "Comment = resolution 5 microns", (5, 5, 5)),
        ("nrrd", 'spacings: 2 2 5\nspace units: "microns" "microns" "microns"', (2, 2, 5)),
        ("nrrd", "# voxel: 2 x 2 x 5 um", (2, 2, 5)),
        ("nrrd", "pixel_size:=2 um", (2, 2, 2)),
        ("nrrd", "spacings: 2 2 5\n# lengths in micrometers", (2, 2, 5)),
        ("mhd", "Spacing: 2 um", (2, 2, 2)),
        ("mhd", "Comment = 2 um/pixel in plane, slices every 5 um", (2, 2, 5)),
        ("mhd", "Comment = isotropic 5 um", (5, 5, 5)),
        ("mhd", "Comment = 1 voxel = 5 micrometers", (5, 5, 5)),
        ("mhd", "ElementSpacing = 2 2 5\nElementSpacingUnit = microns", (2, 2, 5)),
        ("mhd", "ElementSpacing = .002 .002 .005\nDistanceUnits = millimeter", (2, 2, 5)),
        ("mhd", "Comment = pixel size: 2 um, z step: 5 um", (2, 2, 5)),
        ("nrrd", "voxelsize:=2.0 2.0 5.0 µm", (2, 2, 5)),
        ("nrrd", "content: scan at 5 µm/voxel", (5, 5, 5)),
        ("nrrd", "# spacing (um): 2 2 5", (2, 2, 5)),
        ("nrrd", "# voxels of 0.002*0.002*0.005 mm3", (2, 2, 5)),
        ("nrrd", 'content: {"voxel_size_um": [2, 2, 5]}', (2, 2, 5)),
        ("mhd", "Comment = PixelWidth=2 um PixelHeight=2 um VoxelDepth=5 um", (2, 2, 5)),
        (
            "nrrd",
            'centerings: node node node\naxis mins: 0 0 0\naxis maxs: 12 8 55\nunits: "um" "um" "um"',
            (2, 2, 5),
        ),
        ("nrrd", 'spacings: 2 2 0.005\nunits: "um" "um" "mm"', (2, 2, 5)),
        ("nrrd", "# dx=2um dy=2um dz=5um", (2, 2, 5)),
        ("mhd", "Comment = x: 2 um, y: 2 um, z: 5 um", (2, 2, 5)),
        ("nrrd", 'meta:={"dx": 2e-6, "dy": 2e-6, "dz": 5e-6, "unit": "m"}', (2, 2, 5)),
        ("nrrd", "# 500 px/mm", (2, 2, 5)),
        ("mhd", "Comment = 12700 dpi", (2, 2, 5)),
        ("nrrd", "# 500 voxels per mm", (2, 2, 2)),
        ("nrrd", "# scale: 1 px = 2 um", (2, 2, 5)),
        ("nrrd", "sampling:=2um;2um;5um", (2, 2, 5)),
        ("mhd", "Comment = voxel volume 20 um^3, pixel 2 um", (2, 2, 5)),
        ("mhd", "Comment = pixel 2 um\nComment = slices every 5 um", (2, 2, 5)),
        ("mhd", "Comment = every 2 um in x and y, every 5 um in z", (2, 2, 5)),
        ("mhd", "Comment = camera pixel 20 um, voxel 2 um, slices every 5 um", (2, 2, 5)),
        ("nrrd", "# xy 2 um z 5 um", (2, 2, 5)),
        ("nrrd", "spacings: 2e-3 2e-3 5e-3\n# mm", (2, 2, 5)),
        ("nrrd", "# 2 µm in the plane\n# 5 µm across", (2, 2, 5)),
        ("nrrd", 'spacings: 2 2 5\nlabels: "x [um]" "y [um]" "z [um]"', (2, 2, 5)),
        ("nrrd", "spacings: 1 1 2.5\n# 2 µm, 5 µm", (2, 2, 5)),
        ("nrrd", "content: {unit: m, pixel_size: 2e-6}", (2, 2, 5)),
        ("nrrd", "# extent: 14 x 10 x 60 micrometres", (2, 2, 5)),
        ("mhd", "Comment = field of view 14 um x 10 um x 60 um", (2, 2, 5)),
        ("nrrd", "spacings: 20000 20000 50000\n# unit: Å", (2, 2, 5)),
        (
            "nrrd",
            'spacings: 2 2 nan\nthicknesses: nan nan 5\nunits: "um" "um" "um"',
            (2, 2, 5),
        ),
        (
            "nrrd",
            'space units: "um" "um" "um"\nspace directions: (0,0,5) (0,2,0) (2,0,0)',
            (2, 2, 5),
        ),
    ],
)
def test_sides_that_heads_state_with_units_are_those_of_the_case(tmp_path, form, line, micrometres):
    path = tmp_path / "a.nrrd"
    if form == "nrrd":
        nrrd_with(path, line)
    else:
        path = tmp_path / "a.mhd"
        meta_image(path, np.zeros(SHAPE, "u1"), head=f"{line}\n")
    assert read_image(path, spacing=[x * 1e-6 for x in micrometres])
    for factors in ((1e-3, 1e-3, 1e-3), (3e-6, 1e-6, 1e-6), (1e-6, 3e-6, 1e-6)):
        with refuses(path.name):
            read_image(path, spacing=[f * x for f, x in zip(factors, micrometres, strict=True)])


@pytest.mark.parametrize(
    "line",
    [
        "kinds: domain domain time",
        'units: "um" "um" "s"\nspacings: 1 1 1',
        "space: scanner-xyz-time",
        'labels: "x" "y" "t"',
        "kinds: list domain domain",
    ],
)
def test_a_time_as_an_axis_is_no_volume(tmp_path, line):
    nrrd_with(tmp_path / "a.nrrd", line)
    with refuses("a.nrrd"):
        voxels_of(tmp_path / "a.nrrd")
    stack(tmp_path / "t.tif", np.zeros(SHAPE, "u1"), imagej=True, metadata={"axes": "TYX"})
    with refuses("t.tif"):
        voxels_of(tmp_path / "t.tif")


@pytest.mark.parametrize("names", ["LIST", "s_%02d.raw 0 11 1"])
def test_lists_and_patterns_of_slices_are_read_from_the_folder_of_the_head(tmp_path, rng, names):
    values = rng.integers(0, 250, SHAPE).astype("u1")
    for k, page in enumerate(values):
        page.tofile(tmp_path / f"s_{k:02d}.raw")
    listed = "".join(f"\ns_{k:02d}.raw" for k in range(12)) if names == "LIST" else ""
    meta = f"{HEAD}ElementType = MET_UCHAR\nElementDataFile = {names}{listed}\n"
    (tmp_path / "a.mhd").write_text(meta)
    (tmp_path / "a.nhdr").write_text(NRRD.format("uchar", "raw") + f"data file: {names}{listed}\n")
    for head in ("a.mhd", "a.nhdr"):
        assert np.array_equal(voxels_of(tmp_path / head), values)
        assert len(files_of(tmp_path / head)) == 13
        text = (tmp_path / head).read_text()
        (tmp_path / head).write_text(text.replace("s_", "../s_"))
        with refuses(head):
            voxels_of(tmp_path / head)


def test_an_order_of_bytes_that_nrrd_does_not_state_is_asked_for(tmp_path, rng):
    values = rng.integers(0, 60000, SHAPE).astype(">u2")
    head = NRRD.format("unsigned short int", "raw")
    (tmp_path / "a.nrrd").write_bytes(head.encode() + b"\n" + values.tobytes())
    with refuses("a.nrrd"):
        voxels_of(tmp_path / "a.nrrd")
    (tmp_path / "a.nrrd").write_bytes(head.encode() + b"endian: big\n\n" + values.tobytes())
    assert np.array_equal(voxels_of(tmp_path / "a.nrrd"), values)


def test_texts_and_resolutions_of_pictures_state_sides(tmp_path, rng):
    values = rng.integers(0, 250, SHAPE).astype("u1")
    options = {"metadata": {"axes": "ZYX"}, "photometric": "minisblack"}
    stack(tmp_path / "a.tif", values, resolution=(4000, 4000), resolutionunit=3, **options)
    (tmp_path / "slices").mkdir()
    for k, page in enumerate(values):
        head = PngInfo()
        head.add_text("Comment", "Voxelgroesse 2,5 Mikrometer")
        Image.fromarray(page).save(tmp_path / "slices" / f"{k}.png", pnginfo=head)
    for name in ("a.tif", "slices"):
        side = 2.5e-6
        assert np.array_equal(voxels_of(tmp_path / name, (side, side, side)), values)
        with pytest.raises(RefusedError):
            voxels_of(tmp_path / name, (side, 3 * side, side))


ZEISS = "AP_MAG\r\nMag = 2.00 K X\r\nAP_IMAGE_PIXEL_SIZE\r\nImage Pixel Size = 12.5 nm\r\n"
FEI = "[EScan]\r\nPixelWidth=1.25e-008\r\nPixelHeight=1.25e-008\r\n"
OME = {"axes": "YX", "PhysicalSizeX": 12.5, "PhysicalSizeXUnit": "nm"}
STATED = {
    "phys.png": 20e-6,
    "cm.tif": 2e-6,
    "inch.tif": 10e-6,
    "ij.tif": 4e-3,
    "b.ome.tif": 12.5 * NM,
    "zeiss.tif": 12.5 * NM,
    "fei.tif": 12.5 * NM,
    "artist.tif": 3e-6,
    "bar.tif": 5e-6,
    "view.tif": 5e-6,
    "russian.tif": 5e-6,
    "scale.png": 7e-6,
}
"""Side of a pixel that each picture below states, in m."""


def write_picture(path, page):
    grey = {"photometric": "minisblack", "metadata": None}
    options = {
        "cm.tif": {**grey, "resolution": (5000, 5000), "resolutionunit": 3},
        "inch.tif": {**grey, "resolution": (2540, 2540), "resolutionunit": 2},
        "ij.tif": {"imagej": True, "resolution": (0.25, 0.25), "metadata": {"unit": "mm"}},
        "b.ome.tif": {"metadata": OME | {"PhysicalSizeY": 12.5, "PhysicalSizeYUnit": "nm"}},
        "zeiss.tif": {**grey, "extratags": [(34118, 2, len(ZEISS), ZEISS, True)]},
        "fei.tif": {**grey, "extratags": [(34682, 2, len(FEI), FEI, True)]},
        "artist.tif": {**grey, "extratags": [(315, 2, 16, "pixel size 3 um", True)]},
        "bar.tif": {**grey, "description": "scale bar 50 um = 10 px"},
        "view.tif": {**grey, "description": "field of view 40 um x 40 um"},
        "russian.tif": {**grey, "extratags": [(270, 2, 0, "пиксель 5 мкм".encode(), True)]},
    }
    if path.suffix == ".tif":
        tifffile.imwrite(path, page, **options[path.name])
    else:
        dpi = (1270, 1270) if path.name == "phys.png" else (300, 300)
        Image.fromarray(page).save(path, dpi=dpi)
    if path.name == "scale.png":
        chunk = b"sCAL\x017e-6\0" + b"7e-6"
        mark = struct.pack(">I", len(chunk) - 4) + chunk + struct.pack(">I", zlib.crc32(chunk))
        content = path.read_bytes()
        path.write_bytes(content[:33] + mark + content[33:])


@pytest.mark.parametrize("name", STATED)
@pytest.mark.parametrize("kind", ["picture", "slices"])
def test_pixels_that_a_picture_or_its_slices_state_are_those_of_the_case(tmp_path, rng, name, kind):
    page = rng.integers(0, 250, (8, 8)).astype("u1")
    side = STATED[name]
    write_picture(tmp_path / name, page)
    path = tmp_path / name
    if kind == "slices":
        path = tmp_path / "slices"
        path.mkdir()
        for k in range(2):
            (path / f"{k}{(tmp_path / name).suffix}").write_bytes((tmp_path / name).read_bytes())
    dimension = 2 if kind == "picture" else 3
    read_image(path, spacing=(side,) * dimension)
    for factor in (1.1, 2, 1000):
        with pytest.raises(RefusedError):
            read_image(path, spacing=(factor * side,) * dimension)
    if kind == "picture":
        with pytest.raises(RefusedError):
            read_image(path, spacing=(side, 2 * side))


def test_resolutions_of_printers_state_nothing_and_logs_beside_slices_do(tmp_path, rng):
    page = rng.integers(0, 250, (8, 8)).astype("u1")
    for dpi in (72, 96, 130, 300, 1200):
        Image.fromarray(page).save(tmp_path / "a.png", dpi=(dpi, dpi))
        read_image(tmp_path / "a.png", spacing=(3e-6, 4e-6))
    (tmp_path / "b").mkdir()
    for k in range(2):
        Image.fromarray(page).save(tmp_path / "b" / f"rec{k:04}.bmp")
    log = "[Acquisition]\nCamera Pixel Size (um)= 9.00\nImage Pixel Size (um)= 3.25\n"
    (tmp_path / "b" / "rec.log").write_text(log)
    read_image(tmp_path / "b", spacing=3.25e-6)
    for wrong in (9e-6, (3.25e-6, 3.25e-6, 6.5e-6)):
        with pytest.raises(RefusedError, match=r"3\.25 um"):
            read_image(tmp_path / "b", spacing=wrong)
