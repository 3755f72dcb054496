"""Faces that do not fit each other, as those of an open crack that has cut a block."""

from dataclasses import replace

import numpy as np
import pytest

from geomech import dda
from geomech.dda.contact_detection.inherited_contacts import pressed_before
from geomech.model import CONTACT, OPEN, SLIP, STICK, Blocks, DdaSettings, History, JointLaw, Loads, Material, State

#: m that the faces have closed from where they were drawn, as far as the crack was open.
MISFIT = 1e-4
ROCK = Material("rock", 1e10, 0.25, 2600.0)
WEIGHT = Loads(gravity=History.constant(np.array([0.0, -9.81])))


@pytest.mark.parametrize("speed", [-0.3, 0.3])
def test_a_corner_that_slides_past_a_node_of_its_face_keeps_the_misfit(speed):
    """A smooth block slides on a face with a node, over which its corner passes: the node becomes a contact, and where
    blocks overlap by the misfit of the face it brings no energy. (Without the misfit 3 200 J/m for a block of 7 J/m.)"""
    base = np.array([[0.0, -1.0], [1.0, -1.0], [1.0, 0.0], [0.5, 0.0], [0.0, 0.0]])
    left = 0.5 - 1e-4 * np.sign(speed) - (0.3 if speed > 0 else 0.0)
    block = np.array([[left, 0.0], [left + 0.3, 0.0], [left + 0.3, 0.2], [left, 0.2]])
    blocks = Blocks.from_polygons([base, block], fixed=[True, False])
    settings = DdaSettings(time_step=1e-4, dynamic_factor=1.0)
    system = dda.BlockSystem(blocks, [ROCK], [JointLaw("joint", friction_angle=0.0)], settings=settings)
    vertices = blocks.vertices.copy()
    vertices[5:, 1] -= MISFIT
    velocity = np.zeros((2, 6))
    velocity[1, 0] = speed

    state = replace(State.at_rest(blocks), vertices=vertices, velocity=velocity)
    found = system.contacts_near(state)
    below = found.geometry[:, 3] < 0.0
    assert below.sum() == 2
    which, none = np.flatnonzero(below), np.zeros(2)
    normal = np.full(2, 0.5 * 2600.0 * 9.81 * blocks.areas()[1])
    state = system.with_inherited_contacts(state, found, dda.InheritedContacts(which, normal, none, none, none))
    assert state.contacts["lift"][which] == pytest.approx(-MISFIT, rel=1e-3)
    energy, created, touched = 0.5 * 2600.0 * blocks.areas()[1] * speed**2, 0.0, set()
    for _ in range(20):
        result = system.step(state, WEIGHT)
        state, created = result.state, created + result.energy.overlap
        touched |= set(state.contacts["vertex"][state.contacts["state"] != OPEN].tolist())
    assert 3 in touched  # the node
    assert created < 1e-6 * energy
    # Weight on the springs: 1e-8 m.
    assert state.vertices[5:7, 1] == pytest.approx(-MISFIT, abs=3e-8)


@pytest.mark.parametrize(
    ("state", "deep", "closed"), [(STICK, 7e-4, True), (SLIP, 7e-4, True), (STICK, 7e-5, False), (OPEN, 7e-4, False)]
)
def test_a_contact_that_takes_over_the_length_of_another_begins_closed(state, deep, closed):
    """The corner of a block slides past a node of the face below, which then presses on the block: as deep as the corner did
    before, it brings no energy; deeper, or where nothing pressed, it does."""
    old = np.zeros(1, CONTACT)
    old["block"], old["other"], old["state"], old["gap"] = 1, 0, state, -deep
    old["normal"], old["point"] = (0.0, 1.0), (0.0, 0.0)
    tilt = np.radians(2.5)
    geometry = np.zeros((2, 7))
    geometry[:, 1:3], geometry[:, 3] = (-np.sin(tilt), -np.cos(tilt)), -6.6e-4
    geometry[:, 5] = 1e-3
    block, other = np.array([0, 0]), np.array([1, 2])
    found = pressed_before(old, np.array([True, True]), block, other, geometry)
    assert found.tolist() == [closed, False]
