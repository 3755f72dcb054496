"""Verification pages, made from figures that tests and benchmarks have measured and stored.

``docs/verification/figures.json`` comes from tests that take the fixture `verified`, ``bench_baseline.json`` and
``docs/verification/times.json`` from `geomech bench`. Tests hold each against what is computed now.
"""

from __future__ import annotations

import ast
import json
import math
import re
from collections.abc import Iterable, Iterator, Mapping
from itertools import pairwise
from pathlib import Path

ROOT = Path(__file__).parents[2]
#: Written by `geomech bench … --quick --out`, held by tests/validation/test_bench_baseline.py.
FIGURES = ROOT / "tests" / "validation" / "bench_baseline.json"

ACCURACY = """# Accuracy, as measured

Made from `{file}`, which this command writes:

```sh
geomech bench accuracy boundary coupling dda ddm schemes stability steps --quick --out figures.json
geomech bench --quick --against tests/validation/bench_baseline.json      # what got worse since
```

`tests/validation/test_bench_baseline.py` computes the figures again in every run of the tests and fails where one
is worse, or better by so much that
the stored one is stale. Errors are relative; 0 is exact to the last digit. For the references see
[cracks](../verification/cracks.md),
[blocks](../verification/blocks.md), [blocks and cracks](../verification/coupled.md).
"""

#: Written by `pytest --record-figures`, held by the tests that wrote them.
MEASURED = ROOT / "docs" / "verification" / "figures.json"
#: Written by `geomech bench … --quick --out`.
TIMES = ROOT / "docs" / "verification" / "times.json"
TIMES_OPENING = """# Times, as measured

Made from `{file}`, which this command writes:

```sh
geomech bench {topics} --quick --out docs/verification/times.json
geomech bench --quick --against docs/verification/times.json      # what got slower since
```

Processor time where a benchmark runs in one process. Machine: {machine}; load average {load}; the yardstick, a fixed piece
of work by which `--against` compares machines, took {unit:.0f} ms. What the rows mean, and larger cases: [how
fast](../verification/speed.md).
"""

#: Page → its title, and what the paths of the tests match whose figures it shows; a file is on the first that it matches.
CHAPTERS = {
    "blocks": ("Blocks, as measured", r"tests/(dda/|validation/test_(dda|safety|joint_laws))"),
    "cracks": ("Cracks, as measured", r"tests/(ddm|validation)/"),
    "coupled": ("Blocks and cracks together, as measured", r"tests/(pipelines|coupling)/"),
}

CHAPTER = """# {title}

Made from `{file}`. Each section is one file of tests; its command computes the figures again and fails where one is
more than three times as far off as stored, or the stored one is out of date. `--record-figures` stores them again.
Errors are relative unless they have a unit; where a row stands for several variants it is the worst of them.
"""

TOPICS = {
    "accuracy": (
        "Published values and closed forms",
        "case",
        "Default settings: order 4, four elements a crack, unless the row says otherwise.",
    ),
    "boundary": (
        "Ways from contact forces to tractions",
        "way",
        "`contacts` spreads contact forces over faces (default), `springs` leaves them as point forces, `kelvin-springs` "
        "is the paper's route. K against that of the specimen under an even load.",
    ),
    "coupling": (
        "Passes of blocks and cracks",
        "case",
        "K against passes to round-off, by the tolerance at which passes end.",
    ),
    "dda": ("Blocks", "case", "Rigid blocks and a column of elastic ones."),
    "steps": (
        "Fixed steps against events",
        "case",
        "The two-crack specimen by steps of 16 s, against steps from event to event: loads of initiation and "
        "coalescence.",
    ),
}

ORDERS = """# Observed orders

Errors by the order p of elements, by the time step, by what was asked for; from the same stored figures as
[accuracy](accuracy.md). The observed order
is the slope between neighbouring figures in logarithms: −d ln(error)/d ln(p) for elements, d ln(error)/d ln(Δt) for
steps. Where a solution is smooth along the elements it grows with p,
as that of an exponential does.
"""


