"""The command line: ``geomech check | build | run | resume | safety | render | report | bench | doctor``.

Exit codes: 0 done, 1 the run failed (what was written stays readable), 2 bad input, 3 interrupted (Ctrl-C or SIGTERM).
Nothing heavy is imported before a verb asks for it.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

from . import __version__
from .bench import TOPICS, topic

# The matrices of a specimen are small: a second BLAS thread gains them nothing, and costs tens of times their own time
# when the machine is busy. Set before numpy is loaded; whoever wants more says so in the environment.
for _library in ("OPENBLAS", "MKL"):
    os.environ.setdefault(f"{_library}_NUM_THREADS", "1")

DONE, FAILED, BAD_INPUT, INTERRUPTED = 0, 1, 2, 3
#: Pixels, as for a scene's own render.width_px.
LEAST_WIDTH = 64


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; the exit code. ``arguments`` defaults to the process's own."""
    options = _parser().parse_args(arguments)
    verb: Callable[[argparse.Namespace], int] = options.verb
    try:
        return verb(options)
    except KeyboardInterrupt:
        _say("interrupted")
        return INTERRUPTED
    except Exception as error:
        if _is_bad_input(error):
            _say_errors(error)
            return BAD_INPUT
        if options.debug:
            raise
        if isinstance(error, OSError) and error.filename:
            _say(f"geomech: {error.filename}: {(error.strerror or type(error).__name__).lower()}")
            return FAILED
        _say(f"geomech: {type(error).__name__}: {error}\n(run it again with --debug before the verb for the traceback)")
        return FAILED


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="geomech",
        description="How a jointed, cracked rock mass comes apart: blocks that move (DDA), cracks that grow (DDM).",
        epilog="exit codes: 0 done, 1 failed run, 2 bad input, 3 interrupted",
    )
    parser.add_argument("--version", action="version", version=f"geomech {__version__}")
    parser.add_argument("--debug", action="store_true", help="show the traceback of a failure")
    verbs = parser.add_subparsers(title="verbs", required=True, metavar="VERB")

    def verb(name: str, does: Callable, what: str, example: str) -> argparse.ArgumentParser:
        made = verbs.add_parser(
            name,
            help=what,
            description=what[0].upper() + what[1:] + ".",
            epilog="example:\n" + "\n".join(f"  {line}" for line in example.splitlines()),
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )
        made.set_defaults(verb=does)
        return made

    check = verb(
        "check", _check, "read a scene, build its geometry and say every error in it at once",
        "geomech check pipelines/two_cracks\ngeomech check scene.toml --set growth.criterion=g",
    )  # fmt: skip
    _scene_arguments(check)
    check.add_argument("--keys", action="store_true", help="list every key a scene may have, and what it means")

    build = verb(
        "build", _build, "write the blocks that a scene is cut into, and a picture of them, before anything runs",
        "geomech build slope.toml\ngeomech build slope.toml --set geometry.seed=7 --out /tmp/seed7",
    )  # fmt: skip
    build.description += (
        " Joint sets are told as they were asked for and as they came out (block_system.json), with a picture of block"
        " sizes, directions, trace lengths and nodes beside the blocks' own (joint_statistics.png)."
    )
    _scene_arguments(build)
    build.add_argument("--out", type=Path, metavar="DIR", help="folder (default outputs/NAME[/VARIANT]/build)")
    build.add_argument("--picture", type=Path, metavar="FILE", help="where the picture goes (default DIR/blocks.png)")

    run = verb(
        "run", _run, "run a scene, or a pipeline folder, and write its run folder",
        "geomech run pipelines/two_cracks --variant phi_30\n"
        "geomech run scene.toml --out outputs/soft --set materials.rock.youngs_modulus_pa=5e9",
    )  # fmt: skip
    _scene_arguments(run)
    run.add_argument("--out", type=Path, metavar="DIR", help="run folder (default outputs/NAME[/VARIANT])")
    run.add_argument("--quiet", action="store_true", help="say nothing but errors")

    resume = verb(
        "resume", _resume, "go on with a run that was interrupted, killed, or is to last longer, from its last checkpoint",
        "geomech resume outputs/two_cracks/phi_30\ngeomech resume outputs/slope --set run.end_time_s=20",
    )  # fmt: skip
    resume.description += (
        " What is written is bit for bit what the run would have left uninterrupted. A run ends its cycle and stores itself on"
        " Ctrl-C or SIGTERM; a second one ends it at once."
    )
    resume.add_argument("run", type=Path, metavar="RUN", help="run folder")
    resume.add_argument(
        "--set", action="append", default=[], metavar="KEY=VALUE", dest="overrides",
        help="change a key that does not change what has happened: run.end_time_s, run.stop_at, output.every … "
        "(may be repeated)",
    )  # fmt: skip
    resume.add_argument("--quiet", action="store_true", help="say nothing but errors")

    safety = verb(
        "safety", _safety, "find by what factor the strength of joints may be divided before the blocks go",
        "geomech safety slope.toml\ngeomech safety slope.toml --reduce bedding --tolerance 1e-3 --out safety.json",
    )  # fmt: skip
    safety.description += (
        " tan φ, cohesion and tensile strength of the joints are divided by F until no static equilibrium is left; cracks"
        " inside blocks are left out."
    )
    _scene_arguments(safety)
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

    render = verb(
        "render", _render, "draw a run: the last cycle as a picture, its growth as a movie, its curves",
        "geomech render outputs/two_cracks/phi_30 --component yy --no-gif",
    )  # fmt: skip
    render.description += " What is not said here, the scene's [render] table says."
    render.add_argument("run", type=Path, metavar="RUN", help="run folder")
    render.add_argument("--out", type=Path, metavar="DIR", help="where the pictures go (default RUN/pictures)")
    render.add_argument("--component", metavar="NAME", 
                        help="stress: xx, yy, zz, xy, principal_max, principal_min or von_mises")  # fmt: skip
    render.add_argument("--width", type=int, metavar="PX", help="width of the pictures")
    render.add_argument("--gif", action=argparse.BooleanOptionalAction, default=None, help="draw the movie")

    report = verb(
        "report", _report, "tabulate what runs came to, and write a page with tables, curves and pictures",
        "geomech report outputs/two_cracks/phi_0\ngeomech report outputs/two_cracks\ngeomech report outputs/bench_ddm",
    )  # fmt: skip
    report.description += (
        " The page is one file that needs nothing else: of a run, of runs side by side, or of what a benchmark left."
    )
    report.add_argument(
        "runs", nargs="+", type=Path, metavar="RUN", help="run folders, folders of run folders, or a benchmark's folder"
    )
    report.add_argument("--csv", action="store_true", help="write the table as CSV, and no page")
    report.add_argument(
        "--out",
        type=Path,
        metavar="FILE",
        help="where the page goes (default report.html in RUN, runs.html where RUN holds several)",
    )
    report.add_argument("--page", action=argparse.BooleanOptionalAction, default=True, help="write the page")

    bench = verb(
        "bench", _bench, "measure what things cost and how right they are (run it in the project's folder)",
        "geomech bench startup\ngeomech bench --quick --out before.json\ngeomech bench --quick --against before.json",
    )  # fmt: skip
    bench.add_argument("topics", nargs="*", metavar="TOPIC", help=f"{', '.join(TOPICS)} (default: all)")
    bench.add_argument("--quick", action="store_true", help="fewer repetitions, nothing compiled anew")
    bench.add_argument(
        "--out", type=Path, metavar="FILE", help="where the figures go, JSON (default outputs/bench/figures.json)"
    )
    bench.add_argument(
        "--against", type=Path, metavar="FILE", help="figures of an earlier run: say what got slower or less accurate"
    )
    bench.add_argument(
        "--seeds", metavar="FIRST-LAST",
        help="of slopes: run these, one on each core, and leave rows and a picture in outputs/bench_slopes; seeds that have been "
        "run before, by the same program, are not run again",
    )  # fmt: skip

    verb("doctor", _doctor, "check this machine: libraries, rendering, caches; say how to mend what is missing",
         "geomech doctor")  # fmt: skip
    return parser


