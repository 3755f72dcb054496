"""Effect of readings of the paper, crack faces and settings: on one load step, and on whole runs if these were made."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from compare_two_cracks import MPA, Watch, by_angle, coalescence_angle_deg
from first_step import FACES, READINGS, SETTINGS, first_step

from geomech.reference.specimens.two_cracks import PHI_DEG
from geomech.report.study_part import Part

#: Prefixes of the variants that are runs of the four specimens with a change → description of the change.
FAMILIES = {
    "closed": "closed faces, friction 30°",
    "horizontal": "φ from the horizontal",
    "quadratic": "the paper's elements, ungraded; increments of 2 mm, fixed steps",
    "paper": "the paper's: these and Kelvin's solution",
}
#: Prefixes of the variants that vary one setting → its name; the value follows the first "_".
VARIED_SETTINGS = {
    "increment": "increment, mm",
    "approach": "increments to what is left (0: they do not shorten)",
    "order": "order of the elements",
    "step": "time step, s (0: to the events themselves)",
}

#: Lengths, m, of a wing at which loads are compared when one setting is varied: before any two wings meet.
LENGTHS = (2e-3, 3e-3, 4e-3)
#: Why the ways of transmitting forces differ.
SPRINGS = """\
The platens act on the specimen by springs at its corners. Distributed over the face, their forces are the uniform stress
of the test. As point forces at the corners, they load the cracks unevenly. In Kelvin's solution (equations 2-4) about
three quarters of a corner's force are carried by the rest of the infinite plane, which does not exist."""
GUESS = """\
If u in equation 4 were the displacement of the boundary and not the deformation of the spring, forces at the loaded end
would be {:.0f} times as large: a possible explanation, no more, of the low initiation stresses."""


def family(name: str) -> str:
    """The family or varied setting of a variant, by its name; "" of the study's own."""
    return next((known for known in (*FAMILIES, *VARIED_SETTINGS) if name.startswith(known + "_")), "")


def own(runs: Mapping[str, Watch]) -> dict[str, Watch]:
    """The runs of the study itself."""
    return {name: run for name, run in runs.items() if not family(name)}


def of_family(runs: Mapping[str, Watch], which: str) -> dict[str, Watch]:
    return {name: run for name, run in runs.items() if family(name) == which and run.last is not None}


def first_steps(folder: Path, overrides: Sequence[str]) -> list[Part]:
    """Initiation loads by reading, by faces and by settings, and the effect of settings on K; all from one load step."""
    found = {}

    def at(phi: int, changes: tuple) -> object:
        if (phi, changes) not in found:
            found[phi, changes] = first_step(folder, overrides, phi, changes)
        return found[phi, changes]

    def loads(choices: Mapping[str, tuple]) -> list[list]:
        return [
            [name, *(f"{at(phi, changes).initiation / MPA:.2f}" for phi in PHI_DEG)]
            for name, changes in choices.items()
        ]

    headers = ["", *(f"φ = {phi}" for phi in PHI_DEG)]
    cases = Part(
        "Both readings of φ, open and closed faces",
        headers,
        loads(FACES) + loads({name: changes for name, changes in READINGS.items() if changes}),
        [
            (
                "Initiation, MPa: the load at which the first tip reaches the printed toughness, by maximum tangential "
                "stress."
            ),
            "Slots are open at first and stay so; closed cracks slide.",
        ],
    )
    rows = []
    for name, changes in SETTINGS.items():
        if not changes:
            continue
        row: list = [name]
        for phi in PHI_DEG:
            exact, k = at(phi, ()), at(phi, changes).k
            off = np.abs(k / at(phi, changes).load - exact.k / exact.load).max(axis=1)
            row += [f"{100 * part:.2g}" for part in off * exact.load / np.abs(exact.k).max(axis=1)]
        rows.append(row)
    carried = Part(
        "Effect of the paper's settings before growth: errors of K, %",
        ["", *(f"{k}, φ = {phi}" for phi in PHI_DEG for k in ("K_I", "K_II"))],
        rows,
        [
            "Largest error at any tip, in hundredths of the largest K of that mode, against this study's settings.",
            (
                "These are within 2·10⁻⁵ of finer elements, and K within 3·10⁻⁹ of the crack solver alone under the "
                "exact tractions."
            ),
        ],
        [
            SPRINGS,
            GUESS.format(at(0, ()).springs),
        ],
    )
    initiation = Part(
        "Initiation by the same settings, MPa", headers, loads(SETTINGS), after=["The paper prints 2.24 to 5.23 MPa."]
    )
    return [cases, carried, initiation]


