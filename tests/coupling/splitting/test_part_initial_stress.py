"""Parts begin with as much stress of their own as there is energy for."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from geomech.coupling import Coupling
from geomech.coupling.splitting.block_splitting import split_blocks
from geomech.coupling.splitting.part_initial_stress import affordable_stress
from geomech.model import (
    Blocks,
    Cracks,
    DdaSettings,
    EdgeTraction,
    GrowthSettings,
    History,
    JointLaw,
    Loads,
    Material,
    Problem,
    RunSettings,
    State,
)

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
    paid = affordable_stress(split, blocks, state, ROCK.compliance()[None].repeat(2, axis=0), {0: stored})
    assert energy(split.blocks, paid) == pytest.approx(had + min(stored, asked - had), rel=1e-12)
    if share >= 1.0:
        np.testing.assert_allclose(paid.stress, split.state.stress, rtol=1e-12)
    # On the way from the whole's to their own.
    moved, whole_way = paid.stress - state.stress, split.state.stress - state.stress
    part = float(np.sum(moved * whole_way) / np.sum(whole_way**2))
    assert 0.0 <= part <= 1.0
    np.testing.assert_allclose(moved, part * whole_way, rtol=1e-9, atol=1e-9 * np.abs(whole_way).max())


def test_a_crack_that_is_left_in_a_part_begins_with_its_own_strain():
    """A plate under tension is cut in two by one crack and keeps another. The strain of both was many times that of the
    one that is left; had it gone over to the part, its first step would have closed it against the tension."""
    outline = np.array([[-0.5, -1.0], [0.5, -1.0], [0.5, 1.0], [-0.5, 1.0]])
    names = [[["bottom", "", "top", ""]]]
    pulls = tuple(EdgeTraction(name, History.ramp([0.0, way * 4e8])) for name, way in (("top", 1.0), ("bottom", -1.0)))
    lines = [np.array([[-0.5, 0.0], [0.3, 0.0]]), np.array([[-0.1, 0.5], [0.1, 0.5]])]
    given = Problem(
        title="a plate with two cracks",
        blocks=Blocks.from_polygons([outline], edge_names=names),
        cracks=Cracks.from_polylines(lines, aperture=np.inf, surface=[(True, False), (False, False)]),
        materials=(replace(ROCK, k_ic=1e6),),
        joints=(JointLaw("joint"),),
        loads=Loads(edge_tractions=pulls),
        dda=DdaSettings(time_step=1e-4, dynamic_factor=1.0, max_displacement_ratio=0.1),
        growth=GrowthSettings(increment=0.05, min_increment=1e-3),
        run=RunSettings(end_time=4e-3, stop_at=()),
    )
    seen = [cycle for cycle in Coupling(given).cycles() if cycle.number]
    cut = next(n for n, cycle in enumerate(seen) if "split" in [event.kind for event in cycle.events])
    strain = [np.abs(seen[n].state.crack_strain).max() for n in (cut - 1, cut)]
    assert strain[0] > 50 * strain[1] > 0
    begun, first = seen[cut - 1].statistics, seen[cut].statistics
    assert abs(first["crack_work"] - begun["crack_work"]) < 0.05 * begun["crack_elastic"]
    assert 0 < first["crack_elastic"] < 0.05 * begun["crack_elastic"]
    assert first["parting_energy"] > 0.5 * begun["crack_elastic"]
    # Of increments of a quarter of the ligament.
    assert max(abs(cycle.statistics["budget_residual"]) for cycle in seen) < 5e-3