def _scene_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("scene", type=Path, metavar="SCENE", help="a scene.toml, or a folder that holds one")
    parser.add_argument(
        "--set", action="append", default=[], metavar="KEY=VALUE", dest="overrides",
        help="override a key of the scene, e.g. growth.increment_m=2e-3 (may be repeated)",
    )  # fmt: skip
    parser.add_argument(
        "--variant", action="append", default=[], metavar="NAME", dest="variants",
        help="a variant that the scene names, or 'all' (may be repeated)",
    )  # fmt: skip


def _check(options: argparse.Namespace) -> int:
    from .model import counted
    from .scene import load_scene

    first = load_scene(options.scene, options.overrides, None)
    if options.keys:
        print(first.describe_keys())
        return DONE
    scenes = _scenes(first, options)
    _say_warnings(scenes.values())
    for scene in scenes.values():
        problem = scene.problem()
        tips = f" with {counted(len(problem.cracks.tips), 'tip')}" if problem.cracks.n_cracks else ""
        print("\n".join([f"{problem.title}: {problem.inventory}{tips}: no errors", *scene.overview()]))
    if first.variants and not options.variants:
        print(f"variants: {', '.join(first.variants)}")
    return DONE


def _build(options: argparse.Namespace) -> int:
    from .output.block_system import write_block_system
    from .render.block_map import draw_block_map
    from .scene import load_scene
    from .scene.drawing import MENDED

    scenes = _scenes(load_scene(options.scene, options.overrides, None), options)
    # What was mended stands among the lines of each scene.
    _say_warnings(scenes.values(), but=MENDED)
    for name, scene in scenes.items():
        folder = options.out or (default_folder(options.scene) / (name or "") / "build")
        folder = folder / name if options.out and name and len(scenes) > 1 else folder
        told = write_block_system(scene, folder)
        picture = options.picture or folder / "blocks.png"
        draw_block_map(scene, told, picture)
        pictures = str(picture)
        if told["sets"]:
            from .render.network_statistics import draw_network_statistics

            pictures += f", {draw_network_statistics(scene, told, folder / 'joint_statistics.png').name}"
        print("\n".join([f"{told['title']}: {told['summary']}", *told["lines"], f"  written   {folder}, {pictures}"]))
    return DONE


