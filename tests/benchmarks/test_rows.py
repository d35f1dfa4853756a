from pathlib import Path

from benchmarks.rows import write

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"


def test_rows_have_a_header_and_may_lack_keys(tmp_path):
    write([{"a": 1}, {"a": 2, "b": 3}], tmp_path / "new" / "rows.csv")
    assert (tmp_path / "new" / "rows.csv").read_text(encoding="utf-8") == "a,b\n1,\n2,3\n"
    assert [path.name for path in (tmp_path / "new").iterdir()] == ["rows.csv"]


def test_each_kept_result_is_written_by_a_program_that_stands_here():
    """Rows of a program that is gone cannot be measured again."""
    programs = "".join(path.read_text(encoding="utf-8") for path in BENCHMARKS.rglob("*.py"))
    kept = {path.stem for path in (BENCHMARKS / "results").iterdir()}
    assert sorted(stem for stem in kept if stem not in programs) == []
