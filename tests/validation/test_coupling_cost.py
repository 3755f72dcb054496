"""What the benchmark of coupling counts."""

from geomech.bench.coupling_cost import of_wall


def test_standing_cracks_cost_solutions_only():
    """Bodies, factors and compliances are made once, whatever the number of steps; mean stress is solved for in every
    pass, loads once a step."""
    found = of_wall(30, 5, 3)
    work = found["work"]
    assert work["bodies"] == work["boundary_factorisations"] == work["crack_factorisations"] == 5
    passes, steps = work["compliances_kept"] // 5 + 1, found["steps"] + 1
    assert work["solutions"] + work["solutions_kept"] == 5 * (passes + steps)
    assert found["ratio"] > 0 and found["steps"] == 3
