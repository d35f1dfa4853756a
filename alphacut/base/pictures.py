"""Pictures from files, opened by Pillow after their heads are checked.

Some formats that Pillow knows are programs, such as PostScript, which it hands to Ghostscript; only
formats of pixels are opened here. Pillow also allocates memory for the size that a head states
before it looks for the pixels, so that this size is checked first.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from alphacut.base.array_files import DEFLATE_RATIO
from alphacut.base.errors import require
from alphacut.base.extras import extra_named
from alphacut.base.memory import require_free_memory

if TYPE_CHECKING:
    from PIL.Image import Image

LZW_RATIO = 2731
"""Largest number of bytes for which one byte of LZW can stand: 4096 bytes take twelve bits."""
MAX_BYTES_PER_BYTE = {
    "PNG": DEFLATE_RATIO, "BMP": 128, "PPM": 1, "GIF": LZW_RATIO, "raw": 1, "packbits": 64,
    "tiff_lzw": LZW_RATIO, "tiff_adobe_deflate": DEFLATE_RATIO, "tiff_deflate": DEFLATE_RATIO,
}  # fmt: skip
"""Largest number of bytes of pixels for one byte of the file, by format or TIFF's compression."""
MAX_PIXELS = 6e7
"""Largest number of pixels in other formats, of which a few bytes can stand for any number."""


@contextmanager
def opened_picture(path: Path) -> Iterator[Image]:
    """Yield a picture of Pillow whose pixels are not read yet, and close it afterwards.

    Pillow's own limit of the number of pixels is switched off for the whole process.

    Args:
        path: A file in the format BMP, GIF, JPEG, JPEG 2000, PNG, PPM, TIFF or WebP.

    Raises:
        RefusedError: The head promises more pixels than the file can hold (60 million where its
            compression sets no limit), or than fit into the free memory.
        OSError: The file cannot be opened, or has another format.
    """
    # Other formats that Pillow knows may be programs, such as PostScript.
    # Pillow knows the first five at once; for the others it imports all of its formats, in .04 s.
    formats = ("BMP", "GIF", "JPEG", "PNG", "PPM", "JPEG2000", "TIFF", "WEBP")
    # memory of a pixel while it is read: Pillow's four bytes, a copy of them, and a float
    bytes_per_pixel = 16

    with extra_named(path.name):
        from PIL import Image

    # Pillow's own limit, 179 million pixels of any file, is too low for some good pictures and too
    # high for small files; the size is checked here.
    Image.MAX_IMAGE_PIXELS = None
    with Image.open(path, formats=formats) as picture:
        pixels = picture.width * picture.height
        size = path.stat().st_size
        what = f"{picture.width} × {picture.height} pixels"
        coding = str(picture.format)
        if picture.format == "TIFF":
            coding = str(picture.info.get("compression"))
        # The largest number of bytes for which a byte of the file can stand is known of most
        # codings. JPEG and WebP may write any number of equal pixels in a few bytes.
        max_pixels = MAX_PIXELS
        if coding in MAX_BYTES_PER_BYTE:
            max_pixels = 8.0 * MAX_BYTES_PER_BYTE[coding] * size  # a pixel has at least one bit
        value = f"{what} in a file of {size} bytes"
        require(pixels <= max_pixels, path.name, value, f"up to {max_pixels:.3g} pixels")
        require_free_memory(path.name, float(bytes_per_pixel * pixels), what)
        yield picture
