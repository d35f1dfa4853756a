"""Pictures from files, opened by Pillow after their heads are held against the file and memory.

Pillow knows formats that are programs, as PostScript, which it hands to Ghostscript; only formats
of pixels are opened here. It takes memory for the size in a head before it looks for the pixels.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from alphacut.base.array_files import DEFLATE_RATIO
from alphacut.base.errors import require
from alphacut.base.memory import require_free_memory

if TYPE_CHECKING:
    from PIL.Image import Image

FORMATS = ("BMP", "GIF", "JPEG", "JPEG2000", "PNG", "PPM", "TIFF", "WEBP")
"""Formats of pixels, by Pillow's names."""
LZW_RATIO = 2731
"""Bytes that a byte of LZW can stand for: a string of 4096 bytes takes twelve bits."""
MAX_BYTES_PER_BYTE = {
    "PNG": DEFLATE_RATIO, "BMP": 128, "PPM": 1, "GIF": LZW_RATIO, "raw": 1, "packbits": 64,
    "tiff_lzw": LZW_RATIO, "tiff_adobe_deflate": DEFLATE_RATIO, "tiff_deflate": DEFLATE_RATIO,
}  # fmt: skip
"""Bytes of pixels that a byte of the file can stand for, by format, or compression of TIFF."""
MAX_PIXELS = 6e7
"""Pixels of a picture in the other formats, of which a few bytes can stand for any number."""
BYTES_PER_PIXEL = 16
"""Memory of a pixel while it is read: Pillow's four bytes, a copy of them, and a float."""


@contextmanager
def opened_picture(path: Path) -> Iterator[Image]:
    """Yield a picture whose pixels are not read yet, and close it.

    Raises:
        RefusedError: Its head promises more pixels than the file can hold, or than fit the memory
            that is free.
        OSError: The file cannot be opened, or is of no format in `FORMATS`.
    """
    from PIL import Image

    Image.MAX_IMAGE_PIXELS = None  # the size is checked here
    with Image.open(path, formats=FORMATS) as picture:
        pixels, size = picture.width * picture.height, path.stat().st_size
        what = f"{picture.width} × {picture.height} pixels"
        coding = str(
            picture.info.get("compression") if picture.format == "TIFF" else picture.format
        )
        ratio = MAX_BYTES_PER_BYTE.get(coding)
        most = MAX_PIXELS if ratio is None else 8.0 * ratio * size  # a pixel has a bit at least
        value = f"{what} in a file of {size} bytes"
        require(pixels <= most, path.name, value, f"up to {most:.3g} pixels")
        require_free_memory(path.name, float(BYTES_PER_PIXEL * pixels), what)
        yield picture
