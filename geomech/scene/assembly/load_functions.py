"""Loads of a scene as functions of time, and other actions: prescribed motion, water, bolts, excavations, stress."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ...model import (
    GROUND,
    BaseMotion,
    BlockMotion,
    Blocks,
    Bolt,
    CrossesNoJoint,
    Excavation,
    History,
    InSituStress,
    LinearProfile,
    PointMotion,
    WaterTable,
    baseline_corrected,
    grouted_bolt,
)
from ...model.loads.ground import Pond, lowest_over, ponds
from ...shapes.block_cutting.rock_outline import ground_of
from ..checks.check import Check
from ..checks.cross_checks import carrier
from ..tables import SceneTables
from ..tables.entries import given
from ..tables.loads import BaseTable, BoltTable, ForceTable, Timed, TractionTable


def history_of(table: Timed) -> History:
    """The history of ``table``, two columns. Raises OSError or ValueError for a file that is not a record."""
    value, rate, values, _ = table._parts()
    if value is not None and table.frequency_hz is not None:
        end = math.inf if table.until_s is None else table.until_s
        phase = math.radians(table.phase_deg)
        return History.sinusoid(value, table.frequency_hz, phase=phase, start=table.start_s, end=end)
    if value is not None:
        return History.constant(value)
    if rate is not None:
        return History.ramp(rate, table.start_s)
    if table.file is not None:
        if table.direction is not None:
            return History.from_file(table.file, 1, table.direction)
        return History.from_file(table.file, 2)
    return History(np.array(table.times_s, dtype=float), np.array(values, dtype=float))


def traction_history(table: TractionTable) -> History:
    """The history of a traction, Pa."""
    return history_of(table)


def force_history(table: ForceTable) -> History:
    """The history of a force, N per metre of thickness."""
    return history_of(table)


def profile_of(table: TractionTable) -> LinearProfile | None:
    """Variation of a traction along its edge; None if it is uniform."""
    p = table.profile
    return None if p is None else LinearProfile(p.start, p.end, p.factors)


def actions_of(tables: SceneTables, check: Check) -> dict[str, Any]:
    """The parts of `Loads` other than forces, by name."""
    loads, zones = tables.loads, check.drawn.zones
    in_zone: dict[str, list[int]] = {}
    for b, name in enumerate(zones):
        in_zone.setdefault(name, []).append(b)
    motions = tuple(_block_motion(motion, b) for motion in loads.motions for b in in_zone.get(motion.zone, ()))
    points = []
    for k, motion in enumerate(loads.point_motions):
        place = ("loads", "point_motions", k, "at")
        block = carrier(check, place, "the point with prescribed motion", motion.at, motion.zone)
        history, direction = _along_axes(history_of(motion), motion.axes)
        points.append(PointMotion(block, motion.at, history, direction, stiffness=motion.stiffness_n_per_m))
    excavations = tuple(
        Excavation(
            e.time_s,
            tuple(b for name in e.zones for b in in_zone.get(name, ())),
            None if e.polygon is None else np.array(e.polygon),
            e.drained,
        )
        for e in loads.excavations
    )
    return {
        "water": _water(tables, check.blocks),
        "base": None if loads.base is None else BaseMotion(_shaking(loads.base), loads.base.frame),
        "block_motions": motions,
        "point_motions": tuple(points),
        "bolts": tuple(bolt for k, table in enumerate(loads.bolts) for bolt in bolts_of(check, k, table)),
        "excavations": excavations,
    }


def _along_axes(history: History, axes: str) -> tuple[History, tuple[float, float] | None]:
    """The given columns of ``history``, and their direction if it is one column."""
    if axes == "xy":
        return history, None
    column = slice(0, 1) if axes == "x" else slice(1, 2)
    part = History(
        history.times, np.asarray(history.values)[:, column], None if history.rate is None else history.rate[column]
    )
    if history.wave is not None:
        wave = history.wave
        part = History.sinusoid(
            wave.amplitude[column], wave.frequency, phase=wave.phase, start=wave.start, end=wave.end
        )
    return part, (1.0, 0.0) if axes == "x" else (0.0, 1.0)


def _block_motion(motion, block: int) -> BlockMotion:
    history, _ = _along_axes(history_of(motion), motion.axes)
    unknowns = {"x": ("u0",), "y": ("v0",), "xy": ("u0", "v0")}[motion.axes]
    if not motion.turns:
        unknowns += ("r0",)
        still = np.zeros((len(history.times), 1))
        wave = history.wave
        history = History(
            history.times,
            np.hstack([history.values, still]),
            None if history.rate is None else np.append(history.rate, 0.0),
            None
            if wave is None
            else type(wave)(np.append(wave.amplitude, 0.0), wave.frequency, wave.phase, wave.start, wave.end),
        )
    return BlockMotion(block, history, unknowns)


def _shaking(table: BaseTable) -> History:
    history = history_of(table)
    return baseline_corrected(history, {"constant": 0, "linear": 1}[table.baseline]) if table.baseline else history


def _water(tables: SceneTables, blocks: Blocks) -> WaterTable | None:
    w = tables.loads.water
    if w is None:
        return None
    level = None if w.levels_m is None else History.table(given(w.level_times_s), w.levels_m)
    ground = ground_of(blocks) if w.follows_ground else None
    # γw = ρw g: before rock has its weight, it would float in water that has.
    ramp = tables.loads.gravity_ramp_s
    share = History(np.array([0.0, ramp]), np.array([[0.0], [1.0]])) if ramp > 0 else None
    return WaterTable(np.array(w.points), w.unit_weight_n_per_m3, level, w.dry_edges, ground, share)


def deepest_pond(tables: SceneTables, blocks: Blocks) -> tuple[Pond, float] | None:
    """The largest height of a scene's water table above the ground during the run, and its time, s; None if it never is
    above."""
    water = _water(tables, blocks)
    table = tables.loads.water
    if table is None or water is None or water.ground is not None:
        return None
    end, ground = tables.run.end_time_s, lowest_over(ground_of(blocks))
    times = {0.0, end, *(t for t in (table.level_times_s or ()) if 0.0 <= t <= end)}
    found = [(pond, time) for time in sorted(times) for pond in ponds(water.line_at(time), ground)]
    return max(found, key=lambda pair: pair[0].depth) if found else None


def pond_text(pond: Pond, time: float, origin: tuple[float, float]) -> str:
    """Description of a pond at ``time``."""
    return (
        f"ponded up to {pond.depth:.3g} m deep from x = {pond.start + origin[0]:.6g} to {pond.end + origin[0]:.6g} m "
        f"({time:g} s)"
    )


def bolts_of(check: Check, number: int, table: BoltTable) -> tuple[Bolt, ...]:
    """The bolts of one table; none, with an error, if an end is in no block. Raises ValueError for what `Bolt`
    refuses."""
    compression: dict[str, Any] = {} if table.compression is None else {"compression": table.compression}
    properties: dict[str, Any] = {
        "name": table.name,
        "pretension": table.pretension_n_per_m,
        "yield_force": math.inf if table.yield_force_n_per_m is None else table.yield_force_n_per_m,
        "breaking_strain": math.inf if table.breaking_strain is None else table.breaking_strain,
        "shear_stiffness": table.shear_stiffness_n_per_m,
        "shear_strength": math.inf if table.shear_strength_n_per_m is None else table.shear_strength_n_per_m,
        "installation": table.start_s,
        **compression,
    }
    if table.axial_stiffness_n is not None:
        try:
            return grouted_bolt(
                check.blocks, given(table.start), given(table.end), axial_stiffness=table.axial_stiffness_n,
                active_length=given(table.active_length_m), **properties,
            )  # fmt: skip
        except CrossesNoJoint as error:
            if not table.lines:
                raise
            # In a drawn row of bars some may miss the joints, which may be random.
            check.warn(("loads", "bolts", number), str(error), "it does nothing; a longer one might")
            return ()
    place = ("loads", "bolts", number)
    block = carrier(check, (*place, "start"), "the bolt's end", table.start, table.zone)
    other = GROUND
    if not table.end_in_ground:
        other = carrier(check, (*place, "end"), "the bolt's other end", table.end, table.end_zone)
    if block < 0 or (other < 0 and not table.end_in_ground):
        return ()
    return (Bolt(block, given(table.start), other, given(table.end), given(table.stiffness_n_per_m), **properties),)


def in_situ_of(tables: SceneTables) -> InSituStress | None:
    """The stress before the run; None when the scene has none."""
    t = tables.loads.in_situ
    if t is None:
        return None
    if t.stress_pa is None:
        return InSituStress.geostatic(
            given(t.surface_m), given(t.unit_weight_n_per_m3), given(t.k0), surcharge=t.surcharge_pa
        )
    gradient = np.stack([t.gradient_x_pa_per_m, t.gradient_y_pa_per_m], axis=1)
    return InSituStress(np.array(t.stress_pa), gradient, t.about)