def whole_runs(runs: Mapping[str, Watch]) -> list[Part]:
    """The four specimens run to their end with other readings, faces and settings, and with one setting varied at a
    time; [] if no such variant was run."""
    base = by_angle(own(runs))
    rows = []
    for which, title in {"": "this study's", **FAMILIES}.items():
        for run in (own(runs) if not which else of_family(runs, which)).values():
            if run.last is not None:
                rows.append([title, run.phi, *_came_to(run, base.get(run.phi))])
    headers = ["run", "φ to crack 1", "initiation, MPa", "coalescence, MPa", "line, °", "largest distance, mm", "end"]
    found = []
    if any(of_family(runs, which) for which in FAMILIES):
        note = (
            "Largest distance of any grown point from the path of this study's run with the same φ; growth beyond a "
            "tip is not counted."
        )
        found.append(Part("Whole runs by other readings, faces and settings", headers, rows, after=[note]))
    for which, title in VARIED_SETTINGS.items():
        members = of_family(runs, which)
        if members:
            found.append(_effect_of_setting(which, title, members))
    return found


def _came_to(run: Watch, base: Watch | None) -> list:
    """Loads, slope of the line (degrees from the horizontal), largest distance from ``base``'s path, and the reason for
    the end."""
    cells: list = [f"{run.load(kind) / MPA:.2f}" if np.isfinite(run.load(kind)) else None for kind in _KINDS]
    angle = coalescence_angle_deg(run.cracks)
    away = apart(run, base) if base is not None and base is not run else np.nan
    return [
        *cells,
        None if np.isnan(angle) else f"{angle:.2f}",
        f"{1e3 * away:.2f}" if np.isfinite(away) else None,
        run.end,
    ]


_KINDS = ("initiation", "coalescence")


def apart(run: Watch, other: Watch) -> float:
    """Largest distance, m, of a grown node of ``run`` from the cracks of ``other``, of those that lie beside them:
    growth beyond a tip is longer, not elsewhere. nan without any."""
    cracks, against = run.cracks, other.cracks
    nodes = cracks.nodes[np.unique(cracks.segments[cracks.birth_cycle > 0])]
    if not len(nodes):
        return np.nan
    ends = against.nodes[against.segments]
    along = ends[:, 1] - ends[:, 0]
    part = np.clip(
        np.einsum("nsi,si->ns", nodes[:, None] - ends[:, 0], along) / np.einsum("si,si->s", along, along), 0.0, 1.0
    )
    away = np.hypot(*(nodes[:, None] - ends[:, 0] - part[..., None] * along).transpose(2, 0, 1))
    nearest = away.argmin(axis=1)
    rows = np.arange(len(nodes))
    is_tip = np.bincount(against.segments.ravel(), minlength=len(against.nodes)) == 1
    foot = part[rows, nearest]
    beyond = ((foot == 0) & is_tip[against.segments[nearest, 0]]) | ((foot == 1) & is_tip[against.segments[nearest, 1]])
    away = away[rows, nearest]
    return float(away[~beyond].max()) if not beyond.all() else np.nan


def _effect_of_setting(which: str, title: str, members: Mapping[str, Watch]) -> Part:
    """One setting varied: loads, their difference from the finest value at the same φ, and the distance of the paths
    apart."""
    by_value: dict[int, dict[float, Watch]] = {}
    for name, run in members.items():
        by_value.setdefault(run.phi, {})[float(name.split("_")[1].replace("p", "."))] = run
    rows: list[list] = []
    for phi, of_value in by_value.items():
        # From coarse to fine.
        values = sorted(of_value, reverse=which in ("increment", "step"))
        finest = of_value[values[-1]]
        for value in values:
            run = of_value[value]
            row: list = [phi, value]
            pairs = [(one.load("initiation"), *map(one.load_at, LENGTHS)) for one in (run, finest)]
            for load, best in zip(*pairs):
                off = 100 * (load / best - 1)
                row += [f"{load / MPA:.2f}" if np.isfinite(load) else None]
                row += [f"{off:+.2f}".replace("-0.00", "0.00") if run is not finest and np.isfinite(off) else None]
            away = apart(run, finest) if run is not finest else np.nan
            row += [f"{1e3 * away:.3f}" if np.isfinite(away) else None]
            joined, limit = run.load("coalescence"), finest.load("coalescence")
            row += [f"{joined / MPA:.2f}" if np.isfinite(joined) else None]
            off = 100 * (joined / limit - 1)
            row += [f"{off:+.2f}".replace("-0.00", "0.00") if run is not finest and np.isfinite(off) else None]
            rows.append([*row, f"{run.seconds:.1f}"])
    headers = ["φ", title, "initiation, MPa", "off, %"]
    for length in LENGTHS:
        headers += [f"{1e3 * length:.0f} mm long, MPa", "off, %"]
    headers += ["paths apart, mm", "joined, MPa", "off, %", "computed in, s"]
    note = (
        "Off: difference from the finest run of the same φ. Loads at which the wing at crack 1's upper end grows beyond "
        "this length; the series of increments and of their shortening run to coalescence, the others to 200 MPa. Paths "
        "apart: largest distance of a grown point from the cracks of the finest run."
    )
    return Part(f"Convergence: {title.split(',')[0].split(' (')[0]}", headers, rows, [note])
