"""``geomech sweep``: many runs of a scene, on this machine or on a cluster."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from ..messages import report_compiling, say
from ..scenes import trust_argument
from ..verb import DONE, FAILED, BadInput, Verbs, add_verb, check_folder
from .run import prepare_for_a_run


def declare(verbs: Verbs) -> None:
    """The verb's arguments."""
    made = add_verb(
        verbs, "sweep", _sweep, "run a scene many times with varying input: probability of failure with its confidence interval",
        "geomech sweep slope.toml --vary 'joints.beds.friction_angle_deg=20:40:5'\n"
        "geomech sweep slope.toml --seeds 0-499 --measure safety\n"
        "geomech sweep slope.toml --vary 'joints.beds.friction_angle_deg=normal(30, 4)' --runs 1000 --sampling sobol\n"
        "geomech sweep slope.toml --out outputs/slope_sweep --resume",
    )  # fmt: skip
    made.description = str(made.description) + (
        " Variables and all other settings can be given in [sweep] of the scene or in a sweep.toml in its folder; options "
        "on the command line take precedence. Results: one row per run in runs.csv and runs.parquet, a page report.html."
    )
    made.add_argument("scene", type=Path, metavar="SCENE", help="a scene.toml, or a folder that holds one")
    made.add_argument(
        "--vary", action="append", default=[], metavar="KEY=VALUES",
        help="a key and its values: 20:40:5, log(1e3,1e6,4), 10,20,40, normal(35,5), lognormal(1e5,3e4), "
             "uniform(20,40), "
             "triangular(20,30,40), beta(0,1,2,5), exponential(0.08,0,0.16); normal(35,5,15,60) is cut off "
             "(may be repeated)",
    )  # fmt: skip
    made.add_argument("--seeds", metavar="FIRST-LAST", help="joint seeds, one run each, such as 0-499")
    made.add_argument("--runs", type=int, metavar="N", help="number of samples of the random variables")
    made.add_argument(
        "--sampling", choices=("monte-carlo", "latin-hypercube", "sobol", "saltelli"),
        help="how they are sampled; saltelli gives Sobol' sensitivities (default monte-carlo)",
    )  # fmt: skip
    made.add_argument("--seed", type=int, metavar="N", help="seed of the samples (0)")
    made.add_argument(
        "--correlated",
        action="append",
        default=[],
        metavar="KEY,KEY=R",
        help="two correlated random variables, with their correlation (may be repeated)",
    )
    made.add_argument(
        "--derive",
        action="append",
        default=[],
        metavar="KEY=EXPRESSION",
        help="a key computed from the variables (may be repeated)",
    )
    made.add_argument("--measure", choices=("safety", "run"), help="factor of safety (default), or a run to its end")
    made.add_argument("--fails", metavar="EXPRESSION", help="when a slope counts as failed (factor_of_safety < 1)")
    made.add_argument(
        "--column",
        action="append",
        default=[],
        metavar="NAME=EXPRESSION",
        help="a further column, from other columns, the summary or max(history.NAME) (may be repeated)",
    )
    made.add_argument("--along", nargs="+", metavar="JOINT", help="for safety: weaken these joints only")
    made.add_argument(
        "--without-cracks", action="store_true", default=None, help="for safety: leave out cracks inside blocks"
    )
    made.add_argument("--rare", choices=("subset", "importance"), help="method for probabilities below 1e-2")
    made.add_argument("--keep", choices=("none", "failed", "all"), help="which run folders are kept (none)")
    made.add_argument(
        "--table", type=Path, metavar="FILE", help="settings as TOML (default: sweep.toml in the folder of the scene)"
    )
    made.add_argument(
        "--set", action="append", default=[], metavar="KEY=VALUE", dest="overrides", help="override a key of the scene"
    )
    made.add_argument("--variant", metavar="NAME", help="a variant of the scene")
    made.add_argument("--limit", type=int, metavar="N", help="refuse more runs than this (10 000)")
    made.add_argument("--workers", type=int, metavar="N", help="processes on this machine (default: one per core)")
    made.add_argument("--scheduler", metavar="ADDRESS", help="a dask.distributed scheduler, such as tcp://host:8786")
    made.add_argument("--out", type=Path, metavar="DIR", help="folder of the sweep (default outputs/NAME_sweep)")
    made.add_argument("--resume", action="store_true", help="continue the sweep in the folder")
    made.add_argument("--overwrite", action="store_true", help="replace the sweep in the folder")
    made.add_argument("--plan", action="store_true", help="show what would be run, without running it")
    made.add_argument("--log", action="store_true", help="print one line per run")
    made.add_argument("--quiet", action="store_true", help="print nothing but the result")
    made.add_argument("--no-page", action="store_true", help="write no report.html")
    trust_argument(made)


