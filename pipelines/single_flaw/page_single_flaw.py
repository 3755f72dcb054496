"""The study on one page: wings during growth, their stress intensity factors compared with closed forms, and the effect
of settings."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from compare_single_flaw import MPA, Wings, parts, settings

from geomech.output import Run
from geomech.reference.specimens import single_flaw as published
from geomech.render.curves.paths import crack_paths
from geomech.render.curves.studies import against
from geomech.report.page import Page
from geomech.report.run_page import add_curves, add_pictures, add_player, add_time, key_results

#: A sixth of the flaw's half-length: shorter wings are influenced by the corner at which they start.
SHORTEST = published.HALF_LENGTH / 6


def write_page(runs: Mapping[str, Wings], places: Mapping[str, Path], out: Path) -> Path:
    """The page of ``runs`` as ``out/report.html``: the first one in full, the others in comparison. ``places`` are run
    folders."""
    name, wings = next(iter(runs.items()))
    run = Run(places[name])
    page = Page(
        "Wing cracks from a single flaw",
        "Specimen of Wong et al. (2002), 50 × 170 mm, an open flaw of half-length 10 mm at 30° from the horizontal, "
        "between frictionless platens; computed by DDA and DDM coupled, as in Khanizadeh Bahabadi et al. (2023), "
        "Figures 10 (the specimen), 11, 12 and 14 (its cracks, alone and compared with other methods).",
    )
    page.facts(key_results(run))
    add_player(page, [run])
    add_pictures(page, run)
    with tempfile.TemporaryDirectory() as folder:
        drawings = Path(folder)
        grown = {name: {name: wings.last.cracks} for name, wings in runs.items() if len(wings.load)}
        if grown:
            page.figures(
                [(crack_paths(grown, drawings / "paths.svg", 6), "Paths (Figures 11, 12 and 14), mm.")],
                whole=len(grown) > 3,
            )
        for part in parts(wings):
            part.add_to(page)
            if part.title.startswith("K_I/σ"):
                page.figures(_figures(wings, drawings), least_rem=20)
    if len(runs) > 1:
        settings(runs).add_to(page)
    add_curves(page, run)
    add_time(page, run.summary)
    page.section("How to reproduce it")
    page.code(
        "geomech run pipelines/single_flaw                  # this page\n"
        "geomech run pipelines/single_flaw --variant all    # with increments, faces and the paper's settings for comparison"
    )
    return page.write(out / "report.html")


def _figures(wings: Wings, drawings: Path) -> list[tuple[Path, str]]:
    """K_I/σ against length with the closed forms, and the load against length."""
    long = wings.wing > SHORTEST
    lengths = wings.wing[long] / published.HALF_LENGTH
    if len(lengths) < 2:
        return []
    span = np.geomspace(lengths[0], lengths[-1], 40)
    at = span * published.HALF_LENGTH
    factors = {
        "computed": (lengths, wings.k[long, 0] / wings.load[long]),
        "Horii & Nemat-Nasser, closed": (span, published.wing_horii_nemat_nasser(at)),
        "Ashby & Hallam, closed": (span, published.wing_ashby_hallam(at)),
    }
    loads = {"computed": (lengths, wings.load[long] / MPA)}
    x = "length of a wing, l/a"
    return [
        (against(factors, drawings / "k.svg", x, "K_I/σ, √m", log=True), "K_I of the right wing divided by the load."),
        (against(loads, drawings / "load.svg", x, "axial stress, MPa"), "The load at which the wing grew."),
    ]
