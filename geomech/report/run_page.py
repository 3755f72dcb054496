"""Page of one run: input, results, pictures, curves, events, computing time, and how to reproduce it."""

from __future__ import annotations

import re
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..output.console.progress import NO_ANSWER
from ..output.reading import Run
from ..output.units import largest_of, length_text, length_unit, stress_text, stress_unit
from ..player.page import records_of
from .energy_tables import add_energy
from .page import Page, written

#: A record of the log, which may extend over several lines, up to the next.
_RECORD = re.compile(r"^\d{4}-\d\d-\d\d \S+ (\w+) +[\w.]+: (.*?)(?=^\d{4}-\d\d-\d\d |\Z)", re.MULTILINE | re.DOTALL)

#: Number of listed events or tips; the CSV files hold all.
LISTED = 40
#: Displayed material keys → header, factor.
_MATERIAL = {
    "youngs_modulus_pa": ("E, GPa", 1e-9),
    "poissons_ratio": ("ν", 1.0),
    "density_kg_m3": ("density, kg/m³", 1.0),
    "k_ic_pa_sqrt_m": ("K_Ic, MPa√m", 1e-6),
    "k_iic_pa_sqrt_m": ("K_IIc, MPa√m", 1e-6),
    "tensile_strength_pa": ("tensile strength, MPa", 1e-6),
}
_JOINT = {
    "friction_angle_deg": ("friction, °", 1.0),
    "cohesion_pa": ("cohesion, MPa", 1e-6),
    "tensile_strength_pa": ("tensile strength, MPa", 1e-6),
}


def page_of_run(run: Run, play: bool = True) -> Page:
    """Page of ``run``, whose pictures and curves are drawn for it; with ``play`` it includes a player."""
    summary = run.summary
    page = Page(run.title, f"{_ended(summary)} · run folder {run.folder}")
    page.facts(key_results(run))
    add_warnings(page, run)
    if play:
        add_player(page, [run])
    page.section("Input")
    add_scene(page, run)
    add_pictures(page, run)
    add_curves(page, run)
    _add_events(page, run)
    _add_tips(page, run)
    _add_blocks(page, summary)
    add_time(page, summary)
    page.section("How to reproduce it")
    add_remaking(page, run)
    return page


def add_player(page: Page, runs: Sequence[Run]) -> None:
    """Player of the cycles of ``runs`` that have been drawn."""
    records = records_of(runs)
    if not records:
        return
    page.section("The run, cycle by cycle" if len(runs) == 1 else "The runs, side by side")
    page.play(records)
    thinned = [f"{r['name']} {len(r['frames'])} of {r['of']}" for r in records if len(r["frames"]) < r["of"]]
    notes = [f"Cycles that the page holds: {', '.join(thinned)}."] if thinned else []
    if len(runs) > len(records):
        notes.append(
            f"{len(records)} of {len(runs)} runs are shown here; `geomech report RUN RUN` shows the named ones."
        )
    page.text(*notes)


def key_results(run: Run) -> dict[str, Any]:
    """Results of a run in a few numbers; missing ones are left out."""
    summary = run.summary
    first = summary.get("first", {})

    def at(kind: str) -> str | None:
        event = first.get(kind)
        if event is None:
            return None
        if event.get("load_pa") is None or not run.led:
            return f"{written(event['time_s'])} s"
        relative = event.get("load_normalised")
        return stress_text(event["load_pa"]) + (f" ({relative:.3f})" if relative else "")

    def scaled(name: str, factor: float, digits: str) -> str | None:
        value = summary.get(name)
        return None if value is None else f"{factor * value:{digits}}"

    facts: dict[str, Any] = {"how it ended": summary.get("end", "not ended")}
    facts["but"] = summary.get("not_reached")
    facts |= {f"first {kind}": at(kind) for kind in first}
    if run.led:
        peak = summary.get("peak_load_pa")
        facts["peak load"] = None if peak is None else stress_text(peak)
        facts["strain at the end, 10⁻³"] = scaled("last_strain", 1e3, ".3f")
    if summary.get("cracks"):
        grown = summary.get("crack_growth_m")
        facts["crack growth"] = None if grown is None else length_text(grown)
    facts["blocks"] = summary.get("blocks")
    facts["cycles"] = summary.get("cycles")
    facts["time simulated, s"] = summary.get("time_s")
    facts["blocks at the end"] = summary.get("motion", {}).get("condition") or None
    facts["mind"] = NO_ANSWER if "mechanism" in first else None
    facts["computed in, s"] = scaled("wall_s", 1.0, ".1f")
    return facts


