from benchmarks.rows import write


def test_rows_have_a_header_and_may_lack_keys(tmp_path):
    write([{"a": 1}, {"a": 2, "b": 3}], tmp_path / "new" / "rows.csv")
    assert (tmp_path / "new" / "rows.csv").read_text(encoding="utf-8") == "a,b\n1,\n2,3\n"
    assert [path.name for path in (tmp_path / "new").iterdir()] == ["rows.csv"]
