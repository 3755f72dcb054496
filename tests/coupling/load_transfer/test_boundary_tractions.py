"""Boundary loads made from contact forces: held against the forces and moments of the contacts themselves."""

import numpy as np
import pytest
from numba import njit

from geomech.coupling.crack_compliance.added_compliance import stress_rotation
from geomech.coupling.load_transfer.boundary_tractions import BoundaryForces, boundary_load
from geomech.coupling.load_transfer.inertia_forces import BlockInertia
from geomech.coupling.load_transfer.no_tension_pressure import no_pull
from geomech.dda import EDGE_FORCE, POINT_FORCE
from geomech.ddm.loads.body_loads import first_moments, resultants
from geomech.model import CONTACT, SLIP, Blocks, Motion
from geomech.model.blocks.polygon import area_moments

#: No edge forces and no point forces.
NOTHING = np.empty(0, EDGE_FORCE), np.empty(0, POINT_FORCE)
SQUARE = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])


def contact(vertex, edge, block, other, point, normal, push, shear=0.0):
    row = np.zeros(1, CONTACT)
    for name, value in {
        "vertex": vertex,
        "edge": edge,
        "block": block,
        "other": other,
        "state": SLIP,
        "point": point,
        "normal": normal,
        "normal_force": push,
        "shear_force": shear,
    }.items():
        row[name] = value
    return row[0]


def two_squares(offset=0.0):
    """One square on another, the upper one moved sideways by ``offset``."""
    return Blocks.from_polygons([SQUARE, SQUARE + [offset, 1.0]])


def load_of(block, blocks, contacts, **options):
    contacts = np.array(contacts, CONTACT)
    motion = Motion.of(blocks, blocks.vertices)
    moving = {name: options.pop(name) for name in ("density", "gravity", "acceleration", "spin") if name in options}
    forces = BoundaryForces(blocks.vertices, motion, contacts, *NOTHING, **options)
    return boundary_load(block, blocks, forces, inertia(**moving))


def inertia(rotation=0.0, density=0.0, spin=0.0, gravity=None, acceleration=None, overstress=None):
    """That of one block."""
    one = (None if of is None else np.asarray(of, dtype=float)[None] for of in (acceleration, None, overstress))
    return BlockInertia(np.array([rotation]), np.array([density]), np.array([spin]), gravity, *one)


def vertex_at(blocks, block, point):
    inside = np.flatnonzero(blocks.vertex_block == block)
    return int(inside[np.argmin(np.hypot(*(blocks.vertices[inside] - point).T))])


def edge_between(blocks, block, start, end):
    edge = vertex_at(blocks, block, start)
    assert np.allclose(blocks.vertices[blocks.next_vertex[edge]], end)
    return edge


@njit
def pressure(length, force, moment):
    """`no_pull`, which only compiled functions can call."""
    return no_pull(length, force, moment)


@pytest.mark.parametrize("moment", [0.0, 0.01, 0.05, 0.2, 0.3, 0.5, 0.66, 0.8, 0.97, 1.0])
def test_pressure_keeps_force_and_moment_and_does_not_pull(moment):
    """∫p = F and ∫p s = M to round-off; a push whose resultant lies inside the face needs no pull anywhere."""
    pieces, at_start, at_end = pressure(1.0, 1.0, moment)
    force, about_start = at_start + at_end, at_end
    assert at_start >= 0 and at_end >= 0
    for start, end, p_start, p_end in pieces:
        assert p_start >= 0 and p_end >= 0
        length = end - start
        force += length * (p_start + p_end) / 2
        about_start += length**2 * (p_start + 2 * p_end) / 6 + start * length * (p_start + p_end) / 2
    assert force == pytest.approx(1.0, abs=1e-14)
    assert about_start == pytest.approx(moment, abs=1e-14)


def test_end_forces_become_the_linear_pressure_of_their_resultant():
    """Two end forces F0, F1 on a length ℓ: p0 = (4F0 − 2F1)/ℓ, p1 = (4F1 − 2F0)/ℓ (statics of a linear pressure)."""
    f0, f1, length = 3.0, 2.0, 0.5
    [(_, _, p_start, p_end), (begin, end, *_)], at_start, at_end = pressure(length, f0 + f1, f1 * length)
    assert at_start == at_end == 0.0 and begin == end
    assert p_start == pytest.approx((4 * f0 - 2 * f1) / length, rel=1e-14)
    assert p_end == pytest.approx((4 * f1 - 2 * f0) / length, rel=1e-14)


