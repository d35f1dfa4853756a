"""Volumes from files: the same voxels along (z, y, x) from every format, or one line."""

import numpy as np
import pytest
from PIL import Image

from alphacut.fuzzy import RefusedError
from alphacut.rve.image.files import files_of, read_grid, require_memory

tifffile = pytest.importorskip("tifffile")
SHAPE, CUBE = (12, 5, 7), (1, 1, 1)
HEAD = "ObjectType = Image\nNDims = 3\nDimSize = 7 5 12\n"
NRRD = "NRRD0004\n# comment\ntype: {}\ndimension: 3\nsizes: 7 5 12\nencoding: {}\n"


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
            assert np.array_equal(read_grid(path, CUBE), values), path.name


def test_endings_in_capitals_are_those_in_small_letters(tmp_path, rng):
    values = rng.integers(0, 250, SHAPE).astype("u1")
    with (tmp_path / "ARRAY.NPY").open("wb") as file:
        np.save(file, values)
    stack(tmp_path / "STACK.TIF", values)
    meta_image(tmp_path / "HEAD.MHD", values)
    nrrd(tmp_path / "BESIDE.NHDR", values, attached=False)
    nrrd(tmp_path / "WHOLE.NRRD", values, attached=True)
    slices(tmp_path / "slices", values)
    for file in [*(tmp_path / "slices").iterdir()]:
        file.rename(file.with_suffix(".PNG"))
    for path in tmp_path.iterdir():
        if path.suffix != ".raw":
            assert np.array_equal(read_grid(path, CUBE), values), path.name
    head, data = files_of(tmp_path / "HEAD.MHD")
    assert (head.name, data.name) == ("HEAD.MHD", "HEAD.raw")


@pytest.mark.parametrize(
    ("name", "write", "message"),
    [
        ("colour.tif", lambda p: stack(p, np.zeros((4, 5, 6, 3), np.uint8), photometric="rgb"), "axes"),
        ("channels.tif", lambda p: stack(p, np.zeros((3, 5, 6), np.uint8), imagej=True), "axes CYX"),
        ("times.tif", lambda p: stack(p, np.zeros((2, 4, 5, 6), np.uint8), imagej=True), "axes"),
        ("plane.tif", lambda p: stack(p, np.zeros((5, 6), np.uint8)), "axes YX"),
        ("mask.tif", lambda p: stack(p, np.arange(210).reshape(5, 6, 7) % 3 > 0), "white as zero"),
        ("plane.npy", lambda p: np.save(p, np.zeros((5, 6))), "takes cell.pixel"),
        ("complex.npy", lambda p: np.save(p, np.zeros((4, 5, 6), complex)), "complex128"),
        ("thin.npy", lambda p: np.save(p, np.zeros((1, 5, 6))), "2 × 2 × 2 or more"),
        ("nan.npy", lambda p: np.save(p, np.full((2, 5, 6), np.nan)), "not finite"),
        ("raw.raw", lambda p: p.write_bytes(b"0" * 100), ".mhd head"),
        ("a.mhd", lambda p: meta_image(p, np.zeros((11, 5, 7), "u1")), "385 bytes"),
        ("b.mhd", lambda p: meta_image(p, np.zeros(SHAPE, "u1"), head="CompressedData = True\n"), "compressed"),
        ("c.mhd", lambda p: meta_image(p, np.zeros(SHAPE, "u1"), head="ElementSpacing = 1 1 2\n"), "voxels of 1 × 1 × 2"),
        ("d.mhd", lambda p: p.write_text(HEAD + "ElementType = MET_LONG_LONG\nElementDataFile = x\n"), "type"),
        ("e.mhd", lambda p: p.write_text(HEAD + "ElementType = MET_UCHAR\nElementDataFile = x\n"), "beside the head"),
        ("f.nhdr", lambda p: p.write_text(NRRD.format("uchar", "gzip") + "data file: x\n"), "compressed"),
        ("empty", lambda p: p.mkdir(), "0 pictures"),
        ("noise.tif", lambda p: p.write_bytes(b"II*\0nonsense"), "0 series"),
    ],
)  # fmt: skip
def test_what_is_no_volume_of_numbers_is_one_line(tmp_path, name, write, message):
    path = tmp_path / name
    write(path)
    with pytest.raises(RefusedError) as told:
        read_grid(path, CUBE)
    assert message in str(told.value)
    assert "\n" not in str(told.value)


def test_slices_that_are_not_alike_and_bent_voxels_are_told(tmp_path):
    slices(tmp_path / "slices", np.zeros((3, 5, 6), np.uint8))
    Image.fromarray(np.zeros((5, 7), np.uint8)).save(tmp_path / "slices/slice4.png")
    with pytest.raises(RefusedError, match=r"slice4\.png"):
        read_grid(tmp_path / "slices", CUBE)
    meta_image(tmp_path / "c.mhd", np.zeros(SHAPE, "u1"), head="ElementSpacing = 1 1 2\n")
    assert read_grid(tmp_path / "c.mhd", (2, 1, 1)).shape == SHAPE
    assert [file.name for file in files_of(tmp_path / "c.mhd")] == ["c.mhd", "c.raw"]


@pytest.mark.parametrize(
    ("shape", "what"),
    [((10**4,) * 3, "10000 × 10000 × 10000 voxels"), ((10**6,) * 2, "1000000 × 1000000 pixels")],
)
def test_a_grid_too_large_is_told_what_fits(shape, what):
    with pytest.raises(RefusedError, match=rf"{what}.*crop a piece of \d+ × "):
        require_memory(shape)
