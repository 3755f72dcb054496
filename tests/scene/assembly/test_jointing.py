"""Joints in a scene: blocks, cracks, names and laws, mistakes told at their place."""

from __future__ import annotations

import math

import numpy as np
import pytest

from geomech.scene import SceneError, load_scene

SCENE = """
title = "jointed"

[geometry]
seed = 3

[[geometry.zones]]
name = "rock"
rectangle = [0, 0, 20, 10]

[[geometry.zones]]
name = "base"
rectangle = [0, -1, 20, 0]

[[geometry.edges]]
name = "top"
line = [[0, 10], [20, 10]]

[[geometry.joints]]
name = "fault"
points = [[5, 0], [5, 10]]

[[geometry.joint_sets]]
name = "beds"
angle_deg = 10
spacing_m = 2
region = [[0, 0], [20, 0], [20, 10], [0, 10]]

[[geometry.joint_sets]]
name = "cross"
kind = "poisson"
angle_deg = 95
p20_per_m2 = 0.1
length_m = 1.5
ends_on = ["beds"]
region = [[0, 0], [20, 0], [20, 10], [0, 10]]

[materials.rock]
youngs_modulus_pa = 20e9
poissons_ratio = 0.25
density_kg_m3 = 2600
k_ic_pa_sqrt_m = 1e6

[zones.base]
fixed = true

[joints.default]
friction_angle_deg = 30

[joints.rough]
friction_angle_deg = 40
edges = ["joint:cross"]

[loads]
gravity_m_s2 = [0, -9.81]

[run]
end_time_s = 1
"""


def load(tmp_path, text=SCENE, *changes):
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    path = tmp_path / "scene.toml"
    path.write_text(text)
    return load_scene(path)


def test_a_jointed_scene_becomes_blocks_and_cracks(tmp_path):
    problem = load(tmp_path).problem()
    blocks = problem.blocks
    assert blocks.n_blocks > 8 and blocks.areas()[~blocks.fixed].sum() == pytest.approx(200, rel=1e-12)
    assert {"", "top", "joint:fault", "joint:beds"} <= set(blocks.edge_names)
    top = blocks.edges_named("top")
    ends = blocks.vertices[blocks.next_vertex[top]] - blocks.vertices[top]
    assert np.abs(ends[:, 0]).sum() == pytest.approx(20)
    # Dead ends of the rough joints are rough cracks.
    assert problem.cracks.n_cracks > 0 and all(name.startswith("cross ") for name in problem.cracks.names)
    assert {problem.face_laws[k].friction_angle for k in problem.cracks.law} == {math.radians(40)}
    again = load(tmp_path).problem()
    assert np.array_equal(again.blocks.vertices, blocks.vertices) and np.array_equal(
        again.cracks.nodes, problem.cracks.nodes
    )


def test_dead_ends_follow_the_default_joint_unless_an_entry_of_cracks_replaces_it(tmp_path):
    """Faces of ends that no joint names: their law, and without friction when an entry names none."""
    unnamed = ('edges = ["joint:cross"]', 'edges = ["joint:beds"]')
    for entry, names in (
        ("", {"default"}),
        ("[cracks.cross]", {"frictionless"}),
        ("[cracks.default]", {"frictionless"}),
    ):
        problem = load(tmp_path, SCENE + entry, unnamed).problem()
        assert problem.cracks.n_cracks > 0
        assert {problem.face_laws[k].name for k in problem.cracks.law} == names


def test_dead_ends_can_be_trimmed_and_told_about(tmp_path):
    assert load(tmp_path, SCENE, ("seed = 3", 'seed = 3\ndead_ends = "trim"')).problem().cracks.n_cracks == 0
    slot = load(tmp_path, SCENE + '\n[cracks.cross]\naperture = "slot"\n').problem()
    assert np.isinf(slot.cracks.aperture).all()


def test_a_drawn_crack_stands_beside_dead_ends(tmp_path):
    crack = '\n[[geometry.cracks]]\nname = "flaw"\npoints = [[2, 9.0], [2.3, 9.2]]\n[cracks.flaw]\naperture = "slot"\n'
    problem = load(tmp_path, SCENE + crack).problem()
    assert "flaw" in problem.cracks.names and problem.cracks.n_cracks > 1
    flaw = problem.cracks.names.index("flaw")
    assert np.isinf(problem.cracks.aperture[problem.cracks.crack == flaw]).all()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("spacing_m = 2", ""), r'geometry.joint_sets\[0\].*a set of kind "parallel" needs `spacing_m`'),
        (("p20_per_m2 = 0.1", "p21_per_m = 0.1"), "needs `p20_per_m2`"),
        (
            ('ends_on = ["beds"]', 'ends_on = ["bed"]'),
            r"geometry.joint_sets\[1\].*no joints 'bed' are defined before this set.*'fault', 'beds'",
        ),
        (("points = [[5, 0], [5, 10]]", "points = [[5, 0], [5, 0]]"), r"geometry.joints\[0\].*without length"),
        (("angle_deg = 10", "dip_deg = 10"), "both `dip_deg` and `dip_direction_deg`"),
        (("angle_deg = 10", "angle_deg = 10\nfisher = 20"), "`fisher` spreads poles in space: it needs `dip_deg`"),
    ],
)
def test_mistakes_are_told_at_their_place(tmp_path, change, message):
    with pytest.raises(SceneError, match=f"(?s){message}"):
        load(tmp_path, SCENE, change)