def moments_of(load):
    """Moments of the tractions up to the second, by their exact integrals: two loads apart in them differ in the
    block."""
    out = np.zeros((2, 6))
    for (a, b), (t_a, t_b) in zip(load.segments, load.tractions):
        for s, weight in zip((0.5 - np.sqrt(0.15), 0.5, 0.5 + np.sqrt(0.15)), (5 / 18, 8 / 18, 5 / 18)):
            x, y = a + s * (b - a)
            t = (t_a + s * (t_b - t_a)) * weight * np.hypot(*(b - a))
            out += np.outer(t, [1, x, y, x * x, x * y, y * y])
    return out


@pytest.mark.parametrize("places", [(0.0, 1.0), (0.0, 0.4, 1.0), (0.3, 0.6, 1.0)])
@pytest.mark.parametrize("block", [0, 1])
def test_tractions_do_not_jump_as_a_contact_comes_or_goes(places, block):
    """The contact at the right end with a force of 1e-9 of the others, and open by 1e-9 of how much they give: what is
    on the block differs by no more than some 1e-9. With a gap a thousand times what they give it is as if the contact
    were not."""
    lower = np.array([[0.0, 0.0], [1.0, 0.0], *([x, 1.0] for x in places[::-1]), *([[0.0, 1.0]] if places[0] else [])])
    blocks = Blocks.from_polygons([lower, SQUARE + [0.0, 1.0]])
    bottom = edge_between(blocks, 1, [0.0, 1.0], [1.0, 1.0])

    def load(push, gap):
        rows = []
        for x, (force, apart) in zip(places, [(1.0, -1e-6)] * (len(places) - 1) + [(push, gap)]):
            vertex = vertex_at(blocks, 0, [x, 1.0])
            rows.append(contact(vertex, bottom, 0, 1, [x, 1.0], [0, -1], force, 0.3 * force))
            rows[-1]["gap"] = apart
        return load_of(block, blocks, rows)

    closed, opened, far = load(1e-9, -1e-15), load(0.0, 1e-15), load(0.0, 1e-3)
    size = np.abs(moments_of(closed)).max()
    assert np.abs(moments_of(closed) - moments_of(opened)).max() < 2e-8 * size
    rows = [row for row in range(len(places) - 1)]
    without = load_of(
        block,
        blocks,
        [
            contact(vertex_at(blocks, 0, [places[k], 1.0]), bottom, 0, 1, [places[k], 1.0], [0, -1], 1.0, 0.3)
            for k in rows
        ],
    )
    assert np.abs(moments_of(far) - moments_of(without)).max() < 2e-3 * size


@pytest.mark.parametrize("offset", [0.0, 0.3, -0.7])
@pytest.mark.parametrize("pushes", [(1.0, 1.0), (1.0, 0.2), (0.1, 2.0)])
def test_face_contacts_keep_force_and_moment_on_both_blocks(offset, pushes):
    blocks = two_squares(offset)
    left, right = max(0.0, offset), min(1.0, 1.0 + offset)
    lower_top = edge_between(blocks, 0, [1.0, 1.0], [0.0, 1.0])
    upper_bottom = edge_between(blocks, 1, [offset, 1.0], [1.0 + offset, 1.0])
    rows = []
    for x, push, shear in ((left, pushes[0], 0.3), (right, pushes[1], 0.1)):
        if x in (offset, 1.0 + offset):  # the upper block's corner on the lower's top
            rows.append(contact(vertex_at(blocks, 1, [x, 1.0]), lower_top, 1, 0, [x, 1.0], [0, 1], push, shear))
        else:
            rows.append(contact(vertex_at(blocks, 0, [x, 1.0]), upper_bottom, 0, 1, [x, 1.0], [0, -1], push, shear))
    for block in (0, 1):
        load = load_of(block, blocks, rows)
        centre = blocks.loops(block)[0].mean(axis=0)
        force, moment, _ = resultants(load.segments, load.tractions, centre)
        expected, expected_moment = np.zeros(2), 0.0
        for row in rows:
            along = np.array([-row["normal"][1], row["normal"][0]])
            f = row["normal_force"] * row["normal"] + row["shear_force"] * along
            f = f if row["block"] == block else -f
            arm = row["point"] - centre
            expected += f
            expected_moment += arm[0] * f[1] - arm[1] * f[0]
        assert force == pytest.approx(expected, abs=1e-13)
        assert moment == pytest.approx(expected_moment, abs=1e-13)
        # No pull: the pressure on the face (normal component towards the block) is nowhere negative.
        inward = np.array([0.0, -1.0]) if block == 0 else np.array([0.0, 1.0])
        assert (load.tractions @ inward >= -1e-13).all()


