from benchmarks.frame import building as frame_building
from benchmarks.frame import improvements as frame_improvements


def test_full_building_stays_within_the_envelope_of_its_modes():
    found = frame_building.measured(4.0, (0.0,), trajectories=60, climbed=3)
    assert found["method"] == "modal"
    assert float(found["outside"]) < 1e-3
    assert float(found["at_bounds"]) < 1e-3


def test_each_improvement_of_the_graph_follower_is_measured_by_itself(tmp_path):
    rows = {row["variant"]: row for row in frame_improvements.measured(6.0, 0.1)}
    assert rows.keys() == frame_improvements.VARIANTS.keys()
    plain, rounds = rows["faithful, κ = 2"], rows["in rounds (improved)"]
    assert rows["faithful, κ = 1"]["error_m"] > plain["error_m"]
    assert rows["+ models of 3 graphs"]["error_m"] <= plain["error_m"]
    assert rounds["error_m"] <= plain["error_m"]
    assert all(row["graphs"] > 1 for row in rows.values())
    frame_improvements.draw(list(rows.values()), tmp_path / "figure.png")
    assert (tmp_path / "figure.png").stat().st_size > 10_000
