"""What the run and the page of an image or volume say that its bounds are guaranteed of."""

import numpy as np
import pytest

from tests.alphacut.small import told_by

CASE = """
title = "pores"
stages = ["modulus"]
[cell]
image = "image.npy"
{key} = "1 µm"
labels = [0, 1]
modulus = [{first}, "20 GPa"]
poisson = [0.3]
[modulus]
alpha = [1]
"""
PLANE = "guaranteed of the image as segmented, repeated periodically, in plane strain"
SPACE = "guaranteed of the volume, repeated periodically"
NO_LOWER = "This program gives no lower bound of E but 0: no solid that carries is found"


def place(folder, shape, first, *, percolates=False):
    """A case with a phase in the middle, or along the whole first axis, of a modulus."""
    labels = np.ones(shape)
    labels[tuple(slice(2, 4) for _ in shape)] = 0
    if percolates:
        labels[:, 2:4] = 0
    np.save(folder / "image.npy", labels)
    key = "voxel" if len(shape) == 3 else "pixel"
    (folder / "case.toml").write_text(CASE.format(key=key, first=first), encoding="utf-8")
    return str(folder / "case.toml")


def unwrapped(text):
    """A text whose rows are not broken."""
    return " ".join(text.split())


@pytest.mark.parametrize(
    ("shape", "first", "percolates", "words", "other"),
    [
        ((6, 6), '"0 GPa"', False, (PLANE, "Width of E"), "gives no"),
        ((6, 6), '"0 GPa"', True, (PLANE, NO_LOWER), "upper bound"),
        ((6, 6, 6), '"0 GPa"', False, (SPACE, "Width of E"), "gives no"),
        (
            (6, 6),
            '"rigid"',
            False,
            (PLANE, "gives no lower or upper bound of E: a phase may be rigid"),
            "pores",
        ),
    ],
    ids=["closed", "percolating", "volume", "rigid"],
)
def test_texts_say_what_is_guaranteed_of_what(tmp_path, shape, first, percolates, words, other):
    case, out = place(tmp_path, shape, first, percolates=percolates), tmp_path / "out"
    assert words[0] in unwrapped(told_by("run", case, f"--out={out}", "--no-figures"))
    printed = unwrapped(told_by("modulus", case, f"--out={out}"))
    told_by("report", out, "--quiet")
    page = unwrapped((out / "report.html").read_text(encoding="utf-8"))
    for text in (printed, page):
        assert all(x in text for x in words)
    assert other not in printed
