"""Tractions, point loads and water on blocks, held against statics."""

import numpy as np
import pytest
from block_problems import rectangle, turned

from geomech import dda
from geomech.dda.loads.load_vectors import LoadMap, generalised
from geomech.model import (
    Blocks,
    DdaSettings,
    EdgeTraction,
    Excavation,
    History,
    JointLaw,
    LinearProfile,
    Loads,
    Material,
    PointLoad,
    State,
    WaterTable,
)

ROCK = Material("rock", 10e9, 0.25, density=2600.0)


def resultant(blocks, loads, time=0.0, rotation=None, vertices=None):
    """(n_blocks, 6) generalised forces about the centroids."""
    vertices = blocks.vertices if vertices is None else vertices
    moments = dda.block_moments(vertices, blocks.next_vertex, blocks.vertex_start)
    rotation = np.zeros(blocks.n_blocks) if rotation is None else rotation
    points, edges = LoadMap(blocks).rows(loads, time, vertices, rotation)
    return generalised(points, edges, moments[:, 1:3])


def test_a_linear_traction_has_its_force_moment_and_first_moments():
    blocks = Blocks.from_polygons([rectangle(0, 0, 2, 4)], edge_names=[[["", "right", "", ""]]])
    profile = LinearProfile((2.0, 0.0), (2.0, 4.0), (0.0, 3.0))
    loads = Loads(edge_tractions=(EdgeTraction("right", History.constant([-1e5, 2e4]), profile=profile),))
    # t = (−1e5, 2e4) · 3y/4: force ∫ = 6 times it, at y = 8/3, 2/3 above the centroid; x arm 1.
    fx, fy = -6e5, 1.2e5
    ky = 2 / 3
    expected = [fx, fy, 1.0 * fy - ky * fx, fx, ky * fy, 0.5 * (ky * fx + fy)]
    assert resultant(blocks, loads)[0] == pytest.approx(expected, rel=1e-13)


def test_a_profile_spans_the_pieces_of_a_side():
    whole = Blocks.from_polygons([rectangle(0, 0, 2, 4)], edge_names=[[["", "right", "", ""]]])
    pieces = Blocks.from_polygons(
        [np.array([[0, 0], [2, 0], [2, 1], [2, 2.5], [2, 4], [0, 4]], dtype=float)],
        edge_names=[[["", "right", "right", "right", "", ""]]],
    )
    profile = LinearProfile((2.0, 0.0), (2.0, 4.0), (1.0, -2.0))
    loads = Loads(edge_tractions=(EdgeTraction("right", History.constant([-1e5, 2e4]), profile=profile),))
    assert resultant(pieces, loads) == pytest.approx(resultant(whole, loads), rel=1e-13)


def test_followers_turn_with_their_block_and_others_do_not():
    angle = 0.7
    blocks = Blocks.from_polygons([rectangle(-1, -1, 1, 1)], edge_names=[[["", "right", "", ""]]])
    vertices, pull = turned(blocks.vertices, angle), np.array([-3.0, 1.0])
    c, s = np.cos(angle), np.sin(angle)
    carried = np.array([c * pull[0] - s * pull[1], s * pull[0] + c * pull[1]])
    for follower, expected in ((False, pull), (True, carried)):
        loads = Loads(
            edge_tractions=(EdgeTraction("right", History.constant(pull), follower=follower),),
            point_loads=(PointLoad(0, (0.0, 1.0), History.constant(pull), follower=follower),),
        )
        force = resultant(blocks, loads, rotation=np.array([angle]), vertices=vertices)[0]
        assert force[:2] == pytest.approx(2 * expected + expected, rel=1e-13)


def test_gravity_comes_in_stages():
    # Half the weight to 1 s, all of it at 3 s: the block's own acceleration is the history, step by step.
    blocks = Blocks.from_polygons([rectangle(0, 0, 1, 1)])
    system = dda.BlockSystem(
        blocks, [ROCK], settings=DdaSettings(dynamic_factor=1.0, time_step=0.05, max_displacement_ratio=10)
    )
    gravity = History.table([0.0, 1.0, 3.0], [[0.0, 0.0], [0.0, -5.0], [0.0, -10.0]])
    state = State.at_rest(blocks)
    for _ in range(70):
        result = system.step(state, Loads(gravity=gravity))
        assert result.acceleration[0, 1] == pytest.approx(gravity.at(result.state.time)[1], rel=1e-9)
        state = result.state


