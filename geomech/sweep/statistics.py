"""Statistics of a sweep: the probability of failure with its confidence interval, distributions, and sensitivities.

Sensitivities are those of SALib (Herman & Usher 2017): Sobol' indices of Saltelli's design (Saltelli et al. 2010),
otherwise first-order indices by RBD-FAST (Tarantola, Gatelli & Mara 2006; Plischke 2010) from any samples.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from .measures import DONE
from .variables import Random

#: With fewer failures than this only the order of magnitude of a probability of failure is known.
FEW = 10
#: Two-sided 95 %.
Z95 = 1.959963984540054
#: Fraction of the samples at each end of a variable that a tornado diagram compares.
_END = 0.2
#: Smallest number of groups of Saltelli's design for sensitivities; smallest number of other samples, and of samples
#: per variable (RBD-FAST fits ten harmonics, also in resamplings of half the runs).
_LEAST, _LEAST_SAMPLES, _A_VARIABLE = 20, 100, 20


class Probability(NamedTuple):
    """A probability of failure: ``failures`` of ``answered`` runs, of ``runs`` in all; ``value`` with its Wilson
    interval ``low`` to ``high`` (95 %); ``least`` and ``most`` if all runs without a result were stable, or failed."""

    failures: int
    answered: int
    runs: int
    value: float
    low: float
    high: float
    least: float
    most: float

    @property
    def few(self) -> bool:
        """Whether too few runs failed for more than an order of magnitude."""
        return self.failures < FEW

    def __str__(self) -> str:
        if not self.answered:
            return f"no probability of failure: none of {self.runs} runs has a result"
        text = (
            f"probability of failure {share_text(self.value)} ({self.failures} of {self.answered}; 95 %: "
            f"{share_text(self.low)} to {share_text(self.high)})"
        )
        if self.answered < self.runs:
            text += (
                f"; {self.runs - self.answered} runs without a result are left out: {share_text(self.least)} "
                "if all of "
                f"them were stable, {share_text(self.most)} if all failed"
            )
        if self.few and self.failures < self.answered:
            text += f"; fewer than {FEW} failed: more runs, or --rare subset, would reduce the uncertainty"
        return text


def share_text(value: float) -> str:
    """A probability in words: 6.4 %, 0.012 %."""
    return f"{100 * value:.3g} %"


def wilson(successes: int, trials: int, z: float = Z95) -> tuple[float, float]:
    """The Wilson (1927) interval of a probability with ``successes`` in ``trials``; (0, 1) without trials."""
    if trials == 0:
        return 0.0, 1.0
    share, square = successes / trials, z * z / trials
    centre = (share + 0.5 * square) / (1.0 + square)
    half = z / (1.0 + square) * math.sqrt(share * (1.0 - share) / trials + square / (4.0 * trials))
    return (0.0 if successes == 0 else max(0.0, centre - half)), (
        1.0 if successes == trials else min(1.0, centre + half)
    )


def probability(rows: Sequence[Mapping[str, Any]]) -> Probability:
    """The probability of failure from the ``rows`` of independent samples."""
    answered = [row for row in rows if row["status"] == DONE and row["fails"] is not None]
    failures, runs = sum(bool(row["fails"]) for row in answered), len(rows)
    value = failures / len(answered) if answered else math.nan
    without = runs - len(answered)
    least, most = (failures / runs, (failures + without) / runs) if runs else (math.nan, math.nan)
    return Probability(failures, len(answered), runs, value, *wilson(failures, len(answered)), least, most)


def convergence(rows: Sequence[Mapping[str, Any]]) -> np.ndarray:
    """(n, 4): number of runs with a result, in the order of the table, their probability of failure, and its interval."""
    fails = np.array([bool(row["fails"]) for row in rows if row["status"] == DONE and row["fails"] is not None])
    count = np.cumsum(fails)
    return np.array([(n, count[n - 1] / n, *wilson(int(count[n - 1]), n)) for n in range(1, len(fails) + 1)]).reshape(
        -1, 4
    )


def distribution(values: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    """Sorted ``values``, their cumulative shares (k − ½)/n, and the half width of the 95 % confidence band (Dvoretzky,
    Kiefer & Wolfowitz 1956; Massart 1990), √(ln(2/0.05)/2n)."""
    found = np.sort(np.asarray(values, dtype=float))
    n = len(found)
    return found, (np.arange(n) + 0.5) / max(n, 1), math.sqrt(math.log(40.0) / (2.0 * max(n, 1)))


def numbers(rows: Sequence[Mapping[str, Any]], name: str) -> np.ndarray:
    """(n,) the column ``name``, nan where a run has no number."""
    found = (row.get(name) for row in rows)
    return np.array([float(v) if isinstance(v, (int, float)) else math.nan for v in found])


class Swing(NamedTuple):
    """The mean result where the variable ``name`` is in its lowest (``low``) and in its highest fifth (``high``), with
    their standard errors; for a variable with few values, at the lowest and the highest one."""

    name: str
    low: float
    high: float
    low_error: float
    high_error: float

    @property
    def size(self) -> float:
        return abs(self.high - self.low)


def tornado(rows: Sequence[Mapping[str, Any]], names: Sequence[str], result: str) -> list[Swing]:
    """A `Swing` of the column ``result`` for each of the variables ``names``, the largest first."""
    values, found = numbers(rows, result), []
    for name in names:
        at = numbers(rows, name)
        known = np.isfinite(at) & np.isfinite(values)
        if known.sum() < 2 or np.ptp(at[known]) == 0:
            continue
        own, selected = at[known], values[known]
        low, high = np.quantile(own, _END), np.quantile(own, 1.0 - _END)
        ends = selected[own <= low], selected[own >= high]
        means = [float(end.mean()) for end in ends]
        errors = [float(end.std(ddof=1) / math.sqrt(len(end))) if len(end) > 1 else math.nan for end in ends]
        found.append(Swing(name, *means, *errors))
    return sorted(found, key=lambda swing: -swing.size)


class Sensitivity(NamedTuple):
    """Sobol' indices of the variable ``name``: its share of the variance of the result, alone (``first``) and with all
    interactions (``total``; nan if the samples do not determine it); ``*_error``: half the 95 % interval."""

    name: str
    first: float
    first_error: float
    total: float
    total_error: float


class SensitivityMissing(RuntimeError):
    """SALib is not installed, or there are too few runs."""


def sensitivities(
    rows: Sequence[Mapping[str, Any]], variables: Sequence[Random], result: str, sampling: str
) -> list[Sensitivity]:
    """Sobol' sensitivities of the column ``result``. Raises SensitivityMissing."""
    try:
        from SALib.analyze import rbd_fast, sobol
    except ImportError:
        raise SensitivityMissing("sensitivities need SALib: pip install 'geomech[sweep]'") from None
    names = [each.name for each in variables]
    values = numbers(rows, result)
    problem = {"num_vars": len(names), "names": names, "bounds": [[0.0, 1.0]] * len(names)}
    if sampling == "saltelli":
        group = len(names) + 2
        whole = len(values) // group * group
        by_group = values[:whole].reshape(-1, group)
        by_group = by_group[np.isfinite(by_group).all(axis=1)]
        if len(by_group) < _LEAST:
            raise SensitivityMissing(
                f"{len(by_group)} complete groups of runs with a result: sensitivities need {_LEAST}"
            )
        found = sobol.analyze(problem, by_group.ravel(), calc_second_order=False, seed=0)
        columns = found["S1"], found["S1_conf"], found["ST"], found["ST_conf"]
        return [Sensitivity(name, *(float(column[k]) for column in columns)) for k, name in enumerate(names)]
    known = np.isfinite(values)
    points = np.stack([numbers(rows, name) for name in names], axis=1)[known] if names else np.empty((0, 0))
    least = max(_LEAST_SAMPLES, _A_VARIABLE * len(names))
    if known.sum() < least:
        raise SensitivityMissing(f"{int(known.sum())} runs with a result: sensitivities need {least}")
    found = rbd_fast.analyze(problem, points, values[known], seed=0)
    nan = [math.nan] * len(names)
    columns = found["S1"], found["S1_conf"], nan, nan
    return [Sensitivity(name, *(float(column[k]) for column in columns)) for k, name in enumerate(names)]


def picked(rows: Sequence[Mapping[str, Any]], result: str, worst_is_least: bool = True) -> dict[str, int]:
    """The runs with the "worst", the "median" and the "typical" result; the last is, of the runs with the most frequent
    mechanism, the one nearest to their median."""
    found = [
        (float(row[result]), row) for row in rows if row["status"] == DONE and isinstance(row.get(result), (int, float))
    ]
    if not found:
        return {}
    found.sort(key=lambda each: (each[0], each[1]["run"]))
    ordered = [row for _, row in found]
    kinds: dict[Any, list[Mapping[str, Any]]] = {}
    for row in ordered:
        kinds.setdefault(row.get("mechanism", row.get("condition")), []).append(row)
    most = max(kinds.values(), key=len)
    return {
        "worst": ordered[0 if worst_is_least else -1]["run"],
        "median": ordered[len(ordered) // 2]["run"],
        "typical": most[len(most) // 2]["run"],
    }
