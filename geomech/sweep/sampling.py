"""The table of a sweep's runs: all combinations of listed values, and samples of random variables.

Samples are points in the unit cube, of plain Monte Carlo, a Latin hypercube (McKay, Beckman & Conover 1979), scrambled
Sobol' points (Owen 1998) or Saltelli's design (Saltelli et al. 2010, for Sobol' sensitivities); a Gaussian copula
correlates them (Nataf 1962; Liu & Der Kiureghian 1986), and the quantiles of each variable's distribution make values
of them:

    z = Φ⁻¹(u),   z' = L z with L Lᵀ = R,   x_k = F_k⁻¹(Φ(z'_k))

R holds the correlations of the normal variables z'. The table depends on its settings and the seed alone.
"""

from __future__ import annotations

import hashlib
import itertools
import json
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from .variables import Listed, Random, Variable

#: Smallest distance of points from the faces of the unit cube, where quantiles are infinite.
_INSIDE = 1e-15


@dataclass(frozen=True)
class Design:
    """How random variables are sampled: ``sampling`` is "monte carlo", "latin hypercube", "sobol" or "saltelli";
    ``correlations``: (name, name, coefficient of the underlying normal variables)."""

    sampling: str = "monte carlo"
    runs: int = 1
    seed: int = 0
    correlations: tuple[tuple[str, str, float], ...] = ()

    def unit_points(self, dimensions: int) -> np.ndarray:
        """(runs, dimensions) in (0, 1), uncorrelated; in Saltelli's design the number of whole groups that fit into
        ``runs``."""
        if dimensions == 0:
            return np.empty((self.runs, 0))
        if self.sampling == "monte carlo":
            found = np.random.default_rng(self.seed).random((self.runs, dimensions))
        elif self.sampling == "saltelli":
            found = self._saltelli(dimensions)
        else:
            from scipy.stats import qmc

            kind = qmc.LatinHypercube if self.sampling == "latin hypercube" else qmc.Sobol
            with warnings.catch_warnings():
                # Raised if the number of points is not a power of two, which spreads them slightly less evenly.
                warnings.simplefilter("ignore", UserWarning)
                found = _seeded(kind, dimensions, self.seed).random(self.runs)
        return np.clip(found, _INSIDE, 1.0 - _INSIDE)

    def _saltelli(self, dimensions: int) -> np.ndarray:
        """Groups of rows A, A with one column of B each, B."""
        from scipy.stats import qmc

        groups = max(1, self.runs // (dimensions + 2))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)
            base = _seeded(qmc.Sobol, 2 * dimensions, self.seed).random(groups)
        first, second = base[:, :dimensions], base[:, dimensions:]
        rows = []
        for a, b in zip(first, second, strict=True):
            rows.append(a)
            for k in range(dimensions):
                mixed = a.copy()
                mixed[k] = b[k]
                rows.append(mixed)
            rows.append(b)
        return np.array(rows)


def _seeded(kind: Any, dimensions: int, seed: int) -> Any:
    """A sampler of `scipy.stats.qmc`, whose seed argument has another name since SciPy 1.15."""
    try:
        return kind(dimensions, rng=seed)
    except TypeError:
        return kind(dimensions, seed=seed)


def correlation_matrix(names: Sequence[str], pairs: Sequence[tuple[str, str, float]]) -> np.ndarray:
    """(n, n): R. Raises ValueError if it is not positive definite."""
    matrix = np.eye(len(names))
    for a, b, value in pairs:
        i, j = names.index(a), names.index(b)
        matrix[i, j] = matrix[j, i] = value
    if np.linalg.eigvalsh(matrix)[0] <= 1e-12:
        raise ValueError("the correlations contradict one another: their matrix is not positive definite")
    return matrix


def to_values(variables: Sequence[Random], normal: np.ndarray, matrix: np.ndarray | None = None) -> np.ndarray:
    """(n, d): values of the ``variables`` at points of independent standard ``normal`` variables (n, d)."""
    from scipy import special

    if matrix is not None:
        normal = normal @ np.linalg.cholesky(matrix).T
    shares = np.clip(special.ndtr(normal), 1e-300, 1.0 - 1e-16)
    return np.stack([each.quantile(shares[:, k]) for k, each in enumerate(variables)], axis=1)


def samples(variables: Sequence[Random], design: Design) -> np.ndarray:
    """(runs, d): values of the random ``variables``."""
    shares = design.unit_points(len(variables))
    if not design.correlations:
        if not variables:
            return shares
        return np.stack([each.quantile(shares[:, k]) for k, each in enumerate(variables)], axis=1)
    from scipy import special

    matrix = correlation_matrix([each.name for each in variables], design.correlations)
    return to_values(variables, special.ndtri(shares), matrix)


def run_table(variables: Sequence[Variable], design: Design, seeds: Sequence[int] = ()) -> list[dict[str, Any]]:
    """The values of each run by name, in the order of ``variables``: all combinations of listed values, each with all
    samples of the random variables; the k-th sample has the k-th of the ``seeds`` (as "seed")."""
    listed = [each for each in variables if isinstance(each, Listed)]
    random = [each for each in variables if isinstance(each, Random)]
    drawn = samples(random, design).tolist() if random else [[] for _ in seeds or [0]]
    order = [each.name for each in variables]
    table = []
    for combination in itertools.product(*(each.values for each in listed)):
        for k, values in enumerate(drawn):
            found: dict[str, Any] = dict(zip((each.name for each in listed), combination, strict=True))
            found |= dict(zip((each.name for each in random), values, strict=True))
            row = {name: found[name] for name in order}
            if seeds:
                row["seed"] = int(seeds[k % len(seeds)])
            table.append(row)
    return table


def digest_of(table: Sequence[Mapping[str, Any]]) -> str:
    """A digest of the table."""
    return hashlib.sha256(json.dumps(list(table)).encode()).hexdigest()[:16]
