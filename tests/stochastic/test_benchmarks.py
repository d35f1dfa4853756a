"""The benchmarks of the microstructure, in small."""

import shutil

import pytest

from benchmarks.stochastic import paper_data, sphere_map


def test_the_papers_data_as_described(tmp_path, capsys):
    options = ["--discs", "200", "--packings", "5", "--out", str(tmp_path)]
    paper_data.main(options)
    table = capsys.readouterr().out.splitlines()
    assert len(table) == 6
    assert (tmp_path / "paper_data.svg").is_file()


@pytest.mark.skipif(not shutil.which("voro++"), reason="needs Voro++")
def test_the_map_of_spheres(capsys):
    sphere_map.main(["--spheres", "100", "--packings", "5"])
    assert "volume fraction of this map at its modal values: 0.2" in capsys.readouterr().out
