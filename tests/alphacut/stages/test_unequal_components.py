"""Components of a record whose channels stopped at different times."""

import numpy as np
import pytest

from alphacut.case.content import load
from alphacut.stages.suite import suite_records
from tests.alphacut.small import told_by

CASE = """title = "An eccentric floor"
stages = ["envelope"]
[matrices]
unknowns = ["1.x", "1.y"]
mass = [["1", "mass.csv"]]
stiffness = [["k", "stiffness.csv"]]
directions = ["x", "y"]
damping_ratio = "5 %"
[matrices.parameters]
k = "1 ± 1 %"
[matrices.outputs]
corner = { row = { "1.x" = 1.0, "1.y" = 0.3 } }
[records]
files = [["short.AT2", "long.AT2"]]
[envelope]
fuzzy = ["k"]
alpha = [0]
duration = "1 s"
step = "0.02 s"
"""


def written(folder, rng, lengths, step=0.02):
    (folder / "mass.csv").write_text("1e4,0\n0,1e4\n")
    (folder / "stiffness.csv").write_text("4e6,5e5\n5e5,3e6\n")
    head = "PEER\nmade\nACCELERATION TIME SERIES IN UNITS OF G\n"
    samples = {}
    for name, count in zip(("short", "long"), lengths, strict=True):
        samples[name] = 0.3 * rng.normal(size=count)
        lines = "".join(f"{x:.7E}\n" for x in samples[name])
        (folder / f"{name}.AT2").write_text(f"{head}NPTS= {count}, DT= {step} SEC\n{lines}")
    (folder / "case.toml").write_text(CASE)
    return folder / "case.toml", samples


@pytest.mark.parametrize("baseline", ["none", "mean"])
def test_the_shorter_component_ends_in_zeros_and_it_is_said(tmp_path, rng, baseline):
    case, samples = written(tmp_path, rng, (40, 60))
    told = told_by("check", case, f"--set=records.baseline={baseline}")
    assert "warning: of record short ends in 20 zeros, since it is shorter" in told
    content = load(str(case)).content
    section = content.records.model_copy(update={"baseline": baseline})
    (record,) = suite_records(section, content.envelope, content.structure)
    short, long = (ground.samples / 9.80665 for ground in record.components)
    offset = samples["short"].mean() if baseline == "mean" else 0.0
    assert short[:40] == pytest.approx(samples["short"] - offset, abs=1e-6)
    assert np.all(short[40:] == 0)
    assert len(short) == len(long) == 60
