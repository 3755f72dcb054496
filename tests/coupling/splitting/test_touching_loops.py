"""A splinter that reaches to the surface of its block: the loop around it and the outline touch in a point."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from geomech import ddm
from geomech.coupling.load_transfer.elastic_bodies import elastic_bodies
from geomech.coupling.splitting.block_splitting import divided, split_blocks
from geomech.model import (
    Blocks,
    Cracks,
    DdaSettings,
    DdmSettings,
    GrowthSettings,
    JointLaw,
    Loads,
    Material,
    Problem,
    RunSettings,
    State,
)
from geomech.model.blocks.polygon import joined_loops

#: A square with a notch, and the loop around a splinter that touches it.
NOTCH = np.array([3.2, 2.0])
OUTLINE = np.array([[0.0, 0.0], [4.0, 0.0], [4.0, 1.5], NOTCH, [4.0, 2.5], [4.0, 4.0], [0.0, 4.0]])
LOOP = np.array([NOTCH, [2.6, 1.7], [2.5, 2.4]])
BLOCKS = Blocks.from_polygons([[OUTLINE, LOOP]], names=("rock",))
ROCK = Material("rock", 1e10, 0.25, density=2600.0, k_ic=1e6)


def test_loops_that_touch_are_joined_to_one_with_two_corners_there():
    (joined,) = joined_loops(BLOCKS.loops(0))
    assert len(joined) == len(OUTLINE) + len(LOOP)
    assert (joined == NOTCH).all(axis=1).sum() == 2
    # Either corner is below 180°: a ring turned the other way would cross itself there.
    slit = joined.copy()
    for k in np.flatnonzero((joined == NOTCH).all(axis=1)):
        slit[k] += 1e-6 * (joined[k - 1] + joined[(k + 1) % len(joined)] - 2 * NOTCH)
    polygon = shapely.Polygon(slit)
    assert polygon.is_valid and polygon.area == pytest.approx(BLOCKS.areas()[0], abs=1e-5)
    apart = [OUTLINE, LOOP[::-1] - [0.1, 0.0]]
    assert joined_loops(apart) is apart


def test_stress_intensity_beside_it_is_that_beside_a_slit():
    """The rock has a free surface on both sides of the point: as with a slit of 0.2 mm in 4 m there."""
    crack = Cracks.from_polylines([np.array([[0.8, 3.0], [1.5, 3.2]])], names=("crack",))
    problem = Problem(
        title="touching loops",
        blocks=BLOCKS,
        cracks=crack,
        materials=(ROCK,),
        joints=(JointLaw("joint"),),
        face_laws=(JointLaw("smooth"),),
        loads=Loads(),
        dda=DdaSettings(),
        ddm=DdmSettings(order=3),
        growth=GrowthSettings(),
        run=RunSettings(end_time=1.0),
    )
    (body,) = elastic_bodies(problem, BLOCKS, crack, {}, [])[0].values()
    up, down = NOTCH + [0.0, 1e-4], NOTCH - [0.0, 1e-4]
    slit = np.concatenate([OUTLINE[:3], [down], LOOP[1:], [up], OUTLINE[4:]])
    expected = ddm.Body([slit], crack, ROCK, problem.ddm)
    load = ddm.BodyLoad(remote_stress=np.array([0.0, 1e6, 0.0]))
    found, known = (each.solve(load).tips for each in (body, expected))
    for mode in ("k_i", "k_ii"):
        assert found[mode] == pytest.approx(known[mode], rel=1e-4)


def test_a_crack_from_it_to_the_surface_divides_the_block():
    crack = Cracks.from_polylines([np.array([LOOP[2], [0.0, 3.0]])], names=("crack",), surface=[(True, True)])
    assert divided(BLOCKS, crack).tolist() == [0]
    state = State.at_rest(BLOCKS)
    split = split_blocks(BLOCKS, state, crack)
    assert split.blocks.n_blocks == 2
    assert split.blocks.areas().sum() == pytest.approx(BLOCKS.areas()[0])
    # Every vertex of the block is one of a part, the two at the point one of either part's corners there.
    old = split.vertex_origin[split.vertex_origin >= 0]
    assert set(old.tolist()) == set(range(BLOCKS.n_vertices))
    assert (split.blocks.vertices[split.vertex_origin >= 0] == BLOCKS.vertices[old]).all()