def test_small_blocks_spare_the_drawn_fault_and_are_reported(tmp_path):
    whole = load(tmp_path)
    coarse = load(tmp_path, SCENE, ("seed = 3", "seed = 3\nsmallest_block_m2 = 3\nshortest_crack_m = 0.4"))

    def length(scene, name):
        blocks = scene.problem().blocks
        edges = blocks.edges_named(name)
        return np.hypot(*(blocks.vertices[blocks.next_vertex[edges]] - blocks.vertices[edges]).T).sum()

    free = ~coarse.problem().blocks.fixed
    assert coarse.problem().blocks.n_blocks < whole.problem().blocks.n_blocks
    assert coarse.problem().blocks.areas()[free].min() >= 3
    assert length(coarse, "joint:fault") == pytest.approx(length(whole, "joint:fault"), rel=1e-12) == pytest.approx(20)
    said = coarse.drawing.jointed.repair_lines("listed elsewhere")
    number = len([repair for repair in coarse.drawing.jointed.cutting.repairs if repair.kind == "sliver"])
    assert any(text.startswith(f"{number} × sliver, up to ") and " m², at (" in text for text in said)


def test_slivers_are_merged_unless_the_scene_says_otherwise(tmp_path):
    """Three sets cross all over: triangles of any size, some below a thousandth of the median block. 0 keeps them."""
    cross = SCENE[SCENE.index('[[geometry.joint_sets]]\nname = "cross"') : SCENE.index("[materials")]
    sets = "".join(
        f'[[geometry.joint_sets]]\nname = "set {k}"\nangle_deg = {angle}\nspacing_m = 0.5\nzones = ["rock"]\n'
        for k, angle in enumerate((80, 130))
    )
    areas = {}
    for value in ("", "smallest_block_m2 = 0"):
        text = SCENE.replace(cross, sets).replace("seed = 3", f'seed = 3\ndead_ends = "trim"\n{value}')
        scene = load(tmp_path, text.replace("joint:cross", "joint:set 0"))
        blocks = scene.problem().blocks
        areas[value] = blocks.areas()[~blocks.fixed]
    kept, merged = areas["smallest_block_m2 = 0"], areas[""]
    assert kept.min() < 1e-3 * np.median(kept) and merged.min() >= 1e-3 * np.median(merged)
    assert len(merged) < len(kept) and merged.sum() == pytest.approx(kept.sum(), rel=1e-12)


def test_poles_spread_by_fishers_law_turn_the_traces_of_any_set(tmp_path):
    """Beds that dip along the section: their traces spread by 1/√κ."""
    spread = "dip_deg = 10\ndip_direction_deg = 90\nfisher = 400"
    scene = load(tmp_path, SCENE, ("angle_deg = 10", spread), ("spacing_m = 2", "spacing_m = 0.1"))
    (beds,) = (joint for joint in scene.drawing.jointed.joints if joint.name == "joint:beds")
    ends = np.array([line[[0, -1]] for line in beds.lines])
    along = ends[:, 1] - ends[:, 0]
    angle = np.degrees(np.arctan(along[:, 1] / along[:, 0]))
    error = 4 / math.sqrt(len(angle))
    assert angle.mean() == pytest.approx(-10, abs=error * math.degrees(1 / 20))
    assert angle.std() == pytest.approx(math.degrees(1 / 20), rel=error)


@pytest.mark.parametrize(("spacing", "told"), [(1e-3, True), (1e-5, True), (0.2, False)])
def test_sets_that_are_far_too_fine_are_refused_before_they_are_drawn(tmp_path, spacing, told):
    """Spacings in the wrong unit: 10⁴ and 10⁶ lines that cross those of the other set; the finest set is named."""
    path = tmp_path / "scene.toml"
    path.write_text(SCENE)
    fine = [f"geometry.joint_sets[0].spacing_m={spacing}"]
    if not told:
        load_scene(path, fine)
        return
    with pytest.raises(SceneError, match=r"about \de\+\d\d joints") as refused:
        load_scene(path, fine)
    (fault,) = refused.value.errors
    assert "geometry.joint_sets[0]" in fault.place and "in metres?" in fault.way_out
