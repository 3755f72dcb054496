"""Tips of dynamic runs: no faster than a part of the Rayleigh speed."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from geomech.coupling import Coupling, cycles
from geomech.model import (
    Blocks,
    Cracks,
    DdaSettings,
    EdgeTraction,
    GrowthSettings,
    History,
    Loads,
    Material,
    Problem,
    RunSettings,
)
from geomech.reference.cracks.rayleigh_wave import rayleigh_ratio

ROCK = Material("rock", 17e9, 0.21, 2200.0, k_ic=1e6)
LIMIT = 0.4 * ROCK.rayleigh_speed


@pytest.mark.parametrize("nu", [0.0, 0.1, 0.2, 0.25, 0.3, 0.4, 0.49])
def test_rayleigh_speed_is_the_root_of_rayleighs_equation(nu):
    """Viktorov's formula against the cubic: it is told to be good to half a per cent."""
    rock = Material("rock", 10e9, nu, 2500.0)
    exact = rayleigh_ratio(nu) * np.sqrt(rock.shear_modulus / rock.density)
    assert rock.rayleigh_speed == pytest.approx(exact, rel=5e-3)


def test_rayleigh_ratio_of_a_poisson_solid():
    """ν = ¼: c_R/c_s = √(2 − 2/√3) in closed form (Rayleigh 1885)."""
    assert rayleigh_ratio(0.25) == pytest.approx(np.sqrt(2 - 2 / np.sqrt(3)), rel=1e-12)


def pulled(dt: float, dynamic: float = 1.0, **growth) -> Problem:
    """A plate 2 × 1 m that is suddenly pulled along its length by many times what its edge crack bears."""
    outline = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 2.0], [0.0, 2.0]])
    pulls = tuple(
        EdgeTraction(name, History.constant([0.0, way * 5e6])) for name, way in (("top", 1.0), ("bottom", -1.0))
    )
    settings = {"increment": 0.05, "min_increment": 5e-3, "correct": False, **growth}
    return Problem(
        title="pulled",
        blocks=Blocks.from_polygons([outline], edge_names=[[["bottom", "", "top", ""]]]),
        cracks=Cracks.from_polylines([np.array([[0.0, 1.0], [0.2, 1.0]])], aperture=np.inf, surface=[(True, False)]),
        materials=(ROCK,),
        joints=(),
        loads=Loads(edge_tractions=pulls),
        dda=DdaSettings(time_step=dt, dynamic_factor=dynamic, max_displacement_ratio=0.1),
        growth=GrowthSettings(**settings),
        run=RunSettings(end_time=1.0, stop_at=("split",)),
    )  # fmt: skip


@pytest.mark.first_by_default(2)
@pytest.mark.parametrize("dt", [1e-4, 2e-5, 6e-6])
def test_a_driven_tip_runs_at_the_limit_and_no_faster(dt):
    """Driven hard all the time, the tip is where the limit lets it be, to one shortest increment (the last step may go
    less far); also when a step leaves it less than that, and with steps that leave it several increments."""
    begun, length, last = None, 0.2, 0.0
    for cycle in cycles(pulled(dt)):
        if not cycle.number:
            continue
        if not len(cycle.tips) or length > 0.7:
            break
        grown = float(cycle.tips["grown"].max())
        if grown > 0 and begun is None:
            begun = cycle.state.time - dt
        length += grown
        last = cycle.state.time
        assert cycle.statistics["fastest_tip"] <= max(LIMIT, 5e-3 / dt + LIMIT) * (1 + 1e-9)
        if begun is not None:
            assert length - 0.2 <= LIMIT * (last - begun) * (1 + 1e-9) + 5e-3
    assert length > 0.6
    assert (length - 0.2) / (last - begun) == pytest.approx(LIMIT, rel=0.06)


@pytest.mark.slow
def test_half_the_limit_takes_twice_the_time():
    def time_to_split(limit):
        *_, cycle = cycles(pulled(2e-5, speed_limit=limit))
        assert "split" in [event.kind for event in cycle.events]
        return cycle.state.time

    assert time_to_split(0.2) == pytest.approx(2 * time_to_split(0.4), rel=0.15)


def test_statics_know_no_speed():
    given = pulled(1.0, dynamic=0.0)
    *_, cycle = cycles(given)
    assert "split" in [event.kind for event in cycle.events]
    assert cycle.load_step == 1 and "fastest_tip" not in cycle.statistics


def test_passes_of_a_dynamic_step_end_together_where_growth_calls_for_shorter_ones():
    """A step of several increments whose later passes find no answer but in parts: time goes on, the speed limit holds,
    and energy is accounted for as it is by whole passes."""
    dt, taken = 1e-4, []

    def run(most: float):
        coupling = Coupling(pulled(dt))
        step = coupling.now.system.step

        def cut(state, loads, asked, *rest):
            taken.append(asked if coupling.under_way is None else min(asked, most))
            return step(state, loads, taken[-1], *rest)

        coupling.now.system.step = cut
        found, length = [], 0.2
        for cycle in coupling.cycles():
            length += float(cycle.tips["grown"].max(initial=0.0))
            if length > 0.5:
                break
            found.append(cycle)
        return found

    whole, parts = run(dt), run(0.4 * dt)
    assert min(taken) < 0.21 * dt  # 0.4, 0.4 and what is left
    assert max(cycle.growth_pass for cycle in parts) >= 2
    for before, after in pairwise(parts[1:]):
        same = before.load_step == after.load_step
        assert after.state.time == (before.state.time if same else pytest.approx(before.state.time + dt, rel=1e-12))
        assert after.statistics["fastest_tip"] <= LIMIT + 5e-3 / dt
    lost, usual = (run[-1].statistics["energy_residual"] / run[-1].statistics["load_work"] for run in (parts, whole))
    assert abs(lost) < 1.5 * abs(usual) < 1e-4
    assert parts[-1].state.time == pytest.approx(whole[-1].state.time, abs=1.5 * dt)