def _prepare_for_a_run() -> None:
    import atexit
    import gc
    import signal
    import threading

    if threading.current_thread() is threading.main_thread():
        # A batch system's SIGTERM ends a run as Ctrl-C does, with its summary written.
        signal.signal(signal.SIGTERM, signal.default_int_handler)
    # A cycle makes thousands of short-lived arrays and no reference loops worth speaking of: looking for loops every
    # 700 of them costs a twentieth of a run.
    gc.set_threshold(50_000, 20, 20)
    # Python ends with three searches for loops in all that was ever imported, a third of a second: leave these to the
    # operating system.
    atexit.register(gc.freeze)


def _run(options: argparse.Namespace) -> int:
    _prepare_for_a_run()
    place: Path = options.scene
    if place.is_dir() and (place / "run.py").is_file():
        return _run_script(place, options)

    from .output import standard_observers
    from .pipeline import run
    from .scene import load_scene

    # Every variant is read before the first one runs: an error in the last should not cost an hour.
    scenes = _scenes(load_scene(place, options.overrides, None), options)
    if not options.quiet:
        _say_warnings(scenes.values())
    base = options.out or default_folder(place)
    for name, scene in scenes.items():
        # One variant with --out goes into exactly that folder.
        folder = base if name is None or (options.out and len(scenes) == 1) else base / name
        run(scene, out=folder, observers=standard_observers(scene, quiet=options.quiet))
    return DONE


def _resume(options: argparse.Namespace) -> int:
    _prepare_for_a_run()
    from .resumption import Finished, NotResumable, resume

    try:
        resume(options.run, options.overrides, quiet=options.quiet, tell=_say)
    except Finished as nothing_left:
        _say(f"{options.run}: {nothing_left}")
    except NotResumable as error:
        told = str(error)
        raise BadInput(told if str(options.run) in told else f"{options.run}: {told}") from error
    return DONE


