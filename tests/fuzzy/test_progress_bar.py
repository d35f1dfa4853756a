"""Progress is a line now and then where there is no terminal."""

import io

import pytest

from alphacut.fuzzy import progress_bar


@pytest.mark.parametrize(
    ("ticks", "lines"),
    [
        (
            [(second, second / 50) for second in range(26)],
            [" 20% after 10 s, some 40 s left", " 40% after 20 s, some 30 s left"],
        ),
        ([(11, 0.001)], ["  0% after 11 s"]),  # too little to foretell the end
    ],
)
def test_a_line_every_ten_seconds_foretells_the_end(monkeypatch, ticks, lines):
    now, text = [0.0], io.StringIO()
    monkeypatch.setattr(progress_bar, "monotonic", lambda: now[0])
    monkeypatch.setattr(progress_bar.sys, "stderr", text)
    with progress_bar.progress_reporter(None) as tick:
        for second, share in ticks:
            now[0] = float(second)
            tick(share)
    assert text.getvalue().splitlines() == lines
    with progress_bar.progress_reporter(False) as tick:
        assert tick is None
