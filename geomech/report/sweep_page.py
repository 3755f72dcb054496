"""Page of a sweep: probability of failure with its confidence interval, sensitivities, mechanisms, computing time."""

from __future__ import annotations

import tempfile
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..render.curves import sweep_figures
from ..sweep.execution import PICTURED, Sweep, read_sweep
from ..sweep.measures import DONE, moved_cells
from ..sweep.results import counted_by_reason
from ..sweep.statistics import (
    SensitivityMissing,
    convergence,
    distribution,
    numbers,
    picked,
    probability,
    sensitivities,
    share_text,
    tornado,
    wilson,
)  # fmt: skip
from .page import Page

#: Number of variables shown, those with the largest effect.
_DRAWN = 9
#: Columns with statistics, if runs have them.
_RESULTS = (
    "moved_volume", "moved_mass", "moving_blocks", "run_out_m", "peak_load_pa", "initiation_load_pa",
    "coalescence_load_pa", "crack_growth_m", "key_blocks", "largest_displacement_m", "blocks",
)  # fmt: skip
#: Number of reasons, mechanisms and columns shown.
_LISTED = 20


def page_of_sweep(folder: Path | str) -> Page:
    """Page of the sweep in ``folder``, as far as it has come. Raises FileNotFoundError, SceneError."""
    found = read_sweep(folder)
    page = Page(f"Sweep: {found.plan.title}", f"{len(found.rows)} runs · {found.folder}")
    with tempfile.TemporaryDirectory() as place:
        _Writer(page, found, Path(place)).write()
    return page