def _stored() -> Mapping[str, Mapping[str, Mapping[str, float]]]:
    return json.loads(FIGURES.read_text(encoding="utf-8"))["topics"]


def pages() -> dict[str, str]:
    """File name → page as MyST Markdown."""
    return {
        "accuracy.md": _accuracy(),
        "observed_orders.md": _orders(),
        "two_cracks_table.md": two_cracks(),
        "times.md": times(),
        **{f"measured_{name}.md": chapter(name) for name in CHAPTERS},
    }


def measured(name: str) -> dict[str, dict[str, dict]]:
    """Path of a file of tests → test → ``slow`` and ``cases``, of the chapter ``name``; a file belongs to the first
    chapter that names it."""
    stored = json.loads(MEASURED.read_text(encoding="utf-8"))
    of = {path: next((c for c, (_, pattern) in CHAPTERS.items() if re.match(pattern, path)), "") for path in stored}
    return {path: tests for path, tests in stored.items() if of[path] == name}


def chapter(name: str) -> str:
    """The page of one chapter."""
    title, _ = CHAPTERS[name]
    lines = [CHAPTER.format(title=title, file=MEASURED.relative_to(ROOT))]
    if any(row.get("over") for *_, row in _cases(measured(name))):
        lines += [f"![Errors of the convergence studies on this page](measured_{name}.png)", ""]
    for path, tests in measured(name).items():
        docstring = ast.get_docstring(ast.parse((ROOT / path).read_text(encoding="utf-8"))) or path
        heading = (
            " ".join(docstring.split("\n\n")[0].split())
            .partition(";")[0]
            .partition(":")[0]
            .partition(" against ")[0]
            .rstrip(".")
        )
        slow = ' -m "slow or not slow"' if any(test["slow"] for test in tests.values()) else ""
        lines += [f"## {heading}", "", f"`pytest -s{slow} {path}`", ""]
        rows = merged(tests)
        plain = [(case, row) for case, row in rows.items() if "over" not in row]
        if plain:
            values = any("found" in row or "exact" in row for _, row in plain)
            lines += ["| case | computed | reference | error | against |", "|---|---|---|---|---|"] if values else [
                "| case | error | against |", "|---|---|---|"
            ]  # fmt: skip
            lines += [_plain(case, row, values) for case, row in plain]
            lines.append("")
        for case, row in rows.items():
            if "over" in row:
                lines += [f"**{case}**, against {row['against']}", "", *_convergence(row), ""]
    return "\n".join(lines) + "\n"


def merged(tests: Mapping[str, dict]) -> dict[str, dict]:
    """Case → its figure; of one case in several variants of a test the worst, without what belongs to one of them."""
    rows: dict[str, dict] = {}
    for _, case, row in _cases({"": tests}):
        if case not in rows:
            rows[case] = {**row, "variants": 1}
            continue
        worst = max(rows[case], row, key=lambda r: max(r["errors"]))
        rows[case] = {k: v for k, v in worst.items() if k not in ("found", "exact")}
        rows[case]["variants"] = rows[case].get("variants", 1) + 1
    return rows


def _cases(files: Mapping[str, Mapping[str, dict]]) -> Iterator[tuple[str, str, dict]]:
    for path, tests in files.items():
        for test in tests.values():
            for case, row in test["cases"].items():
                yield path, case, row


def _plain(case: str, row: Mapping, values: bool) -> str:
    """A row of the table of a test; without columns of computed and exact ``values`` where no case has them."""
    unit = f" {row['unit']}" if row.get("unit") else ""
    both = [f"{row[key]:.6g}{unit}" if key in row else "" for key in ("found", "exact")]
    # Beside both values a relative error is their ratio's; else an error has the unit of its row.
    relative = not unit or ("found" in row and math.isclose(row["errors"][0], _off(row), rel_tol=0.1, abs_tol=1e-4))
    error = _short(row["errors"][0]) if relative else f"{_digits(row['errors'][0])}{unit}"
    return f"| {' | '.join([case, *(both if values else []), error])} | {row['against']} |"