def _sweep(options: argparse.Namespace) -> int:
    check_folder("--out", options.out)
    if options.workers is not None and options.workers < 1:
        raise BadInput("--workers takes a number of processes, at least 1")
    prepare_for_a_run()
    if not options.quiet:
        report_compiling()
    from ...sweep.cluster import EngineRefused
    from ...sweep.execution import CannotResume, SweepMessages, carry_out_sweep, default_folder, engine_for, read_sweep
    from ...sweep.plan import plan_of

    given = _given(options)
    try:
        if options.resume and not given:
            folder = options.out or default_folder(_scene_file(options.scene))
            plan = _stored(folder, read_sweep)
        else:
            plan = plan_of(
                options.scene, given, overrides=options.overrides, variant=options.variant, table=options.table,
                limit=options.limit, source="--",
            )  # fmt: skip
            folder = options.out or default_folder(plan.scene)
        if options.plan:
            print(described(plan))
            return DONE
        if not options.quiet:
            say(described(plan))
        engine = engine_for(plan, folder, options.workers, options.scheduler)
        messages = SweepMessages(None if options.quiet else say, options.log)
        try:
            found = carry_out_sweep(
                plan, folder, engine, resume=options.resume, overwrite=options.overwrite, messages=messages
            )
        except KeyboardInterrupt:
            say(f"finished runs are kept; to continue: geomech sweep {options.scene} --out {folder} --resume")
            raise
    except (CannotResume, EngineRefused) as error:
        raise BadInput(str(error)) from error
    print(found.text())
    if not options.no_page:
        from ...report import write_sweep_page

        say(f"page: {write_sweep_page(folder)}")
    return DONE if any(row["status"] == "done" for row in found.rows) else FAILED


def _scene_file(scene: Path) -> Path:
    return (scene / "scene.toml" if scene.is_dir() else scene).resolve()


def _stored(folder: Path, read_sweep: Any) -> Any:
    try:
        return read_sweep(folder).plan
    except FileNotFoundError:
        raise BadInput(f"{folder} holds no sweep to continue") from None


def described(plan: Any) -> str:
    """Summary of the planned sweep."""
    settings = plan.settings
    lines = [f"{plan.title}: " + (f"{settings['rare']} simulation" if settings["rare"] else f"{len(plan.table)} runs")
             + f", measure {settings['measure']}"]  # fmt: skip
    lines += [f"  {each.name}: {each}" for each in plan.variables]
    lines += [f"  {key} = {text}" for key, text in plan.derived.items()]
    if plan.seeds:
        lines.append(f"  joint seeds {plan.seeds[0]} to {plan.seeds[-1]} ({len(plan.seeds)})")
    return "\n".join([*lines, *(f"  note: {text}" for text in plan.warnings)])


def _given(options: argparse.Namespace) -> dict[str, Any]:
    """Settings from the command line."""
    given: dict[str, Any] = {
        name: getattr(options, name)
        for name in ("seeds", "runs", "seed", "measure", "fails", "along", "without_cracks", "rare", "keep")
        if getattr(options, name) is not None
    }
    if options.sampling:
        given["sampling"] = options.sampling.replace("-", " ")
    for name, key in (("vary", "vary"), ("derive", "derive"), ("column", "columns")):
        pairs = [_pair(f"--{name}", text) for text in getattr(options, name)]
        if pairs:
            given[key] = dict(pairs)
            if len(given[key]) < len(pairs):
                raise BadInput(f"--{name}: a key is given twice")
    if options.correlated:
        given["correlated"] = [_correlation(text) for text in options.correlated]
    return given


def _pair(option: str, text: str) -> tuple[str, str]:
    key, equals, value = text.partition("=")
    if not equals or not key.strip() or not value.strip():
        raise BadInput(f"{option} {text}: write KEY=VALUE")
    return key.strip(), value.strip()


def _correlation(text: str) -> dict[str, Any]:
    keys, _, value = text.rpartition("=")
    names = [part.strip() for part in keys.split(",")]
    try:
        coefficient = float(value)
    except ValueError:
        names = []
    if len(names) != 2:
        raise BadInput(f"--correlated {text}: write KEY,KEY=COEFFICIENT, as a.friction_angle_deg,a.cohesion_pa=-0.5")
    return {"between": names, "coefficient": coefficient}
