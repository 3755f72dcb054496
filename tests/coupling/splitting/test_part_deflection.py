"""Parts of a split block of higher order: they are where the whole was, move as it did, and store what it stored."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from geomech.coupling.splitting.block_splitting import split_blocks
from geomech.coupling.splitting.part_deflection import inherited_deflection, with_stress
from geomech.dda.higher_order.bent_body import bent_bodies
from geomech.dda.higher_order.deflected_blocks import DeflectedBlocks
from geomech.dda.kinematics.simplex_integration import block_moments, mass_matrix
from geomech.model import FACE_POINT, Blocks, Cracks, Material, Motion, State

ROCK = Material("rock", 20e9, 0.25, 2500.0, 1e6)
BLOCK = np.array([[0.0, 0.0], [2.0, 0.0], [2.1, 1.0], [0.0, 1.2]])
BESIDE = np.array([[3.0, 0.0], [4.0, 0.0], [4.0, 1.0], [3.0, 1.0]])
CUT = np.array([[0.8, 0.0], [1.0, 0.6], [0.9, 1.2 - 0.2 * 0.9 / 2.1]])


def deflected(blocks: Blocks) -> DeflectedBlocks:
    n = blocks.n_blocks
    elastic = np.tile(ROCK.stiffness(), (n, 1, 1))
    return DeflectedBlocks(blocks, np.zeros(n, bool), elastic)


def moving(order: int, size: float) -> tuple[Blocks, State, DeflectedBlocks]:
    """Two blocks, rotated, strained and bent, with velocities; deflections of about ``size``, m."""
    blocks = Blocks.from_polygons([BLOCK, BESIDE], order=[order, 2])
    own, rng = deflected(blocks), np.random.default_rng(7)
    angle = 0.4
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    gradient = turn @ (np.eye(2) + 1e-4 * rng.normal(size=(2, 2)))
    state = State.at_rest(blocks)
    q = rng.normal(size=(own.n_unknowns, 2)) * size * np.array([1.0, 30.0])
    state = replace(
        state, vertices=blocks.vertices @ gradient.T + [0.3, -0.2], rotation=np.full(2, angle), deflection=q,
        velocity=rng.normal(size=(2, 6)) * [1, 1, 0.1, 1e-3, 1e-3, 1e-3], stress=rng.normal(size=(2, 3)) * 1e6,
    )  # fmt: skip
    return blocks, state, own


def places(blocks: Blocks, state: State, own: DeflectedBlocks, block: int, points: np.ndarray) -> np.ndarray:
    motion = Motion.of(blocks, state.vertices)
    return motion.current(block, points) + bent_bodies(own, state, motion)[block].deflection(points)


def momentum_and_energy(blocks: Blocks, state: State, own: DeflectedBlocks) -> tuple[np.ndarray, float]:
    moments = block_moments(
        np.ascontiguousarray(state.vertices), blocks.next_vertex.astype(np.int64), blocks.vertex_start.astype(np.int64)
    )
    density = ROCK.density * blocks.areas() / moments[:, 0]
    mass = mass_matrix(moments, density)
    v = state.velocity
    linear = (density * moments[:, 0])[:, None] * v[:, :2]
    arm = moments[:, 1:3]
    spin = np.einsum("nb,nb->n", mass[:, 2], v) + arm[:, 0] * linear[:, 1] - arm[:, 1] * linear[:, 0]
    kinetic = 0.5 * np.einsum("na,nab,nb->", v, mass, v)
    kinetic += own.kinetic(state.deflection[:, 1], v[:, 3:], state.rotation, density)
    return np.r_[linear.sum(axis=0), spin.sum()], float(kinetic)


@pytest.mark.parametrize("order", [2, 3, 5])
def test_parts_are_where_the_whole_was_and_move_as_it_did(order):
    """Points to a square of the deflection, 1e-5 of 1 m; momentum, and energy of motion, to the same."""
    blocks, state, own = moving(order, 1e-5)
    cracks = Cracks.from_polylines([CUT], surface=[(True, True)])
    split = split_blocks(blocks, state, cracks)
    parts = deflected(split.blocks)
    compliance = np.tile(ROCK.compliance(), (split.blocks.n_blocks, 1, 1))
    after, stresses = inherited_deflection(split, state, own, parts, {}, compliance)
    assert sorted(stresses) == np.flatnonzero(split.parent == 0).tolist()
    for part in np.flatnonzero(split.parent == 0).tolist():
        loop = split.blocks.loops(part)[0]
        points = np.vstack([loop, loop.mean(axis=0)])
        np.testing.assert_allclose(
            places(split.blocks, after, parts, part, points), places(blocks, state, own, 0, points), atol=3e-8
        )
    np.testing.assert_array_equal(after.deflection[parts.basis.of_block(2)], state.deflection[own.basis.of_block(1)])
    was, had = momentum_and_energy(blocks, state, own)
    now, has = momentum_and_energy(split.blocks, after, parts)
    np.testing.assert_allclose(now, was, rtol=1e-6)
    assert has == pytest.approx(had, rel=1e-6)


def test_the_stress_of_the_whole_goes_on_in_its_parts():
    """With its own stress, the parts store its energy; where none of their strain is due to cracks, what else has bent
    them is their origin."""
    blocks, state, own = moving(3, 1e-5)
    split = split_blocks(blocks, state, Cracks.from_polylines([CUT], surface=[(True, True)]))
    parts = deflected(split.blocks)
    compliance = np.tile(ROCK.compliance(), (split.blocks.n_blocks, 1, 1))
    after, stresses = inherited_deflection(split, state, own, parts, {}, compliance)
    energy = 0.0
    for part, of in stresses.items():
        rock = parts.generalised_compliance(part, ROCK.compliance())
        energy += 0.5 * parts.basis.area[part] * float(of.whole @ rock @ of.whole)
        after = with_stress(after, parts, part, rock, of.whole, None)
        np.testing.assert_allclose(
            parts.elastic_part(after)[parts.basis.of_block(part)],
            np.sqrt(parts.basis.area[part]) * rock[3:, 3:] @ of.whole[3:], rtol=1e-9, atol=1e-16,
        )  # fmt: skip
    bent, some = own.stiffness[0], own.basis.of_block(0)
    q = state.deflection[some, 0]
    m = len(q)
    had = 0.5 * q @ bent[:m, :m] @ q + 0.5 * own.basis.area[0] * state.stress[0] @ ROCK.compliance() @ state.stress[0]
    assert energy == pytest.approx(had, rel=1e-9)


def test_faces_that_are_not_divided_keep_their_points():
    """Rows of the points of a face are renumbered with its vertices; those of a divided side are dropped."""
    blocks, state, own = moving(2, 1e-5)
    rows = np.zeros(4, FACE_POINT)
    rows["vertex"], rows["edge"] = [3, 3, 0, 5], [6, 6, 6, 1]
    rows["far_vertex"], rows["far_edge"] = [2, 2, -1, 6], [4, 4, -1, 1]
    rows["block"], rows["other"] = [0, 0, 0, 1], [1, 1, 1, 0]
    rows["place"], rows["normal_force"] = [0, 1, 0, 0], [1, 2, 3, 4]
    # The cut divides the lower and the upper side, edges 0 and 2.
    split = split_blocks(blocks, state, Cracks.from_polylines([CUT], surface=[(True, True)]))
    rows["edge"][3] = 0
    parts = deflected(split.blocks)
    compliance = np.tile(ROCK.compliance(), (split.blocks.n_blocks, 1, 1))
    after, _ = inherited_deflection(split, replace(state, face_points=rows), own, parts, {}, compliance)
    kept = after.face_points
    assert kept["normal_force"].tolist() == [1, 2, 3]
    np.testing.assert_array_equal(split.blocks.vertices[kept["vertex"]], blocks.vertices[rows["vertex"][:3]])
    np.testing.assert_array_equal(split.blocks.vertices[kept["edge"]], blocks.vertices[rows["edge"][:3]])
    assert (kept["far_vertex"] < 0).tolist() == [False, False, True]
    np.testing.assert_array_equal(kept["block"], split.blocks.vertex_block[kept["vertex"]])
