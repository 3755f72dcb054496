"""Orders that are found as the run goes: the estimate against what higher orders bring, and who is raised."""

from __future__ import annotations

import logging
from dataclasses import replace

import numpy as np
import pytest
from scenes_of_bending import after, body_of, moved, rectangle, system_of
from scenes_of_cells import meshed
from small_scenes import two_set_slope

from geomech import dda, load_scene
from geomech.bench.cost.block_scenes import wall
from geomech.coupling import cycles
from geomech.dda.higher_order import order_choice
from geomech.model import AUTO_ORDER, DdaSettings, EdgeTraction, History, JointLaw, Loads, Material, State

WEIGHT = Loads(gravity=History.constant((0.0, -9.81)))
GLUE = JointLaw("glue", 0.5, cohesion=1e12, tensile_strength=1e12, normal_stiffness=1e15, shear_stiffness=1e15)
ROCK = Material("rock", 2e10, 0.0, 2500.0, plane="stress")


def cantilever(order: int, **settings):
    """A beam of slenderness 8 glued to fixed rock, under a traction at its end: its system and the end of three steps."""
    polygons = [rectangle(-1, 0, 0, 1), rectangle(0, 0, 8, 1)]
    system = system_of(polygons, [1, 0], [1, order], joint=GLUE, rock=ROCK, loaded=(1, 1), **settings)
    loads = Loads(edge_tractions=(EdgeTraction("loaded", History.constant((0.0, -1e5))),))
    return system, after(system, loads, 3)


@pytest.mark.parametrize("target", [0.1, 0.01, 3e-4])
def test_the_work_of_a_loaded_beam_is_within_the_target(target):
    """What a load works is twice what the beam stores, so that its deflection is right to the target, too: against Timoshenko's
    beam, from which a clamp without Poisson's ratio takes 1e-4."""
    system, result = cantilever(AUTO_ORDER, order_target=target)
    exact = 1e5 * (8**3 / (3 * 2e10 / 12) + 1.2 * 8 / 1e10)
    assert -moved(system, result.state, 1, [8.0, 0.5])[1] == pytest.approx(exact, rel=target + 1e-4)
    order = int(result.state.order[1])
    assert order == {0.1: 3, 0.01: 3, 3e-4: 4}[target]
    # It is the answer of a beam that has that order from the first.
    given = cantilever(order)[1]
    assert np.array_equal(given.state.vertices, result.state.vertices)
    assert np.array_equal(given.state.deflection, result.state.deflection)


def test_the_estimate_is_the_work_that_higher_orders_take_up(caplog):
    """What a beam of order 5 stores more than one of order 3 is what is estimated of the latter, to a fifth: one block on
    fixed rock is all of its patch. Of order 8 a beam that is asked to be exact tells what is left."""
    stored = [sum(cantilever(order)[1].energy[:3]) for order in (3, 5)]
    more = stored[1] / stored[0] - 1
    for target, order in ((1.2 * more, 3), (0.8 * more, 4)):
        system, _ = cantilever(AUTO_ORDER, order_target=target)
        begun = replace(State.at_rest(system.blocks), order=np.array([1, 3]))
        loads = Loads(edge_tractions=(EdgeTraction("loaded", History.constant((0.0, -1e5))),))
        assert system.step(begun, loads).state.order[1] == order
    with caplog.at_level(logging.WARNING):
        cantilever(AUTO_ORDER, order_target=1e-9)
    assert "'block 1' has order 8, the highest, and higher orders would contain" in caplog.text


def test_a_beam_that_orders_2_and_3_cannot_bend_is_raised_beyond_them():
    """Glued at both ends: Timoshenko's deflection q L⁴ / 384 EI + q L² / 8 κ G A, of which orders 2 and 3 have 7 %."""
    polygons = [rectangle(-1, 0, 0, 1), rectangle(10, 0, 11, 1), rectangle(0, 0, 10, 1)]
    system = system_of(polygons, [1, 1, 0], [1, 1, AUTO_ORDER], joint=GLUE, rock=ROCK)
    state = after(system, WEIGHT, 2).state
    exact = 2500 * 9.81 * (10**4 / (384 * 2e10 / 12) + 10**2 / (8 * (5 / 6) * 1e10))
    assert -moved(system, state, 2, [5.0, 0.5])[1] == pytest.approx(exact, rel=0.01)
    assert state.order.tolist() == [1, 1, 6]