@pytest.mark.parametrize("place", [0.5, 0.02, 0.0])
def test_lone_vertex_keeps_force_and_moment_on_both_blocks(place):
    """A tilted block stands with one corner on another's face: in the middle, near its end, at its very corner."""
    tilted = SQUARE @ np.array([[np.cos(0.6), np.sin(0.6)], [-np.sin(0.6), np.cos(0.6)]])
    blocks = Blocks.from_polygons([SQUARE, tilted - tilted[0] + [place, 1.0]])
    top = edge_between(blocks, 0, [1.0, 1.0], [0.0, 1.0])
    row = contact(vertex_at(blocks, 1, [place, 1.0]), top, 1, 0, [place, 1.0], [0, 1], 2.0, 0.7)
    for block, sign in ((0, -1), (1, 1)):
        load = load_of(block, blocks, [row])
        centre = blocks.loops(block)[0].mean(axis=0)
        force, moment, _ = resultants(load.segments, load.tractions, centre)
        f = sign * np.array([-0.7, 2.0])
        arm = np.array([place, 1.0]) - centre
        assert force == pytest.approx(f, abs=1e-13)
        assert moment == pytest.approx(arm[0] * f[1] - arm[1] * f[0], abs=1e-13)


@pytest.mark.parametrize("bend_deg", [-9.0, -1e-6, 1e-6, 6.6, 9.9, 10.1])
@pytest.mark.parametrize("direction_deg", [0.0, 65.0, 90.0])
def test_a_force_on_a_corner_that_is_nearly_flat_keeps_its_moment(bend_deg, direction_deg):
    """About the corner it has none, whichever way it points and however unlike the corner's edges are."""
    apex = np.array([0.4, 1.0])
    side = np.tan(np.radians(bend_deg))
    roof = Blocks.from_polygons([np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0 - 0.6 * side], apex, [0.0, 1.0]])])
    way = np.radians(direction_deg)
    row = contact(3, 9, 0, 1, apex, [np.cos(way), np.sin(way)], 3.0, 2.0)
    load = load_of(0, roof, [row])
    force, moment, _ = resultants(load.segments, load.tractions, apex)
    assert np.hypot(*force) == pytest.approx(np.hypot(3.0, 2.0), rel=1e-14)
    assert abs(moment) < 1e-14


def test_inertia_balances_what_contacts_leave():
    """A block pushed on one side accelerates: the body force must cancel force and moment of the tractions."""
    blocks = two_squares(0.3)
    lower_top = edge_between(blocks, 0, [1.0, 1.0], [0.0, 1.0])
    row = contact(vertex_at(blocks, 1, [0.3, 1.0]), lower_top, 1, 0, [0.3, 1.0], [0, 1], 2.0, 0.7)
    load = load_of(1, blocks, [row])
    area, centroid, second = area_moments(blocks.loops(1))
    force, moment, _ = resultants(load.segments, load.tractions, centroid)
    of_body = load.body_force_gradient @ second
    assert force + area * load.body_force == pytest.approx([0, 0], abs=1e-14)
    assert moment + of_body[1, 0] - of_body[0, 1] == pytest.approx(0, abs=1e-14)


def test_inertia_and_viscosity_of_a_strain_are_an_even_stress():
    """∫σ dV = Σ x ⊗ f + ∫ x ⊗ b: of the load's body force only that of rigid motion, and with the even stress what the
    whole field of inertia, less the stress that viscosity bears, would make of it. For a block that has turned, too."""
    blocks = two_squares(0.3)
    lower_top = edge_between(blocks, 0, [1.0, 1.0], [0.0, 1.0])
    row = contact(vertex_at(blocks, 1, [0.3, 1.0]), lower_top, 1, 0, [0.3, 1.0], [0, 1], 2.0, 0.7)
    given = {
        "density": 3.0,
        "gravity": np.array([0.0, -9.81]),
        "acceleration": np.array([0.1, 0.2, 0.7, 0.3, -0.4, 0.9]),
    }
    beyond = np.array([0.2, -0.3, 0.5])
    motion = Motion.of(blocks, blocks.vertices)
    rows = np.array([row], CONTACT)
    forces = BoundaryForces(blocks.vertices, motion, rows, *NOTHING)
    for angle in (0.0, 0.4):
        whole, even = (
            boundary_load(1, blocks, forces, inertia(angle, **given, overstress=stress)) for stress in (None, beyond)
        )
        _, _, second = area_moments(blocks.loops(1))
        assert whole.remote_stress is None
        assert even.body_force_gradient == pytest.approx(-even.body_force_gradient.T, abs=1e-14)
        assert even.body_force == pytest.approx(whole.body_force, abs=1e-14)
        # (The square's area is one.)
        missing = second @ (whole.body_force_gradient - even.body_force_gradient).T
        assert missing[0, 1] == pytest.approx(missing[1, 0], abs=1e-14)
        bears = even.remote_stress + stress_rotation(-angle) @ beyond
        assert bears == pytest.approx([missing[0, 0], missing[1, 1], missing[0, 1]], abs=1e-14)


