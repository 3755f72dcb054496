"""``geomech safety``: the factor of safety by strength reduction."""

from __future__ import annotations

import argparse
from pathlib import Path

from .scenes import scene_arguments, scenes_asked
from .telling import say, say_warnings
from .verb import DONE, BadInput, Verbs, add_verb


def declare(verbs: Verbs) -> None:
    safety = add_verb(
        verbs, "safety", _safety, "find by what factor the strength of joints may be divided before the blocks go",
        "geomech safety slope.toml\ngeomech safety slope.toml --reduce bedding --tolerance 1e-3 --out safety.json",
    )  # fmt: skip
    safety.description += (
        " tan φ, cohesion and tensile strength of the joints are divided by F until no static equilibrium is left; "
        "cracks inside blocks are left out."
    )
    scene_arguments(safety)
    safety.add_argument(
        "--reduce", action="append", metavar="JOINT", help="weaken this joint only (may be repeated; default: all)"
    )
    safety.add_argument(
        "--tolerance", type=float, default=2e-3, metavar="X", help="relative width of the bracket (2e-3)"
    )
    safety.add_argument("--at", type=float, metavar="S", help="time whose loads act, s (default: the scene's end)")
    safety.add_argument(
        "--out", type=Path, metavar="FILE", help="write the trials and the answer to a JSON file as well"
    )
    safety.add_argument("--quiet", action="store_true", help="say nothing of the trials while they are made")


def _safety(options: argparse.Namespace) -> int:
    from ..dda import NothingToReduce
    from ..output.summary import write_json
    from ..pipeline import factor_of_safety
    from ..scene import load_scene

    scenes = scenes_asked(load_scene(options.scene, options.overrides, None), options)
    say_warnings(scenes.values())
    told = {}
    for name, scene in scenes.items():
        problem = scene.problem()
        if problem.cracks.n_cracks:
            say("warning: cracks inside blocks are left out")

        def tell(trial) -> None:
            say(f"  F = {trial.factor:.4f}: {trial.reason}")

        try:
            found = factor_of_safety(
                scene, options.at, reduce=options.reduce, tolerance=options.tolerance,
                watch=None if options.quiet else tell,
            )  # fmt: skip
        except NothingToReduce as error:
            raise BadInput(str(error)) from error
        print(f"{problem.title or options.scene}" + (f", {name}" if name else "") + f"\n{found.table()}", flush=True)
        told[name or "scene"] = found.as_dict(problem.blocks)
    if options.out:
        write_json(options.out, told)
    return DONE