class _Writer:
    """Adds section after section; ``place`` holds pictures until the page is written."""

    def __init__(self, page: Page, found: Sweep, place: Path) -> None:
        self.page, self.found, self.place = page, found, place
        self.rows = list(found.rows)
        self.done = [row for row in self.rows if row["status"] == DONE]
        self.result = found.plan.result
        self.label = self.result.replace("_", " ")
        self.names = [each.name for each in found.plan.variables]
        self.limit = _limit(found.plan.fails, self.result)

    def write(self) -> None:
        self._facts()
        self._asked()
        self._distribution()
        if self.found.rare is not None:
            self._rare()
        else:
            self._convergence()
            self._sensitivities()
            self._responses()
        self._map()
        self._mechanisms()
        self._pictures()
        self._without_answer()
        self._columns()
        self._times()
        self._again()

    def _facts(self) -> None:
        failure, values = probability(self.rows), self._values()
        facts: dict[str, Any] = {}
        if self.found.rare is not None:
            low, high = self.found.rare.interval
            facts |= {"probability of failure": f"{self.found.rare.value:.3g}", "95 %": f"{low:.2g} to {high:.2g}",
                      "by": self.found.rare.method}  # fmt: skip
        elif failure.answered:
            facts |= {"probability of "
                      "failure": share_text(failure.value), "95 % (Wilson)": f"{share_text(failure.low)} to "
                                                                          f"{share_text(failure.high)}",
                      "failed": f"{failure.failures} of {failure.answered}"}  # fmt: skip
        if len(values) and self.found.rare is None:
            facts |= {
                f"mean {self.label}": float(values.mean()),
                "standard deviation": float(values.std(ddof=1)) if len(values) > 1 else None,
            }
        facts |= {"runs": len(self.rows), "without a result": len(self.rows) - len(self.done)}
        self.page.facts(facts)
        if not self.found.complete:
            self.page.warning(
                f"The sweep is not complete: {len(self.rows)} of {len(self.found.plan.table)} runs. To continue: "
                "geomech sweep … --resume"
            )
        if self.found.rare is None and failure.few and failure.failures < failure.answered:
            self.page.warning(
                f"Only {failure.failures} runs failed: the probability of failure is known to its order of "
                "magnitude. More runs, or --rare subset, would reduce the uncertainty."
            )
        if failure.answered < failure.runs and self.found.rare is None:
            self.page.warning(
                f"{failure.runs - failure.answered} runs have no result and are left out of the probability of "
                "failure; it would be "
                f"{share_text(failure.least)} if all of them were stable, {share_text(failure.most)} if all failed."
            )

    def _asked(self) -> None:
        plan, settings = self.found.plan, self.found.plan.settings
        self.page.section("Input")
        rows = [[each.name, str(each)] for each in plan.variables]
        rows += [[key, f"= {text}"] for key, text in plan.derived.items()]
        rows += [["joint seeds", f"{plan.seeds[0]} to {plan.seeds[-1]} ({len(plan.seeds)})"]] if plan.seeds else []
        rows += [
            [" and ".join(each["between"]), f"correlation {each['coefficient']:g}"] for each in settings["correlated"]
        ]
        if rows:
            self.page.table(["what varies", "how"], rows)
        sampled = f"{settings['sampling']} samples from seed {settings['seed']}; " if plan.random else ""
        self.page.text(f"Scene {plan.scene}; {sampled}measure: {settings['measure']}; a run fails where {plan.fails}.")
        self.page.text(*plan.warnings)

    def _values(self) -> np.ndarray:
        values = numbers(self.done, self.result)
        return values[np.isfinite(values)]

    def _distribution(self) -> None:
        values = self._values()
        if len(values) < 2 or self.found.rare is not None:
            return
        self.page.section(f"Distribution of the {self.label}")
        ordered, shares, half = distribution(values)
        drawn = sweep_figures.draw_distribution(
            ordered, shares, half, self.label, self.place / "distribution.svg", self.limit
        )
        self.page.figures(
            [
                (
                    drawn,
                    f"Left: runs by {self.label}, failed ones in red. Right: the cumulative distribution, with the 95 "
                    "% band of Dvoretzky, Kiefer and Wolfowitz.",
                )
            ],
            whole=True,
        )
        bounds = sum(bool(row.get("is_bound")) for row in self.done)
        if bounds:
            self.page.text(
                f"Of {bounds} runs the factor is a bound: no failure up to the end of the search, or cracks left out."
            )
        quantiles = (0.01, 0.05, 0.25, 0.5, 0.75, 0.95, 0.99)
        self.page.table(
            [f"{100 * q:g} %" for q in quantiles],
            [[float(value) for value in np.quantile(values, quantiles)]],
            "Quantiles",
        )

    def _rare(self) -> None:
        rare = self.found.rare
        assert rare is not None  # asked for by the caller
        self.page.section("Rare failure")
        self.page.text(f"{rare}.")
        if rare.levels:
            self.page.text(
                "Levels: "
                + ", ".join(f"{level:.4g}" for level in rare.levels)
                + " (each holds a tenth of the samples before it)."
            )
        if rare.design_point:
            pairs = zip((each.name for each in self.found.plan.random), rare.design_point, strict=True)
            self.page.table(
                ["variable", "design point, standard deviations"],
                [[name, value] for name, value in pairs],
                f"Reliability index β = {rare.beta:.3f}",
            )
        self.page.text(
            "Its runs are not plain samples: counts, maps and shares below refer to the runs that the method has made."
        )

    def _convergence(self) -> None:
        table = convergence(self.rows)
        if len(table) > 1:
            self.page.section("Convergence")
            drawn = sweep_figures.draw_convergence(table, self.place / "convergence.svg")
            self.page.figures(
                [(drawn, "Probability of failure against the number of runs, in the order of the table.")], whole=True
            )

    def _sensitivities(self) -> None:
        swings = tornado(self.done, self.names, self.result)
        if not swings or len(self._values()) < 3:
            return
        self.page.section("Sensitivities")
        mean = float(self._values().mean())
        drawn = sweep_figures.draw_tornado(swings[:_DRAWN], mean, self.label, self.place / "tornado.svg")
        self.page.figures(
            [
                (
                    drawn,
                    f"Mean {self.label} at both ends of each variable, with the others random; lines: 95 % "
                    "interval of the mean.",
                )
            ],
            whole=True,
        )
        plan = self.found.plan
        if not plan.random:
            return
        try:
            found = sensitivities(self.rows, plan.random, self.result, plan.settings["sampling"])
        except SensitivityMissing as missing:
            self.page.text(f"No Sobol' indices: {missing}.")
            return
        drawn = sweep_figures.draw_sensitivities(found, self.place / "sensitivities.svg")
        way = "Saltelli's design" if plan.settings["sampling"] == "saltelli" else "RBD-FAST from the given samples"
        self.page.figures([(drawn, f"Sobol' indices ({way}; SALib), with 95 % intervals.")], whole=True)
        if plan.settings["correlated"]:
            self.page.text("Variables are correlated: an index includes the effect of correlated ones.")

    def _responses(self) -> None:
        rows = [row for row in self.done if isinstance(row.get(self.result), (int, float))]
        columns = {name: numbers(rows, name) for name in self.names}
        columns = {name: at for name, at in columns.items() if np.isfinite(at).all() and len(np.unique(at)) > 1}
        if not columns or len(rows) < 2:
            return
        order = [swing.name for swing in tornado(rows, list(columns), self.result)]
        columns = {name: columns[name] for name in [*order, *(n for n in columns if n not in order)][:_DRAWN]}
        self.page.section("Responses")
        fails = np.array([bool(row["fails"]) for row in rows])
        drawn = sweep_figures.draw_responses(
            columns, numbers(rows, self.result), fails, self.label, self.place / "responses.png", self.limit
        )
        self.page.figures(
            [(drawn, "All runs, failed ones in red. Lines: means of tenths of the runs, or at each value.")], whole=True
        )

    def _map(self) -> None:
        plan = self.found.plan
        rows = [row for row in self.done if row.get("_places")]
        if not rows:
            return
        from ..scene import load_scene

        shares = np.mean([moved_cells(row["_places"], plan.cells) for row in rows], axis=0)
        if not shares.any():
            return
        names = [each.name for each in plan.variables]
        first = {name: rows[0][name] for name in (*names, "seed") if name in rows[0]}
        problem = load_scene(plan.scene, plan.changes(first), plan.variant, to_run=False).problem()
        blocks = problem.blocks
        outlines = [blocks.loops(b)[0] for b in range(blocks.n_blocks)]
        self.page.section("Moving region")
        drawn = sweep_figures.draw_map(shares, plan.box, outlines, blocks.fixed.tolist(), self.place / "map.png")
        what = "at failure, whatever the factor," if plan.settings["measure"] == "safety" else "in the run"
        self.page.figures(
            [
                (
                    drawn,
                    f"Number of {len(rows)} runs in which each place moves {what}, with the blocks of run {rows[0]['run']}.",
                )
            ],
            whole=True,
        )

    def _mechanisms(self) -> None:
        kind = "mechanism" if any("mechanism" in row for row in self.done) else "condition"
        counts = Counter(str(row[kind]) for row in self.done if row.get(kind))
        if not counts:
            return
        self.page.section("Mechanisms" if kind == "mechanism" else "Ends of runs")
        total, table = sum(counts.values()), []
        for name, number in counts.most_common(_LISTED):
            own = [row for row in self.done if row.get(kind) == name]
            low, high = wilson(number, total)
            table.append([name, number, share_text(number / total), f"{share_text(low)} to {share_text(high)}",
                          sum(bool(row["fails"]) for row in own), _mean(own, self.result),
                          _mean(own, "moved_volume"), _mean(own, "moving_blocks")])  # fmt: skip
        self.page.table(
            [kind, "runs", "share", "95 %", "that fail", f"mean {self.label}", "moves, m³/m", "blocks"], table
        )

    def _pictures(self) -> None:
        shown = []
        names: dict[int, list[str]] = {}
        for name, number in picked(self.rows, self.result, self.found.plan.settings["measure"] == "safety").items():
            names.setdefault(number, []).append(name)
        for number, called in names.items():
            name = " and the ".join(called)
            path = self.found.folder / PICTURED / f"{number:06d}" / "picture.png"
            value = next(row[self.result] for row in self.rows if row["run"] == number)
            if path.is_file():
                shown.append((path, f"The {name} run: {number}, {self.label} {value:.4g}"))
        if shown:
            self.page.section("Typical, worst and median run")
            self.page.figures(shown, least_rem=24)

    def _without_answer(self) -> None:
        counted = counted_by_reason(self.rows)
        if not counted:
            return
        self.page.section("Runs without a result")
        self.page.table(
            ["status", "runs", "reason, of the first", "run"],
            [[each["status"], each["runs"], each["reason"], each["run"]] for each in counted[:_LISTED]],
        )
        plan = self.found.plan
        one = next(row for row in self.rows if row["run"] == counted[0]["run"])
        values = {name: one[name] for name in (*self.names, "seed") if name in one}
        self.page.text("The first of them alone:")
        self.page.code(plan.how_to_repeat(values))

    def _columns(self) -> None:
        plan = self.found.plan
        names = [name for name in plan.settings["columns"] if np.isfinite(numbers(self.done, name)).any()]
        names += [name for name in _RESULTS if np.isfinite(numbers(self.done, name)).any()]
        if not names:
            return
        self.page.section("Other results")
        table = []
        for name in names:
            values = numbers(self.done, name)
            values = values[np.isfinite(values)]
            table.append(
                [name, len(values), *map(float, (values.mean(), values.std(), *np.quantile(values, (0.05, 0.5, 0.95))))]
            )
        self.page.table(["column", "runs", "mean", "standard deviation", "5 %", "median", "95 %"], table)

    def _times(self) -> None:
        seconds, processor = numbers(self.rows, "seconds"), numbers(self.rows, "processor_seconds")
        if not len(seconds):
            return
        self.page.section("Computing time")
        hosts = Counter(row.get("host") for row in self.rows)
        self.page.facts({
            "per run, mean, s": float(seconds.mean()), "the longest, s": float(seconds.max()),
            "processor, h": float(processor.sum()) / 3600, "the sweep, s": self.found.seconds or None,
            "at a time": self.found.workers, "machines": len(hosts),
            "repeated": sum(int(row.get("attempts") or 1) > 1 for row in self.rows),
        })  # fmt: skip

    def _again(self) -> None:
        self.page.section("How to reproduce it")
        plan = self.found.plan
        lines = [f"geomech sweep {plan.scene} --out {self.found.folder} --resume        # missing runs",
                 f"geomech report {self.found.folder}"]  # fmt: skip
        if self.rows:
            values = {name: self.rows[0][name] for name in (*self.names, "seed") if name in self.rows[0]}
            lines.append(plan.how_to_repeat(values) + f"        # run {self.rows[0]['run']} only")
        self.page.code("\n".join(lines))


def _mean(rows: Sequence[dict[str, Any]], name: str) -> float | None:
    values = numbers(rows, name)
    return float(np.nanmean(values)) if np.isfinite(values).any() else None


def _limit(fails: str, result: str) -> float | None:
    """The number with which the expression ``fails`` compares the ``result``."""
    head, sign, tail = fails.partition("<")
    try:
        return float(tail) if sign and head.strip() == result else None
    except ValueError:
        return None
