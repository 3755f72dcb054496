"""Several cracked blocks in one run: solved side by side, and only where something has changed."""

from __future__ import annotations

import threading
import time
from dataclasses import replace
from itertools import islice

import numpy as np
import pytest

from geomech.bench.cost.block_scenes import cracked_wall
from geomech.coupling import cycles, load_pass, parallel_map
from geomech.coupling.load_transfer import elastic_bodies
from geomech.ddm import Body
from geomech.ddm.system import boundary_system
from geomech.ddm.system.boundary_system import BoundarySystem
from geomech.model import (
    Blocks,
    Cracks,
    DdaSettings,
    DdmSettings,
    EdgeTraction,
    GrowthSettings,
    History,
    JointLaw,
    Loads,
    Material,
    Problem,
    RunSettings,
)


def plates(friction: bool) -> Problem:
    """Four plates under tension that rises at unlike rates, in dynamics: halves fly apart. The first is cut in two
    while the others stand, the next one's crack grows a little, that of the third is pressed shut (and may rub)."""
    w, h = 0.03, 0.06
    left = 0.1 * np.arange(4)
    blocks = Blocks.from_polygons(
        [np.array([[x - w, -h], [x + w, -h], [x + w, h], [x - w, h]]) for x in left],
        edge_names=[[[f"load:bottom {k}", "", f"load:top {k}", ""]] for k in range(4)],
    )
    lines = [
        np.array([[x - a, -b], [x + a, b]]) for x, a, b in zip(left, (0.02, 0.012, 0.01, 0.004), (0, 1e-3, 9e-3, 0))
    ]
    lines[0][0, 0] = -w  # an edge crack
    loads = []
    for k, rate in enumerate((0.9e6, 0.8e6, -1e6, 0.5e6)):
        for name, way in (("top", 1.0), ("bottom", -1.0)):
            loads.append(EdgeTraction(f"load:{name} {k}", History.ramp([0.0, 1e4 * way * rate])))
    return Problem(
        title="plates",
        blocks=blocks,
        cracks=Cracks.from_polylines(
            lines, block=range(4), law=int(friction), surface=[(k == 0, False) for k in range(4)]
        ),
        materials=(Material("rock", 17e9, 0.21, 2200.0, 1e6),),
        joints=(JointLaw("joint"),),
        face_laws=(JointLaw("smooth"), JointLaw("rough", friction_angle=0.3)),
        loads=Loads(edge_tractions=tuple(loads)),
        dda=DdaSettings(time_step=1e-4, dynamic_factor=1.0),
        ddm=DdmSettings(order=3),
        growth=GrowthSettings(increment=4e-3),
        run=RunSettings(end_time=5e-4, stop_at=()),
        load_edge="load:top 0",
    )


def results(problem: Problem) -> tuple[list[np.ndarray], dict[str, int], list[str]]:
    seen = list(islice(cycles(problem), 8))  # the halves fly ever faster then
    last = seen[-1]
    tips = [np.concatenate([cycle.tips[name] for cycle in seen]) for name in ("k_i", "k_ii", "grown", "k_eq")]
    return (
        [last.state.vertices, last.state.stress, last.cracks.nodes, *tips],
        last.work,
        [event.kind for cycle in seen for event in cycle.events],
    )


def test_results_do_not_depend_on_the_number_of_threads(monkeypatch):
    monkeypatch.setattr(elastic_bodies, "LARGE", 0)
    found = {}
    for threads in (1, 2, 3):
        monkeypatch.setattr(parallel_map, "THREADS", threads)
        found[threads] = results(plates(friction=False))
    assert "split" in found[1][2]
    for threads in (2, 3):
        for one, many in zip(found[1][0], found[threads][0]):
            assert one.tobytes() == many.tobytes()
        assert found[1][1:] == found[threads][1:]


@pytest.mark.parametrize("friction", [False, True])
def test_leaving_out_what_has_not_changed_changes_nothing(monkeypatch, friction):
    kept, work, events = results(plates(friction))
    with monkeypatch.context() as always:
        always.setattr(Body, "reusable_for", lambda *of: None)
        always.setattr(elastic_bodies, "_same_question", lambda *of: False)
        done, all_work, all_events = results(plates(friction))
    assert work["bodies_kept"] > work["bodies"] - 4 > 0
    assert work["solutions_kept"] > 0 and work["compliances_kept"] > 0
    assert all_work["bodies"] == work["bodies"] + work["bodies_kept"]
    assert events == all_events and "split" in events
    for a, b in zip(kept, done):
        # Round-off: loads that come again are scaled from unit loads, new ones are solved for.
        assert np.abs(a - b).max() <= 1e-9 * np.abs(b).max()


