"""Cases whose files of mass and stiffness name different unknowns."""

import pytest

from tests.alphacut.small import told_by

CASE = """title = "Two matrices of one frame"
stages = ["envelope"]

[matrices]
unknowns = "STIF1.mtx"
mass = [["1", "MASS1.mtx"]]
stiffness = [["s", "STIF1.mtx"]]
damping_ratio = "4 %"
direction = "1"

[matrices.parameters]
s = "1 ± 5 %"

[matrices.outputs]
first = { row = { "1.1" = 1.0 } }

[[force]]
history = "harmonic, 1.9 Hz"
amplitude = { "1.1" = "280 N" }

[envelope]
fuzzy = ["s"]
alpha = [0]
duration = "0.2 s"
step = "0.02 s"
"""
MASS = ["1,1, 1,1, 2.0e3\n", "2,1, 2,1, 2.0e3\n", "3,1, 3,1, 1.0e3\n"]
STIFFNESS = [
    "1,1, 1,1, 4.0e6\n",
    "2,1, 1,1, -2.0e6\n2,1, 2,1, 4.0e6\n",
    "3,1, 2,1, -2.0e6\n3,1, 3,1, 2.0e6\n",
]


@pytest.mark.parametrize("command", ["check", "run"])
@pytest.mark.parametrize(
    ("n_mass", "n_stiffness", "words"),
    [
        (3, 3, ""),
        (2, 3, "the files of matrices.mass do not name 1 unknowns that those of stiffness name"),
        (3, 2, "1 unknowns of the files are not named, and so are held: 3.1"),
    ],
)
def test_unknowns_of_one_file_alone_are_told(tmp_path, command, n_mass, n_stiffness, words):
    (tmp_path / "MASS1.mtx").write_text("".join(MASS[:n_mass]))
    (tmp_path / "STIF1.mtx").write_text("".join(STIFFNESS[:n_stiffness]))
    (tmp_path / "case.toml").write_text(CASE)
    arguments = [command, str(tmp_path / "case.toml"), "--quiet"]
    if command == "run":
        arguments += ["--out", str(tmp_path / "out"), "--no-figures"]
    told = told_by(*arguments)
    assert ("unknowns" in told) == bool(words)
    assert words in told
