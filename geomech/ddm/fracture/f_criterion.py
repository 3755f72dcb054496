"""The F-criterion with trial kinks: a short fictitious extension at every tip, solved in many directions.

On an infinitesimal kink, tractions on its faces are negligible against k_1 and k_2, so that under compression the
energy criteria predict wing cracks that open where a real extension would be closed. Therefore, following Shen &
Stephansson (1993), every tip is extended by a given length in each of several directions, the body is solved with
contact (and friction) on the kink faces, and the direction with the largest

    F = (k_1/K_Ic)² + (k_2/K_IIc)²

is taken, with K_eq = √F K_Ic and a parabola between directions. Trial bodies border the factors of the body and are
kept, so that a load costs one solution per direction.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ...model import Cracks, GrowthSettings, Material
from ..crack_contact.frictionless_contact import NotConverged
from ..growth.tie_tolerance import best as best_direction
from .criteria import CRITERIA

if TYPE_CHECKING:
    from ..body import Body
    from ..interfaces import CrackedBody
    from ..loads.body_loads import BodyLoad
    from ..solution import Solution

#: Directions of trial kinks, rad from that of the tip.
DIRECTIONS = np.radians(np.arange(-120.0, 121.0, 10.0))


def apply_criterion(solution: Solution, growth: GrowthSettings, material: Material) -> tuple[np.ndarray, np.ndarray]:
    """(n_tips,) growth angle and K_eq of the tips of ``solution`` by the criterion in ``growth``. Raises ValueError for
    an unknown criterion, or one that trial kinks do not support."""
    if growth.trial_kink > 0:
        check_criterion(growth)
        return driven(solution, growth.trial_kink, material)
    return apply_criterion_to_rows(solution.tips, growth, material)


def apply_criterion_to_rows(
    tips: np.ndarray, growth: GrowthSettings, material: Material
) -> tuple[np.ndarray, np.ndarray]:
    """`apply_criterion` to TIP rows of one or more bodies, by a criterion that needs only K. Raises ValueError for an
    unknown criterion."""
    check_criterion(growth)
    return CRITERIA[growth.criterion](tips["k_i"], tips["k_ii"], material)


def check_criterion(growth: GrowthSettings) -> None:
    """Raise ValueError where `apply_criterion` would."""
    if growth.criterion not in CRITERIA:
        raise ValueError(f"no growth criterion {growth.criterion!r}; there are {', '.join(CRITERIA)}")
    if not 0 <= growth.trial_kink < np.inf:
        raise ValueError(f"trial_kink must be a length, got {growth.trial_kink!r}")
    if growth.trial_kink and growth.criterion != "f":
        raise ValueError(f'trial kinks need the criterion "f", not {growth.criterion!r}')


def driven(solution: Solution, length: float, material: Material) -> tuple[np.ndarray, np.ndarray]:
    """(n_tips,) angle of the kink with the largest F and its K_eq, Pa √m, from kinks of ``length`` m under the load and
    with the history of ``solution``. Infinitesimal kinks are used at tips where a kink does not fit into the rock or
    its faces do not converge."""
    tips, body = solution.tips, solution.body
    n = len(tips)
    value = np.full((len(DIRECTIONS), n), np.nan)
    at = np.flatnonzero(_fitting(body, length)) if n else np.zeros(0, int)
    for k in range(len(DIRECTIONS)) if len(at) else ():
        trial = _body(body, k, length, at)
        try:
            load = _load(solution.load, body.cracks, at)
            found = trial.solve(load, equilibrium_tolerance=np.inf, history=solution.began).tips
        except (NotConverged, np.linalg.LinAlgError):
            continue
        ahead = {int(tip["node"]): tip for tip in found}
        rows = [ahead[len(body.cracks.nodes) + j] for j in range(len(at))]
        k_1, k_2 = (np.array([row[name] for row in rows]) for name in ("k_i", "k_ii"))
        value[k, at] = (np.maximum(k_1, 0.0) / material.k_ic) ** 2 + (k_2 / material.k_iic) ** 2
    angle, k_eq = CRITERIA["f"](tips["k_i"], tips["k_ii"], material)
    known = np.isfinite(value).all(axis=0)
    angle[known], k_eq[known] = _largest(value[:, known], material)
    return angle, k_eq


def _largest(value: np.ndarray, material: Material) -> tuple[np.ndarray, np.ndarray]:
    """Angle and K_eq at the maximum of ``value`` (n_directions, n_tips), by a parabola through its neighbours."""
    every = np.arange(value.shape[1])
    at = np.clip([best_direction(column, DIRECTIONS) for column in value.T], 1, len(DIRECTIONS) - 2)
    low, best, high = (value[at + side, every] for side in (-1, 0, 1))
    bend = np.minimum(low - 2 * best + high, -np.finfo(float).tiny)
    shift = np.clip(0.5 * (low - high) / bend, -1.0, 1.0)
    best = np.maximum.reduce([best - 0.25 * (low - high) * shift, low, high])
    return DIRECTIONS[at] + shift * (DIRECTIONS[1] - DIRECTIONS[0]), np.sqrt(best) * material.k_ic


def _fitting(body: CrackedBody, length: float) -> np.ndarray:
    """(n_tips,) bool: tips farther than two kink lengths from all other cracks and from the boundary."""
    network, tips = body.cracks, body.tip_elements[0]
    sides = body.sides
    pieces = np.concatenate([network.nodes[network.segments], sides])
    out = np.ones(len(tips), bool)
    for j, tip in enumerate(tips):
        own = np.concatenate([(network.segments == tip["node"]).any(axis=1), np.zeros(len(sides), bool)])
        a, d = pieces[~own, 0], pieces[~own, 1] - pieces[~own, 0]
        rel = tip["point"] - a
        s = np.clip(np.sum(rel * d, axis=1) / np.sum(d * d, axis=1), 0.0, 1.0)
        to = s[:, None] * d - rel
        distance = np.hypot(*to.T)
        # Points straight behind belong to the crack itself; no kink turns that far.
        behind = to @ tip["direction"] < -0.7 * distance
        out[j] = not (~behind & (distance <= 2 * length)).any()
    return out


def _body(body: CrackedBody, k: int, length: float, at: np.ndarray) -> Body:
    """``body`` with kinks in direction ``k`` at the tips ``at``; kept with it."""
    from ..body import Body, Reuse

    assert isinstance(body, Body)
    kept = body.trials.setdefault(length, {})
    if k not in kept:
        kinked = _kinked(body.cracks, body.tip_elements[0][at], DIRECTIONS[k], length)
        kept[k] = Body(
            body.outline, kinked, body.material, body.settings, Reuse(body, body.work), body.holes, body.supports,
            body.face_laws,
        )  # fmt: skip
    return kept[k]


def _kinked(cracks: Cracks, tips: np.ndarray, angle: float, length: float) -> Cracks:
    """``cracks`` with one more segment at each of ``tips`` (TIP rows), the new nodes after all others. Trial kinks have
    no aperture."""
    n, n_nodes = len(tips), len(cracks.nodes)
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    owner = _owners(cracks, tips["node"])
    return replace(
        cracks,
        nodes=np.concatenate([cracks.nodes, tips["point"] + length * tips["direction"] @ turn]),
        segments=np.concatenate([cracks.segments, np.column_stack([tips["node"], n_nodes + np.arange(n)])]),
        birth_cycle=np.concatenate([cracks.birth_cycle, np.full(n, cracks.birth_cycle.max() + 1)]),
        aperture=np.concatenate([cracks.aperture, np.zeros(n)]),
        surface=np.concatenate([cracks.surface, np.zeros(n, bool)]),
        crack=np.concatenate([cracks.crack, cracks.crack[owner]]),
        block=np.concatenate([cracks.block, cracks.block[owner]]),
        law=np.concatenate([cracks.law, cracks.law[owner]]),
    )


def _owners(cracks: Cracks, nodes: np.ndarray) -> np.ndarray:
    """(n,) the segment that ends at each of the tips ``nodes``."""
    return np.array([int(np.argmax((cracks.segments == node).any(axis=1))) for node in nodes], dtype=int)


def _load(load: BodyLoad, cracks: Cracks, at: np.ndarray) -> BodyLoad:
    """``load`` on the network with kinks: with a fluid pressure for each segment, a kink has that of its crack."""
    pressure = load.crack_pressure
    if callable(pressure) or not np.ndim(pressure):
        return load
    owner = _owners(cracks, cracks.tips[at])
    return replace(load, crack_pressure=np.concatenate([pressure, np.asarray(pressure)[owner]]))
