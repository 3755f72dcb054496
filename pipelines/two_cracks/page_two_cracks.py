"""The study on one page: paths, tables and figures of the paper compared with computed ones, and the effect of
settings."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from compare_settings import FAMILIES, VARIED_SETTINGS, family, first_steps, of_family, own, whole_runs
from compare_two_cracks import MPA, Watch, by_angle, parts

from geomech.output import Run
from geomech.reference.specimens import two_cracks as published
from geomech.render.curves.paths import crack_paths
from geomech.render.curves.studies import against
from geomech.report.comparison_page import add_compared_curves, add_ends
from geomech.report.page import Page
from geomech.report.run_page import add_player

#: Parts of the comparison that have a figure.
LOADS = "Loads and strains"


def write_page(runs: Mapping[str, Watch], folder: Path, out: Path, overrides: Sequence[str] = ()) -> Path:
    """The page of ``runs`` (variant → its observer; their run folders are in ``out``) as ``out/report.html``."""
    base = own(runs)
    by_phi = by_angle(base or runs)
    page = Page(
        "Two cracks under uniaxial compression",
        "Specimens of Haeri et al. (2014), computed by DDA and DDM coupled as Khanizadeh Bahabadi et al. (2023) did "
        "(KB 2023), compared with the printed results of both.",
    )
    facts = {f"φ = {phi}°: initiation, coalescence": _pair(run) for phi, run in by_phi.items()}
    page.facts(facts)
    page.section("The specimens")
    page.text(
        "60 × 120 mm between frictionless platens, two open slots of 10 mm, 20 mm apart on the axis, crack 1 (upper) "
        "at 45° and crack 2 turned from it by φ. E = 17 GPa, ν = 0.21, K_Ic = 2 MPa√m; the load rises by 0.2 MPa/s. "
        "Compression is given positive here."
    )
    with tempfile.TemporaryDirectory() as drawings:
        _fill(page, runs, by_phi, folder, out, overrides, Path(drawings))
    page.section("How to reproduce it")
    page.code(
        "geomech run pipelines/two_cracks                  # the four specimens and this page\n"
        "geomech run pipelines/two_cracks --variant all    # and readings, faces, settings, convergence\n"
        "geomech bench boundary                            # errors of K by the way contact forces are transmitted"
    )
    return page.write(out / "report.html")


def _fill(page: Page, runs, by_phi, folder: Path, out: Path, overrides, drawings: Path) -> None:
    folders = [Run(out / name) for name in own(runs) or runs if (out / name / "history.csv").is_file()]
    add_ends(page, folders, "Paths (Figures 8, 9 and 13)")
    add_player(page, folders[:4])
    if by_phi:
        page.figures(
            [(_paths(own(runs) or runs, drawings / "paths.svg"), "Paths only, mm: slots black, growth in colour.")],
            whole=True,
        )
    sections = parts(own(runs) or runs)
    for part in sections:
        if part.title.startswith("Where"):
            continue
        part.add_to(page)
        if part.title.startswith(LOADS):
            page.figures(_figures(by_phi, drawings), least_rem=20)
    add_compared_curves(page, folders)
    for part in first_steps(folder, overrides):
        part.add_to(page)
    others = whole_runs(runs)
    for part in others:
        part.add_to(page)
    panels = _compared_paths(runs)
    if panels:
        page.figures(
            [(crack_paths(panels, drawings / "compared.svg"), "Paths by other readings, faces and settings, mm.")],
            whole=True,
        )
    series = _paths_by_setting(runs)
    if series:
        page.figures(
            [(crack_paths(series, drawings / "ladders.svg", 3), "Paths with one setting varied, mm.")], whole=True
        )
    if not others:
        page.section("Whole runs by other readings, faces and settings; convergence")
        page.text(
            "Not made: they take some minutes. geomech run pipelines/two_cracks --variant all makes them, and adds "
            "them here."
        )
    for part in sections:
        if part.title.startswith("Where"):
            part.add_to(page)


def _pair(run: Watch) -> str:
    return (
        ", ".join(
            "none" if np.isnan(run.load(k)) else f"{run.load(k) / MPA:.1f}" for k in ("initiation", "coalescence")
        )
        + " MPa"
    )


def _paths(runs: Mapping[str, Watch], path: Path) -> Path:
    return crack_paths({f"φ = {phi}°": {"": run.cracks} for phi, run in by_angle(runs).items()}, path)


def _figures(by_phi: Mapping[int, Watch], drawings: Path) -> list[tuple[Path, str]]:
    """Figures 15, 16 and 17: stresses, their ratio to the strength and strains against φ."""
    if len(by_phi) < 2:
        return []

    def curve(kind: str, of) -> tuple[list[float], list[float]]:
        found = [(angle, of(run)) for angle, run in by_phi.items() if np.isfinite(run.load(kind))]
        return [float(angle) for angle, _ in found], [value for _, value in found]

    def stresses(scale: float = 1.0) -> dict:
        return {
            kind: curve(kind, lambda run, kind=kind: scale * run.load(kind) / MPA)
            for kind in ("initiation", "coalescence")
        }

    ranges = {
        f"{kind}, {who}": span
        for kind, table in (
            ("initiation", published.INITIATION_STRESS_MPA),
            ("coalescence", published.COALESCENCE_STRESS_MPA),
        )
        for who, span in table.items()
    }
    name, made = "φ, degrees", []
    made.append(
        (
            against(stresses(), drawings / "f15.svg", name, "axial stress, MPa", ranges),
            "Figure 15: stresses, printed toughness; bands are published ranges.",
        )
    )
    if 0 in by_phi and np.isfinite(by_phi[0].load("initiation")):
        fit = published.INITIATION_STRESS_MPA["experiment"][0] * MPA / by_phi[0].load("initiation")
        caption = (
            f"Figure 15 with one effective toughness of {fit * published.K_IC / MPA:.2f} MPa√m, fitted to the "
            "experiment's initiation at φ = 0."
        )
        measured = {key: span for key, span in ranges.items() if "experiment" in key}
        made.append((against(stresses(fit), drawings / "f15b.svg", name, "axial stress, MPa", measured), caption))
    ratio = {"σ_F/σ_c": curve("coalescence", lambda run: run.load("coalescence") / published.UNIAXIAL_STRENGTH)}
    made.append(
        (
            against(ratio, drawings / "f16.svg", name, "σ_F/σ_c"),
            "Figure 16: stress of coalescence over the strength of intact rock.",
        )
    )
    strains = {
        kind: curve(kind, lambda run, kind=kind: 1e3 * run.strains[kind]) for kind in ("initiation", "coalescence")
    }
    made.append(
        (
            against(strains, drawings / "f17.svg", name, "axial strain, 10⁻³"),
            "Figure 17: strains at initiation and coalescence.",
        )
    )
    return made


def _compared_paths(runs: Mapping[str, Watch]) -> dict[str, dict]:
    """Panel per φ (to crack 1) → family → cracks."""
    panels: dict[str, dict] = {}
    if not any(of_family(runs, which) for which in FAMILIES):
        return panels
    for which, title in {"": "this study's", **FAMILIES}.items():
        members = own(runs) if not which else of_family(runs, which)
        for run in members.values():
            if run.last is not None:
                panels.setdefault(f"φ = {run.phi}°", {})[title] = run.cracks
    return panels


def _paths_by_setting(runs: Mapping[str, Watch]) -> dict[str, dict]:
    """Panel per varied setting and φ → value → cracks."""
    panels: dict[str, dict] = {}
    for name, run in runs.items():
        which = family(name)
        if which in VARIED_SETTINGS and run.last is not None:
            label = f"{VARIED_SETTINGS[which].split(' (')[0]} {name.split('_')[1].replace('p', '.')}"
            panels.setdefault(f"{VARIED_SETTINGS[which].split(',')[0]}, φ = {run.phi}°", {})[label] = run.cracks
    return panels
