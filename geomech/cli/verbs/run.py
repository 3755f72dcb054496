"""``geomech run``: a scene, all its variants, or a pipeline folder with a script of its own."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

from ..messages import report_compiling, say_warnings
from ..scenes import default_folder, scene_arguments, scenes_asked, variants_asked
from ..verb import DONE, BadInput, Verbs, add_verb, check_folder


def declare(verbs: Verbs) -> None:
    """The verb's arguments."""
    run = add_verb(
        verbs, "run", _run, "run a scene, or a pipeline folder, and write its run folder",
        "geomech run pipelines/two_cracks --variant phi_30\n"
        "geomech run scene.toml --out outputs/soft --set materials.rock.youngs_modulus_pa=5e9",
    )  # fmt: skip
    scene_arguments(run)
    run.add_argument("--out", type=Path, metavar="DIR", help="run folder (default outputs/NAME[/VARIANT])")
    run.add_argument(
        "--overwrite",
        action="store_true",
        help="replace the results of an earlier run in the run folder (otherwise refused)",
    )
    run.add_argument(
        "--repeat",
        metavar="KIND,…",
        help="repeat the finished run with one change at a time, any of noise, steps, increment, elements, and state by "
        "how much its results differ",
    )
    run.add_argument("--quiet", action="store_true", help="print nothing but errors")


def _run(options: argparse.Namespace) -> int:
    check_folder("--out", options.out)
    if options.repeat is not None:
        kinds = [kind.strip() for kind in options.repeat.split(",")]
        options.overrides.append(f"run.repeat={json.dumps(kinds)}")
    prepare_for_a_run()
    if not options.quiet:
        report_compiling()
    from ...pipeline import overwriting

    with overwriting(options.overwrite):
        return _run_all(options)


def _run_all(options: argparse.Namespace) -> int:
    place: Path = options.scene
    if place.is_dir() and (place / "run.py").is_file():
        return _run_script(place, options)

    from ...output import standard_observers
    from ...pipeline import refuse_results, run
    from ...scene import load_scene

    # All variants are read before the first one runs: an error in the last should not cost an hour.
    scenes = scenes_asked(load_scene(place, options.overrides, None), options)
    if not options.quiet:
        say_warnings(scenes.values())
    base = options.out or default_folder(place)
    # A single variant with --out goes into exactly that folder.
    alone = options.out and len(scenes) == 1
    folders = {name: base if name is None or alone else base / name for name in scenes}
    refuse_results(folders.values())
    for name, scene in scenes.items():
        run(scene, out=folders[name], observers=standard_observers(scene, quiet=options.quiet))
    return DONE


def _run_script(place: Path, options: argparse.Namespace) -> int:
    """Pass the command line to a pipeline's own script, with the names of its variants."""
    variants = options.variants
    if (place / "scene.toml").is_file():
        from ...scene import load_scene

        first = load_scene(place, options.overrides, None)
        variants = variants_asked(first, variants)
        if not options.quiet:
            say_warnings(scenes_asked(first, options).values())
    elif "all" in variants:
        raise BadInput(f"{place} holds no scene.toml with variants: name them")
    from ...output.console.at_work import AtWork
    from ...output.console.pace import name_of_study

    script = _load_script(place / "run.py")
    out = options.out or default_folder(place)
    course = name_of_study(place, (list(options.overrides), list(variants)))
    with AtWork(place.resolve().name, course=course, quiet=options.quiet):
        result = script.main(place, out, overrides=options.overrides, variants=variants, quiet=options.quiet)
    return DONE if result is None else int(result)


def _load_script(path: Path) -> Any:
    import importlib.util

    spec = importlib.util.spec_from_file_location(f"geomech_pipeline_{path.parent.name}", path)
    if spec is None or spec.loader is None:
        raise ImportError(f"{path} cannot be imported")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    if not hasattr(module, "main"):
        raise BadInput(f"{path} has no main(folder, out, overrides, variants, quiet)")
    return module


def prepare_for_a_run() -> None:
    """Let SIGTERM and SIGHUP end this process like Ctrl-C, and switch off Python's search for reference cycles, which
    costs time and finds nothing."""
    import atexit
    import gc
    import signal
    import threading

    if threading.current_thread() is threading.main_thread():
        # SIGTERM of a batch system and SIGHUP of a closed terminal end a run like Ctrl-C, with its summary written.
        # `nohup` ignores the latter.
        for number in (signal.SIGTERM, signal.SIGHUP):
            if signal.getsignal(number) is not signal.SIG_IGN:
                signal.signal(number, signal.default_int_handler)
    # A cycle makes thousands of short-lived arrays and hardly any reference cycles: searching for them after every 700
    # objects takes a twentieth of a run.
    gc.set_threshold(50_000, 20, 20)
    # At exit Python searches three times for cycles in everything imported, a third of a second: this is left to the
    # operating system.
    atexit.register(gc.freeze)
