"""Random stacks of cracked blocks of mixed order: cracks run, blocks split, and energy comes from nowhere."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from geomech.coupling import Coupling
from geomech.model import (
    AUTO_ORDER,
    Blocks,
    Cracks,
    DdaSettings,
    GrowthSettings,
    History,
    JointLaw,
    Loads,
    Material,
    Problem,
    RunSettings,
)

#: Random draws: a part of first order among parts that bend, and faces that splits make under bent blocks (seeds 13 and
#: 92 once made energy of 3 and 20 times the work of the weight); orders 2 to 6 that hold.
DEFAULT, MORE = (92, 43, 8, 54), tuple(range(60, 90))


def stack(seed: int) -> tuple[Problem, bool]:
    """One to three blocks on a base, with cracks from below and inside; whether the run is static."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 4))
    polygons, orders, y = [np.array([[-3.0, -1.0], [6.0, -1.0], [6.0, 0.0], [-3.0, 0.0]])], [1], 0.0
    lines, owners, surface = [], [], []
    for k in range(n):
        w, h = rng.uniform(0.5, 2.5), rng.uniform(0.4, 1.2)
        x = rng.uniform(-0.2, 0.2)
        rng.uniform(-0.1, 0.1)
        polygons.append(np.array([[x, y], [x + w, y], [x + w, y + h], [x, y + h]]))
        orders.append(int(rng.choice([1, 2, 3, 4, 6])))
        for c in range(int(rng.integers(1, 3))):
            if rng.random() < 0.5:
                start = np.array([x + w * rng.uniform(0.2, 0.4) + c * w * 0.3, y])
                end, mouths = start + [rng.uniform(-0.05, 0.05) * w, h * rng.uniform(0.2, 0.7)], (True, False)
            else:
                start = np.array([x + w * (0.15 + 0.4 * c), y + h * rng.uniform(0.3, 0.7)])
                end, mouths = start + [w * rng.uniform(0.1, 0.2), h * rng.uniform(-0.2, 0.2)], (False, False)
            lines.append(np.array([start, end]))
            owners.append(k + 1)
            surface.append(mouths)
        y += h
    aperture, static = float(rng.choice([0.0, np.inf])), bool(rng.random() < 0.4)
    cracks = Cracks.from_polylines(lines, block=owners, aperture=aperture, surface=surface)
    modulus, k_ic = 10 ** rng.uniform(8.5, 10.5), 10 ** rng.uniform(3.3, 6)
    joint = JointLaw("joint", friction_angle=float(rng.uniform(0, 0.7)))
    faces = JointLaw("faces", friction_angle=float(rng.choice([0, 0.5])))
    loads = Loads(gravity=History.constant([float(rng.uniform(-2, 2)), -9.81]))
    dt = 1.0 if static else float(10 ** rng.uniform(-4.3, -2.7))
    newmark = (0.25, 0.5) if rng.random() < 0.5 else (0.5, 1.0)
    problem = Problem(
        title=f"stack {seed}",
        blocks=Blocks.from_polygons(polygons, fixed=[True] + n * [False], order=orders),
        cracks=cracks,
        materials=(Material("rock", float(modulus), 0.25, 2500.0, float(k_ic)),),
        joints=(joint,),
        face_laws=(faces,),
        loads=loads,
        dda=DdaSettings(time_step=dt, dynamic_factor=0.0 if static else 1.0, newmark=newmark),
        growth=GrowthSettings(increment=0.08),
        run=RunSettings(end_time=1.0, stop_at=()),
    )
    return problem, static


@pytest.mark.parametrize("seed", [*DEFAULT, *(pytest.param(s, marks=pytest.mark.slow) for s in MORE)])
def test_cracked_stacks_make_no_energy(seed):
    makes_no_energy(*stack(seed))


@pytest.mark.first_by_default(1)
@pytest.mark.parametrize(
    "seed", [61, 74, *(pytest.param(s, marks=pytest.mark.slow) for s in (*DEFAULT, *MORE) if s not in (61, 74))]
)
def test_cracked_stacks_of_automatic_order_make_no_energy(seed):
    problem, static = stack(seed)
    order = np.where(problem.blocks.fixed, 1, AUTO_ORDER)
    makes_no_energy(replace(problem, blocks=replace(problem.blocks, order=order)), static)


def makes_no_energy(problem: Problem, static: bool) -> None:
    """Unexplained energy below 1 % of all that is converted, that of overlaps and of splits likewise in motion."""
    told: list[dict[str, float]] = []
    for cycle in Coupling(problem).cycles():
        assert np.isfinite(cycle.state.vertices).all()
        told += [cycle.statistics] if cycle.number else []
        if len(told) > 40:
            break
    if static:
        return
    last = told[-1]
    turnover = sum(last[name] for name in ("kinetic_energy", "elastic_energy", "friction_loss", "damping_loss"))
    turnover = max(turnover, *(abs(one["gravity_work"]) for one in told))
    assert max(abs(one["budget_residual"]) for one in told) < 0.01
    assert last["overlap_energy"] < 0.01 * turnover
    assert last["parting_energy"] > -0.05 * turnover
