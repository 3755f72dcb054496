"""A block that is cut while it is glued to its neighbours: the face stays glued, as strong and as loaded as it was. Held
against the strength of the whole face, and against the state before the cut."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from geomech.conventions import normal_of
from geomech.coupling.coupled_state import CrackedBlocks
from geomech.coupling.growth.crack_growth import take_growth
from geomech.coupling.load_pass import balanced
from geomech.ddm.growth.tip_advance import Growth, Join
from geomech.model import (
    Blocks,
    Cracks,
    DdaSettings,
    EdgeTraction,
    History,
    JointLaw,
    Loads,
    Material,
    PointLoad,
    Problem,
    RunSettings,
    WaterTable,
)

TENSION, COHESION = 2e6, 3e6
#: The glue by the solver's springs, and by its own stiffness.
PLAIN = JointLaw("glue", 0.0, COHESION, TENSION)
STIFF = replace(PLAIN, normal_stiffness=2e11, shear_stiffness=1e10)
#: How deep the block is that is cut (the parts of a deep one would bend under shear), and where the crack stops before
#: it runs through.
DEPTH, SHORT = 0.1, 1e-3


def column(law: JointLaw, at: float, loads: Loads) -> Problem:
    """A block of 1 m × 1 m, glued with ``law`` onto one that has a crack at x = ``at`` all but through it, on a base to
    which that is glued for good."""

    def rectangle(x0, y0, x1, y1):
        return np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]], dtype=float)

    polygons = [rectangle(-1, -1, 1, -DEPTH), rectangle(-0.5, -DEPTH, 0.5, 0), rectangle(-0.5, 0, 0.5, 1)]
    names = [["", "", "base", ""], ["base", "", "", ""], ["", "", "top", ""]]
    return Problem(
        title="column",
        blocks=Blocks.from_polygons(polygons, fixed=[True, False, False], edge_names=[[n] for n in names]),
        cracks=Cracks.from_polylines([np.array([[at, -DEPTH], [at, -SHORT]])], surface=[(True, False)], block=1),
        # Poisson's ratio would make the base hold the block's width.
        materials=(Material("rock", 17e9, 0.0, 2200.0, k_ic=1e6),),
        joints=(law, replace(law, name="for good", cohesion=1e12, tensile_strength=1e12), JointLaw("crack", 0.5)),
        joint_of={("base", "base"): 1, ("crack:crack 0",) * 2: 2},
        face_laws=(JointLaw("crack", 0.5),),
        loads=loads,
        dda=DdaSettings(time_step=1.0, dynamic_factor=0.0, max_displacement_ratio=0.1),
        run=RunSettings(end_time=1e9, stop_at=()),
    )


def pulled(pull: float, shear: float = 0.0, moment: float = 0.0) -> Loads:
    """``pull`` (N) across the upper block's face, ``shear`` along it in its line, ``moment`` about its middle."""
    corners = [(x, y) for y in (0.0, 1.0) for x in (-0.5, 0.5)]
    # The moment by a couple across, which stretches nothing along the face.
    forces = [(0.5 * shear, 0.0)] * 2 + [(0.0, -moment), (0.0, moment)]
    return Loads(
        edge_tractions=(EdgeTraction("top", History.constant((0.0, pull))),),
        point_loads=tuple(PointLoad(2, at, History.constant(f)) for at, f in zip(corners, forces) if any(f)),
    )


def before_and_after(law: JointLaw, at: float, loads: Loads, bond: int = 1):
    """The blocks in balance with the crack, the face in the state ``bond``, and when it has run through at the same
    load."""
    out = []
    for through in (False, True):
        now = CrackedBlocks(column(law, at, loads))
        for _ in range(3):
            found = balanced(now, 1.0, None)
            now.take_step(found.result.state, now.budget.after(found.result.energy))
            rows = now.state.contacts
            rows["bonded"][np.isin(rows["block"], (1, 2)) & np.isin(rows["other"], (1, 2))] = bond
            rows["wear"] = 1e-3
        if through:
            old, last = now.cracks, len(now.cracks.nodes) - 1
            cracks = replace(
                old,
                nodes=np.vstack([old.nodes, (at, 0.0)]),
                segments=np.vstack([old.segments, [last, last + 1]]),
                surface=np.append(old.surface, True),
                **{name: np.append(getattr(old, name), getattr(old, name)[-1]) for name in ("crack", "block", "law")},
                birth_cycle=np.append(old.birth_cycle, 1),
                aperture=np.append(old.aperture, 0.0),
            )
            join = Join("daylighting", last, 0, -1, (at, 0.0))
            events = take_growth(now, Growth(cracks, np.array([SHORT]), (join,)), now.state, now.solutions)
            assert [event.kind for event in events] == ["daylighting", "split"]
        out.append(now)
    return out


