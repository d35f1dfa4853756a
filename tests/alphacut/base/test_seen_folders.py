"""Files that `./enter` does not show are told apart from files that are not there."""

from pathlib import Path

from alphacut.base.seen_folders import INSIDE, unseen


def test_only_files_outside_of_shown_folders_may_be_there_unseen(monkeypatch, tmp_path):
    elsewhere = Path("/srv/records/a.csv")
    monkeypatch.setenv(INSIDE, "apart")
    assert "may be there unseen" in unseen(elsewhere)
    for path in (tmp_path / "a.csv", Path.home() / "a.csv", Path("cases/a.csv")):
        assert unseen(path) == ""
    for value in ("1", ""):
        monkeypatch.setenv(INSIDE, value)
        assert unseen(elsewhere) == ""
