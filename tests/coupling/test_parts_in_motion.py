"""Parts begin with as much stress of their own as there is energy for."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from geomech.coupling.parts_in_motion import paid_stress
from geomech.coupling.splitting import split_blocks
from geomech.model import Blocks, Cracks, Material, State

ROCK = Material("rock", 10e9, 0.25, 2500.0)
BLOCK = np.array([[0.0, 0.0], [3.0, 0.0], [3.0, 1.0], [0.0, 1.0]])


def energy(blocks: Blocks, state: State) -> float:
    """½ A σ·C⁻¹σ of all blocks, J/m."""
    return 0.5 * float(blocks.areas(state.vertices) @ np.sum(state.stress @ ROCK.compliance() * state.stress, axis=1))


@pytest.mark.parametrize("share", [0.0, 0.3, 0.999, 1.0, 5.0])
@pytest.mark.parametrize("lean", [0.0, 0.4, -0.4])
def test_parts_store_no_more_than_the_whole_and_its_cracks_did(share, lean):
    """A third and two thirds of a block under stresses that are unlike its own; ``lean``: in the mean, too. With a
    ``share`` of what their own stress takes they begin with all that it pays for, with all of it with their own."""
    blocks = Blocks.from_polygons([BLOCK])
    state = replace(State.at_rest(blocks), stress=np.array([[-2e6, 1e6, 5e5]]))
    cracks = Cracks.from_polylines([np.array([[1.0, 0.0], [1.0, 1.0]])], surface=[(True, True)])
    change = np.array([3e6, -1e6, 8e5])

    def own(loops: list[np.ndarray]) -> np.ndarray:
        way = 2.0 if np.ptp(loops[0][:, 0]) < 1.5 else -1.0
        return state.stress[0] + (way + lean) * change

    split = split_blocks(blocks, state, cracks, {0: own})
    had, asked = energy(blocks, state), energy(split.blocks, split.state)
    assert asked > had
    stored = share * (asked - had)
    paid = paid_stress(split, blocks, state, ROCK.compliance()[None].repeat(2, axis=0), {0: stored})
    assert energy(split.blocks, paid) == pytest.approx(had + min(stored, asked - had), rel=1e-12)
    if share >= 1.0:
        np.testing.assert_allclose(paid.stress, split.state.stress, rtol=1e-12)
    # On the way from the whole's to their own.
    moved, whole_way = paid.stress - state.stress, split.state.stress - state.stress
    part = float(np.sum(moved * whole_way) / np.sum(whole_way**2))
    assert 0.0 <= part <= 1.0
    np.testing.assert_allclose(moved, part * whole_way, rtol=1e-9, atol=1e-9 * np.abs(whole_way).max())
