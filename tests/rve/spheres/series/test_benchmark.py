import pytest

from alphacut.rve import Phase
from benchmarks.rve import sphere_series
from benchmarks.rve.sphere_series import Check, closed_limits, lattice_constants, main, published


def test_published_expansions_and_closed_limits_hold():
    checks = [*closed_limits(), *published()]
    assert len(checks) == 10
    assert [check.what for check in checks if not check.holds] == []


def test_constants_of_the_lattice_are_its_sums():
    assert lattice_constants() == pytest.approx((0.2857, -0.04655), abs=2e-4)
    assert lattice_constants(10.0) == pytest.approx(lattice_constants(16.0), abs=1e-8)


def test_a_wrong_series_is_seen(monkeypatch):
    right = sphere_series.with_errors
    monkeypatch.setattr(
        sphere_series,
        "with_errors",
        lambda radius, matrix, inclusion, tolerance: (
            right(radius, matrix, inclusion, tolerance)[0] * (1 + 1e-6 * radius),
            right(radius, matrix, inclusion, tolerance)[1],
        ),
    )
    assert not all(check.holds for check in closed_limits())
    assert sphere_series.moduli(0.5, Phase(1.0), Phase(1.0))[0] > 1 / 1.2


def test_a_broken_check_ends_with_one(monkeypatch, tmp_path, capsys):
    for group in ("closed_limits", "published", "times"):
        monkeypatch.setattr(sphere_series, group, lambda: iter([Check("a", 1.0, 2.0)]))
    for group in ("random_cells",):
        monkeypatch.setattr(sphere_series, group, lambda *_: iter([Check("b", 3.0, 2.0)]))
    assert main(["--out", str(tmp_path)]) == 1
    assert "b: 3 (limit 2)  BROKEN" in capsys.readouterr().out
    assert (tmp_path / "sphere_series.csv").read_text().count("True") == 3