def test_a_punch_presses_into_an_elastic_block(caplog):
    """A stiff-cornered punch on a block six times as wide: uniformly strained blocks store two thirds of the work. The
    energy of both at order 8 is reached to 3 %, and that polynomials do no better is told."""
    polygons = [rectangle(-20, -3, 20, -2), rectangle(-3, -2, 3, 0), rectangle(-0.5, 0, 0.5, 1)]
    joint = JointLaw("joint", 0.6, normal_stiffness=1e13, shear_stiffness=1e13)
    loads = Loads(edge_tractions=(EdgeTraction("loaded", History.constant((0.0, -1e7))),))

    def pressed(order: int):
        rock = Material("rock", 2e10, 0.25, 2500.0)
        return after(system_of(polygons, [1, 0, 0], [1, order, order], joint=joint, rock=rock, loaded=(2, 2)), loads, 2)

    found, best = pressed(AUTO_ORDER), pressed(8)
    assert pressed(1).energy.elastic < 0.7 * best.energy.elastic
    assert found.energy.elastic == pytest.approx(best.energy.elastic, rel=0.03)
    assert found.state.order[1] > found.state.order[2] > 1
    assert "corners or ends of contacts" in caplog.text
    # Corners that press into a face which has given way are no overlaps.
    assert "no shorter step avoids it" not in caplog.text


def test_a_re_entrant_block_that_converges_slowly_is_reported(caplog):
    frame = np.array([[0, 0], [1, 0], [1, 2], [3, 2], [3, 3], [0, 3.0]])
    polygons = [rectangle(-1, -1, 4, 0), frame]
    system = system_of(polygons, [1, 0], [1, AUTO_ORDER], joint=GLUE, loaded=(1, 3))
    after(system, Loads(edge_tractions=(EdgeTraction("loaded", History.constant((0.0, -1e6))),)), 1)
    assert "stress is singular at its re-entrant corner (1, 2)" in caplog.text
    assert "zones.NAME.mesh_size_m" in caplog.text


def test_cells_do_better_than_any_order_at_a_re_entrant_corner():
    """The L on its foot: energy compared with that of small cells of order 4. One block of order 8 is 22 % off, cells as large as
    the L is thick, as the warning advises, below 1 %, smaller ones less."""
    frame = [np.array([[0, 0], [1, 0], [1, 2], [3, 2], [3, 3], [0, 3.0]])]
    names = [["", "", "", "loaded", "", ""]]
    # So small that no step is cut because cells move by much of their size.
    loads = Loads(edge_tractions=(EdgeTraction("loaded", History.constant((0.0, -1e3))),))

    def energy(size: float, order: int) -> float:
        system = meshed(frame, size, order, below=rectangle(-1, -1, 4, 0), names=names, joint=GLUE)
        return after(system, loads, 2).energy.elastic

    fine = energy(0.25, 4)
    errors = [abs(energy(*of) / fine - 1) for of in ((np.nan, 8), (1.0, 3), (0.5, 3))]
    print("one block of order 8, cells of 1 and 0.5 m:", errors)
    assert errors[0] > 0.2
    assert errors[1] < 0.01
    assert errors[2] < 0.6 * errors[1]


def test_blocks_among_many_stay_of_first_order():
    """A wall of a hundred bricks: its answer is that of first order, to the bit."""
    drawn = wall(100)

    def built(order):
        blocks = replace(drawn, order=order)
        settings = DdaSettings(dynamic_factor=0.0, time_step=10.0, max_displacement_ratio=1.0)
        system = dda.BlockSystem(
            blocks, [Material("rock", 2e10, 0.25, 2500.0)], [JointLaw("joint", 0.6)], settings=settings
        )
        return after(system, WEIGHT, 3).state

    first, found = built(None), built(np.where(drawn.fixed, 1, AUTO_ORDER))
    assert (found.order == 1).all() and found.deflection is None
    assert np.array_equal(first.vertices, found.vertices)
    assert np.array_equal(first.contacts["normal_force"], found.contacts["normal_force"])


def test_a_beam_that_is_raised_in_motion_goes_on_where_it_was():
    """A state tells the orders: another system goes on from it as the first does, and one that has gone on can begin
    again."""
    moving = {"dynamic_factor": 1.0, "newmark": (0.25, 0.5), "damping": 0.0, "time_step": 1e-3}

    def beam():
        polygons = [rectangle(-1, 0, 0, 1), rectangle(0, 0, 8, 1)]
        return system_of(polygons, [1, 0], [1, AUTO_ORDER], joint=GLUE, rock=ROCK, **moving)

    one = beam()
    start = State.at_rest(one.blocks)
    middle = after(one, WEIGHT, 4, start).state
    last = after(one, WEIGHT, 4, middle).state
    assert middle.order[1] >= 3
    other = after(beam(), WEIGHT, 4, middle).state
    again = after(one, WEIGHT, 8, start).state
    for name in ("vertices", "velocity", "deflection", "order"):
        assert np.array_equal(getattr(last, name), getattr(other, name))
        assert np.array_equal(getattr(last, name), getattr(again, name))
    assert body_of(one, last, 1).q.any()