def _safety(options: argparse.Namespace) -> int:
    from .output.summary import write_json
    from .pipeline import factor_of_safety
    from .scene import load_scene

    scenes = _scenes(load_scene(options.scene, options.overrides, None), options)
    _say_warnings(scenes.values())
    told = {}
    for name, scene in scenes.items():
        problem = scene.problem()
        if problem.cracks.n_cracks:
            _say("warning: cracks inside blocks are left out")

        def say(trial) -> None:
            _say(f"  F = {trial.factor:.4f}: {trial.reason}")

        try:
            found = factor_of_safety(
                scene, options.at, reduce=options.reduce, tolerance=options.tolerance,
                watch=None if options.quiet else say,
            )  # fmt: skip
        except ValueError as error:
            raise BadInput(str(error)) from error
        print(f"{problem.title or options.scene}" + (f", {name}" if name else "") + f"\n{found.table()}", flush=True)
        told[name or "scene"] = found.as_dict(problem.blocks)
    if options.out:
        write_json(options.out, told)
    return DONE


def _run_script(place: Path, options: argparse.Namespace) -> int:
    """Hand a pipeline's own script what the command line says, its variants by name."""
    variants = options.variants
    if (place / "scene.toml").is_file():
        from .scene import load_scene

        first = load_scene(place, options.overrides, None)
        variants = _variants(first, variants)
        if not options.quiet:
            _say_warnings(_scenes(first, options).values())
    elif "all" in variants:
        raise BadInput(f"{place} holds no scene.toml that says what its variants are: name them")
    script = _load_script(place / "run.py")
    result = script.main(
        place, options.out or default_folder(place), overrides=options.overrides, variants=variants, quiet=options.quiet
    )
    return DONE if result is None else int(result)


def _scenes(first: Any, options: argparse.Namespace) -> dict[str | None, Any]:
    """The scenes that are asked for, by variant; ``first``, which has none, where none is asked for."""
    from .scene import load_scene

    names = _variants(first, options.variants)
    return {name: load_scene(options.scene, options.overrides, name) for name in names} or {None: first}


def _variants(scene: Any, asked: Sequence[str]) -> list[str]:
    known = list(scene.variants)
    names = known if "all" in asked else list(dict.fromkeys(asked))
    unknown = [name for name in names if name not in known]
    if unknown:
        raise BadInput(f"no variant {', '.join(unknown)}; the scene has {', '.join(known) or 'none'}")
    return names


def default_folder(scene: Path) -> Path:
    """``outputs/NAME`` below the working folder: NAME is the pipeline's folder, or the file's name without suffix."""
    scene = scene.resolve()
    return Path("outputs") / (scene.parent.name if scene.name == "scene.toml" else scene.stem)


