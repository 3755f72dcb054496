"""Fixed load steps compared with event stepping: loads and cost of the two-crack specimen up to coalescence.

Fixed steps detect an event at the end of the step in which it occurs, so that its load is accurate to one step. Event
stepping finds the load itself, for any longest step.
"""

from __future__ import annotations

import math
from pathlib import Path

from ...output.tables.summary import write_json
from ..figures import Measured, Point, stopwatch

#: Folder of the numbers, in the working folder.
FOLDER = Path("outputs/bench_steps")
SCENE = Path("pipelines/two_cracks/scene.toml")
VARIANT = "phi_0"
#: Methods in the picture; the load of an event is found to the relative accuracy `LEAST` (K of the tip then equals its
#: toughness to 1e-6).
FIXED_STEPS, EVENTS, LEAST = "fixed steps", "from event to event", 1e-6
#: Fixed steps, s (0.2 MPa each); longest steps of event stepping, s (None: limited by the motion of blocks only).
FIXED, LONGEST = (16.0, 8.0, 4.0, 2.0, 1.0), (None, 20.0, 5.0)


def of_run(overrides: list[str], repeats: int) -> dict:
    """Loads of the events (Pa), number of cycles and of solutions of cracked blocks, shortest time of ``repeats``
    (s)."""
    from ...pipeline import cycles
    from ...scene import load_scene

    scene = load_scene(SCENE, overrides, variant=VARIANT)
    seconds, seen = [], []
    for _ in range(repeats):
        spent_on = stopwatch()
        seen = list(cycles(scene))
        seconds.append(spent_on())
    first: dict[str, float] = {}
    for cycle in seen:
        for event in cycle.events:
            first.setdefault(event.kind, event.load)
    return {"cycles": len(seen), "solutions": seen[-1].work["solutions"], "seconds": min(seconds), "loads": first}


def measure(quick: bool = False) -> Measured:
    """The table; writes ``steps.json`` and ``work_precision.png`` to `FOLDER`. ``quick``: one fixed step, once."""
    from ...render.benchmarks.work_precision import draw

    if not SCENE.exists():
        return Measured.of(f"Load steps: {SCENE} is not below this folder")
    repeats = 1 if quick else 2
    events = 'run.stepping="events"'
    # Compilation and loading do not count: a run until some increments after the first growth precedes.
    of_run([events, "run.end_time_s=260"], 1)
    rows = {
        "events" if longest is None else f"events, at most {longest:g} s": of_run(
            [events] + ([] if longest is None else [f"run.longest_step_s={longest}"]), repeats
        )
        | {"step": longest or math.nan}
        for longest in (LONGEST[:1] if quick else LONGEST)
    }
    rows |= {
        f"fixed, {dt:g} s": of_run(['run.stepping="fixed"', f"dda.time_step_s={dt}"], repeats) | {"step": dt}
        for dt in (FIXED[:1] if quick else FIXED)
    }
    FOLDER.mkdir(parents=True, exist_ok=True)
    write_json(FOLDER / "steps.json", {"rows": rows, "quick": quick})
    exact = rows["events"]["loads"]
    lines = [
        f"Load steps, two-crack specimen {VARIANT} to coalescence, warm; a second is 0.2 MPa",
        f"{'steps':<22}{'cycles':>8}{'solutions':>11}{'s':>8}"
        + "".join(f"{kind + ' MPa':>18}{'off':>10}" for kind in ("initiation", "coalescence")),
    ]
    errors, points = {}, []
    for name, row in rows.items():
        text = f"{name:<22}{row['cycles']:8d}{row['solutions']:11d}{row['seconds']:8.2f}"
        for kind in ("initiation", "coalescence"):
            off = row["loads"][kind] / exact[kind] - 1
            text += f"{row['loads'][kind] / 1e6:18.4f}" + (f"{off:10.1e}" if name != "events" else " " * 10)
            method = FIXED_STEPS if name.startswith("fixed") else EVENTS
            points.append(Point(f"load of {kind}", method, row["step"], max(abs(off), LEAST), row["seconds"]))
            if method == FIXED_STEPS:
                errors[f"{kind}, {name}"] = abs(off)
        lines.append(text.rstrip())
    if not quick:
        draw(
            points, (FIXED_STEPS, EVENTS), FOLDER / "work_precision.png", (1, 3), lambda p: f"{p.size:g} s",
            ("error of the load against that of the longest steps to events, better to the right", "the whole run, ms"),
            None,
        )  # fmt: skip
    return Measured.of("\n".join(lines), errors=errors, times={name: row["seconds"] for name, row in rows.items()})
