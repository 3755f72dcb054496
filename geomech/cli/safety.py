"""``geomech safety``: the factor of safety by strength reduction."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from .scenes import scene_arguments, scenes_asked
from .telling import say, say_warnings, tell_compiling
from .verb import DONE, BadInput, Verbs, add_verb, check_writable


def declare(verbs: Verbs) -> None:
    safety = add_verb(
        verbs, "safety", _safety, "find by what factor the strength of joints may be divided before the blocks go",
        "geomech safety slope.toml\ngeomech safety slope.toml --reduce bedding --tolerance 1e-3 --out safety.json",
    )  # fmt: skip
    safety.description += (
        " tan φ, cohesion and tensile strength of the joints are divided by F until no static equilibrium is left. "
        "Blocks are whole: where cracks lead into blocks that can move, what rock bridges hold would count as if it "
        "could not break, and no factor is given unless it is asked for --without-cracks."
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
        "--without-cracks", action="store_true",
        help="leave cracks inside blocks out, as if rock bridges never broke: the factor is then a bound from above",
    )  # fmt: skip
    safety.add_argument(
        "--out", type=Path, metavar="FILE", help="write the trials and the answer to a JSON file as well"
    )
    safety.add_argument("--quiet", action="store_true", help="say nothing of the trials while they are made")


def _safety(options: argparse.Namespace) -> int:
    check_writable("--out", options.out)
    from ..dda import NothingToReduce
    from ..output.summary import write_json
    from ..pipeline import CracksInBlocks, cracked_and_free, factor_of_safety
    from ..scene import load_scene

    if not options.quiet:
        tell_compiling()
    scenes = scenes_asked(load_scene(options.scene, options.overrides, None), options)
    say_warnings(scenes.values())
    told = {}
    for name, scene in scenes.items():
        problem = scene.problem()
        left_out = cracked_and_free(problem)

        def tell(trial) -> None:
            say(f"  F = {trial.factor:.4f}: {trial.reason}")

        try:
            found = factor_of_safety(
                scene, options.at, reduce=options.reduce, tolerance=options.tolerance,
                watch=None if options.quiet else tell, without_cracks=options.without_cracks,
            )  # fmt: skip
        except CracksInBlocks as error:
            raise BadInput(f"{error}; --without-cracks gives a bound from above") from error
        except NothingToReduce as error:
            raise BadInput(str(error)) from error
        title = "factor of the blocks without their cracks" if left_out else "factor of safety"
        print(f"{problem.title or options.scene}" + (f", {name}" if name else "") + f"\n{found.table(title)}")
        answer = told[name or "scene"] = found.as_dict(problem.blocks)
        if left_out:
            print(f"  {_caution(left_out)}")
            answer["factor_without_cracks"], answer["factor_of_safety"] = answer["factor_of_safety"], None
            answer["cracks_left_out"], answer["caution"] = left_out, _caution(left_out)
        sys.stdout.flush()
    if options.out:
        options.out.parent.mkdir(parents=True, exist_ok=True)
        write_json(options.out, told)
    return DONE


def _caution(left_out: list[str]) -> str:
    from ..model import counted

    return (
        f"not the factor of safety but a bound from above: {counted(len(left_out), 'crack')} left out, "
        "what rock bridges hold taken as unbreakable"
    )
