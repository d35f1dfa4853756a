import ast
from pathlib import Path

import numpy as np

from alphacut.frame import MatrixStructure
from benchmarks.frame.plane_frame import MatrixCase
from benchmarks.rows import write

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"


def test_rows_have_a_header_and_may_lack_keys(tmp_path):
    write([{"a": 1}, {"a": 2, "b": 3}], tmp_path / "new" / "rows.csv")
    assert (tmp_path / "new" / "rows.csv").read_text(encoding="utf-8") == "a,b\n1,\n2,3\n"
    assert [path.name for path in (tmp_path / "new").iterdir()] == ["rows.csv"]


def test_each_kept_result_is_written_by_a_program_that_stands_here():
    """Rows of a program that is gone cannot be measured again."""
    names = {
        Path(node.value).stem
        for path in BENCHMARKS.rglob("*.py")
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and "\n" not in node.value
    }
    results = sorted((BENCHMARKS / "results").iterdir())
    assert results
    assert [path.name for path in results if path.stem not in names] == []


def test_a_structure_without_a_damping_ratio_is_a_case(tmp_path):
    frame = MatrixStructure({"k": 1.0}, [(1.0, np.eye(1))], [("k", np.eye(1))], {"q": np.ones(1)})
    MatrixCase("One mass", frame, ["1.x"], {"k": "1 ± 5 %"}, "x", "").write(tmp_path / "one.toml")
    text = (tmp_path / "one.toml").read_text(encoding="utf-8")
    assert 'k = "1 ± 5 %"' in text
    assert "damping_ratio" not in text
    assert (tmp_path / "one" / "mass1.mtx").is_file()
