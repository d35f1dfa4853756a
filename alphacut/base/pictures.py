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
MAX_PIXELS_PER_BYTE = {"PNG": 8 * DEFLATE_RATIO, "BMP": 128, "PPM": 8}
"""Pixels that a byte of the file can stand for: of PNG one bit each and deflated, of BMP a run of
255 in two bytes, of PPM one bit each. What a byte of the other formats can stand for is not bounded
so well, and the memory that is free alone limits them."""
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
        per_byte = MAX_PIXELS_PER_BYTE.get(picture.format or "", pixels)
        value = f"{what} in a file of {size} bytes"
        require(pixels <= per_byte * size, path.name, value, f"up to {per_byte * size} pixels")
        require_free_memory(path.name, float(BYTES_PER_PIXEL * pixels), what)
        yield picture
