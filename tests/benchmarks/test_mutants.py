"""Every planted fault still applies, and its tests exist; the runner tells red from green."""

import pytest

from benchmarks.mutation.mutants import ROOT, Mutant, mutants, red_tests

TABLE = mutants()


def test_there_are_enough_and_their_names_are_unique():
    assert len(TABLE) >= 60
    assert len({mutant.name for mutant in TABLE}) == len(TABLE)


@pytest.mark.parametrize("mutant", TABLE, ids=lambda mutant: mutant.name)
def test_a_fault_applies_once_and_its_file_still_compiles(mutant):
    text = (ROOT / mutant.file).read_text(encoding="utf-8")
    faulty = mutant.applied(text)
    if mutant.file.endswith(".py"):
        compile(faulty, mutant.file, "exec")
    assert mutant.tests
    assert all((ROOT / test.partition("::")[0]).exists() for test in mutant.tests)


@pytest.mark.parametrize("find", ["absent", "a"])
def test_a_fault_that_does_not_fit_is_refused(find):
    with pytest.raises(ValueError, match="it must occur once"):
        Mutant("m", "f", find, "b", ("t",)).applied("a a")


def test_red_is_told_from_green(tmp_path):
    (tmp_path / "test_red.py").write_text("def test_it():\n    assert False\n")
    (tmp_path / "test_green.py").write_text("def test_it():\n    pass\n")
    (tmp_path / "test_broken.py").write_text("1 / 0\n")
    assert red_tests(tmp_path, ["test_green.py", "test_red.py"]) == ["test_red.py::test_it"]
    assert red_tests(tmp_path, ["test_broken.py"]) == ["test_broken.py"]
    assert red_tests(tmp_path, ["test_green.py"]) == []
    with pytest.raises(RuntimeError, match="status 4"):
        red_tests(tmp_path, ["test_missing.py"])