def _off(row: Mapping) -> float:
    return abs(row["found"] / row["exact"] - 1)


def _convergence(row: Mapping) -> Iterator[str]:
    at, errors, unit = row["at"], row["errors"], row.get("unit", "")
    shown = [f"{_digits(e)}" if unit else _short(e) for e in errors]
    yield f"| {row['over']} | " + " | ".join(f"{x:g}" for x in at) + " |"
    yield "|" + "---|" * (len(at) + 1)
    yield f"| error{', ' + unit if unit else ''} | " + " | ".join(shown) + " |"
    if all(errors):
        slopes = [abs(math.log(b / a) / math.log(y / x)) for (x, a), (y, b) in pairwise(zip(at, errors))]
        yield "| observed order |  | " + " | ".join(f"{slope:.1f}" for slope in slopes) + " |"


def two_cracks() -> str:
    """The table of the specimens of the paper, from a slow test of that study."""
    from geomech.reference.specimens import two_cracks as published

    tests = measured("coupled")["tests/pipelines/test_two_cracks.py"]
    cases = tests["test_all_four_as_published"]["cases"]
    lines = [
        "| φ | initiation, MPa (σ√(πb)/K_Ic) | coalescence, MPa (σ√(πb)/K_Ic) | line of coalescence: computed | experiment "
        "| published DDA–DDM |",
        "|---|---|---|---|---|---|",
    ]
    for phi in published.PHI_DEG:
        loads = [cases[f"φ = {phi}°: {kind}"]["found"] for kind in ("initiation", "coalescence")]
        cells = [f"{load:.4g} ({published.normalised_load(1e6 * load):.3g})" for load in loads]
        angles = [
            cases[f"φ = {phi}°: line of coalescence"]["found"],
            *(published.COALESCENCE_ANGLE_DEG[name][phi] for name in ("experiment", "KB 2023, DDA-DDM")),
        ]
        cells += [f"{angle:.1f}°".replace("-", "−") for angle in angles]
        lines.append(f"| {phi}° | " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


def times() -> str:
    """The page of run times, as `geomech bench` stored them."""
    stored = json.loads(TIMES.read_text(encoding="utf-8"))
    machine = stored["machine"]
    lines = [
        TIMES_OPENING.format(
            file=TIMES.relative_to(ROOT),
            topics=" ".join(stored["topics"]),
            machine=f"{machine['processor']}, {machine['cores']} cores, Python {machine['python']}",
            load=machine["load average"],
            unit=1e3 * stored["yardstick_s"],
        )
    ]
    for topic, found in stored["topics"].items():
        if found["time"]:
            lines += [f"## {topic}\n", f"`geomech bench {topic}`\n", "| what | time |", "|---|---|"]
            lines += [f"| {name} | {_seconds(value)} |" for name, value in found["time"].items()]
            lines.append("")
    return "\n".join(lines) + "\n"


def _seconds(value: float) -> str:
    for least, unit in ((1.0, "s"), (1e-3, "ms"), (1e-6, "µs")):
        if value >= least:
            return f"{value / least:.3g} {unit}"
    return f"{value / 1e-9:.3g} ns"


def pictures() -> Iterable[tuple[str, str]]:
    """(file, chapter) of the pictures that `draw` makes."""
    return [
        (f"measured_{name}.png", name) for name in CHAPTERS if any("over" in row for *_, row in _cases(measured(name)))
    ]


def draw(name: str, path: Path) -> None:
    """All convergence studies of a chapter: error over what was refined, coarsest at 1."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9, 5), layout="constrained")
    axes = figure.subplots()
    for tests in measured(name).values():
        for case, row in merged(tests).items():
            if "over" not in row or not all(row["errors"]):
                continue
            # Small values of a step are fine, large ones of an order, a number of elements or a modulus.
            finer = [max(x / row["at"][0], row["at"][0] / x) for x in row["at"]]
            label = case if len(case) < 60 else case[:57] + "…"
            axes.loglog(finer, row["errors"], ".-", lw=1.2, label=label)
    for order in (1, 2):
        axes.loglog([1, 10], [1e-2, 1e-2 / 10**order], "--", color="0.7", lw=0.8)
        axes.annotate(f"order {order}", (10, 1e-2 / 10**order), color="0.5", fontsize=8)
    axes.set(xlabel="refinement", ylabel="error")
    axes.legend(frameon=False, fontsize=7, loc="center left", bbox_to_anchor=(1.0, 0.5))
    figure.savefig(path, dpi=110)


def _accuracy() -> str:
    lines = [ACCURACY.format(file=FIGURES.relative_to(ROOT))]
    for topic, (title, what, text) in TOPICS.items():
        errors = _stored()[topic]["error"]
        lines += [f"## {title}\n", text + "\n", f"`geomech bench {topic}`\n", f"| {what} | error |", "|---|---|"]
        lines += [f"| {name} | {_short(value)} |" for name, value in errors.items()]
        lines.append("")
    return "\n".join(lines) + "\n"


def _orders() -> str:
    lines = [ORDERS]
    for topic, title, text in (
        (
            "ddm",
            "Cracks",
            "`geomech bench ddm` (in quick form here). K against closed forms, published values and second methods.",
        ),
        ("schemes", "Blocks", "`geomech bench schemes`. Springs against multipliers, three time schemes."),
    ):
        lines += [f"## {title}\n", text + "\n"]
        for name, curve in _curves(_stored()[topic]["error"]).items():
            lines += [f"**{name}**\n", *_table(name, curve), ""]
    return "\n".join(lines) + "\n"


def _curves(errors: Mapping[str, float]) -> dict[str, list[tuple[float, float]]]:
    """Name → (abscissa, error) of figures that differ in a number at their end alone."""
    curves: dict[str, list[tuple[float, float]]] = {}
    for name, error in errors.items():
        what, _, number = name.rpartition(": ")
        try:
            curves.setdefault(what.rstrip(":"), []).append((float(number), error))
        except ValueError:
            continue
    return {name: curve for name, curve in curves.items() if len(curve) > 1}


#: Words in the name of a curve → what its figures are over, and whether an order is observed in it.
ABSCISSAE = (
    ("p = ", "order p", True),
    ("asked for", "digits asked for", False),
    ("time step", "time step, s", True),
    ("penalty", "penalty, E", True),
    ("increments", "increments", True),
    ("depths", "size of the block, depths", True),
    ("tolerance", "tolerance", False),
)


def _table(name: str, curve: list[tuple[float, float]]) -> Iterator[str]:
    what, ordered = next(((what, ordered) for word, what, ordered in ABSCISSAE if word in name), ("at", False))
    yield "| " + " | ".join([what, *(f"{x:g}" for x, _ in curve)]) + " |"
    yield "|" + "---|" * (len(curve) + 1)
    yield "| " + " | ".join(["error", *(_short(error) for _, error in curve)]) + " |"
    if ordered:
        slopes = [abs(math.log(b / a) / math.log(y / x)) for (x, a), (y, b) in pairwise(curve)]
        yield "| " + " | ".join(["observed order", "", *(f"{slope:.1f}" for slope in slopes)]) + " |"


def _digits(value: float) -> str:
    """Two digits of a number with a unit."""
    if value == 0 or 1e-2 <= value < 1e4:
        return f"{value:.2g}"
    digits, _, power = f"{value:.1e}".partition("e")
    return f"{digits}e{chr(0x2011) if int(power) < 0 else ''}{abs(int(power))}"


def _short(value: float) -> str:
    if value == 0 or value >= 1e-2:
        return f"{100 * value:.2g} %" if value else "0"
    digits, _, power = f"{value:.1e}".partition("e")
    # A hyphen at which no line is broken.
    return f"{digits}e\u2011{abs(int(power))}"
