"""State of motion of the blocks, at rest, sliding or moving, in words for the progress line and the summary."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from geomech.model import OPEN, RESTS, SLIP, Cycle, Problem
from geomech.model.blocks.key_blocks import CLASSES, FALLS, FIXED, SLIDES, key_blocks

#: Blocks are at rest, apart from small vibrations, if the unbalanced force on every block is below this part of its
#: forces …
AT_REST = 1e-2
#: … and their kinetic energy is below this part of the energy stored in blocks and contacts (steady sliding is in
#: equilibrium, too). In statics the displacement that is left is also small (`RESTS`).
STILL = 1e-2
#: Number of blocks that are named.
NAMED = 5
#: A block counts as stable if it has moved by less than this part of its size √area, and at its velocity would not
#: reach that in the time of a free fall over that distance.
STANDS = 1e-3


def condition(cycle: Cycle) -> str:
    """ "at rest", "sliding" (every moving block keeps touching others) or "moving"; "" before the first step."""
    statistics = cycle.statistics
    unbalanced = statistics.get("unbalanced_ratio", math.nan)
    if math.isnan(unbalanced):
        return ""
    strained = statistics.get("elastic_energy", 0.0) + statistics.get("contact_energy", 0.0)
    settled = statistics["kinetic_energy"] <= STILL * strained and statistics.get("remaining_motion", 0.0) <= RESTS
    if unbalanced < AT_REST and settled:
        return "at rest"
    contacts, alone = cycle.state.contacts, ~np.asarray(cycle.blocks.fixed, dtype=bool)
    if cycle.state.removed is not None:
        alone &= ~cycle.state.removed
    closed = contacts[contacts["state"] != OPEN]
    alone[closed["block"]] = alone[closed["other"]] = False
    return "sliding" if (closed["state"] == SLIP).any() and not alone.any() else "moving"


def state_text(cycle: Cycle) -> str:
    """The state of motion of ``cycle`` for a progress line."""
    now = condition(cycle)
    if not now:
        return "starting"
    statistics = cycle.statistics
    sliding = int(np.count_nonzero(cycle.state.contacts["state"] == SLIP))
    text = (
        f"{now}, unbalanced {statistics['unbalanced_ratio']:.1e}, kinetic energy {statistics['kinetic_energy']:.2g} J/m"
    )
    text += f", {sliding} contacts slide" if sliding else ""
    cuts = int(statistics.get("step_cuts", 0))
    return text + (f", step cut {cuts} times" if cuts > 1 else "")


def motion_summary(cycle: Cycle) -> dict[str, Any]:
    """State of motion at the end of the run, for ``summary.json``."""
    statistics = cycle.statistics
    names = ("kinetic_energy", "unbalanced_ratio", "worst_penetration")
    return {"condition": condition(cycle), **{name: statistics[name] for name in names if name in statistics}}


def energy_summary(cycle: Cycle) -> dict[str, float]:
    """Energy budget of the run, J/m, for ``summary.json``; empty without one.

    ``budget_residual`` is relative to all energy converted. ``unpaid_toughness``: fracture energy in a run in motion
    that the blocks did not supply: those of order 1 store no bending energy.
    """
    names = (
        "kinetic_energy", "elastic_energy", "contact_energy", "gravity_work", "load_work", "crack_work",
        "friction_loss",
        "damping_loss", "bond_loss", "crushing_loss", "impact_loss", "scheme_loss", "carried_loss", "overlap_energy",
        "split_energy", "energy_residual",
        "growth_release",
        "uneven_work", "set_free_energy", "crack_elastic", "crack_friction", "crack_bond_loss", "fracture_energy",
        "runaway_loss", "parting_energy", "excavated_crack_energy", "toughness_energy", "crack_residual", "budget_residual",
    )  # fmt: skip
    found = {name: float(cycle.statistics[name]) for name in names if name in cycle.statistics}
    if found.get("toughness_energy") and "runaway_loss" not in found:
        given = found["fracture_energy"] + found["parting_energy"]
        found["unpaid_toughness"] = max(0.0, found["toughness_energy"] - given)
    return found


def key_block_summary(cycle: Cycle, problem: Problem) -> list[dict[str, Any]]:
    """The blocks that have moved farthest, with their classification by block theory, for ``summary.json``."""
    rows = key_blocks(
        cycle.blocks, problem.materials, problem.joints, cycle.state, problem.loads.gravity.at(cycle.state.time)
    )
    out, area = [], cycle.blocks.areas(cycle.state.vertices)
    pull = float(np.hypot(*problem.loads.gravity.at(cycle.state.time)))
    for block in np.argsort(rows["rank"], kind="stable")[:NAMED].tolist():
        row = rows[block]
        if row["kind"] == FIXED:
            continue
        entry = {
            "block": cycle.blocks.names[block],
            "displacement_m": float(row["displacement"]),
            "speed_m_s": float(row["speed"]),
            "class": CLASSES[int(row["kind"])],
        }
        size = float(np.sqrt(area[block]))
        if (
            row["kind"] in (SLIDES, FALLS)
            and row["displacement"] < STANDS * size
            and row["speed"] < STANDS * math.sqrt(pull * size)
        ):
            # Neighbours, bolts or bonds hold it: block theory considers only its own weight and friction.
            entry["class"] = f"stands (by its own weight and friction a {entry['class']})"
        if not math.isnan(row["direction"]):
            entry["direction_deg"] = math.degrees(row["direction"])
        if not math.isnan(row["factor"]):
            entry["factor_of_safety"] = float(row["factor"])
        out.append(entry)
    return out


def closing(summary: dict[str, Any]) -> list[str]:
    """Closing lines of a run of blocks: state of motion, energy balance, the blocks that moved farthest."""
    motion, energy = summary.get("motion", {}), summary.get("energy", {})
    lines = []
    if motion.get("condition"):
        lines.append(
            f"  {motion['condition']}: unbalanced force {motion['unbalanced_ratio']:.1e} of the forces on a block, "
            f"kinetic energy {motion['kinetic_energy']:.3g} J/m"
        )
    if energy.get("gravity_work") is not None:
        work = energy["gravity_work"] + energy["load_work"]
        struck = f" impacts {energy['impact_loss']:.3g}," if energy.get("impact_loss") else ""
        if energy.get("crushing_loss"):
            struck += f" crushing {energy['crushing_loss']:.3g},"
        lines.append(
            f"  work {work:.3g} J/m, of which lost in friction {energy['friction_loss']:.3g}, damping "
            f"{energy['damping_loss']:.3g},{struck} time scheme {energy['scheme_loss']:.3g}; unexplained "
            f"{energy['energy_residual']:.1g}"
        )
    for entry in summary.get("key_blocks", ()):
        text = f"  {entry['block']:<13} moved {entry['displacement_m']:.3g} m, {entry['class']}"
        text += f" towards {entry['direction_deg']:.0f}°" if "direction_deg" in entry else ""
        lines.append(text + (f", factor {entry['factor_of_safety']:.2f}" if "factor_of_safety" in entry else ""))
    return lines
