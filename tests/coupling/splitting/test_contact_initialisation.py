"""Blocks that part along a crack: their contacts begin with what its faces bore. Held against statics of the parts (the
stress of the whole block is known in closed form), integrals of the face tractions, and the motion before the cut."""

from dataclasses import replace

import numpy as np
import pytest

from geomech import dda
from geomech.conventions import normal_of
from geomech.coupling.coupled_state import CrackedBlocks
from geomech.coupling.growth.crack_growth import take_growth
from geomech.coupling.load_pass import balanced
from geomech.coupling.splitting import contact_initialisation
from geomech.dda.contact_detection.initial_overlap import REFUSED
from geomech.ddm.growth.tip_advance import Growth, Join
from geomech.model import (
    OPEN,
    SLIP,
    STICK,
    Blocks,
    Cracks,
    DdaSettings,
    EdgeTraction,
    History,
    JointLaw,
    Loads,
    Material,
    Problem,
    RunSettings,
)

ROCK = Material("rock", 17e9, 0.21, 2200.0, k_ic=1e6)
SLOPE = 0.2
ALONG = np.array([1.0, SLOPE]) / np.hypot(1.0, SLOPE)
ACROSS = normal_of(ALONG)
#: A ligament so short that what it bears is a thousandth of the whole.
REACH = 0.499


def rectangle(x0, y0, x1, y1):
    return np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]])


def plate(stress, friction, line=None, platen=False, aperture=0.0, **settings):
    """A plate of 1 × 2 m under ``stress`` (xx, yy) Pa with a crack from its left side that ends just before its right
    side, with or without a floor that it slides on and a platen that comes down on it, both without friction."""
    polygons, names, fixed = [rectangle(-0.5, -1.0, 0.5, 1.0)], [["bottom", "right", "top", "left"]], [False]
    if platen:
        polygons += [rectangle(-0.6, -1.3, 0.6, -1.0), rectangle(-0.6, 1.0, 0.6, 1.3)]
        names = [["floor", "right", "roof", "left"], ["", "", "floor", ""], ["roof", "", "top", ""]]
        fixed = [False, True, False]
    held = np.zeros((len(polygons), 6), bool)
    loads = {"top": (0.0, stress[1]), "left": (-stress[0], 0.0), "right": (stress[0], 0.0)}
    if platen:
        held[2, [0, 2, 5]] = True
        loads["top"] = (0.0, stress[1] / 1.2)
    else:
        loads["bottom"] = (0.0, -stress[1])
    law = JointLaw("crack", friction_angle=np.arctan(friction))
    return Problem(
        title="plate",
        blocks=Blocks.from_polygons(polygons, fixed=fixed, constrained=held, edge_names=[[n] for n in names]),
        cracks=Cracks.from_polylines(
            [np.array([[-0.5, -0.5 * SLOPE], [0.0, 0.0], [REACH, REACH * SLOPE]] if line is None else line)],
            surface=[(True, False)],
            aperture=aperture,
        ),
        materials=(ROCK,),
        joints=(law, JointLaw("smooth")),
        joint_of={("floor", "floor"): 1, ("roof", "roof"): 1},
        face_laws=(law,),
        loads=Loads(
            edge_tractions=tuple(
                EdgeTraction(name, History.constant(each)) for name, each in loads.items() if any(each)
            )
        ),
        dda=DdaSettings(**{"time_step": 1.0, "dynamic_factor": 0.0, "max_displacement_ratio": 0.1, **settings}),
        run=RunSettings(end_time=1e9, stop_at=()),
    )


def stepped(problem, steps=2):
    """The blocks after some steps, each in balance with the crack."""
    now = CrackedBlocks(problem)
    for _ in range(steps):
        found = balanced(now, problem.dda.time_step, None)
        now.take_step(found.result.state, now.budget.after(found.result.energy))
    return now


def cut(now, end=(0.5, 0.5 * SLOPE)):
    """Let the crack run straight through the other side, to ``end``."""
    old, last = now.cracks, len(now.cracks.nodes)
    cracks = Cracks(
        nodes=np.vstack([old.nodes, end]),
        segments=np.vstack([old.segments, [last - 1, last]]),
        crack=np.append(old.crack, 0),
        block=np.append(old.block, 0),
        birth_cycle=np.append(old.birth_cycle, 1),
        aperture=np.append(old.aperture, 0.0),
        surface=np.append(old.surface, True),
        names=old.names,
        law=np.append(old.law, 0),
    )
    join = Join("daylighting", last - 1, 0, -1, end)
    events = take_growth(now, Growth(cracks, np.array([1 - REACH]), (join,)), now.state, now.solutions)
    assert [event.kind for event in events] == ["daylighting", "split"]