@pytest.mark.parametrize("friction", [False, True])
def test_the_switch_of_a_scene_changes_nothing_but_the_work(friction):
    """``run.skip = false``: every body and every answer anew, and the same results to round-off (loads that come again
    are scaled from unit loads, new ones are solved for; factors grow with cracks, or are made whole)."""
    given = plates(friction)
    kept, work, events = results(given)
    done, all_work, all_events = results(replace(given, run=replace(given.run, skip=False)))
    assert work["bodies_kept"] > 0 and work["solutions_kept"] > 0
    assert all_work["bodies_kept"] == all_work["solutions_kept"] == all_work["compliances_kept"] == 0
    assert all_work["boundary_factorisations"] > 2 * work["boundary_factorisations"]
    assert events == all_events and "split" in events
    for a, b in zip(kept, done):
        assert np.abs(a - b).max() <= 1e-8 * np.abs(b).max()


@pytest.mark.parametrize("spare", [0.0, 1e9])
def test_giving_up_what_growth_needs_changes_nothing(monkeypatch, spare):
    """Blocks taken for some of many, with sides taken for large: what growth needs of them is kept until a load step without
    growth, or (``spare`` bytes) not at all."""
    given = replace(plates(False), growth=GrowthSettings(increment=5e-4))
    kept, _, events = results(given)
    monkeypatch.setattr(elastic_bodies, "MANY", 1)
    monkeypatch.setattr(elastic_bodies, "FOR_GROWTH", spare)
    monkeypatch.setattr(boundary_system, "KEPT_BESIDE_FACTORS", 10)
    factored, made = [], BoundarySystem._factored
    monkeypatch.setattr(BoundarySystem, "_factored", lambda system, matrix: factored.append(1) or made(system, matrix))
    lean, work, lean_events = results(given)
    assert lean_events == events
    # Once for each new boundary, and again with the first grown crack, or with each of six.
    assert len(factored) == work["boundary_factorisations"] + (1 if spare else 6)
    for a, b in zip(lean, kept):
        assert np.abs(a - b).max() <= 1e-8 * np.abs(b).max()


def test_passes_of_growth_in_motion_begin_with_the_contacts_of_the_last_one(monkeypatch):
    """Contact states of a wall, in which cracks grow through several passes of a step, as if each pass found them from
    those at the beginning of the step, in fewer iterations."""
    of = cracked_wall(12, 4)
    given = replace(
        of,
        cracks=replace(of.cracks, aperture=np.zeros(of.cracks.n_segments)),
        run=replace(of.run, end_time=0.02, stop_at=()),
        materials=(replace(of.materials[0], k_ic=6e3),),
        growth=replace(of.growth, increment=0.01),
    )
    runs = [[*cycles(given)]]
    with monkeypatch.context() as alone:
        passes = load_pass._passes
        alone.setattr(
            load_pass, "_passes", lambda now, dt, load_time, ways, like: passes(now, dt, load_time, ways, None)
        )
        runs.append([*cycles(given)])
    later = [[cycle for cycle in run if cycle.growth_pass > 0] for run in runs]
    assert len(later[0]) == len(later[1]) > 2
    few, many = (sum(cycle.statistics["open_close_iterations"] for cycle in each) for each in later)
    assert few < 0.7 * many
    for a, b in zip(*runs):
        assert a.cracks.nodes == pytest.approx(b.cracks.nodes, rel=0, abs=1e-8)
        assert a.state.vertices == pytest.approx(b.state.vertices, rel=0, abs=1e-10)


def test_the_first_of_several_failures_is_reported():
    def work(item):
        if item > 1:
            raise ValueError(str(item))
        return item

    with pytest.raises(ValueError, match="2"):
        parallel_map.parallel_map(work, list(range(5)), threads=3)
    assert parallel_map.parallel_map(lambda k: k * k, range(4), threads=2) == [0, 1, 4, 9]


def test_an_interrupt_leaves_what_has_not_begun(monkeypatch):
    """Two of twenty are under way when the wait for them is interrupted."""
    begun, go_on = [], threading.Event()

    def work(k):
        begun.append(k)
        go_on.wait(10.0)

    def interrupted(_):
        while len(begun) < 2:
            time.sleep(0.001)
        raise KeyboardInterrupt

    monkeypatch.setattr(parallel_map, "wait", interrupted)
    with pytest.raises(KeyboardInterrupt):
        parallel_map.parallel_map(work, list(range(20)), threads=2)
    go_on.set()
    monkeypatch.undo()
    assert parallel_map.parallel_map(lambda k: k, [3, 4], threads=2) == [3, 4]
    assert begun == [0, 1]
