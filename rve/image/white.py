"""One meaning for pictures whose stored zeros are white (TIFF's PhotometricInterpretation 0)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from alphacut.base.arrays import Array
from alphacut.base.errors import RefusedError, require

if TYPE_CHECKING:
    from PIL.Image import Image

PHOTOMETRIC = 262
"""Number of TIFF's tag PhotometricInterpretation."""
WHITE_IS_ZERO = 0  # the tag's value where a stored zero is white


def tags_of(picture: Image) -> Mapping[int, object]:
    """Return the tags of a page of TIFF that Pillow has opened, by their numbers; {} of others."""
    tags: Mapping[int, object] = getattr(picture, "tag_v2", {})
    return tags


def stored_values(picture: Image) -> Array:
    """Return the values of a picture as its file stores them, shape (rows, columns).

    Pillow inverts pictures of 8 bits, and no others, whose stored zeros are white; that is undone.

    Args:
        picture: Picture of a single channel that Pillow has opened.
    """
    values = np.asarray(picture)
    if picture.mode == "L" and tags_of(picture).get(PHOTOMETRIC) == WHITE_IS_ZERO:
        return np.asarray(np.uint8(255) - values)
    return values


def as_shown(name: str, values: Array, photometric: object) -> Array:
    """Return the stored values of a picture or a stack such that bright is large.

    Args:
        name: Name of the file, for messages.
        values: Values as stored, of any shape; returned as they are unless white is zero.
        photometric: The file's PhotometricInterpretation: 0 says that a stored zero is white; other
            values, and None, that it is black.

    Raises:
        RefusedError: White is zero in a mask of two values, whose phases programs exchange, or
            beside numbers that are not unsigned integers, whose largest is not known.
    """
    if photometric != WHITE_IS_ZERO:
        return values
    # Programs disagree on masks: a guess would exchange the phases without a word.
    if len(np.unique(values)) == 2:
        bright_fraction = np.mean(values == values.max())
        what = f"two-valued with white as zero, bright on {bright_fraction:.4g}"
        cure = "save it as .npy or PNG, and look at the fractions that check prints"
        raise RefusedError(name, what, "masks that all programs read alike", cure)
    is_known = values.dtype.kind == "u"
    cure = "save it with black as zero, or as .npy"
    require(is_known, name, f"{values.dtype} with white as zero", "unsigned integers", cure)
    largest = (1 << 8 * values.dtype.itemsize) - 1
    return np.asarray(largest - values)
