"""Bolts on blocks and cells of higher order, whose ends move with the deflection: beams held by bolts against Timoshenko,
tendons, and stiff blocks against those of first order."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scenes_of_bending import after, moved, rectangle, system_of
from scenes_of_cells import cells_of, columns_and_rows, moved_corners

from geomech.dda import EnergyBudget
from geomech.model import (
    AUTO_ORDER,
    GROUND,
    Bolt,
    CrossesNoJoint,
    EdgeTraction,
    History,
    JointLaw,
    Loads,
    Material,
    State,
    grouted_bolt,
)

BEAM = Material("rock", 2e10, 0.0, 2500.0, plane="stress")
CLAMP = JointLaw("clamp", 0.5, cohesion=1e12, tensile_strength=1e12, normal_stiffness=1e15, shear_stiffness=1e15)
LENGTH = 16.0
#: N/m: of the tip of the cantilever, by bending and shear (Timoshenko; 5/6 of the section bear shear).
TIP = 1.0 / (4 * LENGTH**3 / 2e10 + 1.2 * LENGTH / 1e10)


def cantilever(order: int, **settings):
    return system_of(
        [rectangle(-1, -0.5, 0, 0.5), rectangle(0, -0.5, LENGTH, 0.5)], [1, 0], [1, order], joint=CLAMP, rock=BEAM,
        loaded=(1, 1), **settings,
    )  # fmt: skip


def tip_and_force(order: int, bolt: Bolt, load: float = 0.0) -> tuple[float, float]:
    """Upward displacement of the middle of the end, m, and the force of the bolt, N."""
    system = cantilever(order)
    loads = Loads(edge_tractions=(EdgeTraction("loaded", History.constant((0.0, load))),), bolts=(bolt,))
    result = after(system, loads, 3)
    tip = moved(system, result.state, 1, np.array([LENGTH, 0.0]))[1]
    return float(tip), result.statistics[f"bolt:{bolt.name}"]


@pytest.mark.parametrize(("order", "error"), [(3, 3e-3), (5, 6e-4), (8, 2e-4)])
@pytest.mark.parametrize("stiffness", [1e3, TIP, 1e3 * TIP])
def test_a_tip_that_a_bolt_pulls_up_moves_as_a_beam(order, error, stiffness):
    """The bolt to the ground has the pretension P and loses k per metre: δ = P/(k + k_beam); the point load dents the end,
    which the beam does not know."""
    bolt = Bolt(1, (LENGTH, 0.0), GROUND, (LENGTH, 10.0), stiffness, pretension=1e4)
    tip, force = tip_and_force(order, bolt)
    assert tip == pytest.approx(1e4 / (stiffness + TIP), rel=error)
    assert force == pytest.approx(1e4 * TIP / (stiffness + TIP), rel=2 * error)


def test_an_order_is_raised_for_what_a_bolt_does():
    system = cantilever(AUTO_ORDER, order_target=0.02)
    bolt = Bolt(1, (LENGTH, 0.0), GROUND, (LENGTH, 10.0), TIP, pretension=1e4)
    result = after(system, Loads(bolts=(bolt,)), 3)
    assert result.state.order[1] >= 3
    tip = moved(system, result.state, 1, np.array([LENGTH, 0.0]))[1]
    assert tip == pytest.approx(1e4 / (2 * TIP), rel=0.05)


def test_a_bolt_that_yields_gives_the_beam_the_rest():
    bolt = Bolt(1, (LENGTH, 0.0), GROUND, (LENGTH, 10.0), 1e3 * TIP, yield_force=4e3)
    tip, force = tip_and_force(5, bolt, -1e4)
    assert force == 4e3
    assert tip == pytest.approx(-6e3 / TIP, rel=1e-3)


def test_a_slack_bolt_does_nothing_and_a_bar_pushes():
    load, above = 1e3, (LENGTH, 10.0)
    slack, none = tip_and_force(5, Bolt(1, (LENGTH, 0.0), GROUND, above, TIP), load)
    assert none == 0.0 and slack == pytest.approx(load / TIP, rel=1e-3)
    tip, force = tip_and_force(5, Bolt(1, (LENGTH, 0.0), GROUND, above, TIP, compression=True), load)
    assert tip == pytest.approx(0.5 * slack, rel=1e-3) and force == pytest.approx(-0.5 * load, rel=1e-3)


def test_a_dowel_bears_across():
    """A bolt along the beam bears by its dowel alone."""
    bolt = Bolt(1, (LENGTH, 0.0), GROUND, (LENGTH + 2.0, 0.0), 1.0, shear_stiffness=3 * TIP)
    assert tip_and_force(5, bolt, -1e3)[0] == pytest.approx(-1e3 / (4 * TIP), rel=1e-3)
    weak = replace(bolt, shear_strength=500.0)
    assert tip_and_force(5, weak, -1e3)[0] == pytest.approx(-500.0 / TIP, rel=1e-3)


def test_an_eccentric_tendon_bends_a_beam_of_cells():
    """A free beam of 8 × 1 m with a tendon of P at e above its axis: the curvature P e/(E I) between the ends, where its
    anchors spread."""
    cells = columns_and_rows(np.linspace(0, 8, 9), np.linspace(0, 1, 2))
    system = cells_of(cells, 4, rock=BEAM)
    tendon = Bolt(0, (0.0, 0.9), 7, (8.0, 0.9), 1e3, pretension=1e5)
    result = after(system, Loads(bolts=(tendon,)), 3)
    out = moved_corners(system, result.state)
    at = system.blocks.vertices

    def sag(x: float) -> float:
        return float(out[(np.abs(at[:, 0] - x) < 1e-9) & (at[:, 1] < 0.5), 1].mean())

    curvature = 1e5 * 0.4 * 12 / 2e10
    # Pulled together above its axis the beam opens upwards: its ends rise.
    assert sag(2) + sag(6) - 2 * sag(4) == pytest.approx(curvature * 4, rel=1e-3)
    assert result.statistics["bolt:bolt"] == pytest.approx(1e5, rel=1e-4)


def hanging(order: int, bolts) -> tuple[dict[str, float], np.ndarray]:
    """Forces of bolts, and corners, of a stiff block pulled off a fixed one."""
    stiff = Material("rock", 1e14, 0.2, 2500.0)
    system = system_of(
        [rectangle(0, 2, 4, 3), rectangle(0, 0, 2, 2), rectangle(2, 0, 4, 2)], [1, 0, 0], [1, order, order], rock=stiff,
        joint=JointLaw("open", 0.3), time_step=1.0,
    )  # fmt: skip
    loads = Loads(gravity=History.constant((1.0, -9.81)), bolts=bolts)
    state = State.at_rest(system.blocks)
    for _ in range(15):
        result = system.step(state, loads)
        state = result.state
    forces = {name: value for name, value in result.statistics.items() if name.startswith("bolt:")}
    return forces, state.vertices - system.blocks.vertices


def test_stiff_blocks_hang_from_bolts_as_those_of_first_order():
    bolts = (
        Bolt(1, (0.7, 0.5), 0, (0.5, 2.8), 1e8, shear_stiffness=3e7, name="left"),
        Bolt(1, (1.5, 1.2), 2, (2.6, 1.2), 5e7, pretension=2e4, shear_stiffness=2e7, name="tie"),
        Bolt(2, (3.0, 1.0), 0, (3.2, 2.5), 1e8, pretension=1e4, yield_force=8e4, compression=True, name="right"),
    )
    first, there = hanging(1, bolts)
    third, here = hanging(3, bolts)
    largest = max(map(abs, first.values()))
    for name, force in first.items():
        assert third[name] == pytest.approx(force, abs=1e-7 * largest)
    assert np.abs(here - there).max() < 1e-5 * np.abs(there).max()


def test_a_beam_that_swings_on_a_bolt_keeps_its_energy():
    """The balance closes to round-off. A bolt acts with its force at the end of each step: its work is P Δ − k δ Δ there, less
    than what the spring loses by ½ k Δ² in every step."""
    system = cantilever(5, dynamic_factor=1.0, newmark=(0.25, 0.5), damping=0.0, time_step=2e-3)
    bolt = Bolt(1, (LENGTH, 0.0), GROUND, (LENGTH, 10.0), TIP, pretension=1e4, compression=True)
    state, budget, tips = State.at_rest(system.blocks), EnergyBudget(), []
    for _ in range(200):
        result = system.step(state, Loads(bolts=(bolt,)))
        state, budget = result.state, budget.after(result.energy, result.state.time)
        tips.append(float(moved(system, state, 1, np.array([LENGTH, 0.0]))[1]))
    # Released at once, it swings between nothing and nearly twice its rest.
    assert 1.8 < max(tips) / (1e4 / (2 * TIP)) < 2.2
    assert abs(budget.residual) < 1e-5 * budget.turnover
    own = 1e4 * tips[-1] - TIP * float(np.array(tips) @ np.diff([0.0, *tips]))
    assert budget.load_work == pytest.approx(own, rel=1e-3)


def test_a_grouted_bar_crosses_joints_and_not_the_faces_of_cells():
    """In a beam of cells on a bed: one short bolt, where the bar leaves the beam; none in the beam alone."""
    cells = columns_and_rows(np.linspace(0, 4, 5), np.linspace(0, 1, 3))
    system = cells_of(cells, 2, below=[rectangle(-1, -1, 5, 0)], rock=BEAM)
    given = {"axial_stiffness": 1e8, "active_length": 0.4}
    (bolt,) = grouted_bolt(system.blocks, (0.5, 0.9), (0.5, -0.8), **given)
    assert {bolt.block, bolt.other} == {0, 1}
    with pytest.raises(CrossesNoJoint):
        grouted_bolt(system.blocks, (0.5, 0.3), (3.5, 0.6), **given)
    lifted = Loads(gravity=History.constant((0.0, 5.0)), bolts=(bolt,))
    result = after(system, lifted, 3)
    assert result.statistics[f"bolt:{bolt.name}"] > 0.0
