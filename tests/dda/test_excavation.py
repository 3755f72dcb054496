"""The energy balance of runs in stages: what is dug out takes what it stores, what is bolted does its work, nothing
else."""

from __future__ import annotations

import numpy as np
import pytest
from block_problems import rectangle

from geomech import dda
from geomech.dda.energy_balance import EnergyBudget
from geomech.model import Blocks, Bolt, DdaSettings, Excavation, History, JointLaw, Loads, Material

ROCK = Material("rock", 2e9, 0.2, density=2500.0)


def pillar_and_roof() -> Blocks:
    """A roof beam on three pillars; the one in the middle, block 2, is to be mined."""
    polygons = [rectangle(-1, -1, 7, 0), *(rectangle(x, 0, x + 1, 3) for x in (0.0, 2.5, 5.0)), rectangle(0, 3, 6, 4)]
    return Blocks.from_polygons(polygons, fixed=[True, False, False, False, False])


@pytest.mark.parametrize("factor", (0.0, 1.0))
def test_the_balance_closes_through_excavation_and_bolting(factor):
    """The pillar is a third of all that is stored, and was the residual of the step after it was gone."""
    blocks = pillar_and_roof()
    loads = Loads(
        gravity=History.constant([0.0, -9.81]),
        excavations=(Excavation(0.01, (2,)),),
        bolts=(Bolt(4, (3.0, 3.2), 1, (0.5, 1.5), 5e7, pretension=2e4, installation=0.02, name="tie"),),
    )
    settings = DdaSettings(time_step=1e-3, dynamic_factor=factor, equilibrium="start")
    seen, budget = [], EnergyBudget()

    def watch(result: dda.StepResult) -> None:
        nonlocal budget
        dug = result.state.removed is not None and not any(r.state.removed is not None for r in seen)
        budget = (budget.cut() if dug else budget).after(result.energy, result.state.time)
        seen.append(result)

    joint = JointLaw("face", friction_angle=np.radians(35))
    stored = {s.time: s for s in dda.run(blocks, [ROCK], [joint], loads, settings, 0.04, watch=watch)}
    before = [s for time, s in stored.items() if time < 0.0101][-1]
    pillar = 0.5 * 3.0 * float(before.stress[2] @ ROCK.compliance() @ before.stress[2])
    rest = next(r for r in seen if r.state.time > 0.0099)
    # Its stress is the weight of its part of the roof: what went is that, and the springs of its two faces.
    assert pillar > 0.05 * rest.energy.elastic
    assert -1.2 * pillar < budget.split < -pillar
    # Contacts, blocks and work are the same to what the update of the geometry leaves in such steps.
    assert abs(budget.residual) < 1e-4 * abs(budget.split)
    assert abs(budget.load_work) > 0.0


def test_nothing_of_a_block_that_is_gone_is_stored():
    blocks = pillar_and_roof()
    loads = Loads(gravity=History.constant([0.0, -9.81]), excavations=(Excavation(0.002, (2,)),))
    settings = DdaSettings(time_step=1e-3, dynamic_factor=0.0, equilibrium="start")
    results: list[dda.StepResult] = []
    joint = JointLaw("face", friction_angle=np.radians(35))
    list(dda.run(blocks, [ROCK], [joint], loads, settings, 0.004, watch=results.append))
    for result in results:
        elastic = (
            0.5 * blocks.areas() @ np.einsum("bi,ij,bj->b", result.state.stress, ROCK.compliance(), result.state.stress)
        )
        assert result.energy.elastic == pytest.approx(elastic, rel=1e-4)
    with_it, first, *_ = (r.energy.elastic for r in results[1:])
    assert first < with_it
