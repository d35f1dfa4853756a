import pytest

from benchmarks.rve.many_spheres import main


def test_the_comparison_in_small(tmp_path, capsys):
    sizes = ["--spheres", "8", "16", "--cells", "8", "8", "--refined", "4", "--resolution", "4"]
    assert main([*sizes, "--draws", "1", "--contrast", "3", "--out", str(tmp_path)]) == 0
    printed = capsys.readouterr().out
    assert printed.count("covers in 1 of 1") == 1
    assert "finite size" in printed
    assert len((tmp_path / "many_spheres.csv").read_text().splitlines()) == 7


@pytest.mark.parametrize(
    ("changed", "told"),
    [
        (["--refined", "3"], "3 of them refined, are asked for; take"),
        (["--refined", "500"], "500 of them refined, are asked for; take"),
        (["--resolution", "1"], "the resolution is 1 voxels"),
        (["--fraction", "0.9"], "the volume fraction is 0.9; it must lie in"),
        (["--contrast", "-4"], "Young's modulus is -8e+10 Pa"),
        (["--spheres", "30", "40"], "--spheres is 30 40; the second must be twice"),
        (["--spheres", "0", "40"], "a packing of 0 spheres"),
        (["--draws", "0"], "--draws is 0; it must be 1 or more"),
        (["--seed", "-1"], "--seed is -1; it must be 0 or more"),
        (["--workers", "0"], "--workers is 0; it must be 1 or more"),
    ],
)
def test_bad_input_is_one_line_and_status_2(changed, told, tmp_path, capsys):
    assert main([*changed, "--out", str(tmp_path)]) == 2
    printed, err = capsys.readouterr()
    assert (printed, len(err.splitlines())) == ("", 1)
    assert told in err
    assert not list(tmp_path.iterdir())
