"""Cost of the coupling relative to the blocks: a wall of 1 000 bricks of which 100 have a crack, and a specimen up to
coalescence.

The wall is loaded by its weight at once, in steps of 10 ms, and its rock is too tough for growth. Every step takes as
many passes as the strain of the cracks needs to converge, one if they are open; a pass is a step of the blocks and a
solution of every cracked brick. Bricks whose cracks cannot grow are skipped after some steps, unless all tips are
requested, as for a table of all tips: the table has both. `pass_tolerance` gives time against error by the number of
passes.
"""

from __future__ import annotations

import os
import statistics
from dataclasses import asdict
from pathlib import Path

from ...output.tables.summary import write_json
from ..accuracy import pass_tolerance
from ..figures import Measured, stopwatch
from . import block_scenes

#: Folder of the numbers, in the working folder.
FOLDER = Path("outputs/bench_coupling")
SPECIMEN = Path("pipelines/two_cracks/scene.toml")
#: Goals on two cores: the coupling's share of a step relative to the blocks; seconds of the specimen, warm.
RATIO, SECONDS = 1.0, 2.0
#: Phases of a run that belong to the blocks.
BLOCKS = "dda"


def of_wall(n: int, n_cracked: int, steps: int) -> dict:
    """Medians over the passes of ``steps`` load steps with skipped bricks, and of earlier ones except the first:
    seconds of the blocks and of the coupling."""
    from ...coupling import cycles
    from ...coupling.crack_compliance.growth_screening import STOOD

    problem = block_scenes.cracked_wall(n, n_cracked)
    before: dict[str, float] = {}
    blocks, coupling, solved, passes, left_out, cycle = [], [], [], [], 0, None
    for cycle in cycles(problem):
        spent = {phase: seconds - before.get(phase, 0.0) for phase, seconds in cycle.seconds.items()}
        before = cycle.seconds
        # Bodies, patterns and unit loads, which a scene computes once, are in the first step; bounds are in the last of
        # those that bricks have to be stable in.
        if cycle.load_step > 1 and cycle.load_step != STOOD:
            count = int(cycle.statistics["compliance_passes"])
            passes.append(count)
            blocks.append(spent[BLOCKS] / count)
            added = sum(seconds for phase, seconds in spent.items() if phase != BLOCKS) / count
            (coupling if cycle.work["solutions_left_out"] > left_out else solved).append(added)
        left_out = cycle.work.get("solutions_left_out", 0)
        if cycle.load_step >= steps + STOOD:
            break
    own, added, full = (statistics.median(each) for each in (blocks, coupling, solved))
    return {
        "blocks": problem.blocks.n_blocks,
        "cracked": n_cracked,
        "steps": len(coupling),
        "passes": statistics.mean(passes),
        "blocks_s": own,
        "coupling_s": added,
        "solved_s": full,
        "ratio": added / own,
        "solved_ratio": full / own,
        "first_assembly_s": before.get("ddm assembly", 0.0),
        "work": cycle.work,
    }


def of_specimen(repeats: int) -> dict:
    """The two-crack specimen to the end of its scene, after a warm-up run; the shortest of ``repeats``, s."""
    from ...pipeline import cycles

    seconds, seen = [], []
    for _ in range(repeats + 1):
        spent_on = stopwatch()
        seen = list(cycles(SPECIMEN))
        seconds.append(spent_on())
    phases = {phase: round(spent, 3) for phase, spent in seen[-1].seconds.items()}
    return {"cycles": len(seen), "seconds": min(seconds[1:]), "phases": phases, "work": seen[-1].work}


def measure(quick: bool = False) -> Measured:
    """The table; writes ``coupling.json`` and ``work_precision.png`` to `FOLDER`.

    ``quick``: 200 bricks with 20 cracked, few steps, no specimen.
    """
    from ...coupling.load_pass import COMPLIANCE_TOLERANCE
    from ...render.benchmarks.work_precision import draw

    walls = [of_wall(200, 20, 3)] if quick else [of_wall(200, 20, 10), of_wall(1000, 100, 10), of_wall(1000, 10, 10)]
    specimen = None if quick or not SPECIMEN.exists() else of_specimen(2)
    FOLDER.mkdir(parents=True, exist_ok=True)
    points = pass_tolerance.points()
    written = {
        "walls": walls, "specimen": specimen, "tolerances": [asdict(p) for p in points], "quick": quick,
        "processors": os.cpu_count(),
    }  # fmt: skip
    write_json(FOLDER / "coupling.json", written)
    if not quick:
        draw(
            points, pass_tolerance.METHODS, FOLDER / "work_precision.png", (1, 2), lambda p: f"{p.size:g}",
            ("error of a stress intensity factor, better to the right", "steps, ms"), None,
        )  # fmt: skip
    lines = [
        "Cost of the coupling relative to that of the blocks, per pass without growth (medians)",
        (
            f"{'blocks':>8}{'cracked':>9}{'passes':>8}{'blocks ms':>11}{'coupling ms':>13}{'ratio':>8}"
            f"{'all solved ms':>15}{'ratio':>8}   goal < {RATIO:g}"
        ),
    ]
    lines += [
        f"{w['blocks']:8d}{w['cracked']:9d}{w['passes']:8.1f}{1e3 * w['blocks_s']:11.1f}{1e3 * w['coupling_s']:13.1f}"
        f"{w['ratio']:8.2f}{1e3 * w['solved_s']:15.1f}{w['solved_ratio']:8.2f}"
        for w in walls
    ]
    if specimen is not None:
        lines.append(
            f"Two-crack specimen to its end, warm: {specimen['seconds']:.2f} s in {specimen['cycles']} cycles "
            f"(goal {SECONDS:g} s)"
        )
    lines += [
        "",
        (
            f"{pass_tolerance.PROBLEM} (default {COMPLIANCE_TOLERANCE:g}): error of K against "
            f"{pass_tolerance.EXACT:g}, and time"
        ),
    ]
    lines += [f"  {p.size:>8g}{p.passes:6d} passes   {p.error:8.1e}   {1e3 * p.seconds:8.1f} ms" for p in points]
    times = {
        f"{w['blocks']} blocks, {w['cracked']} cracked: {part} a pass": w[f"{part}_s"]
        for w in walls
        for part in ("blocks", "coupling", "solved")
    }
    errors = pass_tolerance.by_name(points)
    times |= {"specimen": specimen["seconds"]} if specimen else {}
    return Measured.of("\n".join(lines), errors=errors, times=times)