@pytest.mark.parametrize(
    "polygon",
    [
        turned(rectangle(-1, -0.5, 1, 0.5), 0.4),
        np.array([[0, 0], [3, 0], [3, 3], [2, 3], [2, 1], [1, 1], [1, 3], [0, 3]], dtype=float) - [1, 5],
    ],
    ids=["inclined", "concave"],
)
def test_a_submerged_block_is_lifted_by_the_water_it_displaces(polygon):
    # Archimedes: γw A through the centroid. On the strain rows −∮ p n_j x_i ds = −∫ p dA δ_ij (the pressure's gradient
    # meets first moments about the centroid only, which vanish).
    blocks = Blocks.from_polygons([polygon])
    loads = Loads(water=WaterTable(np.array([[0.0, 50.0]])))
    area, _, cy = dda.block_moments(blocks.vertices, blocks.next_vertex, blocks.vertex_start)[0, :3]
    force = resultant(blocks, loads)[0]
    pressure = 9810.0 * (50.0 - cy) * area
    # Round-off of pressures on edges, not of what is left of them.
    assert force[:3] == pytest.approx([0.0, 9810.0 * area, 0.0], abs=1e-14 * pressure * 10)
    assert force[3:] == pytest.approx([-pressure, -pressure, 0.0], rel=1e-13, abs=1e-13 * pressure)


def test_a_floating_block_displaces_its_own_weight():
    blocks = Blocks.from_polygons([rectangle(0, 0, 2, 1)])
    for depth in (0.25, 0.9, 1.0, 7.0):
        lift = resultant(blocks, Loads(water=WaterTable(np.array([[0.0, depth]]))))[0]
        assert lift[:3] == pytest.approx([0.0, 2 * 9810.0 * min(depth, 1.0), 0.0], abs=1e-9)


def test_an_inclined_line_presses_as_a_piezometric_one():
    # A bent line over a long edge: pressure by its own depth below the line at each x, exactly (pieces split at the
    # bend).
    blocks = Blocks.from_polygons([rectangle(0, 0, 10, 1)])
    line = np.array([[2.0, 1.0 + 2.0], [6.0, 1.0 + 5.0], [9.0, 1.0 - 1.0]])
    rows = LoadMap(blocks).rows(Loads(water=WaterTable(line)), 0.0, blocks.vertices, np.zeros(1))[1]
    top = rows[rows["edge"] == 2]
    x = np.linspace(0, 10, 200_001)
    depth = np.maximum(np.interp(x, *line.T) - 1.0, 0.0)
    assert top["force"].sum(axis=0) == pytest.approx([0.0, -9810 * np.trapezoid(depth, x)], rel=1e-8)
    assert top["force"][:, 1].sum() == pytest.approx(-9810 * (2 * 2 + 4 * 3.5 + 0.5 * 5 * 2.5), rel=1e-13)


def test_the_level_may_rise_and_edges_may_be_dry():
    blocks = Blocks.from_polygons([rectangle(0, 0, 2, 10)], edge_names=[[["", "", "", "lined"]]])
    water = WaterTable(np.array([[0.0, 2.0]]), level=History.ramp([0.5]), dry=("lined",))
    force = resultant(blocks, Loads(water=water), time=4.0)[0]
    assert force[0] == pytest.approx(-0.5 * 9810 * 16.0, rel=1e-13)  # nothing on the left to hold the right's push
    with pytest.raises(ValueError, match="'linned' dry, but no edge"):
        resultant(blocks, Loads(water=WaterTable(np.array([[0.0, 2.0]]), dry=("linned",))))
    with pytest.raises(ValueError, match="x of the points of a water table must increase"):
        WaterTable(np.array([[1.0, 0.0], [0.0, 0.0]]))
    with pytest.raises(ValueError, match="unit weight"):
        WaterTable(np.array([[1.0, 0.0]]), unit_weight=0.0)


def test_uplift_takes_its_share_of_the_force_on_a_base():
    # A dam block on its base: water stands 8 m deep on its left, nothing on its right; the line falls through the base.
    # The contact forces are effective: weight less uplift, and the friction that they can carry with it.
    names = [[[""] * 4], [["base", "", "", "face"]]]
    blocks = Blocks.from_polygons(
        [rectangle(-5, -1, 15, 0), rectangle(0, 0, 6, 10)], fixed=[True, False], edge_names=names
    )
    line = np.array([[0.0, 8.0], [6.0, 0.0]])
    system = dda.BlockSystem(
        blocks, [ROCK], [JointLaw("rough", friction_angle=0.9)], settings=DdaSettings(max_displacement_ratio=1.0)
    )
    result = system.step(
        State.at_rest(blocks), Loads(gravity=History.constant([0, -9.81]), water=WaterTable(line)), dt=1e3
    )
    weight, uplift, thrust = 2600 * 9.81 * 60, 0.5 * 9810 * 8 * 6, 0.5 * 9810 * 8 * 8
    rows = result.contacts
    # Friction takes the thrust on the face; the line stands over nothing else (the far side is dry).
    assert rows["normal_force"].sum() == pytest.approx(weight - uplift, rel=1e-6)
    assert abs(rows["shear_force"].sum()) == pytest.approx(thrust, rel=1e-6)


