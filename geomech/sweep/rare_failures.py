"""Probabilities of failure below a hundredth, with fewer runs than plain Monte Carlo takes.

In the space of independent standard normal variables u, g(u) < 0 is failure.

subset       Subset simulation (Au & Beck 2001, Probabilistic Engineering Mechanics 16, 263-277):
             P_f = Π P(F_i | F_{i−1}), F_i = {g ≤ b_i}, b_i such that a tenth of the samples lies below, the next ones
             from there by Markov chains that keep the normal distribution (Papaioannou et al. 2015, conditional
             sampling: u' = ρ u + √(1 − ρ²) z)
importance   The design point u* of first-order reliability (Hasofer & Lind 1974; Rackwitz & Fiessler 1978), then
             samples about it: P_f = mean of 1[g < 0] φ(u)/φ(u − u*) (Melchers 1989)
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

#: g of points (n, d) → (n,); nan where a run has no result.
LimitState = Callable[[np.ndarray], np.ndarray]
#: Fraction of a level's samples that lie in the next level.
_LEVEL = 0.1
#: Largest number of levels, each with a probability of 0.1: 1e-12.
_LEVELS = 12
#: Acceptance rate at which chains mix best (Papaioannou et al. 2015).
_ACCEPTED = 0.44
#: The design point has converged when it moves by less than this, and g is below this fraction of its value at the
#: mean.
_NEAR, _STEPS, _DIFFERENCE = 1e-2, 12, 0.05


@dataclass(frozen=True)
class RareProbability:
    """``value`` with its coefficient of ``variation`` (as estimated by the method), found by ``method`` in ``runs``, of
    which ``unanswered`` had no result (counted as stable); ``levels`` of g, or the ``design_point`` with its
    reliability index ``beta``."""

    method: str
    value: float
    variation: float
    runs: int
    unanswered: int = 0
    levels: tuple[float, ...] = ()
    design_point: tuple[float, ...] = field(default=())
    beta: float = math.nan

    @property
    def interval(self) -> tuple[float, float]:
        """95 % interval of a log-normal estimate."""
        if not self.value > 0 or not math.isfinite(self.variation):
            return 0.0, 1.0
        spread = 1.96 * math.sqrt(math.log1p(self.variation**2))
        return self.value * math.exp(-spread), min(1.0, self.value * math.exp(spread))

    def __str__(self) -> str:
        low, high = self.interval
        text = (
            f"probability of failure {self.value:.3g} (95 %: {low:.2g} to {high:.2g}; {self.method}, {self.runs} runs)"
        )
        return text + (f"; {self.unanswered} without a result, counted as stable" if self.unanswered else "")


def subset_simulation(g: LimitState, dimensions: int, samples: int = 500, seed: int = 0) -> RareProbability:
    """P(g < 0) by subset simulation with ``samples`` per level."""
    rng = np.random.default_rng(seed)
    kept = max(1, round(_LEVEL * samples))
    points = rng.standard_normal((samples, dimensions))
    values = _answered(g(points))
    unanswered, runs = int(np.isposinf(values).sum()), samples
    levels: list[float] = []
    value, variance, scale = 1.0, 0.0, 0.6
    correlation: np.ndarray | None = None
    while True:
        order = np.argsort(values, kind="stable")
        level = float(values[order[kept - 1]])
        failed = values < 0
        last = level < 0 or len(levels) >= _LEVELS or not math.isfinite(level)
        share = float(failed.mean()) if last else kept / samples
        variance += _variance(failed if last else values <= level, share, correlation)
        value *= share
        if last:
            variation = math.sqrt(variance) if value > 0 else math.inf
            return RareProbability("subset simulation", value, variation, runs, unanswered, tuple(levels))
        levels.append(level)
        points, values, scale, made, lost = _next_level(
            g, points[order[:kept]], values[order[:kept]], level, samples, scale, rng
        )
        runs, unanswered = runs + made, unanswered + lost
        correlation = np.arange(len(values)) % kept


def _next_level(g, starts, at, level, samples, scale, rng):
    """``samples`` points below ``level`` by Markov chains from ``starts``, all chains advanced together; the scale of
    their steps, the number of runs, and the number of runs without a result."""
    points, values, made, lost = [starts], [at], 0, 0
    now, value = starts.copy(), at.copy()
    step = 0
    while sum(map(len, values)) < samples:
        step += 1
        number = min(len(now), samples - sum(map(len, values)))
        spread = min(1.0, scale)
        trial = math.sqrt(1.0 - spread**2) * now[:number] + spread * rng.standard_normal((number, now.shape[1]))
        found = _answered(g(trial))
        made, lost = made + number, lost + int(np.isposinf(found).sum())
        better = found <= level
        now[:number][better], value[:number][better] = trial[better], found[better]
        points.append(now[:number].copy())
        values.append(value[:number].copy())
        # Robbins & Monro: towards the acceptance rate at which chains mix best.
        scale = float(np.clip(scale * math.exp((better.mean() - _ACCEPTED) / math.sqrt(step)), 0.05, 1.0))
    return np.concatenate(points), np.concatenate(values), scale, made, lost


def _variance(inside: np.ndarray, share: float, chain: np.ndarray | None) -> float:
    """Squared coefficient of variation of a level's ``share``, with correlated neighbours in its chains (Au & Beck
    2001, equations 25 to 29)."""
    n = len(inside)
    if not 0 < share < 1:
        return 0.0 if share else math.inf
    plain = (1.0 - share) / (share * n)
    if chain is None:
        return plain
    by_chain = [inside[chain == k].astype(float) for k in range(int(chain.max()) + 1)]
    length = max(map(len, by_chain))
    gamma = 0.0
    for lag in range(1, length):
        products = [each[:-lag] * each[lag:] for each in by_chain if len(each) > lag]
        covariance = float(np.concatenate(products).mean()) - share**2
        gamma += 2.0 * (1.0 - lag / length) * covariance / (share * (1.0 - share))
    return plain * (1.0 + max(0.0, gamma))


def importance_sampling(g: LimitState, dimensions: int, samples: int = 500, seed: int = 0) -> RareProbability:
    """P(g < 0) by ``samples`` around the design point."""
    point, made = design_point(g, dimensions)
    rng = np.random.default_rng(seed)
    points = point + rng.standard_normal((samples, dimensions))
    values = _answered(g(points))
    # φ(u)/φ(u − u*) = exp(−u·u* + u*²/2)
    weights = np.where(values < 0, np.exp(0.5 * point @ point - points @ point), 0.0)
    value = float(weights.mean())
    variation = float(weights.std(ddof=1) / math.sqrt(samples) / value) if value > 0 else math.inf
    return RareProbability(
        "importance sampling", value, variation, made + samples, int(np.isposinf(values).sum()), (),
        tuple(point.tolist()), float(np.linalg.norm(point)),
    )  # fmt: skip


def design_point(g: LimitState, dimensions: int) -> tuple[np.ndarray, int]:
    """The point of g = 0 nearest to the origin, (d,), by the iteration of Hasofer & Lind and Rackwitz & Fiessler with
    central differences; and the number of runs. Raises ValueError if a point of the iteration has no result or g does
    not change."""
    point, made, scale = np.zeros(dimensions), 0, 1.0
    for step in range(_STEPS):
        moved = _DIFFERENCE * np.eye(dimensions)
        values = np.asarray(g(np.concatenate([point[None], point + moved, point - moved])), dtype=float)
        made += len(values)
        if not np.isfinite(values).all():
            raise ValueError("importance sampling met a run without a result: use subset simulation")
        here, gradient = values[0], (values[1 : dimensions + 1] - values[dimensions + 1 :]) / (2 * _DIFFERENCE)
        size = float(gradient @ gradient)
        if size == 0:
            raise ValueError("no variable changes the result: there is no design point")
        scale = abs(here) if step == 0 and here else scale
        new = (gradient @ point - here) / size * gradient
        change = float(np.linalg.norm(new - point))
        point = new
        if change < _NEAR and abs(here) < _NEAR * max(scale, 1e-12):
            break
    return point, made


def _answered(values: np.ndarray) -> np.ndarray:
    """Runs without a result count as stable, farther from failure than all others."""
    found = np.array(values, dtype=float)
    return np.where(np.isnan(found), math.inf, found)


METHODS: dict[str, Callable[..., RareProbability]] = {"subset": subset_simulation, "importance": importance_sampling}
