"""Sums by joint and reactions, against the forces of a block that is pushed on its support."""

from __future__ import annotations

import numpy as np
import pytest
from block_problems import rectangle

from geomech import dda
from geomech.model import Blocks, DdaSettings, History, JointLaw, Loads, Material, PointLoad, State
from geomech.model.joints.joint_sums import joint_names, joint_sums, reactions

GRAVITY = 9.81


@pytest.fixture
def pushed():
    """A 2 m wide block on a named floor, one on top of it of no name, pushed at 2 kN/m: (blocks, laws, contacts,
    weight)."""
    blocks = Blocks.from_polygons(
        [rectangle(-5, -1, 5, 0), rectangle(0, 0, 2, 1), rectangle(0, 1, 2, 2)], fixed=[True, False, False],
        edge_names=[[["", "", "floor", ""]], [[""] * 4], [[""] * 4]],
    )  # fmt: skip
    laws = [JointLaw("between", 0.6), JointLaw("below", 0.4, cohesion=1e4)]
    system = dda.BlockSystem(
        blocks, [Material("rock", 10e9, 0.0, density=2000.0)], laws,
        joint_index=lambda a, b: 1 if "floor" in (a, b) else 0, settings=DdaSettings(max_displacement_ratio=0.1),
    )  # fmt: skip
    loads = Loads(
        gravity=History.constant([0.0, -GRAVITY]), point_loads=(PointLoad(1, (1.0, 0.5), History.constant([2e3, 0.0])),)
    )
    result = system.step(State.at_rest(blocks), loads, 1.0)
    return blocks, laws, result.contacts, 2000 * GRAVITY * 4


def test_a_joint_goes_by_its_edges_name_or_its_law(pushed):
    blocks, laws, contacts, _ = pushed
    names = joint_names(blocks, contacts, laws)
    assert set(names) == {"floor", "between"}
    assert ((names == "floor") == ((contacts["block"] == 0) | (contacts["other"] == 0))).all()


def test_sums_are_what_the_joint_carries(pushed):
    blocks, laws, contacts, weight = pushed
    sums = joint_sums(blocks, contacts, laws)
    floor, between = sums["floor"], sums["between"]
    # Statics to the inertia of a static step of 1 s: 1e-10 of the load.
    assert floor["normal_force"] == pytest.approx(weight, rel=1e-6)
    assert between["normal_force"] == pytest.approx(weight / 2, rel=1e-6)
    assert floor["shear_force"] == pytest.approx(2e3, rel=1e-6)
    assert floor["mobilised"] == pytest.approx(2e3 / (weight * np.tan(0.4) + 2 * 1e4), rel=1e-6)
    assert (floor["contacts"], floor["length"], floor["bonded_length"]) == (2, 2.0, 2.0)
    assert floor["open_length"] == floor["sliding_length"] == floor["max_opening"] == floor["max_slip"] == 0.0
    assert floor["max_penetration"] == pytest.approx(-contacts["gap"].min())
    assert between["bonded_length"] == 0.0


def test_openings_and_slips_are_weighed_by_length(pushed):
    blocks, laws, contacts, _ = pushed
    contacts = contacts.copy()
    floor = np.flatnonzero(joint_names(blocks, contacts, laws) == "floor")
    contacts["state"][floor[0]], contacts["gap"][floor[0]] = 0, 0.03
    contacts["slip"][floor[1]] = -0.02
    row = joint_sums(blocks, contacts, laws)["floor"]
    assert row["open_length"] == 1.0
    assert (row["mean_opening"], row["max_opening"]) == pytest.approx((0.015, 0.03))
    assert (row["mean_slip"], row["max_slip"]) == pytest.approx((0.01, 0.02))
    assert joint_sums(blocks, contacts[:0], laws) == {}


def test_supports_carry_all_that_acts(pushed):
    blocks, _, contacts, weight = pushed
    held = reactions(blocks, contacts)
    assert list(held) == [0]
    # Forces through (1, 0.5) and (1, 1) on a floor whose vertices' mean is (0, −0.5).
    assert held[0] == pytest.approx([2e3, -weight, -weight * 1.0 - 2e3 * 1.0], rel=1e-6)