def _ended(summary: Mapping[str, Any]) -> str:
    return f"Ended: {summary['end']}" if "end" in summary else "Still running, or stopped without a summary"


def add_warnings(page: Page, run: Run) -> None:
    """Warnings and errors in the run's log."""
    path = run.folder / "run.log"
    text = path.read_text(encoding="utf-8", errors="replace") if path.is_file() else ""
    lines = [" ".join(words.split()) for level, words in _RECORD.findall(text) if level in ("WARNING", "ERROR")]
    if not lines:
        return
    page.section("Warnings")
    for words in list(dict.fromkeys(lines))[:LISTED]:
        page.warning(words)
    if run.summary.get("error"):
        page.warning(str(run.summary["error"]))


def add_scene(page: Page, run: Run) -> None:
    """The scene in a few tables, and in full in a folded section."""
    scene = run.scene
    if not scene:
        page.text("The run was not made from a scene file.")
        return
    geometry = scene.get("geometry", {})
    parts = []
    if geometry.get("model"):
        given = ", ".join(f"{name} {written(value)}" for name, value in geometry.get("parameters", {}).items())
        parts.append(f"Geometry: {Path(geometry['model']).name}" + (f" with {given}." if given else "."))
    counts = {name: len(geometry.get(name) or ()) for name in ("zones", "cracks", "joints", "joint_sets")}
    drawn = ", ".join(f"{count} {name.replace('_', ' ')}" for name, count in counts.items() if count)
    parts += [f"Drawn in the scene: {drawn}."] if drawn else []
    page.text(*parts)
    for name, keys, caption in (("materials", _MATERIAL, "Materials"), ("joints", _JOINT, "Joints")):
        rows = scene.get(name, {})
        shown = [key for key in keys if any(isinstance(row.get(key), (int, float)) for row in rows.values())]
        if rows and shown:
            page.table(
                ["", *(keys[key][0] for key in shown)],
                [
                    [called, *(_times(row.get(key), keys[key][1]) for key in shown)]
                    for called, row in rows.items()
                ],
                caption,
            )  # fmt: skip
    page.folded("The complete scene", (run.folder / "scene.toml").read_text(encoding="utf-8"))


def _times(value: Any, factor: float) -> float | None:
    return float(value) * factor if isinstance(value, (int, float)) else None


def add_pictures(page: Page, run: Run) -> None:
    """The run's stages."""
    from ..render.pictures.stages import stages

    with tempfile.TemporaryDirectory() as folder:
        shown = stages(run, Path(folder))
        if not shown:
            return
        page.section("Pictures")
        page.figures([(path, f"{lines[0].upper()}{lines[1:]}: {_moment(run, cycle)}") for path, lines, cycle in shown])


def _moment(run: Run, cycle: int) -> str:
    row = run.at(cycle)
    load = f"{stress_text(row['load'])}, " if np.isfinite(row["load"]) and row["load"] else ""
    return f"{load}t = {written(float(row['time']))} s, cycle {written(cycle)}"


#: File of a curve → caption.
_CURVES = {
    "stress_strain": "Load and axial strain.",
    "stress_intensity": "K_I (full) and K_II (dashed) of the tips.",
    "crack_length": "Length of all cracks.",
    "energy": "Use of the work done.",
    "monitors": "Displacements of the monitored points.",
    "joints": "Mean slip of the joints with the largest slip.",
    "bolts": "Largest bolt forces.",
}


def add_curves(page: Page, run: Run) -> None:
    """The run's curves, as vector graphics."""
    from ..render.curves.plots import plots

    if not len(run.history):
        return
    with tempfile.TemporaryDirectory() as folder:
        drawn = plots(run, Path(folder), suffix=".svg", more=True)
        if drawn:
            page.section("Curves")
            page.figures([(path, _CURVES[path.stem]) for path in drawn], least_rem=24)


