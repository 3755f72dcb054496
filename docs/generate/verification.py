"""Pages of verification from stored figures of benchmarks, which tests hold against what is computed now."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping
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
the stored one is stale. Errors are relative; 0 is exact to the last digit. What each is held against:
[cracks](../verification/cracks.md),
[blocks](../verification/blocks.md), [blocks and cracks](../verification/coupled.md).
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
    return {"accuracy.md": _accuracy(), "observed_orders.md": _orders()}


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


def _short(value: float) -> str:
    if value == 0 or value >= 1e-2:
        return f"{100 * value:.2g} %" if value else "0"
    digits, _, power = f"{value:.1e}".partition("e")
    # A hyphen at which no line is broken.
    return f"{digits}e\u2011{abs(int(power))}"
