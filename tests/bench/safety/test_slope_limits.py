"""Limits of rigid blocks: the linear programme of static admissibility and sliding blocks, against closed forms; the
random slopes that are held against them."""

from __future__ import annotations

import math

import numpy as np
import pytest

from geomech.bench.safety.factor_scenes import FAMILIES, OPEN, PLANE, random_slope
from geomech.bench.safety.slope_factors import Factored, Searched, factored, table
from geomech.bench.safety.slope_limits import (
    admissible_factor,
    shared_faces,
    sliding_factor,
)
from geomech.bench.slopes.drawn_slopes import Isometry, moved, problem_of
from geomech.reference.slopes import rock_slopes

GRAVITY, DENSITY = 9.81, 2600.0


def on_incline(dip: float, width: float, height: float, **law) -> dict:
    """A block on a plane that dips ``dip`` degrees to the left."""
    slope = math.radians(dip)

    def at(s: float, n: float) -> list[float]:
        return [s * math.cos(slope) - n * math.sin(slope), s * math.sin(slope) + n * math.cos(slope)]

    return {
        "title": "Block on an incline",
        "geometry": {
            "zones": [
                {"name": "base", "polygon": [at(-9, -9), at(9 + width, -9), at(9 + width, 0), at(-9, 0)]},
                {"name": "block", "polygon": [at(0, 0), at(width, 0), at(width, height), at(0, height)]},
            ],
            "edges": [{"name": PLANE, "line": [at(0, 0), at(width, 0)]}],
        },
        "materials": {"rock": {"youngs_modulus_pa": 2e10, "poissons_ratio": 0.25, "density_kg_m3": DENSITY}},
        "zones": {"base": {"fixed": True}},
        "joints": {"default": law},
        "loads": {"gravity_m_s2": [0.0, -GRAVITY]},
        "dda": {"time_step_s": 0.01, "dynamic_factor": 0.0},
        "run": {"end_time_s": 1.0},
    }


@pytest.mark.parametrize("cohesion", [0.0, 8e3])
def test_a_block_on_a_plane(cohesion):
    dip, width, height = 30.0, 3.0, 1.0
    problem = problem_of(on_incline(dip, width, height, friction_angle_deg=25.0, cohesion_pa=cohesion))
    expected = rock_slopes.plane_failure_factor(
        DENSITY * GRAVITY * width * height, math.radians(dip), width, cohesion, math.radians(25.0)
    )
    assert sliding_factor(problem, (PLANE,)) == pytest.approx(expected, rel=1e-9)
    assert admissible_factor(problem) == pytest.approx(expected, rel=2e-5)


def test_a_column_topples_whatever_its_friction():
    # Held at its foot alone: h/b = 2.2 beyond cot 30° = 1.73.
    problem = problem_of(on_incline(30.0, 1.0, 2.2, friction_angle_deg=60.0))
    assert admissible_factor(problem) == 0.0


def test_a_level_block_never_fails():
    assert admissible_factor(problem_of(on_incline(0.0, 2.0, 1.0, friction_angle_deg=30.0))) == math.inf


def test_two_blocks_as_jaeger_has_them():
    """The least friction that holds the active and the passive block, across an upright joint."""
    slope = next(s for s in map(random_slope, range(1, 100, 5)) if not s.traits or s.traits == ("sharp",))
    problem = problem_of(slope.scene)
    weight = DENSITY * GRAVITY * problem.blocks.areas()
    planes = [zone["line"] for zone in slope.scene["geometry"]["edges"] if zone["name"] == PLANE]
    flat, steep = (math.atan2(b[1] - a[1], b[0] - a[0]) for a, b in planes)
    names = list(problem.blocks.names)
    limit = rock_slopes.two_block_friction(
        (weight[names.index("active")], steep), (weight[names.index("passive")], flat)
    )
    expected = math.tan(problem.joints[0].friction_angle) / math.tan(limit)
    assert slope.limit == pytest.approx(expected, rel=1e-6)
    assert slope.bound == pytest.approx(expected, rel=2e-5)


def test_faces_are_found_where_blocks_lie_on_one_another():
    problem = problem_of(on_incline(20.0, 2.0, 1.0, friction_angle_deg=30.0))
    faces = shared_faces(problem)
    assert faces.name == [PLANE] and faces.length == pytest.approx([2.0])


@pytest.mark.first_by_default(2)
@pytest.mark.parametrize("seed", range(5))
def test_a_seed_is_a_slope_with_a_limit_that_moments_admit(seed):
    slope, again = random_slope(seed), random_slope(seed)
    assert slope.family == FAMILIES[seed] and slope.scene == again.scene
    assert math.isnan(slope.limit) or slope.limit <= slope.bound * 1.001
    for by in (Isometry.mirrored(), Isometry.rotated(0.2)):
        there = problem_of(moved(slope.scene, by))
        assert admissible_factor(there, OPEN) == pytest.approx(slope.bound, rel=1e-4)


def test_bolts_and_named_edges_are_moved_with_their_blocks():
    slope = next(s for s in map(random_slope, range(0, 40, 5)) if "anchor" in s.traits)
    by = Isometry.rotated(0.3)
    there = moved(slope.scene, by)
    for name in ("start", "end"):
        was, now = slope.scene["loads"]["bolts"][0][name], there["loads"]["bolts"][0][name]
        assert now == pytest.approx(np.array(was) @ by.matrix.T)
    assert there["geometry"]["edges"][0]["line"][1] == pytest.approx(
        by.points(slope.scene["geometry"]["edges"][0]["line"][1])
    )


def test_a_slope_without_anything_else_is_right():
    """The second seed: a stepped plane, friction alone."""
    found = factored(random_slope(2), variants=("drawn", "mirrored"))
    assert found.verdict == "right" and abs(found.off) < 1e-3


def test_what_is_off_in_silence_is_wrong():
    def slope(factor: float, verdict: str, warnings: tuple[str, ...] = ()) -> Factored:
        searched = Searched("drawn", verdict, factor, 1.0, warnings)
        return Factored(0, "planar", "free", (), 1.0, 1.0, 1.0, 0.0, verdict, (searched,))

    told = table([slope(1.0, "right"), slope(1.3, "wrong"), slope(0.8, "wrong"), slope(2.0, "reported", ("a toe",))])
    figures = {figure.name: figure.value for figure in told.figures}
    assert figures["share of slopes wrong"] == 0.5 and figures["share of slopes above in silence"] == 0.25
    assert "a toe" in told.text