def on_upper(now, rows=None):
    """Force (along the crack, across it, N) and its moment about the origin of what the lower part does to the upper
    one."""
    rows = now.state.contacts if rows is None else rows
    upper = int(np.argmax([now.blocks.area_moments(b)[1][1] for b in (0, 1)]))
    rows = rows[(rows["state"] != OPEN) & np.isin(rows["block"], (0, 1)) & np.isin(rows["other"], (0, 1))]
    sign = np.where(rows["block"] == upper, 1.0, -1.0)
    force = rows["normal_force"][:, None] * rows["normal"] + rows["shear_force"][:, None] * normal_of(rows["normal"])
    force = sign[:, None] * force
    moment = np.sum(rows["point"][:, 0] * force[:, 1] - rows["point"][:, 1] * force[:, 0])
    return np.array([force.sum(axis=0) @ ALONG, force.sum(axis=0) @ ACROSS, moment])


def after_a_step(now, dynamic=False):
    """The contacts and the state after one more static step, or a dynamic one from rest, at the same load."""
    system, state = now.system, now.state
    if dynamic:
        settings = replace(system.settings, dynamic_factor=1.0, time_step=1e-5)
        system = dda.BlockSystem(now.blocks, system.materials, system.joints, now.problem.joint_index, settings)
        state = replace(state, velocity=np.zeros_like(state.velocity))
    return system.step(state, now.problem.loads, system.settings.time_step)


@pytest.mark.parametrize("contact", ["penalty", "augmented"])
def test_faces_that_stick_hand_on_what_they_bear(contact):
    """Under −1 MPa along y the plate is as if it had no crack, and 1 MN goes straight through the cut."""
    now = stepped(plate((0.0, -1e6), 0.6, contact=contact))
    cut(now)
    # 1e-7 is the crack solver's; the moment has the displacements of 6e-5 m as arms.
    straight = np.array([ALONG[1], ACROSS[1]]) * 1e6
    assert on_upper(now)[:2] == pytest.approx(straight, rel=1e-6)
    assert abs(on_upper(now)[2]) < 1e-4 * 1e6
    assert set(now.state.contacts["state"]) == {STICK}


def test_nothing_moves_when_the_last_of_a_stuck_crack_parts():
    """The parts are in equilibrium as they are cut: 1e-5 of the elastic shortening, of the stress that quadrature finds
    in them, is left; from rest no force jumps."""
    now = stepped(plate((0.0, -1e6), 0.6))
    shortening = 2.0 * 1e6 / ROCK.plane_modulus
    cut(now)
    for dynamic in (False, True):
        result = after_a_step(now, dynamic)
        assert np.abs(result.state.vertices - now.state.vertices).max() < 2e-5 * shortening
        assert on_upper(now, result.contacts)[:2] == pytest.approx(on_upper(now)[:2], rel=3e-5)
    # Without what the faces bore the parts take up speed at once.
    speed = np.abs(result.state.velocity[:, :2]).max()
    now.state = replace(now.state, contacts=now.state.contacts[:0])
    assert speed < 1e-3 * np.abs(after_a_step(now, True).state.velocity[:, :2]).max()


def test_faces_that_slide_go_on_sliding():
    """Faces held by a ligament alone: what contacts bear is the integral of the faces' tractions (polynomials through
    their nodes, integrated here), friction at its limit."""
    now = stepped(plate((0.0, -1e6), 0.1))
    solution = now.solutions[0]
    elements, traction = solution.body.faces, solution.faces.traction[:, 1:-1]
    total = np.zeros(2)
    for k in range(elements.n):
        length = np.hypot(*(elements.end[k] - elements.start[k]))
        at = np.hypot(*(elements.nodes[k] - elements.start[k]).T) / length
        for c in range(2):
            fit = np.polynomial.Polynomial.fit(at, traction[k, :, c], len(at) - 1).integ()
            total[c] -= length * (fit(1.0) - fit(0.0))
    cut(now)
    rows = now.state.contacts
    assert (rows["state"] == SLIP).all()
    # The faces' axes have turned by strains of 6e-5 since, and shear is a tenth of pressure.
    assert np.abs(rows["shear_force"]) == pytest.approx(0.1 * rows["normal_force"], rel=1e-3)
    assert (np.abs(rows["shear_force"]) <= 0.1 * rows["normal_force"] * (1 + 1e-12)).all()
    # The ligament presses besides, a thousandth of the length next to a tip: with it the parts are in equilibrium
    # across the crack.
    along, across, _ = on_upper(now)
    assert across == pytest.approx(ACROSS[1] * 1e6, rel=2e-4)
    ligament = across - total[0]
    assert 0 < ligament < 0.03 * across
    assert along == pytest.approx(total[1] + 0.1 * ligament, rel=1e-3)
    # It has slid by what the crack solver says, with the sense that friction opposes.
    middle = rows[np.argmin(np.abs(rows["point"][:, 0]))]
    assert abs(middle["slip"]) == pytest.approx(np.abs(solution.faces.slip).max(), rel=0.5)
    assert middle["slip"] * middle["shear_force"] < 0


