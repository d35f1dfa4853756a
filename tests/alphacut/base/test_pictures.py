"""What heads of pictures promise, and formats that are programs."""

import zlib

import numpy as np
import pytest

from alphacut.base import memory, pictures
from alphacut.fuzzy import RefusedError
from alphacut.rve import read_image
from alphacut.stochastic.particles.measured import section_picture
from tests.refused import refuses

Image = pytest.importorskip("PIL.Image")
READERS = {
    "picture": lambda path: read_image(path, spacing=1.0).values,
    "section": section_picture,
}


def png(path, size):
    """A picture of 5 × 7 pixels, whose head says another size."""
    Image.fromarray(np.arange(35, dtype=np.uint8).reshape(7, 5)).save(path)
    content = path.read_bytes()
    sides = b"".join(n.to_bytes(4, "big") for n in size)
    head = b"IHDR" + sides + content[24:29]
    path.write_bytes(content[:12] + head + zlib.crc32(head).to_bytes(4, "big") + content[33:])


@pytest.mark.parametrize("read", READERS.values(), ids=READERS)
def test_a_head_that_promises_more_pixels_than_its_file_holds_is_refused(tmp_path, read):
    png(tmp_path / "a.png", (5, 7))
    assert read(tmp_path / "a.png").shape == (7, 5)
    png(tmp_path / "a.png", (30000, 30000))
    with refuses("a.png"):
        read(tmp_path / "a.png")


def test_a_picture_that_does_not_fit_the_free_memory_is_refused(tmp_path, monkeypatch):
    Image.fromarray(np.zeros((400, 500), np.uint8)).save(tmp_path / "a.png")
    monkeypatch.setattr(memory, "free_memory", lambda: 3e4)
    with refuses("a.png"):
        read_image(tmp_path / "a.png", spacing=1.0)


@pytest.mark.parametrize("read", READERS.values(), ids=READERS)
def test_a_page_of_postscript_is_no_picture_and_starts_no_program(tmp_path, monkeypatch, read):
    """An empty page, which Pillow would hand to Ghostscript."""
    from PIL import EpsImagePlugin

    def refuse(*_, **__):
        raise AssertionError("Ghostscript was called")

    monkeypatch.setattr(EpsImagePlugin, "Ghostscript", refuse)
    page = "%!PS-Adobe-3.0 EPSF-3.0\n%%BoundingBox: 0 0 9 9\n%%EndComments\nshowpage\n%%EOF\n"
    (tmp_path / "a.png").write_text(page)
    with pytest.raises(RefusedError, match="cannot identify image file"):
        read(tmp_path / "a.png")


@pytest.mark.parametrize("name", ["a.gif", "a.jpg", "a.webp", "a.tif"])
def test_every_format_has_a_most_of_pixels(tmp_path, monkeypatch, name):
    Image.fromarray(np.zeros((40, 50), np.uint8)).save(tmp_path / name)
    assert section_picture(tmp_path / name).shape == (40, 50)
    monkeypatch.setattr(pictures, "MAX_PIXELS", 1999)
    monkeypatch.setattr(pictures, "MAX_BYTES_PER_BYTE", dict.fromkeys(("GIF", "raw"), 1e-3))
    with refuses(name):
        section_picture(tmp_path / name)
