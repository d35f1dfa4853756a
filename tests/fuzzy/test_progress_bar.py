"""Progress is a line now and then where there is no terminal."""

import io

from alphacut.fuzzy import progress_bar


def test_a_line_every_ten_seconds_foretells_the_end(monkeypatch):
    now, text = [0.0], io.StringIO()
    monkeypatch.setattr(progress_bar, "monotonic", lambda: now[0])
    monkeypatch.setattr(progress_bar.sys, "stderr", text)
    with progress_bar.progress_reporter(None) as tick:
        for second in range(26):
            now[0] = float(second)
            tick(second / 50)
    assert text.getvalue().splitlines() == [" 20% after 10 s, some 40 s left",
                                            " 40% after 20 s, some 30 s left"]  # fmt: skip


def test_little_work_foretells_no_end(monkeypatch):
    now, text = [0.0], io.StringIO()
    monkeypatch.setattr(progress_bar, "monotonic", lambda: now[0])
    monkeypatch.setattr(progress_bar.sys, "stderr", text)
    with progress_bar.progress_reporter(None) as tick:
        now[0] = 11.0
        tick(0.001)
    assert text.getvalue() == "  0% after 11 s\n"


def test_nothing_is_shown_where_nothing_is_wanted():
    with progress_bar.progress_reporter(False) as tick:
        assert tick is None