def test_a_slot_closes_by_its_width_before_it_bears():
    """Open faces leave a gap that the geometry has not: aperture less closure. The parts come nearer by as much, and
    not more than the springs give."""
    width = 1e-3
    line = [[-0.5, -0.5 * SLOPE], [0.0, 0.0], [0.4, 0.4 * SLOPE]]
    now = stepped(plate((0.0, -0.01e6), 0.6, line=line, aperture=width))
    closing = now.solutions[0].faces.opening
    cut(now)
    rows = now.state.contacts
    mouth = rows[np.argmin(rows["point"][:, 0])]
    assert mouth["state"] == OPEN and mouth["normal_force"] == 0
    assert mouth["gap"] == pytest.approx(width + closing.min(), rel=1e-6)
    assert mouth["lift"] == pytest.approx(-mouth["gap"], rel=1e-3)
    state = now.state
    for _ in range(4):
        result = now.system.step(state, now.problem.loads, 1.0)
        state = result.state
    shut = result.contacts[np.argmin(result.contacts["point"][:, 0])]
    assert shut["state"] != OPEN and abs(shut["gap"]) < 1e-3 * width
    assert shut["lift"] == pytest.approx(mouth["lift"], rel=1e-12)


def test_faces_that_a_thread_held_apart_meet_before_they_lie_in_each_other(monkeypatch):
    """What a crack has opened by is told, but no more than a part of the blocks' size below what is refused in a
    drawing: the parts stand face on face, and close by as much. The width of a slot is told, besides."""

    def widest(width):
        now = stepped(plate((0.0, 1e6), 0.6, aperture=width))
        # Held by a thousandth of its length it opens by several times the plate's σ H / E'.
        assert now.solutions[0].faces.opening.max() > 1e-4
        cut(now)
        rows = now.state.contacts
        return rows["gap"][rows["state"] == OPEN].max(), float(np.sqrt(now.blocks.areas().min()))

    monkeypatch.setattr(contact_initialisation, "_OPENED", 1e-5)
    gap, size = widest(0.0)
    assert gap == pytest.approx(1e-5 * size, rel=1e-6)
    gap, size = widest(1e-3)
    assert gap == pytest.approx(1e-3 + 1e-5 * size, rel=1e-6)
    monkeypatch.undo()
    assert contact_initialisation._OPENED < REFUSED
    gap, size = widest(0.0)
    assert gap <= contact_initialisation._OPENED * size * (1 + 1e-9)


def test_platens_press_on_parts_as_on_the_whole():
    """A crack along the load divides the faces under the platens: each part bears its share of the width at once."""
    now = stepped(plate((0.0, -1e6), 0.6, line=[[0.1, -1.0], [0.1, 0.0], [0.1, 0.999]], platen=True))
    cut(now, end=(0.1, 1.0))
    left = int(np.argmin([now.blocks.area_moments(b)[1][0] for b in (0, 1)]))
    result = after_a_step(now)
    for rows, rel in ((now.state.contacts, 1e-6), (result.contacts, 1e-4)):
        for block, width in ((left, 0.6), (1 - left, 0.4)):
            own = rows[
                ((rows["block"] == block) | (rows["other"] == block)) & ((rows["block"] > 1) | (rows["other"] > 1))
            ]
            force = dda.contact_resultants(own, 4, np.zeros((4, 2)))
            assert np.abs(force[2:, 1]) == pytest.approx([width * 1e6] * 2, rel=rel)
    assert np.abs(result.state.vertices - now.state.vertices).max() < 1e-3 * 2.0 * 1e6 / ROCK.plane_modulus