@pytest.mark.parametrize("drained", [True, False])
def test_an_excavation_drains_the_faces_it_lays_open(drained):
    # Block 1 leans on a lower and an upper block, all under 5 m of water: once the lower one is out, the water presses
    # on what the upper one still covers, and on the other sides.
    blocks = Blocks.from_polygons(
        [rectangle(-5, -1, 5, 0), rectangle(0, 0, 1, 3), rectangle(1, 0, 2, 1.2), rectangle(1, 1.2, 2, 3)],
        fixed=[True, False, False, False],
    )
    system = dda.BlockSystem(blocks, [ROCK], settings=DdaSettings(max_displacement_ratio=1.0))
    loads = Loads(
        gravity=History.constant([0.0, -9.81]),
        water=WaterTable(np.array([[0.0, 5.0]])),
        excavations=(Excavation(0.0, (2,), drained=drained),),
    )
    rows = system.step(State.at_rest(blocks), loads, 1e-6).forces.edges
    assert not (rows["block"] == 2).any()
    force = rows["force"][rows["block"] == 1].sum(axis=0)
    # Drained, what pressed on the right below 1.2 m is missing: mean depth 4.4 m.
    assert force == pytest.approx([9810 * 4.4 * 1.2 if drained else 0.0, 9810 * 3.0], rel=1e-12, abs=1e-8)
    on_top = rows[(rows["block"] == 3) & (rows["start"][:, 1] == rows["end"][:, 1])]
    assert len(on_top) == (1 if drained else 2)  # the upper block's underside


def test_plane_failure_with_water_in_its_tension_crack():
    # Hoek & Bray (1981), ch. 7: a wedge on a plane at ψ, cut off by a vertical tension crack with water z_w deep in it,
    # the pressure falling from there linearly to the toe: U = ½ γw z_w A, V = ½ γw z_w²;
    # F = (W cos ψ − U − V sin ψ) tan φ / (W sin ψ + V cos ψ). The piezometric line says the same.
    slope, depth_of_water, unit = np.radians(35), 4.0, 9810.0
    crack_foot = np.array([10.0, 10.0 * np.tan(slope)])
    wedge = np.array([[0.0, 0.0], crack_foot, crack_foot + [0, 6.0], [6.0, crack_foot[1] + 6.0]])
    c, s = np.cos(slope), np.sin(slope)
    ground = np.array([[-3 * c, -3 * s], [-3 * c + s, -3 * s - c], [14.0, -3.0], [14.0, 14 * np.tan(slope)]])
    back = np.array([crack_foot, [14.0, 14 * np.tan(slope)], [14.0, 14.0], [10.0, 14.0]])
    blocks = Blocks.from_polygons(
        [ground, back, wedge], fixed=[True, True, False], edge_names=[[[""] * 4], [[""] * 4], [["", "", "top", "face"]]]
    )
    line = np.array([[0.0, 0.0], [10.0, crack_foot[1] + depth_of_water]])
    loads = Loads(gravity=History.constant([0.0, -9.81]), water=WaterTable(line, unit))
    u, v = 0.5 * unit * depth_of_water * np.hypot(*crack_foot), 0.5 * unit * depth_of_water**2
    water = LoadMap(blocks).rows(loads, 0.0, blocks.vertices, np.zeros(3))[1]
    assert set(water["edge"].tolist()) == {8, 9}  # plane and crack; the line runs below the face and the top
    assert water["force"].sum(axis=0) == pytest.approx([-v - u * s, u * c], rel=1e-12)
    weight = 2600 * 9.81 * blocks.areas()[2]
    balance = (weight * s + v * c) / (weight * c - u - v * s)
    # It holds just above the friction that balances. Just below it slides: a quarter of a metre, until so much of it
    # has left the water, which stays where its line is, that it holds again.
    for factor, most in ((1.01, 1e-3), (0.99, np.inf)):
        joint = JointLaw("joint", friction_angle=float(np.arctan(factor * balance)))
        system = dda.BlockSystem(blocks, [ROCK], [joint], settings=DdaSettings(max_displacement_ratio=0.5))
        found = dda.equilibrium(system, State.at_rest(blocks), loads)
        slid = np.hypot(*(found.state.vertices - blocks.vertices)[8])
        assert slid < most if factor > 1 else slid > 0.1
