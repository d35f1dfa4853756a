"""What is printed of an envelope, and what its documentation says of its facts and options."""

from __future__ import annotations

import inspect
import re

import pytest

from alphacut.frame import METHODS, Envelope, MatrixStructure, StoreyFrame, envelope
from alphacut.frame.methods.named import options_of
from alphacut.fuzzy import Triangular

FRAME = StoreyFrame(
    (2e4, 1e4), (3.0, 3.0), 25e9, 1e-6, q0=(0.0, 0.01), outputs=("q2", "base_shear")
)
INPUTS = {"E": Triangular(24e9, 25e9, 26e9)}


def test_an_envelope_prints_as_a_few_lines() -> None:
    found = envelope(FRAME, INPUTS, duration=1.0, step=0.05, alpha=(0, 1))
    lines = repr(found).splitlines()
    assert str(found) == repr(found)
    assert lines[0] == "Envelope of q2, base_shear over 0 … 1 s (21 nodes), α = 0, 1, uncertain E"
    assert re.fullmatch(r"  q2: [\d.e-]+ … 0\.0100\d* m at α = 0, error up to [\d.e-]+ m", lines[1])
    assert re.fullmatch(
        r"  base_shear: -?[\d.e-]+ … [\d.]+ N at α = 0, error up to [\d.e-]+ N", lines[2]
    )
    assert re.fullmatch(
        r"  modal: \d+ eigen-analyses, [\d.]+ s, bounds guaranteed at nodes.*", lines[3]
    )
    inner = envelope(
        FRAME, INPUTS, duration=1.0, step=0.05, alpha=(0, 1), method="vertex", integrator="exact"
    )
    assert "error" not in repr(inner)
    assert "trajectories" in repr(inner)


def test_an_envelope_says_what_may_lie_between_its_nodes() -> None:
    """A step of most of a period hides a peak that bounds at nodes do not hold."""
    common = {"inputs": INPUTS, "duration": 20, "alpha": (0,)}
    one = StoreyFrame((2e4,), (3.0,), 25e9, 1e-6, q0=(0.01,), outputs=("q1",))
    coarse, fine = (envelope(one, step=step, **common) for step in (2, 0.01))  # type: ignore[arg-type]
    more = float(coarse.facts["between_nodes"])
    words = f"bounds guaranteed at nodes every 2 s; between them up to {more:.3g} m more"
    assert words in repr(coarse)
    assert words in coarse._repr_html_()
    assert "guaranteed at nodes every 0.01 s\n" in repr(fine)
    both = repr(envelope(FRAME, step=2, **common))  # type: ignore[arg-type]
    assert re.search(r"up to [\d.e-]+ m more \(q2\), [\d.e+]+ N more \(base_shear\)\n", both)


def test_outputs_without_a_known_unit_have_none() -> None:
    import numpy as np

    model = MatrixStructure(
        {"k": 10.0}, [(1.0, np.eye(1))], [("k", np.eye(1))], {"x": np.ones(1)}, q0=np.ones(1)
    )
    assert "SI" not in repr(envelope(model, {"k": Triangular(9, 10, 11)}, duration=1.0, step=0.1))


@pytest.mark.parametrize("method", METHODS)
def test_the_documentation_names_every_option_and_default(method: str) -> None:
    text = inspect.getdoc(envelope)
    assert text is not None
    for name in options_of(method):
        assert f"`{name}`" in text


def test_the_documentation_names_every_fact() -> None:
    common = {"duration": 0.5, "step": 0.05, "alpha": (0,)}
    text = inspect.getdoc(Envelope)
    assert text is not None
    for options in (
        {"method": "modal", "certify": 1e-3},
        {"method": "auto"},
        {"method": "auto", "exclude": ("modal",)},
        {"method": "graph-follower", "integrator": "midpoint"},
        {"method": "improved-graph-follower", "budget": 2},
    ):
        found = envelope(FRAME, INPUTS, **{**common, **options})  # type: ignore[arg-type]
        for name in found.facts:
            assert re.search(rf"\b{name}\b", text), name
