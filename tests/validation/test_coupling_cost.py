"""What the benchmark of coupling counts."""

from geomech.bench.cost.coupling_cost import of_wall
from geomech.coupling.crack_compliance.growth_screening import STOOD


def test_standing_cracks_cost_solutions_only():
    """Bodies, factors and compliances are made once, whatever the number of steps; the answer to mean stress is scaled in
    every pass, loads are solved for once a step, twice for the brick on the ground, whose pressure is found, until it is known that
    nothing can grow."""
    found = of_wall(30, 5, 3)
    work = found["work"]
    # (The bound asks for the equations of the faces once, by the factors that there are.)
    assert work["bodies"] == work["boundary_factorisations"] == work["crack_factorisations"] == 5
    passes = work["compliances_kept"] // 5 + 1
    assert work["solutions_scaled"] == 5 * passes and passes >= STOOD + 3
    assert work["solutions"] + work["solutions_kept"] == 6 * STOOD
    assert found["steps"] == 3 and work["solutions_left_out"] == 5 * 3
    assert found["solved_ratio"] > 0 and found["ratio"] > 0
