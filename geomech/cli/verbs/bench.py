"""``geomech bench``: cost and accuracy, now and compared with earlier figures."""

from __future__ import annotations

import argparse
import time
from pathlib import Path

from ...bench import TOPICS, topic
from ..verb import DONE, FAILED, BadInput, Verbs, add_verb, check_writable

#: Topics that run any number of random scenes, one per seed.
_SEEDED = {"safety", "slopes", "sliding"}


def declare(verbs: Verbs) -> None:
    """The verb's arguments."""
    bench = add_verb(
        verbs, "bench", _bench, "measure cost and accuracy (run it in the project's folder)",
        "geomech bench startup\ngeomech bench --quick --out before.json\ngeomech bench --quick --against before.json",
    )  # fmt: skip
    bench.add_argument("topics", nargs="*", metavar="TOPIC", help=f"{', '.join(TOPICS)} (default: all)")
    bench.add_argument(
        "--quick", action="store_true", help="fewer and smaller sizes, few pictures, no new "
                                             "compilation: a minute for all (otherwise a quarter of an hour)"
    )  # fmt: skip
    bench.add_argument(
        "--out", type=Path, metavar="FILE", help="where the figures go, JSON (default outputs/bench/figures.json)"
    )
    bench.add_argument(
        "--against",
        type=Path,
        metavar="FILE",
        help="figures of an earlier run: report what became slower or less accurate",
    )
    bench.add_argument(
        "--seeds", metavar="FIRST-LAST",
        help="for safety, slopes and sliding: run these seeds, one on each core, and leave rows (and a picture) in "
             "outputs/bench_safety, outputs/bench_slopes or outputs/bench_sliding; seeds that have been run before, by "
             "the same program, are not run again",
    )  # fmt: skip
    bench.add_argument(
        "--invariance", action="store_true",
        help="for slopes, with --seeds: compare moved mass, its gravity work, displacements and energies of each "
             "with those in shorter steps, mirrored, rotated, shifted, with joints in another order and with noise",
    )  # fmt: skip
    bench.add_argument(
        "--blocks",
        type=int,
        metavar="N",
        help="for dda: also a wall and a slope of this many blocks (100000: 12 minutes, 7 GB); for motion: also such a slope",
    )
    bench.add_argument("--seconds", type=float, metavar="S", help="for debris: simulated time, s (60: an hour)")


def _bench(options: argparse.Namespace) -> int:
    unknown = [name for name in options.topics if name not in TOPICS]
    if unknown:
        raise BadInput(f"no benchmark {', '.join(unknown)}; there are {', '.join(TOPICS)}")
    from ...bench import figures

    try:
        before = figures.read(options.against, quick=options.quick) if options.against else None
    except (OSError, ValueError) as error:
        raise BadInput(f"--against: {error}") from error
    seeds = _seeds(options)
    out = options.out or Path("outputs/bench/figures.json")
    check_writable("--out", out)
    if options.blocks is not None and (not {"dda", "motion"} & set(options.topics) or options.blocks < 1):
        raise BadInput(
            "--blocks takes a number of blocks and belongs to dda and motion: geomech bench dda --blocks 100000"
        )
    if options.seconds is not None and ("debris" not in options.topics or not options.seconds > 0):
        raise BadInput("--seconds takes a time in s and belongs to debris: geomech bench debris --seconds 60")
    if options.invariance and ("slopes" not in options.topics or not seeds):
        raise BadInput("--invariance belongs to slopes, with --seeds: geomech bench slopes --seeds 0-9 --invariance")
    unit, found = figures.yardstick(), {}
    spent: dict[str, dict[str, float]] = {}
    print(figures.machine_text(figures.machine()), end="\n\n")
    for name in options.topics or TOPICS:
        began = time.perf_counter(), figures.processor_seconds()
        if name == "slopes" and options.invariance:
            from ...bench.slopes.slope_invariance import measure_invariance

            found[name] = measure_invariance(seeds)
        elif name in _SEEDED and seeds:
            found[name] = topic(name, "measure_many")(seeds)
        elif name in ("dda", "motion"):
            found[name] = topic(name)(options.quick, options.blocks)
        elif name == "debris":
            found[name] = topic(name)(options.quick, options.seconds)
        else:
            found[name] = topic(name)(options.quick)
        spent[name] = {
            "seconds": time.perf_counter() - began[0],
            "of processor": figures.processor_seconds() - began[1],
        }
        print(found[name].text, end="\n\n", flush=True)
    print(figures.times_text(spent), end="\n\n")
    print(figures.write(out, found, quick=options.quick, unit=unit, spent=spent))
    if before is None:
        return DONE
    changes = figures.changes(before, found, unit)
    print(figures.compared(changes, before, options.against))
    return FAILED if figures.less_accurate(changes) else DONE


def _seeds(options: argparse.Namespace) -> range:
    """The requested seeds; none: the benchmark's own."""
    if options.seeds is None:
        return range(0)
    if not _SEEDED & set(options.topics):
        raise BadInput("--seeds belongs to safety, slopes and sliding: geomech bench slopes --seeds 0-299")
    first, _, last = options.seeds.partition("-")
    if not (first.isdecimal() and (last or first).isdecimal() and int(first) <= int(last or first)):
        raise BadInput(f"--seeds takes two ascending numbers, such as 0-299, not {options.seeds!r}")
    return range(int(first), int(last or first) + 1)