def _load_script(path: Path) -> Any:
    import importlib.util

    spec = importlib.util.spec_from_file_location(f"geomech_pipeline_{path.parent.name}", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    if not hasattr(module, "main"):
        raise BadInput(f"{path} has no main(folder, out, overrides, variants, quiet)")
    return module


def _render(options: argparse.Namespace) -> int:
    from .output import Run
    from .render import draw
    from .render.look import COMPONENTS

    if options.component is not None and options.component not in COMPONENTS:
        raise BadInput(f"no stress component {options.component!r}; there are {', '.join(COMPONENTS)}")
    if options.width is not None and options.width < LEAST_WIDTH:
        raise BadInput(f"a width of {options.width} pixels shows nothing; give at least {LEAST_WIDTH}")
    run = _open_run(Run, options.run)
    wishes = {"component": options.component, "width": options.width, "movie": options.gif}
    for path in draw(run, options.out, **{key: value for key, value in wishes.items() if value is not None}):
        print(path)
    return DONE


def _report(options: argparse.Namespace) -> int:
    from .output import Run
    from .report import as_csv, as_text, is_benchmark, table, write_page

    place, benchmark = options.runs[0], len(options.runs) == 1 and is_benchmark(options.runs[0])
    folders = [] if benchmark else [found for place in options.runs for found in _run_folders(place)]
    runs = [_open_run(Run, folder) for folder in folders]
    if runs:
        rows = table(runs)
        print(as_csv(rows) if options.csv else as_text(rows))
    if options.page and not options.csv:
        if len(options.runs) > 1:
            place = Path(os.path.commonpath([folder.resolve() for folder in folders]))
        _say(f"page: {write_page(place, runs, options.out)}")
    return DONE


def _run_folders(place: Path) -> list[Path]:
    if (place / "history.csv").is_file() or not place.is_dir():
        return [place]
    return sorted(found.parent for found in place.rglob("history.csv")) or [place]


def _open_run(run: Callable[[Path], Any], folder: Path) -> Any:
    try:
        return run(folder)
    except FileNotFoundError as error:
        below = [str(found) for found in _run_folders(folder) if found != folder]
        listed = ", ".join(below[:12]) + (f" and {len(below) - 12} more" if len(below) > 12 else "")
        raise BadInput(f"{error}" + (f"; runs below it: {listed}" if below else "")) from None


def _bench(options: argparse.Namespace) -> int:
    unknown = [name for name in options.topics if name not in TOPICS]
    if unknown:
        raise BadInput(f"no benchmark {', '.join(unknown)}; there are {', '.join(TOPICS)}")
    from .bench import figures

    try:
        before = figures.read(options.against) if options.against else None
    except (OSError, ValueError) as error:
        raise BadInput(f"--against: {error}") from error
    seeds = _seeds(options)
    unit, found = figures.yardstick(), {}
    print(figures.said(figures.machine()), end="\n\n")
    for name in options.topics or TOPICS:
        if name == "slopes" and seeds:
            from .bench.fuzzed_slopes import measure_many

            found[name] = measure_many(seeds)
        else:
            found[name] = topic(name)(options.quick)
        print(found[name].text, end="\n\n", flush=True)
    print(figures.write(options.out or Path("outputs/bench/figures.json"), found, quick=options.quick, unit=unit))
    if before is None:
        return DONE
    changes = figures.changes(before, found, unit)
    print(figures.compared(changes, before, options.against))
    return FAILED if figures.less_accurate(changes) else DONE


def _seeds(options: argparse.Namespace) -> range:
    """The seeds of slopes that are asked for; none: the benchmark's own."""
    if options.seeds is None:
        return range(0)
    if "slopes" not in options.topics:
        raise BadInput("--seeds belongs to slopes: geomech bench slopes --seeds 0-299")
    first, _, last = options.seeds.partition("-")
    if not (first.isdecimal() and (last or first).isdecimal() and int(first) <= int(last or first)):
        raise BadInput(f"--seeds takes two numbers that ascend, as 0-299, not {options.seeds!r}")
    return range(int(first), int(last or first) + 1)


def _doctor(options: argparse.Namespace) -> int:
    from .doctor import examine

    checks = examine()
    for check in checks:
        print(f"{'ok  ' if check.good else 'FAIL'} {check.name:<12} {check.found}")
        if not check.good:
            print(f"     {'':<12} → {check.mend}")
    return DONE if all(check.good for check in checks) else FAILED


class BadInput(ValueError):
    """Something on the command line that cannot be: exit code 2."""


def _is_bad_input(error: Exception) -> bool:
    if isinstance(error, BadInput):
        return True
    # The scene package is only asked when it has been imported: no other part raises its error.
    scene = sys.modules.get("geomech.scene")
    return scene is not None and isinstance(error, getattr(scene, "SceneError", ()))


def _say_errors(error: Exception) -> None:
    errors = getattr(error, "errors", None)
    if not errors:
        _say(f"geomech: {error}")
        return
    for place, message, way_out in errors:
        _say(f"{place}: {message}" + (f"\n    {way_out}" if way_out else ""))
    _say(f"{len(errors)} error{'s' if len(errors) > 1 else ''}; nothing was run")


def _say_warnings(scenes: Iterable[Any], but: str | None = None) -> None:
    """A line each, ``but`` for those that begin so; what several variants share is said once."""
    for place, message, way_out in dict.fromkeys(warning for scene in scenes for warning in scene.warnings):
        if but is not None and message.startswith(but):
            continue
        _say(f"warning: {place}: {message}" + (f"; {way_out}" if way_out else ""))


def _say(text: str) -> None:
    print(text, file=sys.stderr)


if __name__ == "__main__":
    sys.exit(main())