def test_turned_block_sees_its_forces_in_its_own_frame():
    """The same block and forces, all turned by 30°: the load in the reference frame must not change."""
    blocks = two_squares(0.0)
    lower_top = edge_between(blocks, 0, [1.0, 1.0], [0.0, 1.0])
    points = np.array([[0.0, 1.0], [1.0, 1.0]])
    upright = [
        contact(vertex_at(blocks, 1, p), lower_top, 1, 0, p, [0, 1], push, 0.2) for p, push in zip(points, (1.0, 2.0))
    ]
    angle = np.radians(30)
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    turned_vertices = blocks.vertices @ turn.T
    turned = np.array(upright, CONTACT)
    turned["point"], turned["normal"] = points @ turn.T, [turn @ [0, 1]] * 2
    motion = Motion.of(blocks, turned_vertices)
    there = boundary_load(0, blocks, BoundaryForces(turned_vertices, motion, turned, *NOTHING), inertia(angle))
    here = load_of(0, blocks, upright)
    assert there.segments == pytest.approx(here.segments, abs=1e-13)
    assert there.tractions == pytest.approx(here.tractions, abs=1e-13)


@pytest.mark.parametrize("share", [1e-3, 0.02, 0.2])
def test_a_force_at_the_end_of_a_face_that_is_off_the_grid_keeps_its_moment(share):
    """Pressures end on a grid; where the resultant is near an end, of which the contact lies off it by up to 1.2e-4 of
    the side, part of it is a lone force there."""
    blocks = Blocks.from_polygons([SQUARE, SQUARE + [0.3333, 1.0]])
    top, bottom = edge_between(blocks, 0, [1, 1], [0, 1]), edge_between(blocks, 1, [0.3333, 1], [1.3333, 1])
    ends = np.array([[0.3333, 1.0], [1.0, 1.0]])
    rows = [
        contact(vertex_at(blocks, 1, ends[0]), top, 1, 0, ends[0], [0, 1], 1 - share, 0.2 * (1 - share)),
        contact(vertex_at(blocks, 0, ends[1]), bottom, 0, 1, ends[1], [0, -1], share, 0.2 * share),
    ]
    load = load_of(0, blocks, rows)
    force, moment, _ = resultants(load.segments, load.tractions, np.zeros(2))
    assert force == pytest.approx([0.2, -1.0], abs=1e-13)
    # Of the pushes at both ends, and of the shear along y = 1.
    assert moment == pytest.approx(-(0.3333 * (1 - share) + share) - 0.2, abs=1e-12)


@pytest.mark.parametrize("beyond", [1e-9, 0.5, 3.0])
def test_contacts_beyond_the_end_of_a_short_side_keep_force_and_moment(beyond):
    """Two corners press on a side of 1 cm from beyond its end, by so many lengths of it: they have the moment of where
    they act, and next to nothing of it is on the short side; what is added has no mean stress but the force's at the
    end."""
    cut = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 0.99], [0.99, 1.0], [0.0, 1.0]])
    above = np.array([[0.995, 1.0], [2.0, 0.5], [2.0, 2.0]])
    hole = np.array([[0.4, 0.4], [0.4, 0.6], [0.6, 0.6], [0.6, 0.4]])
    blocks = Blocks.from_polygons([[cut, hole], above])
    side = edge_between(blocks, 0, [1.0, 0.99], [0.99, 1.0])
    start, end = blocks.vertices[side], blocks.vertices[blocks.next_vertex[side]]
    point, normal = end + beyond * (end - start), np.array([1.0, 1.0]) / np.sqrt(2)
    row = contact(vertex_at(blocks, 1, [0.995, 1.0]), side, 1, 0, point, normal, 2.0, 0.7)
    push = -(2.0 * normal + 0.7 * (end - start) / np.hypot(*(end - start)))
    load = load_of(0, blocks, [row])
    force, moment, _ = resultants(load.segments, load.tractions, np.zeros(2))
    assert force == pytest.approx(push, abs=1e-12)
    assert moment == pytest.approx(point[0] * push[1] - point[1] * push[0], abs=1e-12)
    at_end = contact(vertex_at(blocks, 1, [0.995, 1.0]), side, 1, 0, end, normal, 2.0, 0.7)
    missing = first_moments(load.segments, load.tractions, np.zeros(2))
    missing -= first_moments(
        *(getattr(load_of(0, blocks, [at_end]), name) for name in ("segments", "tractions")), np.zeros(2)
    )
    assert missing + missing.T == pytest.approx(np.zeros((2, 2)), abs=1e-12)


