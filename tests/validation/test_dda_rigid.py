"""Rigid blocks: three unknowns, strains zero exactly, stress from the forces on them."""

from __future__ import annotations

import numpy as np
import pytest
from block_problems import GRAVITY, WEIGHT, march, moved, rectangle, system_of, turned

from geomech import dda
from geomech.model import (
    BlockMotion,
    Blocks,
    Cracks,
    DdaSettings,
    History,
    JointLaw,
    Loads,
    Material,
    PointMotion,
    Problem,
    State,
)
from geomech.reference.blocks import block_motion as exact

RIGID = Material("stone", 10e9, 0.25, density=2600.0, rigid=True)


def strained(system: dda.BlockSystem, state: State) -> float:
    """The largest change of a distance between two vertices of a block, m."""
    worst = 0.0
    for b in range(system.blocks.n_blocks):
        old, new = system.blocks.loops(b)[0], system.blocks.loops(b, state.vertices)[0]
        distances = [np.hypot(*(p[:, None] - p[None]).transpose(2, 0, 1)) for p in (old, new)]
        worst = max(worst, float(np.abs(distances[1] - distances[0]).max()))
    return worst


def test_a_column_of_rigid_blocks_carries_the_stress_that_statics_say():
    n, width, height = 6, 1.0, 2.0
    system = system_of(
        [rectangle(-1, -1, 2, 0), *(rectangle(0, height * k, width, height * (k + 1)) for k in range(n))],
        0.5,
        rock=RIGID,
    )
    found = dda.equilibrium(system, State.at_rest(system.blocks), WEIGHT, tolerance=1e-9)
    weight = 2600.0 * GRAVITY * width * height
    mean = weight * (np.arange(n, 0, -1) - 0.5) / width
    assert found.state.stress[1:, 1] == pytest.approx(-mean, rel=1e-6)
    print(f"column of rigid blocks: stress {np.abs(found.state.stress[1:, 1] / -mean - 1).max():.1e}")
    # No lateral force: what friction of corners that settle leaves is below a millionth.
    assert np.abs(found.state.stress[1:, [0, 2]]).max() < 1e-6 * mean[0]
    assert strained(system, found.state) < 1e-14
    # The springs alone give way: two at each joint, 40 E' each.
    springs = np.cumsum(weight * np.arange(n, 0, -1) / (80 * RIGID.plane_modulus))
    assert moved(system, found.state)[1:, 1] == pytest.approx(-springs, rel=1e-5)


@pytest.mark.parametrize("moved_by", ["points", "springs", "centroid"])
def test_a_rigid_platen_that_is_driven_bears_what_it_presses_with(moved_by):
    """A platen 2 m × 0.5 m pressed on a block with F: σ A = F Δy between where it is pushed and where it pushes."""
    rock = Material("rock", 10e9, 0.0, density=2600.0)
    blocks = Blocks.from_polygons(
        [rectangle(-1, -1, 2, 0), rectangle(0, 0, 1, 1), rectangle(-0.5, 1, 1.5, 1.5)],
        fixed=[True, False, False], material=[0, 0, 1],
    )  # fmt: skip
    down = History(np.array([0.0, 1.0]), np.array([[0.0], [-1e-4]]))
    at = [(x, 1.5) for x in (-0.5, 1.5)]
    loads = {
        "points": Loads(point_motions=tuple(PointMotion(2, p, down, (0.0, 1.0)) for p in at)),
        "springs": Loads(point_motions=tuple(PointMotion(2, p, down, (0.0, 1.0), stiffness=1e13) for p in at)),
        "centroid": Loads(
            block_motions=(BlockMotion(2, down, ("v0",)), BlockMotion(2, History.constant([0.0, 0.0]), ("u0", "r0")))
        ),
    }[moved_by]
    settings = DdaSettings(max_displacement_ratio=0.1)
    system = dda.BlockSystem(blocks, [rock, RIGID], [JointLaw("joint", 0.5)], settings=settings)
    result = system.step(State.at_rest(blocks), loads, 1.0)
    force = -float(result.state.stress[1, 1]) * 1.0
    assert force == pytest.approx(1e-4 * 10e9, rel=0.05)
    depth = 0.25 if moved_by == "centroid" else 0.5
    assert result.state.stress[2] == pytest.approx([0.0, -force * depth / 1.0, 0.0], rel=1e-4, abs=1.0)