def _add_events(page: Page, run: Run) -> None:
    if not len(run.events):
        return
    page.section("Events")
    load, pascals = stress_unit(largest_of(run.events["load"]))
    length, metres = _unit_of_places(run)
    led = [f"load, {load}"] if run.led else []
    rows = [
        [str(e["kind"]), int(e["cycle"]), float(e["time"]), *([float(e["load"]) / pascals] if led else [])]
        + [*(float(e[x]) / metres for x in "xy"), str(e["detail"])]
        for e in run.events[:LISTED]
    ]
    page.table(["event", "cycle", "time, s", *led, f"x, {length}", f"y, {length}", "what"], rows)
    if len(run.events) > LISTED:
        page.text(f"{len(run.events) - LISTED} more in events.csv.")


def _unit_of_places(run: Run) -> tuple[str, float]:
    """(name, m) of the unit for coordinates of events and tips."""
    return length_unit(max(largest_of(rows[x]) for rows in (run.events, run.tips) if len(rows) for x in "xy"))


def _add_tips(page: Page, run: Run) -> None:
    tips = run.tips
    if not len(tips):
        return
    names = run.summary.get("cracks", [])
    length, metres = _unit_of_places(run)
    page.section("Crack tips")
    for title, cycle in (("In the first step", tips["cycle"][0]), ("At the end", tips["cycle"][-1])):
        own = tips[tips["cycle"] == cycle][:LISTED]
        page.table(
            [
                "crack",
                "end",
                f"x, {length}",
                f"y, {length}",
                "K_I, MPa√m",
                "K_II, MPa√m",
                "K_eq, MPa√m",
                "would turn, °",
            ],
            [
                [
                    names[int(t["crack"])] if t["crack"] < len(names) else str(int(t["crack"])),
                    ("start", "end")[int(t["end"])],
                    *(float(t[name]) / metres for name in "xy"),
                    *(float(t[name]) / 1e6 for name in ("K_I", "K_II", "K_eq")),
                    float(t["angle_deg"]),
                ]
                for t in own
            ],
            f"{title}: {_moment(run, int(cycle))}",
        )


def _add_blocks(page: Page, summary: Mapping[str, Any]) -> None:
    key_blocks, energy = summary.get("key_blocks"), summary.get("energy")
    if not key_blocks and not energy:
        return
    page.section("Blocks and energy")
    if key_blocks:
        page.table(
            ["block", "moved, m", "speed, m/s", "block theory", "towards, °", "factor of safety"],
            [
                [row["block"], row["displacement_m"], row["speed_m_s"], row["class"]]
                + [row.get("direction_deg"), row.get("factor_of_safety")]
                for row in key_blocks
            ],
            "The blocks that have moved farthest",
        )
    if energy:
        add_energy(page, energy)


def add_time(page: Page, summary: Mapping[str, Any]) -> None:
    """Computing time by phase."""
    seconds = summary.get("seconds")
    if not seconds:
        return
    page.section("Computing time")
    spent = dict(sorted(seconds.items(), key=lambda pair: -pair[1]))
    rest = summary.get("wall_s", 0.0) - sum(spent.values())
    page.bars(["phase", "s"], spent | ({"the rest": rest} if rest > 0 else {}))
    work = summary.get("crack_solver")
    if work:
        page.table(
            ["operations of the crack solver", "times"], [[name.replace("_", " "), n] for name, n in work.items()]
        )
    skipped = summary.get("skipped")
    if skipped:
        rows = [[entry.get("what", name), entry["count"], entry.get("saved_s")] for name, entry in skipped.items()]
        page.table(["skipped work", "times", "saved, s"], rows)


def add_remaking(page: Page, run: Run) -> None:
    """Commands that reproduce the run and this page, and the versions used."""
    kept = run.folder / "scene.toml"
    again = f"geomech run {kept} --out {run.folder}_again\n" if kept.is_file() else ""
    page.code(f"{again}geomech report {run.folder}")
    versions = run.summary.get("versions", {})
    if versions:
        page.text("Made with " + ", ".join(f"{name} {found}" for name, found in versions.items()) + ".")
