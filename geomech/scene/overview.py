"""Summary of a scene in a few lines, so that users can check that it is the intended one."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable

import numpy as np

from ..model import Blocks, Cracks, History, counted
from .assembly.fixed_blocks import holds
from .assembly.load_functions import deepest_pond, force_history, pond_text, traction_history
from .checks.cross_checks import material_of
from .drawing import Drawing
from .tables import SceneTables
from .tables.entries import given
from .tables.loads import FluidTable, RemoteTable
from .unbounded_rock import rising_history

#: Longer lists are cut after this many lines.
SHOWN = 8


def overview(tables: SceneTables, drawing: Drawing) -> list[str]:
    """Size, zones, materials, cracks, loads and time of a scene, one line each."""
    blocks, cracks = drawing.assembled()
    rows = [("size", _box(blocks.vertices) + f", {counted(len(set(drawing.zones)), 'zone')}")]
    rows += _cut("zones", _zones(tables, drawing))
    guided = [name for name in blocks.edge_names if holds(name)]
    if guided:
        edges = np.concatenate([blocks.edges_named(name) for name in guided])
        count = counted(len(np.unique(blocks.vertex_block[edges])), "block")
        rows.append(("constrained", f"{count} by edges called {', '.join(map(repr, guided))}"))
    rows += _cut("materials", _materials(tables))
    rows += _cut("cracks", _cracks(cracks))
    rows += _cut("loads", _loads(tables, drawing))
    stops = f" or the first of {', '.join(tables.run.stop_at)}" if tables.run.stop_at else ""
    rows.append(("run", f"to {tables.run.end_time_s:g} s{stops}, {_steps(tables)}"))
    # A label precedes the first of its lines.
    labels = [label if k == 0 or rows[k - 1][0] != label else "" for k, (label, _) in enumerate(rows)]
    return [f"  {label:<9} {text}" for label, (_, text) in zip(labels, rows)]


def _steps(tables: SceneTables) -> str:
    run = tables.run
    if run.stepping == "fixed":
        return f"in steps of at most {tables.dda.time_step_s:g} s"
    most = "" if run.longest_step_s is None else f", at most {run.longest_step_s:g} s long"
    follows = ", the load following the cracks" if run.control == "toughness" else ""
    return f"in steps from event to event{most}{follows}"


def _cut(label: str, texts: Iterable[str]) -> list[tuple[str, str]]:
    texts = list(texts)
    left = len(texts) - SHOWN
    shown = texts if left <= 1 else [*texts[:SHOWN], f"… and {left} more"]
    return [(label, text) for text in shown]


def _box(points: np.ndarray) -> str:
    width, height = np.ptp(points, axis=0)
    return f"{width:.4g} × {height:.4g} m"


def _zones(tables: SceneTables, drawing: Drawing) -> list[str]:
    blocks, _ = drawing.assembled()
    lines = []
    for name, count in Counter(drawing.zones).items():
        own = np.isin(blocks.vertex_block, [b for b, zone in enumerate(drawing.zones) if zone == name])
        entry = tables.zones.get(name)
        text = f"{name}: {_box(blocks.vertices[own])}, {material_of(tables, name)}"
        text += f", {count} blocks" if count > 1 else ""
        if entry is not None and (entry.fixed or entry.guided):
            text += ", fixed" if entry.fixed else f", guided along {entry.guided}"
        if entry is not None and entry.order != 1:
            text += f", order {entry.order}"
        if entry is not None and entry.velocity_m_s is not None:
            text += f", at ({entry.velocity_m_s[0]:g}, {entry.velocity_m_s[1]:g}) m/s initially"
        if entry is not None and entry.body != "block":
            text += f", a piece of the {'infinite ' if entry.body == 'plane' else ''}{entry.body}"
        lines.append(text)
    return lines


def _materials(tables: SceneTables) -> list[str]:
    lines = []
    for name, m in tables.materials.items():
        text = f"{name}: E {_scaled(m.youngs_modulus_pa, 'Pa')}, ν {m.poissons_ratio:g}"
        if m.k_ic_pa_sqrt_m is not None:
            text += f", K_Ic {_scaled(m.k_ic_pa_sqrt_m, 'Pa√m')}"
        lines.append(text)
    return lines


def _cracks(cracks: Cracks) -> list[str]:
    lines, tips = [], set(cracks.tips.tolist())
    for k, name in enumerate(cracks.names):
        own = np.flatnonzero(cracks.crack == k)
        nodes, times = np.unique(cracks.segments[own], return_counts=True)
        ends = nodes[times == 1]
        daylight = int(cracks.surface[ends].sum())
        text = f"{name}: {_length(float(cracks.lengths[own].sum()))}, "
        text += counted(sum(end in tips for end in ends.tolist()), "tip")
        text += {0: "", 1: ", one end daylights"}.get(daylight, ", both ends daylight")
        lines.append(text)
    return lines


def _loads(tables: SceneTables, drawing: Drawing) -> list[str]:
    end, lines, (blocks, _) = tables.run.end_time_s, [], drawing.assembled()
    for traction in tables.loads.tractions:
        history = traction_history(traction)
        lines.append(f"{traction.edge}: " + _course(history, end, "Pa", _sense(blocks, traction.edge, history.at(end))))
    for force in tables.loads.forces:
        x, y = given(force.at)
        lines.append(f"force at ({x:g}, {y:g}): " + _course(force_history(force), end, "N/m", ""))
    if any(tables.loads.gravity_m_s2):
        x, y = tables.loads.gravity_m_s2
        lines.append(f"gravity ({x:g}, {y:g}) m/s²")
    for remote in tables.loads.remote:
        lines.append("far away, [xx, yy, xy]: " + _rising(remote, end))
    for fluid in tables.loads.fluids:
        where = " and ".join(fluid.fills)
        where += f" ({', '.join(fluid.cracks)})" if fluid.cracks else ""
        lines.append(f"fluid in {where}: " + _rising(fluid, end))
    for text, count in (
        ("motions of blocks", len(tables.loads.motions)),
        ("motions of points", len(tables.loads.point_motions)),
        ("bolts", len(tables.loads.bolts)),
        ("excavations", len(tables.loads.excavations)),
    ):
        lines += [f"{text}: {count}"] if count else []
    if tables.loads.water is not None:
        text = f"water table over {counted(len(given(tables.loads.water.points)), 'point')}"
        pond = deepest_pond(tables, blocks)
        text += ", following the ground" if tables.loads.water.follows_ground else ""
        lines.append(text if pond is None else f"{text}, {pond_text(*pond, drawing.origin)}")
    if tables.loads.base is not None:
        lines.append(f"shaking, seen from the {tables.loads.base.frame}")
    if tables.loads.in_situ is not None:
        lines.append("in-situ stress")
    return lines or ["none"]


def _rising(table: RemoteTable | FluidTable, end: float) -> str:
    value = ", ".join(_scaled(part, "Pa") for part in rising_history(table).at(end).tolist())
    return value if table.value_pa is not None else f"{value} at {end:g} s"


def _course(history: History, end: float, unit: str, sense: str) -> str:
    """Magnitude and history of a load, and its direction unless given by ``sense``."""
    value = history.at(end)
    size, direction = float(np.hypot(*value)), sense or f"along ({value[0]:.3g}, {value[1]:.3g})"
    if size == 0.0:
        return f"nothing at {end:g} s"
    if history.rate is not None:
        rate = float(np.hypot(*history.rate))
        return f"{direction}, {_scaled(rate, unit)}/s to {_scaled(size, unit)} at {end:g} s"
    return f"{direction}, {_scaled(size, unit)}" + ("" if len(history.times) == 1 else f" at {end:g} s")


def _sense(blocks: Blocks, edge_name: str, traction: np.ndarray) -> str:
    """Whether a traction is compressive, tensile or shear; empty if it varies."""
    edges = blocks.edges_named(edge_name)
    along = blocks.vertices[blocks.next_vertex[edges]] - blocks.vertices[edges]
    size = np.hypot(*traction)
    if not len(edges) or size == 0.0:
        return ""
    # Outlines run counter-clockwise, so that the outward normal is to the right.
    normal = (along[:, 1] * traction[0] - along[:, 0] * traction[1]) / (np.hypot(*along.T) * size)
    for sense, fits in (
        ("compression", normal < -0.999), ("tension", normal > 0.999), ("shear", np.abs(normal) < 1e-3)
    ):  # fmt: skip
        if fits.all():
            return sense
    return ""


def _length(length: float) -> str:
    return f"{length:.4g} m" if length >= 1 else f"{1e3 * length:.4g} mm"


def _scaled(value: float, unit: str) -> str:
    """``value`` with the prefix of ``unit`` that leaves one to three digits before the point."""
    for factor, prefix in ((1e9, "G"), (1e6, "M"), (1e3, "k")):
        if abs(value) >= factor:
            return f"{value / factor:.4g} {prefix}{unit}"
    return f"{value:.4g} {unit}"
