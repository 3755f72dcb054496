"""``geomech safety``: factor of safety by strength reduction."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from ..messages import report_compiling, say, say_warnings
from ..scenes import scene_arguments, scenes_asked
from ..verb import DONE, BadInput, Verbs, add_verb, check_writable


def declare(verbs: Verbs) -> None:
    """The verb's arguments."""
    safety = add_verb(
        verbs, "safety", _safety, "find the factor by which the strength of joints can be divided before the blocks fail",
        "geomech safety slope.toml\n"
        "geomech safety slope.toml --along bedding fault --json safety.json --picture mechanism.png\n"
        "geomech safety slope.toml --divide cohesion=1.25 friction=1.25 tension=1.0",
    )  # fmt: skip
    safety.description = (safety.description or "") + (
        " tan φ, cohesion and tensile strength of the joints are divided by F until no static equilibrium is left. "
        "Blocks are intact: where cracks end in blocks that can move, rock bridges would count as unbreakable, and a "
        "factor is given only with --without-cracks."
    )
    scene_arguments(safety)
    safety.add_argument(
        "--along", "--reduce", nargs="+", action="extend", metavar="JOINT",
        help="weaken these joints only: laws of [joints], or joints as they are drawn (default: all)",
    )  # fmt: skip
    safety.add_argument(
        "--divide", nargs="+", action="extend", metavar="STRENGTH=X",
        help="partial factors of a design code on cohesion, friction (tan φ) and tension (tensile strength) of all "
             "joints, such as cohesion=1.25: applied first, the factor is in addition to them",
    )  # fmt: skip
    safety.add_argument(
        "--tolerance", type=float, default=2e-3, metavar="X", help="relative width of the bracket (2e-3)"
    )
    safety.add_argument(
        "--at", type=float, metavar="S", help="time at which the loads are taken, s (default: the scene's end)"
    )
    safety.add_argument(
        "--without-cracks", action="store_true",
        help="leave out cracks inside blocks, as if rock bridges never broke: the factor is then an upper bound",
    )  # fmt: skip
    safety.add_argument(
        "--json", "--out", type=Path, metavar="FILE", dest="out",
        help="also write everything printed, and every trial, to a JSON file",
    )  # fmt: skip
    safety.add_argument(
        "--picture", type=Path, metavar="FILE", help="draw the mechanism (PNG, PDF or SVG by the file's name)"
    )
    safety.add_argument("--quiet", action="store_true", help="do not report trials as they are made")


def _safety(options: argparse.Namespace) -> int:
    check_writable("--out", options.out)
    check_writable("--picture", options.picture)
    from ...dda import NothingToReduce, PartialFactors
    from ...output.tables.summary import write_json
    from ...pipeline import CracksInBlocks, safety_report
    from ...scene import load_scene

    try:
        divide = PartialFactors.of(options.divide)
    except NothingToReduce as error:
        raise BadInput(f"--divide: {error}") from error
    if not options.quiet:
        report_compiling()
    scenes = scenes_asked(load_scene(options.scene, options.overrides, None), options)
    say_warnings(scenes.values())
    answers = {}
    for name, scene in scenes.items():

        def tell(trial) -> None:
            say(f"  F = {trial.factor:.4f}: {trial.reason}")

        try:
            report = safety_report(
                scene, options.at, along=options.along, divide=divide, tolerance=options.tolerance,
                watch=None if options.quiet else tell, without_cracks=options.without_cracks,
            )  # fmt: skip
        except CracksInBlocks as error:
            raise BadInput(f"{error}; --without-cracks gives an upper bound") from error
        except NothingToReduce as error:
            raise BadInput(str(error)) from error
        title = "factor of the blocks without their cracks" if report.cracks else "factor of safety"
        print(f"{report.problem.title or options.scene}" + (f", {name}" if name else "") + f"\n{report.text(title)}")
        answer = answers[name or "scene"] = report.as_dict()
        if report.cracks:
            print(f"  {_caution(report.cracks)}")
            answer["factor_without_cracks"], answer["factor_of_safety"] = answer["factor_of_safety"], None
            answer["cracks_left_out"], answer["caution"] = list(report.cracks), _caution(report.cracks)
        if options.picture:
            place = options.picture
            print(f"  {report.draw(place.with_stem(f'{place.stem}_{name}') if name else place, title)}")
        sys.stdout.flush()
    if options.out:
        options.out.parent.mkdir(parents=True, exist_ok=True)
        write_json(options.out, answers)
    return DONE


def _caution(left_out: tuple[str, ...]) -> str:
    from ...model import counted

    return (
        f"not the factor of safety but an upper bound: {counted(len(left_out), 'crack')} left out, "
        "rock bridges taken as unbreakable"
    )
