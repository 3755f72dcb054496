"""Faces that crush (`crushing_strength`): stress block, irreversible closure, impact, voussoir beams and arches, refusals."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scenes_of_bending import rectangle
from test_masonry_of_higher_order import weight

from geomech import dda
from geomech.model import (
    BlockMotion,
    Blocks,
    DdaSettings,
    EdgeTraction,
    History,
    JointLaw,
    Loads,
    Material,
    PointLoad,
    State,
)
from geomech.reference.blocks import masonry

STRENGTH, STIFFNESS, DENSITY = 10e6, 1e11, 2500.0


def joint(strength: float | None = STRENGTH, stiffness: float | None = STIFFNESS) -> JointLaw:
    return JointLaw(
        "bed", np.radians(35), crushing_strength=strength, normal_stiffness=stiffness, shear_stiffness=stiffness
    )


def block_on_floor(
    order: int, youngs_modulus: float = 2e13, law: JointLaw | None = None, **settings
) -> dda.BlockSystem:
    """A block of 1 m by 1 m on a fixed one."""
    blocks = Blocks.from_polygons(
        [rectangle(-1, -1, 2, 0), rectangle(0, 0, 1, 1)], fixed=[1, 0], order=[1, order],
        edge_names=[[["", "", "", ""]], [["", "", "top", ""]]],
    )  # fmt: skip
    chosen = {"dynamic_factor": 0.0, "time_step": 1.0, "max_displacement_ratio": 0.02} | settings
    rock = Material("rock", youngs_modulus, 0.2, DENSITY)
    return dda.BlockSystem(blocks, [rock], [law or joint()], settings=DdaSettings(**chosen))


def pressed(system: dda.BlockSystem, force: float, eccentricity: float) -> dda.Equilibrium:
    load = PointLoad(1, (0.5 + eccentricity, 1.0), History.constant((0.0, -force)))
    return dda.equilibrium(system, State.at_rest(system.blocks), Loads(point_loads=(load,)))


def plateau(force: float, eccentricity: float) -> tuple[float, float]:
    """Lengths (m) of the plateau a and of the triangle b of stress on an elastic-plastic bed without tension: f (a + b/2) = N,
    and their moment about the edge."""
    depth, distance = force / STRENGTH, 0.5 - eccentricity
    # a = N/f − b/2 in a²/2 + b (a + b/3)/2 = N d/f leaves N²/(2 f²) + b²/24 = N d/f.
    triangle = np.sqrt(24.0 * (depth * distance - 0.5 * depth**2))
    return depth - 0.5 * triangle, triangle


@pytest.mark.parametrize("order", [1, 2, 8])
def test_eccentric_pressure_has_a_plateau(verified, order):
    force, eccentricity = 3e6, 0.33
    system = block_on_floor(order)
    found = pressed(system, force, eccentricity)
    flat, triangle = plateau(force, eccentricity)
    assert found.converged and flat > 0.1
    rows = found.state.face_points
    stress = rows["normal_force"] / np.maximum(rows["length"], 1e-9)
    assert stress[rows["length"] > 0].max() == pytest.approx(STRENGTH, rel=1e-6)
    rotation = -float(found.state.rotation[1])
    exact = STRENGTH / STIFFNESS / triangle
    print(f"order {order}: rotation {rotation / exact - 1:+.4f} off that of an elastic-plastic bed")
    verified(f"eccentric pressure on a crushing face, order {order}: rotation", rotation / exact - 1, "closed form")
    assert rotation == pytest.approx(exact, rel=0.03)


@pytest.mark.parametrize("order", [1, 3])
def test_eccentric_force_is_borne_until_the_stress_block_reaches_the_edge(order):
    """M = N h/2 (1 − N/(f h)); points of the face find the arm of a stress block to some thousandths."""
    force = 3e6
    limit = 0.5 * (1 - force / STRENGTH)
    assert pressed(block_on_floor(order), force, 0.99 * limit).converged
    assert not pressed(block_on_floor(order), force, 1.01 * limit).converged


def test_even_pressure_is_borne_up_to_the_strength():
    """Beyond it the block sinks and the run says so; the closure is that of the springs before."""
    for share, stands in ((0.999, True), (1.001, False)):
        system = block_on_floor(2)
        tractions = (EdgeTraction("top", History.constant((0.0, -share * STRENGTH))),)
        found = dda.equilibrium(system, State.at_rest(system.blocks), Loads(edge_tractions=tractions))
        assert found.converged is stands


@pytest.mark.parametrize("order", [1, 4])
def test_closure_by_crushing_does_not_open_again(verified, order):
    """A platen presses by 0.3 mm, withdraws, and presses by 0.5 mm: force f, elastic unloading, reloading to f at the closure
    that remained, dissipation f Δc."""
    blocks = Blocks.from_polygons(
        [rectangle(-1, -1, 2, 0), rectangle(0, 0, 1, 1), rectangle(-1, 1, 2, 2)], fixed=[1, 0, 1], order=[1, order, 1]
    )
    settings = DdaSettings(dynamic_factor=0.0, time_step=1.0, max_displacement_ratio=0.02)
    system = dda.BlockSystem(blocks, [Material("rock", 2e13, 0.0, DENSITY)], [joint()], settings=settings)
    stiffness = 1.0 / (2.0 / STIFFNESS + 1.0 / 2e13)  # of both beds and the block
    path = np.array([0.0, 1.5, 3.0, 2.2, 1.5, 0.5, 2.0, 3.0, 4.0, 5.0]) * 1e-4
    loads = Loads(block_motions=(BlockMotion(2, History(np.arange(10.0), -path[:, None]), ("v0",)),))
    state, budget, force, closed = State.at_rest(blocks), dda.EnergyBudget(), [], 0.0
    for target in path[1:]:
        end = round(state.time) + 1
        while state.time < end - 1e-9:
            result = system.step(state, loads, end - state.time)
            state, budget = result.state, budget.after(result.energy, result.state.time)
        rows = state.face_points
        force.append(float(rows["normal_force"][(rows["block"] == 2) | (rows["other"] == 2)].sum()))
        closed = max(closed, target - STRENGTH / stiffness)
        expected = max(0.0, stiffness * (target - closed))
        assert force[-1] == pytest.approx(expected, rel=1e-4, abs=1e-4 * STRENGTH)
    print(f"order {order}: dissipated {budget.crushing:.2f} J/m, exact {STRENGTH * closed:.2f}")
    verified(
        f"cyclic closing of crushing faces, order {order}: dissipation",
        budget.crushing / (STRENGTH * closed) - 1,
        "f Δc",
    )
    assert budget.crushing == pytest.approx(STRENGTH * closed, rel=2e-3)
    assert abs(budget.residual) < 1e-4 * budget.turnover


@pytest.mark.parametrize(("order", "newmark"), [(1, (0.5, 1.0)), (3, (0.25, 0.5))])
def test_a_block_dropped_on_a_crushing_floor(verified, order, newmark):
    """½ m v² = f A Δc, less what vibrates and rebounds; impulse and energies balance."""
    speed = 5.0
    system = block_on_floor(
        order, 2e12, joint(stiffness=1e12), dynamic_factor=1.0, time_step=2e-5, newmark=newmark, damping=0.0
    )
    state, budget, impulse = State.at_rest(system.blocks), dda.EnergyBudget(), 0.0
    velocity = state.velocity.copy()
    velocity[1, 1] = -speed
    state = replace(state, velocity=velocity)
    for _ in range(120):
        result = system.step(state, Loads())
        state, budget = result.state, budget.after(result.energy, result.state.time)
        impulse += float(result.contacts["normal_force"].sum()) * result.dt
    assert impulse == pytest.approx(DENSITY * (state.velocity[1, 1] + speed), rel=1e-12)
    kinetic = 0.5 * DENSITY * speed**2
    closed = -float(np.mean(state.face_points["lift"]))
    print(
        f"order {order}: {budget.crushing / kinetic:.4f} of the energy crushes, residual {budget.residual / kinetic:.1e}"
    )
    verified(
        f"block dropped on a crushing floor, order {order}: closure", STRENGTH * closed / kinetic - 1, "m v²/(2 f A)"
    )
    assert budget.crushing == pytest.approx(kinetic, rel=0.02) and STRENGTH * closed == pytest.approx(kinetic, rel=0.02)
    assert abs(budget.residual) < 1e-4 * kinetic and budget.scheme > -1e-4 * kinetic


def voussoir_beam(order: int, strength: float, youngs_modulus: float, stiffness: float) -> dda.BlockSystem:
    """Two halves of 5 m by 1 m between fixed abutments."""
    outlines = [rectangle(-1, -2, 0, 3), rectangle(10, -2, 11, 3), rectangle(0, 0, 5, 1), rectangle(5, 0, 10, 1)]
    blocks = Blocks.from_polygons(outlines, fixed=[1, 1, 0, 0], order=[1, 1, order, order])
    law = replace(joint(strength, stiffness), friction_angle=np.radians(60))
    settings = DdaSettings(dynamic_factor=0.0, time_step=1.0, max_displacement_ratio=0.02)
    return dda.BlockSystem(blocks, [Material("rock", youngs_modulus, 0.0, DENSITY)], [law], settings=settings)


def thrust_of(system: dda.BlockSystem) -> float | None:
    """Thrust at an abutment, N; None where the beam falls."""
    try:
        found = dda.equilibrium(system, State.at_rest(system.blocks), weight())
    except dda.NotConverged:
        return None
    rows = found.state.face_points
    return float(rows["normal_force"][(rows["block"] == 0) | (rows["other"] == 0)].sum()) if found.converged else None


@pytest.mark.parametrize("order", [1, 3])
def test_a_voussoir_beam_crushes_at_its_capacity(verified, order):
    """Stiff halves: N (T − N/f) = w S²/8, which has no solution above w = 2 f T²/S²."""
    load = DENSITY * 9.81
    capacity = load * 100.0 / 2.0
    for share, within in ((2.0, 0.01), (1.2, 0.005), (1.05, 0.005)):
        thrust, exact = thrust_of(voussoir_beam(order, share * capacity, 1e13, 1e14)), masonry.crushing_voussoir_thrust(
            10.0, 1.0, load, share * capacity
        )  # fmt: skip
        assert thrust is not None
        print(f"order {order}, strength {share:g} of the least: thrust {thrust / exact - 1:+.4f} off")
        verified(
            f"voussoir beam at {share:g} of its least strength, order {order}: thrust",
            thrust / exact - 1,
            "closed form",
        )
        assert thrust == pytest.approx(exact, rel=within)
    assert thrust_of(voussoir_beam(order, 0.98 * capacity, 1e13, 1e14)) is None


def arch(n: int, ratio: float, order: int, strength: float) -> dda.BlockSystem:
    """``n`` voussoirs between two fixed springings, mean radius 10 m."""
    inner, outer = 10 * (1 - 0.5 * ratio), 10 * (1 + 0.5 * ratio)
    springings = [rectangle(inner, -1, outer, 0), rectangle(-outer, -1, -inner, 0)]
    blocks = Blocks.from_polygons(
        springings + masonry.voussoirs(n, ratio, 10.0), fixed=[1, 1] + [0] * n, order=[1, 1] + [order] * n
    )
    settings = DdaSettings(dynamic_factor=0.0, max_displacement_ratio=0.01)
    law = replace(joint(strength, None), friction_angle=np.radians(60))
    return dda.BlockSystem(blocks, [Material("stone", 1e11, 0.2, DENSITY)], [law], settings=settings)


@pytest.mark.parametrize(
    ("n", "order", "strength"),
    [(6, 1, 20.0), pytest.param(6, 3, 20.0, marks=pytest.mark.slow), pytest.param(12, 1, 5.0, marks=pytest.mark.slow),
     pytest.param(12, 3, 5.0, marks=pytest.mark.slow), pytest.param(25, 2, 10.0, marks=pytest.mark.slow)],
)  # fmt: skip
def test_an_arch_that_crushes_stands_and_falls_where_limit_analysis_says(n, order, strength):
    """Hinges are at N/(2 f) from the edges (`masonry.moment_reserve`)."""
    thinnest = masonry.thinnest_crushing_arch(n, strength)
    assert thinnest > 1.04 * masonry.thinnest_arch(n)

    def stands(ratio: float) -> bool:
        system = arch(n, ratio, order, strength * DENSITY * 9.81 * 10.0)
        try:
            return dda.equilibrium(system, State.at_rest(system.blocks), weight()).converged
        except dda.NotConverged:
            return False

    assert stands(1.01 * thinnest)
    assert not stands(0.99 * thinnest)


def test_reference_of_crushing_masonry():
    """A strong arch is that of infinite strength; the beam bears half of its depth in compression at its capacity."""
    assert masonry.thinnest_crushing_arch(12, 1e5) == pytest.approx(masonry.thinnest_arch(12), rel=1e-4)
    assert masonry.crushing_voussoir_thrust(10.0, 1.0, 2e4, 1e6) == pytest.approx(0.5e6)
    assert np.isnan(masonry.crushing_voussoir_thrust(10.0, 1.0, 2.001e4, 1e6))


def test_a_strength_that_is_not_reached_changes_nothing():
    """Order 3: faces with more points, and the same forces."""
    forces = []
    for strength in (None, 1e9):
        system = block_on_floor(3, 2e10, joint(strength))
        result = pressed(system, 3e6, 0.1).result
        assert result is not None
        rows = result.contacts
        forces.append((rows["normal_force"].sum(), (rows["normal_force"] * rows["point"][:, 0]).sum()))
    assert forces[1] == pytest.approx(forces[0], rel=1e-6)


@pytest.mark.parametrize(
    ("changes", "message"),
    [({"dilation_angle": 0.1}, "does not go with"), ({"max_closure": 1e-3}, "does not go with"),
     ({"residual_cohesion": 1.0, "cohesion": 2.0}, "does not go with"), ({"crushing_strength": -1.0}, "must be positive")],
)  # fmt: skip
def test_laws_that_cannot_crush(changes, message):
    with pytest.raises(ValueError, match=message):
        replace(joint(), **changes)


@pytest.mark.parametrize(
    ("laws", "settings", "message"),
    [([JointLaw("worn", 0.5, residual_friction_angle=0.4)], {}, "joint 'bed' has a crushing strength.*worn"),
     ([JointLaw("ball", restitution=0.5)], {}, "crushing strength.*restitution"),
     ([], {"contact": "augmented"}, "crushing strength.*penalty"),
     ([], {"springs": "resolved"}, "crushing strength.*stiff springs")],
)  # fmt: skip
def test_what_faces_that_crush_do_not_support(laws, settings, message):
    blocks = Blocks.from_polygons([rectangle(-1, -1, 2, 0), rectangle(0, 0, 1, 1)], fixed=[1, 0])
    with pytest.raises(ValueError, match=message):
        dda.BlockSystem(blocks, [Material("rock", 2e10, 0.2)], [joint(), *laws], settings=DdaSettings(**settings))


def test_no_factor_of_safety_with_faces_that_crush():
    blocks = Blocks.from_polygons([rectangle(-1, -1, 2, 0), rectangle(0, 0, 1, 1)], fixed=[1, 0])
    with pytest.raises(dda.NothingToReduce, match="joint 'bed' crushes"):
        dda.factor_of_safety(blocks, [Material("rock", 2e10, 0.2, DENSITY)], [joint()], loads=weight())
