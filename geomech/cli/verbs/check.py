"""``geomech check``: all errors of a scene at once, or its content."""

from __future__ import annotations

import argparse

from ..messages import say_warnings
from ..scenes import scene_arguments, scenes_asked
from ..verb import DONE, Verbs, add_verb


def declare(verbs: Verbs) -> None:
    """The verb's arguments."""
    check = add_verb(
        verbs, "check", _check, "read a scene, build its geometry and report all its errors",
        "geomech check pipelines/two_cracks\ngeomech check scene.toml --set growth.criterion=g",
    )  # fmt: skip
    scene_arguments(check)
    check.add_argument("--keys", action="store_true", help="list all keys of a scene with their meaning")


def _check(options: argparse.Namespace) -> int:
    from ...coupling.crack_cost import cost_lines, crack_cost
    from ...coupling.run_cost import run_line
    from ...model import counted
    from ...model.loads.wave_limits import wave_lines
    from ...scene import load_scene

    first = load_scene(options.scene, options.overrides, None)
    if options.keys:
        print(first.describe_keys())
        return DONE
    scenes = scenes_asked(first, options)
    say_warnings(scenes.values())
    for scene in scenes.values():
        problem = scene.problem()
        tips = f" with {counted(len(problem.cracks.tips), 'tip')}" if problem.cracks.n_cracks else ""
        print("\n".join([f"{problem.title}: {problem.inventory}{tips}: no errors", *scene.overview()]))
        cost = crack_cost(problem)
        about = (
            ("elements", cost_lines(problem, cost)),
            ("waves", wave_lines(problem)),
            ("time", [run_line(problem, cost)]),
        )
        for label, lines in about:
            for k, line in enumerate(lines):
                print(f"  {label if k == 0 else '':<9} {line}")
    if first.variants and not options.variants:
        print(f"variants: {', '.join(first.variants)}")
    return DONE
