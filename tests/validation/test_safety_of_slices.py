"""Factors of safety of columns on a stepped base and of slices on a curved surface, and what toes hold in runs."""

from __future__ import annotations

import itertools
import logging
import math

import numpy as np
import pytest
from block_problems import GRAVITY, WEIGHT, turned

from geomech import dda
from geomech.model import Blocks, DdaSettings, History, JointLaw, Loads, Material

ROCK = Material("rock", 20e9, 0.25, density=2600.0)
HEIGHTS, WIDTH, STEP, DIP = (2.5, 4.0, 5.5, 6.5, 7.0, 6.0, 4.5), 2.0, 0.3, math.radians(30)


def push_at_the_toe(slope: float) -> float:
    """N/m that columns which all topple push the lowest one beyond what it bears, ``slope`` tan φ of all faces: from
    the top column down, moments about the lower front corner,

        P' = (P (M − tan φ Δx) + W (y sin α − Δx cos α)/2)/L ≥ 0.
    """
    push = 0.0
    for k in reversed(range(len(HEIGHTS))):
        high, weight = HEIGHTS[k], 2600.0 * GRAVITY * HEIGHTS[k] * WIDTH
        behind = min(high, STEP + HEIGHTS[k + 1]) if k + 1 < len(HEIGHTS) else high
        before = min(high, HEIGHTS[k - 1] - STEP) if k else high
        own = 0.5 * weight * (high * math.sin(DIP) - WIDTH * math.cos(DIP))
        push = max(0.0, (push * (behind - slope * WIDTH) + own) / before)
    return push


def test_columns_on_a_stepped_base_topple_at_the_friction_of_limit_equilibrium(verified):
    """The base has a riser behind each column; linear programming, whose forces may press on them, bounds the factor
    far above, and is told."""
    n, friction = len(HEIGHTS), math.radians(42)
    columns = [
        [
            (k * WIDTH, k * STEP), ((k + 1) * WIDTH, k * STEP), ((k + 1) * WIDTH, k * STEP + high),
            (k * WIDTH, k * STEP + high),
        ]
        for k, high in enumerate(HEIGHTS)
    ]  # fmt: skip
    treads = [at for column in columns for at in column[:2]]
    base = [(-8, -8), (n * WIDTH + 8, -8), (n * WIDTH + 8, (n - 1) * STEP), *treads[::-1], (-8, 0)]
    outlines = [turned(np.asarray(points, float), DIP) for points in (base, *columns)]
    blocks = Blocks.from_polygons(outlines, fixed=[True] + n * [False])
    found = dda.factor_of_safety(
        blocks, [ROCK], [JointLaw("joint", friction)], WEIGHT, search=dda.FactorSearch(tolerance=5e-4)
    )
    low, high = 0.5, 2.0
    while high - low > 1e-9:
        middle = 0.5 * (low + high)
        low, high = (low, middle) if push_at_the_toe(math.tan(friction) / middle) > 0 else (middle, high)
    print(f"{found.factor:.5f}, limit equilibrium {low:.5f}; {found.warnings}")
    verified("seven columns that topple on a stepped base", found.other_factor / low - 1, "limit equilibrium")
    assert found.factor == pytest.approx(low, rel=2e-3) and found.other_factor == pytest.approx(low, rel=1e-3)
    assert found.admissible > 1.2 and "upper bound" in found.warnings[-1]


@pytest.mark.slow
def test_slices_whose_faces_bear_shear_by_cohesion_alone_have_a_factor(verified):
    """Six slices on an arc, c = 20 kPa, φ = 20°. Faces between slices want to open, and nothing presses them: whole,
    they would have to hold shear by cohesion with no force across. The answer is that of what touches, that of rigid
    blocks is told, and both lie below the largest factor with admissible forces."""
    angles = np.radians(np.linspace(-80, -20, 7))
    arc = np.stack([25.0 * np.cos(angles), 25.0 + 25.0 * np.sin(angles)], axis=1)
    (left, foot), crest = arc[0], arc[-1, 1]
    corner = left + (crest - foot) / 1.2

    def face(x: float) -> float:
        return min(foot + 1.2 * (x - left), crest)

    slices = []
    for one, two in itertools.pairwise(arc):
        points = [one, two]
        if face(two[0]) > two[1] + 1e-9:
            points.append((two[0], face(two[0])))
        if one[0] < corner < two[0]:
            points.append((corner, crest))
        if face(one[0]) > one[1] + 1e-9:
            points.append((one[0], face(one[0])))
        slices.append(np.asarray(points, float))
    low = foot - 15.0
    base = [(left - 30, low), (arc[-1, 0] + 40, low), (arc[-1, 0] + 40, crest), *arc[::-1], (left - 30, foot)]
    blocks = Blocks.from_polygons([np.asarray(base, float), *slices], fixed=[True] + len(slices) * [False])
    found = dda.factor_of_safety(blocks, [ROCK], [JointLaw("joint", math.radians(20), 20e3)], WEIGHT)
    print(f"{found.factor:.4f}, rigid {found.factor_if_rigid}, admissible {found.admissible}; {found.warnings}")
    verified(
        "six slices on an arc with cohesion, rigid", found.factor_if_rigid / found.admissible - 1, "linear programme"
    )
    assert 0.75 < found.factor < found.factor_if_rigid < found.admissible
    assert any("rigid blocks have the factor" in line for line in found.warnings)


def on_a_plane(drop: float) -> tuple[Blocks, Loads]:
    """A block on a plane of 35° that daylights ``drop`` above a floor."""
    crest, floor = 20.0 / math.tan(math.radians(35)), [(0.0, -drop)] if drop else []
    base = [(-20, -drop), (-20, -10), (60, -10), (60, 20), (crest, 20), (0, 0), *floor]
    outlines = [np.asarray(points, float) for points in (base, [(0, 0), (crest, 20), (8, 20)])]
    return Blocks.from_polygons(outlines, fixed=[True, False]), Loads(gravity=History.constant([0.0, -GRAVITY]))


@pytest.mark.parametrize(("drop", "friction", "said"), [(0.0, 30, True), (0.0, 45, False), (0.5, 45, False)])
def test_equilibrium_of_a_run_names_the_toe_that_holds(caplog, drop, friction, said):
    blocks, loads = on_a_plane(drop)
    settings = DdaSettings(dynamic_factor=0.0, time_step=0.01, equilibrium="start")
    with caplog.at_level(logging.WARNING, "geomech"):
        next(iter(dda.run(blocks, [ROCK], [JointLaw("plane", math.radians(friction))], loads, settings, 0.01)))
    warnings = [record.getMessage() for record in caplog.records if "the toe of" in record.getMessage()]
    assert len(warnings) == said, warnings
    if said:
        assert "block 1" in warnings[0] and "x = 0, y = 0 m" in warnings[0] and "blocks are unstable" in warnings[0]


def test_equilibrium_of_a_run_does_not_take_a_floor_that_a_block_slides_to():
    blocks, loads = on_a_plane(0.5)
    settings = DdaSettings(dynamic_factor=0.0, time_step=0.01, equilibrium="start")
    with pytest.raises(dda.NotConverged, match=r"come to rest 0\.87. m farther; 'block 1' moves"):
        next(iter(dda.run(blocks, [ROCK], [JointLaw("plane", math.radians(30))], loads, settings, 0.01)))
