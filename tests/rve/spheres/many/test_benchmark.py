from benchmarks.rve.many_spheres import main


def test_the_comparison_in_small(tmp_path, capsys):
    sizes = ["--spheres", "8", "16", "--cells", "8", "8", "--refined", "4", "--resolution", "4"]
    assert main([*sizes, "--draws", "1", "--contrast", "3", "--out", str(tmp_path)]) == 0
    printed = capsys.readouterr().out
    assert printed.count("covers in 1 of 1") == 1
    assert "finite size" in printed
    assert len((tmp_path / "many_spheres.csv").read_text().splitlines()) == 7
