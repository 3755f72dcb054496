"""Every accepted state of blocks that pile up at random obeys the laws of contact."""

from __future__ import annotations

import numpy as np
import pytest

from geomech import dda
from geomech.model import OPEN, SLIP, STICK, Blocks, DdaSettings, History, JointLaw, Loads, Material, State

WEIGHT = Loads(gravity=History.constant([0.0, -9.81]))


def pile(seed: int, layers: int, friction_deg: float, dt: float, **settings) -> dda.BlockSystem:
    """Convex polygons of three to six corners, at random places and angles above a trough."""
    rng = np.random.default_rng(seed)
    polygons = [
        np.array([[-3.0, -1.0], [7.0, -1.0], [7.0, 0.0], [-3.0, 0.0]]),
        np.array([[-1.5, 0.0], [-0.5, 0.0], [-1.5, 4.0]]),
        np.array([[4.5, 0.0], [5.5, 0.0], [5.5, 4.0]]),
    ]
    for layer in range(layers):
        for column in range(4):
            corners = np.sort(rng.uniform(0, 2 * np.pi / rng.integers(3, 7), size=1)) + np.linspace(
                0, 2 * np.pi, rng.integers(3, 7), endpoint=False
            )
            size = rng.uniform(0.42, 0.48)
            centre = [0.5 + column + rng.uniform(-0.02, 0.02), 0.5 + layer * 0.97]
            polygons.append(centre + size * np.stack([np.cos(corners), np.sin(corners)], axis=1))
    blocks = Blocks.from_polygons(polygons, fixed=[True] * 3 + [False] * (len(polygons) - 3))
    return dda.BlockSystem(
        blocks, [Material("rock", 5e9, 0.2, density=2500.0)], [JointLaw("j", friction_angle=np.radians(friction_deg))],
        settings=DdaSettings(time_step=dt, dynamic_factor=1.0, max_displacement_ratio=0.02, **settings),
    )  # fmt: skip


def inconsistencies(result: dda.StepResult, friction: float, stiffness: float, slack: float) -> list[str]:
    rows = result.contacts
    closed = rows["state"] != OPEN
    n, s = rows["normal_force"], rows["shear_force"]
    force = max(float(np.abs(n).max(initial=0.0)), 1.0)
    # Forces are known to the round-off of the coordinates times the springs' stiffness.
    off = 1e-9 * force + stiffness * slack
    out = []
    if (n[closed] < -off).any():
        out.append("a contact pulls")
    if n[~closed].any() or s[~closed].any():
        out.append("an open contact carries force")
    if (np.abs(s[closed]) > friction * np.maximum(n[closed], 0.0) + off).any():
        out.append("a contact carries more than its friction")
    slide = rows["state"] == SLIP
    if (np.abs(np.abs(s[slide]) - friction * n[slide]) > off).any():
        out.append("a sliding contact does not carry its friction")
    if not result.statistics["unbalanced"] < 1e-7:
        out.append(f"forces do not balance: {result.statistics['unbalanced']:.1e}")
    return out


@pytest.mark.first_by_default(1)
@pytest.mark.parametrize(("seed", "friction_deg", "dt"), [(1, 30.0, 2e-3), (2, 0.0, 5e-3), (3, 50.0, 1e-3)])
def test_piles_are_consistent_at_every_step(seed, friction_deg, dt):
    system = pile(seed, 3, friction_deg, dt)
    friction = np.tan(np.radians(friction_deg))
    state, seen, deepest = State.at_rest(system.blocks), set(), 0.0
    hardest = 0.0
    for _ in range(200):
        before = {(r["vertex"], r["edge"]): r["slip"] for r in state.contacts}
        result = system.step(state, WEIGHT)
        assert inconsistencies(result, friction, 4e11, 1e-14) == []
        rows = result.contacts
        for row in rows[(rows["state"] == SLIP) & (np.abs(rows["shear_force"]) > 1.0)]:
            # Friction opposes what slips in the step, whatever slipped before.
            slipped = row["slip"] - before.get((row["vertex"], row["edge"]), row["slip"])
            assert slipped * row["shear_force"] <= 1e-12 * abs(row["shear_force"])
        deepest = max(deepest, float(-rows["gap"][rows["state"] != OPEN].min(initial=0.0)))
        hardest = max(hardest, float(rows["normal_force"].max(initial=0.0)))
        seen |= set(rows["state"].tolist())
        state = result.state
    assert {OPEN, SLIP} <= seen and (friction == 0.0 or STICK in seen)
    # Nothing was ever deeper than the springs, 40 E' and for slender faces less, are compressed by what they carried.
    assert deepest < hardest / 1e11