def test_the_work_on_all_blocks_is_that_on_a_patch_of_all(monkeypatch):
    """A punch on a block on fixed rock: all contacts are those of the block, whose patch has both. That of the punch lacks the
    contacts with the fixed rock, and gives way by more."""
    work, found = order_choice._FaceForces.work, []

    def both_ways(self, trial, block, group, left, cracks=None, every=None):
        out = work(self, trial, block, group, left, cracks, every)
        if every is None:
            found.append(
                (block, out, work(self, trial, block, group, left, cracks, order_choice._AllBlocks.of(self, trial)))
            )
        return out

    monkeypatch.setattr(order_choice._FaceForces, "work", both_ways)
    polygons = [rectangle(-20, -3, 20, -2), rectangle(-3, -2, 3, 0), rectangle(-0.5, 0, 0.5, 1)]
    system = system_of(polygons, [1, 0, 0], [1, AUTO_ORDER, AUTO_ORDER], loaded=(2, 2))
    after(system, Loads(edge_tractions=(EdgeTraction("loaded", History.constant((0.0, -1e7))),)), 1)
    assert len(found) > 4
    for block, patch, every in found:
        assert every[1] == pytest.approx(patch[1], rel=1e-5) if block == 1 else every[1] < patch[1]


SLOPE = (
    two_set_slope(
        "angle_deg = -35\nspacing_m = 3.0", "spacing_m = 3.5", "smallest_block_m2 = 0.3", rock="order = ORDER"
    )
    + """
[loads]
gravity_m_s2 = [0, -9.81]
[dda]
dynamic_factor = 1.0
time_step_s = 0.005
newmark = [0.5, 1.0]
max_displacement_ratio = 0.01
[run]
end_time_s = 0.05
"""
)


def slid(tmp_path, order: str, bends: str | None = None, end: float = 0.05) -> State:
    """The state at the ``end``, s, of `SLOPE` with this ``order``; the block ``bends`` has order 2."""
    path = tmp_path / "slope.toml"
    path.write_text(SLOPE.replace("ORDER", order), encoding="utf-8")
    problem = load_scene(path).problem()
    if bends is not None:
        given = np.where(np.array(problem.blocks.names) == bends, 2, 1)
        problem = replace(problem, blocks=replace(problem.blocks, order=given))
    for cycle in cycles(problem):
        if cycle.state.time >= end - 1e-9:
            break
    return cycle.state


def test_a_slope_under_sudden_weight_stays_of_first_order(tmp_path):
    """209 blocks of 20 GPa: of orders 2 and 3, none bends with more than a thousandth of the energy. Its forces act on faces
    of which often one end alone is closed, and its neighbours are held by theirs: without either the estimate was ten
    times as large. Its answer is that of first order, to the bit."""
    first, found = slid(tmp_path, "1"), slid(tmp_path, '"auto"')
    assert found.deflection is None and (found.order == 1).all()
    assert np.array_equal(first.vertices, found.vertices)


def test_a_block_that_bends_leaves_the_contacts_of_the_others_as_they_were(tmp_path):
    """A block of that slope with order 2: all others have the contacts of first order, and displacements change by
    less than a hundredth in the mean."""
    first, found = slid(tmp_path, "1"), slid(tmp_path, "1", "rock 100")
    assert found.deflection is not None and np.abs(found.deflection[:, 0]).max() > 0
    before, after_it = first.vertices, found.vertices
    moves = np.abs(before - slid(tmp_path, "1", end=0.0).vertices).max()
    far = np.abs(after_it - before).max(axis=1)
    print(f"changed by at most {far.max() / moves:.2e}, in the mean {far.mean() / moves:.2e} of the displacement")
    assert far.max() < 0.1 * moves and far.mean() < 0.01 * moves


@pytest.mark.first_by_default(1)
@pytest.mark.parametrize("orders", ["one of 2", "all of 3", "all of 2", "some of 2 to 4"])
def test_a_slope_at_rest_finds_its_contacts_at_any_orders(tmp_path, orders):
    """Under its weight, with 50° of friction, in one step of 1 s. Newton's method and pivoting alone cut the step for one
    block of order 2 until it failed; from the states of first order it takes ten iterations."""
    text = SLOPE.replace("= 30\n[joints.beds]\nfriction_angle_deg = 20", "= 50\n[joints.beds]\nfriction_angle_deg = 50")
    text = text.replace("ORDER", "1").replace("dynamic_factor = 1.0", "dynamic_factor = 0.0")
    text = text.replace("time_step_s = 0.005", "time_step_s = 1.0").replace("end_time_s = 0.05", "end_time_s = 4.0")
    path = tmp_path / "slope.toml"
    path.write_text(text, encoding="utf-8")
    problem = load_scene(path).problem()
    free, rng = np.flatnonzero(~problem.blocks.fixed), np.random.default_rng(0)
    given = np.ones(problem.blocks.n_blocks, int)
    if orders.startswith("all"):
        given[free] = int(orders[-1])
    elif orders.startswith("one"):
        given[free[0]] = 2
    else:
        given[rng.choice(free, 5, replace=False)] = rng.integers(2, 5, 5)
    *_, first = cycles(problem)
    *_, last = cycles(replace(problem, blocks=replace(problem.blocks, order=given)))
    sinks = [np.abs(cycle.state.vertices - problem.blocks.vertices).max() for cycle in (first, last)]
    assert last.statistics["unbalanced_ratio"] < 1e-6
    assert sinks[1] == pytest.approx(sinks[0], rel=0.06)
