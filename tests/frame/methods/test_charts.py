from benchmarks.frame import building as frame_building


def test_full_building_stays_within_the_envelope_of_its_modes():
    found = frame_building.measured(2.0, (0.0,), trajectories=40, climbed=3)
    assert found["method"] == "modal"
    assert float(found["outside"]) < 1e-3
    assert float(found["at_bounds"]) < 1e-3