def in_the_face(now, rows=None):
    """The contacts of the uppermost block."""
    rows = now.state.contacts if rows is None else rows
    top = int(np.argmax([now.blocks.area_moments(b)[1][1] for b in range(now.blocks.n_blocks)]))
    return rows[((rows["block"] == top) | (rows["other"] == top)) & (rows["length"] > 0)], top


def on_top(now, rows=None) -> np.ndarray:
    """Force (2) N on the uppermost block and its moment about the middle of the face."""
    rows, top = in_the_face(now, rows)
    force = rows["normal_force"][:, None] * rows["normal"] + rows["shear_force"][:, None] * normal_of(rows["normal"])
    force = np.where(rows["block"] == top, 1.0, -1.0)[:, None] * force
    moment = rows["point"][:, 0] * force[:, 1] - rows["point"][:, 1] * force[:, 0]
    return np.array([*force.sum(axis=0), moment.sum()])


def holds(now, loads: Loads) -> bool:
    """Whether the whole face of the upper block is glued after a step from the blocks as they are."""
    children = [replace(load, block=now.blocks.n_blocks - 1) for load in loads.point_loads]
    loads = replace(loads, point_loads=tuple(children))
    result = now.system.step(now.state, loads, 1.0)
    # A block that flies off moves too far for the step, and inertia bears a part of the load in a shorter one.
    return result.statistics["step_cuts"] == 0 and bool((in_the_face(now, result.contacts)[0]["bonded"] == 1).all())


@pytest.mark.parametrize(("law", "at"), [(PLAIN, 0.0), (STIFF, 0.0), (STIFF, 0.2)], ids=["plain", "stiff", "beside"])
def test_a_face_is_as_strong_after_its_block_is_cut(law, at):
    """σ_t ℓ in tension and c ℓ in shear: the length is what it was."""
    for now in before_and_after(law, at, pulled(-0.1e6)):
        for part, whole in ((0.98, True), (1.02, False)):
            assert holds(now, pulled(part * TENSION)) == whole
            assert holds(now, pulled(-1e6, part * COHESION)) == whole


def test_what_had_come_unglued_stays_so():
    """A face that has lost its bond gets none back at its new corners; what is cracked from its edge stays that, and
    what is worn stays worn."""
    for bond in (0, 3):
        whole, parts = before_and_after(PLAIN, 0.0, pulled(-0.1e6), bond)
        assert set(in_the_face(parts)[0]["bonded"]) == {bond} == set(in_the_face(whole)[0]["bonded"])
        assert set(in_the_face(parts)[0]["wear"]) == {1e-3}


@pytest.mark.parametrize("loads", [(0.6e6,), (0.6e6, 0.2e6, 0.04e6)], ids=["pulled", "pulled, sheared and bent"])
@pytest.mark.parametrize(("law", "at"), [(PLAIN, 0.0), (STIFF, 0.0), (STIFF, 0.2)], ids=["plain", "stiff", "beside"])
def test_nothing_moves_when_a_glued_block_is_cut(law, at, loads):
    """Pulled, sheared and bent, all below the strength: the parts are as glued and as loaded as the whole, and the
    balance of energy closes."""
    whole, parts = before_and_after(law, at, pulled(*loads))
    rows = in_the_face(parts)[0]
    assert len(rows) == 4 and (rows["bonded"] == 1).all()
    assert on_top(parts) == pytest.approx(on_top(whole), abs=300)
    result = parts.system.step(parts.state, parts.problem.loads, 1.0)
    went = np.abs(result.state.vertices - parts.state.vertices).max()
    stretched = np.abs(whole.state.vertices - whole.blocks.vertices).max()
    print(f"parts move by {went / stretched:.1e} of what the load has moved them")
    budget = parts.budget.after(result.energy)
    print(f"energy of the cut {budget.split / budget.turnover:.1e}, residual {budget.residual / budget.turnover:.1e}")
    assert abs(budget.residual - parts.budget.residual) < 1e-9 * budget.turnover
    if loads == (0.6e6,):
        assert went < 1e-12 * stretched
    # What is bent and sheared gives way by a little more in two parts.
    assert went < 0.03 * stretched


def test_contacts_in_water_begin_with_what_they_bear_beside_it():
    """Below a water table joints press, or here pull, by what the water leaves; the pressure of 30 m is as much again."""
    under = replace(pulled(0.3e6), water=WaterTable(np.array([[0.0, 30.0]])))
    whole, parts = before_and_after(PLAIN, 0.0, under)
    assert on_top(parts) == pytest.approx(on_top(whole), abs=300)
    result = parts.system.step(parts.state, parts.problem.loads, 1.0)
    assert on_top(parts, result.contacts) == pytest.approx(on_top(whole), abs=300)
