"""Loads of a step beyond their mean over it.

A scheme takes the loads of one time in a step (its end in statics and in Shi's scheme), whereas the work of a load that
varies is that of its mean, as the work of stress and of contact forces on the straight line from the start to the end of
the step: in statics ½ (F₀ + F₁)·d, in motion F(t₀ + ½ dt)·d. What the scheme takes beyond it belongs to the scheme, like
(θ − ½) A Δσ·Δε, which it balances: a load that grows slowly loses nothing, however many steps it takes. Nothing changes
under constant loads, nor with the trapezoidal rule, which takes the loads of the middle of the step.
"""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np

from ...model import Loads
from .load_vectors import generalised
from .step_actions import effective_gravity


class LoadRows(Protocol):
    """Gives POINT_FORCE and EDGE_FORCE rows, as `LoadMap.rows`."""

    def rows(
        self, loads: Loads, time: float, vertices: np.ndarray, rotation: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]: ...


class BeyondMean(NamedTuple):
    """Loads that a step takes minus their mean over it.

    gravity   (2,) m/s², effective gravity
    parts     (factor, POINT_FORCE rows, EDGE_FORCE rows): the loads are the sum of these rows times their factors
    """

    gravity: np.ndarray
    parts: list[tuple[float, np.ndarray, np.ndarray]]

    def load(self, centroid: np.ndarray) -> np.ndarray:
        """(n_blocks, 6) generalised forces about ``centroid`` (n_blocks, 2), N and N m."""
        out = np.zeros((len(centroid), 6))
        for factor, points, edges in self.parts:
            out += factor * generalised(points, edges, centroid)
        return out


def beyond_mean(
    loads: Loads, span: tuple[float, float, float], static: bool, taken: tuple[np.ndarray, np.ndarray, np.ndarray],
    rows: LoadRows, at: tuple[np.ndarray, np.ndarray],
) -> BeyondMean | None:  # fmt: skip
    """The loads of a step beyond their mean; None where the step takes the mean.

    ``span``: start of the step, the time whose loads it takes, and its length, s. ``taken``: effective gravity, and the
    POINT_FORCE and EDGE_FORCE rows that act; ``at``: vertices (n_vertices, 2) and rotations (n_blocks,) of these rows."""
    start, acting, dt = span
    times = (start, acting) if static else (start + 0.5 * dt,)
    gravity, points, edges = taken
    mean = np.mean([effective_gravity(loads, start, time, dt, static) for time in times], axis=0)
    parts = []
    if any(time != acting for time in times) and (loads.point_loads or loads.edge_tractions or loads.water is not None):
        parts = [(1.0, points, edges), *((-1.0 / len(times), *rows.rows(loads, time, *at)) for time in times)]
    return BeyondMean(gravity - mean, parts) if parts or (gravity != mean).any() else None