def test_bonds_that_pull_have_linear_pressure_and_no_jump():
    """The resultant of two bonded contacts leaves the face: tractions change as little as it does. A face without
    tensile strength is a triangle, and at last a lone force, before; a bond goes on as the linear pressure it has
    beyond."""
    lower = SQUARE
    blocks = Blocks.from_polygons([lower, SQUARE + [0.0, 1.0]])
    bottom = edge_between(blocks, 1, [0.0, 1.0], [1.0, 1.0])

    def load(push, **options):
        rows = []
        for x, force in ((0.0, 1.0), (1.0, push)):
            vertex = vertex_at(blocks, 0, [x, 1.0])
            rows.append(contact(vertex, bottom, 0, 1, [x, 1.0], [0, -1], force, 0.3))
            rows[-1]["bonded"] = 1
        return load_of(0, blocks, rows, **options)

    inside, outside = (load(push, tensile_strength=[1.0]) for push in (1e-9, -1e-9))
    assert np.allclose(moments_of(inside), moments_of(outside), rtol=0, atol=1e-8)
    assert not np.allclose(moments_of(load(1e-9)), moments_of(load(-1e-9)), rtol=0, atol=1e-3)
    # Force and moment are the contacts' whatever the law.
    for found in (inside, load(1e-9)):
        moments = moments_of(found)
        assert np.allclose(moments[:, 0], [0.6, -1.0], rtol=0, atol=1e-8)
        assert moments[1, 1] - moments[0, 2] == pytest.approx(-0.6, abs=1e-8)


@pytest.mark.parametrize("holds", [False, True])
def test_shears_off_the_side_and_against_each_other_leave_a_strained_block_in_balance(holds):
    """A square that is sheared, pulled and turned bears forces at contacts that are pressed in or gape, its shears
    against each other: in equilibrium where they act, and so nothing is out of balance (1e-3 with the forces on the
    side: the gaps; 2e-4 without what the shears stretch: the strain)."""
    blocks, gap = two_squares(), 1e-3
    gradient = np.array([[1.0003, 2e-4], [1e-4, 0.9995]])
    vertices = blocks.vertices.copy()
    vertices[4:] = (vertices[4:] - [0, 1]) @ gradient.T + [0, 1]
    corner, end, top = vertices[4], vertices[5], vertices[6:]
    along = (end - corner) / np.hypot(*(end - corner))
    normal = np.array([-along[1], along[0]])
    at = [corner - gap * normal, end + 0.5 * gap * normal]
    force = [2.0 * normal + 1.7 * along, 1.5 * normal - 1.6 * along]
    # Two forces on the upper corners, and one in the middle, hold it.
    centre = vertices[4:].mean(axis=0)
    moment = sum(float(np.cross([*(p - centre), 0], [*f, 0])[2]) for p, f in zip(at, force))
    arm = top[0] - top[1]
    couple = -moment / (arm @ arm) * np.array([-arm[1], arm[0]])
    points = np.zeros(3, POINT_FORCE)
    points["block"] = 1
    for row, point, f in zip(
        points, (blocks.vertices[6], blocks.vertices[7], [0.5, 1.5]), (couple, -couple, -sum(force))
    ):
        row["at"], row["force"] = point, f
    vertex = [vertex_at(blocks, 0, p) for p in ([0.0, 1.0], [1.0, 1.0])]
    bottom = edge_between(blocks, 1, [0.0, 1.0], [1.0, 1.0])
    rows = [contact(v, bottom, 0, 1, p, -normal, f @ normal, -f @ along) for v, p, f in zip(vertex, at, force)]
    for row in rows:
        row["bonded"] = holds
    forces = BoundaryForces(
        vertices, Motion.of(blocks, vertices), np.array(rows, CONTACT), NOTHING[0], points,
        tensile_strength=[float(holds)],
    )  # fmt: skip
    load = boundary_load(1, blocks, forces)
    # What is left is the gaps' change by strain.
    assert load.imbalance < 1e-6