def test_a_single_corner_presses_on_as_it_did():
    """A lid, inclined by 1°, presses on a corner of a plate that a crack cuts through from top to bottom. The crack solver
    loads a corner along both of its edges: on the divided top no pressure is seen, and the corner had lost its force."""
    problem = plate((0.0, 0.0), 0.6, line=[[0.1, -1.0], [0.1, 0.0], [0.1, 0.999]], platen=True)
    lid = np.array([[-0.6, 0.998], [0.6, 1.022], [0.6, 1.3], [-0.6, 1.3]])
    before = problem.blocks
    names = [[["floor", "right", "roof", "left"]], [["", "", "floor", ""]], [["roof", "", "top", ""]]]
    given = [before.loops(0)[0], before.loops(1)[0], lid]
    blocks = Blocks.from_polygons(given, fixed=before.fixed, constrained=before.constrained, edge_names=names)
    pressed = EdgeTraction("top", History.constant((0.0, -5e3)))
    loads = replace(problem.loads, gravity=History.constant((0.0, -9.81)), edge_tractions=(pressed,))
    now = stepped(replace(problem, blocks=blocks, loads=loads))
    (held,) = now.state.contacts[(now.state.contacts["other"] == 2) & (now.state.contacts["normal_force"] > 0)]
    assert held["normal_force"] > 5e3
    cut(now, end=(0.1, 1.0))
    (after,) = now.state.contacts[(now.state.contacts["other"] == 3) & (now.state.contacts["normal_force"] > 0)]
    assert after["normal_force"] == pytest.approx(held["normal_force"], rel=1e-12)
    assert after_a_step(now).state.contacts["normal_force"].max() < 1e5


def test_neighbours_press_on_where_they_did():
    """Two neighbours whose corners meet on a divided edge, one of them by 1e-5 beyond the other: forces go to the
    contacts of the one that they are under, whatever their order; nothing is lost, nor a moment."""
    at, neighbour = np.array([0.0, 0.5, 0.5 - 1e-5, 1.0]), np.array([7, 7, 8, 8])
    place = np.array([0.1, 0.4, 0.499, 0.501, 0.9])
    share = contact_initialisation._shares(at, neighbour, place)
    assert share.sum(axis=0) == pytest.approx(np.ones(5))
    assert at @ share == pytest.approx(place)
    assert not share[2:, :3].any() and not share[:2, 3:].any()


def test_springs_are_charged_by_the_cut():
    """The energy that the springs of new contacts begin with (½ N²/kₙ, here 0.5 % of the whole) is told as that of the
    cut; nothing is left over."""
    now = stepped(plate((0.0, -1e6), 0.6))
    cut(now)
    budget = now.budget.after(after_a_step(now).energy)
    springs = -0.5 * float(now.state.contacts["normal_force"] @ now.state.contacts["gap"])
    # … and that of the mean stress of the parts, by quadrature.
    assert budget.split == pytest.approx(springs, rel=0.05)
    assert springs < 6e-3 * budget.last.stored
    assert budget.residual == pytest.approx(now.budget.residual, abs=1e-12 * budget.last.stored)


def test_motion_goes_on():
    """Mass, momentum, angular momentum and kinetic energy are those before the cut."""
    now = stepped(plate((0.0, -1e6), 0.6))
    now.state = replace(now.state, velocity=np.array([[0.3, -0.2, 0.05, 1e-2, -2e-2, 3e-2]]))
    before = moving(now)
    cut(now)
    assert moving(now) == pytest.approx(before, rel=1e-12)


def moving(now):
    """Mass, momentum, angular momentum about the origin and kinetic energy of all blocks."""
    total = np.zeros(5)
    for loops, v in zip(
        [now.blocks.loops(b, now.state.vertices) for b in range(now.blocks.n_blocks)], now.state.velocity
    ):
        following = np.append(np.arange(1, len(loops[0])), 0)
        moments = dda.block_moments(np.ascontiguousarray(loops[0]), following, np.array([0, len(loops[0])]))[0]
        momentum = dda.mass_matrix(moments, 1.0 * ROCK.density) @ v
        x, y = moments[1:3]
        spin = x * momentum[1] - y * momentum[0] + momentum[2]
        total += [moments[0], momentum[0], momentum[1], spin, v @ momentum / 2]
    return total


def test_elements_graded_to_a_corner_are_no_part_of_the_segment_that_leaves_it():
    """A ligament that breaks from a kink graded to 1e-7 of its length is whole rock before, and the crack's last
    segment a crack."""
    ends = np.array([[[-1.0, 0.5], [-3e-7, 1e-7]], [[-3e-7, 1e-7], [0.0, 0.0]]])
    nodes = ends[:, :1] + np.array([0.02, 0.5, 0.98])[:, None] * (ends[:, 1:] - ends[:, :1])
    length = np.repeat(np.hypot(*(ends[:, 1] - ends[:, 0]).T) / 3, 3)
    nothing = np.zeros((2, 2))
    faces = contact_initialisation._Faces(
        nodes.reshape(-1, 2), length, np.ones((6, 2)), ends, nothing[:, :1], nothing, nothing
    )
    assert faces.on(np.zeros(2), np.array([1.0, -0.3])) is None
    place, share, _ = faces.on(*ends[0])
    assert share.sum() == pytest.approx(np.hypot(1.0, 0.5))
    assert place[:3] == pytest.approx([0.02, 0.5, 0.98])