@pytest.mark.first_by_default(1)
@pytest.mark.parametrize("dt", [1e-2, 1e-3])
def test_friction_on_an_incline_is_that_of_the_rigid_block(dt):
    slope, friction = np.radians(30), np.radians(15)
    polygons = [turned(rectangle(-20, -1, 20, 0), slope), turned(rectangle(4, 0, 5, 1), slope)]
    errors = []
    for rock in (RIGID, Material("rock", 10e9, 0.25, density=2600.0)):
        system = system_of(polygons, friction, rock=rock)
        end = march(system, State.at_rest(system.blocks), WEIGHT, 0.5, dt)
        way = -moved(system, end)[1] @ [np.cos(slope), np.sin(slope)]
        errors.append(abs(way / (0.5 * exact.incline_acceleration(slope, friction) * 0.5**2) - 1))
        if rock.rigid:
            assert strained(system, end) < 1e-13
    print(f"dt = {dt:g} s: rigid {errors[0]:.1e}, elastic {errors[1]:.1e} off the closed form")
    # Penalty springs remain: W over 2 × 40 E', a fortieth of the elastic block's share.
    assert errors[0] < 2e-7


def test_a_spinning_rigid_block_has_the_stress_of_its_rotation_and_keeps_its_shape():
    blocks = Blocks.from_polygons([rectangle(0, 0, 2, 2)])
    system = dda.BlockSystem(blocks, [RIGID], settings=DdaSettings(dynamic_factor=1.0, max_displacement_ratio=10.0))
    state = State.at_rest(blocks)
    state.velocity[0, 2] = 2 * np.pi
    state = march(system, state, Loads(), 10.0, 0.05)
    expected = exact.spinning_square_stress(2.0, 2600.0, 2 * np.pi)
    assert state.stress[0] == pytest.approx([expected, expected, 0.0], rel=1e-9, abs=1e-9 * expected)
    assert state.rotation[0] == pytest.approx(20 * np.pi, rel=1e-13)
    assert state.vertices == pytest.approx(blocks.vertices, abs=1e-11)


def test_rigid_and_elastic_blocks_meet_with_momentum_kept():
    blocks = Blocks.from_polygons([rectangle(0, 0, 1, 1), rectangle(1.01, 0.1, 3.01, 0.9)], material=[0, 1])
    rocks = [RIGID, Material("rock", 10e9, 0.25, density=2500.0)]
    system = dda.BlockSystem(blocks, rocks, settings=DdaSettings(dynamic_factor=1.0, max_displacement_ratio=1.0))
    state = State.at_rest(blocks)
    state.velocity[0, :2], state.velocity[1, :2] = [4.0, 0.5], [-1.0, 0.0]
    mass = np.array([2600.0, 2500.0]) * blocks.areas()
    momentum, budget = mass @ state.velocity[:, :2], dda.EnergyBudget()
    while state.time < 8e-3:
        result = system.step(state, Loads(), 2e-5)
        state, budget = result.state, budget.after(result.energy)
    assert state.velocity[0, 0] < state.velocity[1, 0]
    off = np.abs(mass @ state.velocity[:, :2] - momentum).max() / np.abs(momentum).max()
    print(f"rigid against elastic: momentum {off:.1e}, energy unaccounted for {budget.left_over():.1e}")
    assert mass @ state.velocity[:, :2] == pytest.approx(momentum, rel=1e-9)
    # The update of the geometry: the square of a strain of v/c = 2.5e-3.
    assert abs(budget.residual) < 6e-6 * budget.turnover


def test_a_crack_in_a_rigid_block_is_refused():
    blocks = Blocks.from_polygons([rectangle(0, 0, 1, 1)], names=["stone"])
    crack = Cracks.from_polylines([np.array([[0.3, 0.5], [0.7, 0.5]])], block=[0])
    with pytest.raises(ValueError, match="'stone' contains a crack, but its material 'stone' is rigid"):
        Problem("", blocks, crack, (RIGID,), ())
