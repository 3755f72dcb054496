"""Error estimate of stress intensity factors by comparison with a finer solution.

Estimates from one solution (decay of its coefficients, order p against p−1) follow the error of K only within factors
of ten to a thousand: K is far more accurate than the densities it comes from, and odd and even orders differ. The finer
solution has one order more and is graded one level deeper. The error of chords on curved walls is added
(`chord_error`).
"""

from __future__ import annotations

import logging
from typing import TYPE_CHECKING

import numpy as np

from .. import adaptivity
from ..mesh.elements import interior_angles, wedges
from ..mesh.grading import Grading, ungraded
from .chord_error import chord_errors, chord_errors_at_tips
from .tip_factors import factors, largest

if TYPE_CHECKING:
    from ..interfaces import CrackedBody, SolvedBody

_log = logging.getLogger(__name__)

#: Factor on the difference to the finer solution. In `tests/validation/test_automatic.py` the difference is 0.35 to 1.3
#: times the error.
SAFETY = 2.0
#: Estimated error, relative to the largest K, above which a warning is logged.
WORTH_A_WARNING = 0.01


def tip_errors(solution: SolvedBody) -> np.ndarray:
    """(n_tips, 2) estimated absolute error of K_I and K_II, Pa √m. Solves another, somewhat larger body. Logs a warning
    when the error exceeds 1 % of the largest K."""
    body = solution.body
    k = factors(solution)
    if not len(k):
        return k
    other = body.remeshed(adaptivity.finer(body.settings)).solve(
        solution.load, equilibrium_tolerance=np.inf, history=solution.began
    )
    errors = SAFETY * (np.abs(factors(other) - k) + chord_errors(solution)) + floor(body) * largest(k)
    chords = chord_errors_at_tips(solution)
    warn(errors + chords, k, chords)
    return errors + chords


def warn(errors: np.ndarray, k: np.ndarray, chords: np.ndarray | float = 0.0) -> None:
    """Log a warning when ``errors``, of which ``chords`` is that of curved cracks drawn as polygons, exceed 1 % of the
    largest of ``k``, all (n_tips, 2)."""
    if errors.max(initial=0.0) > WORTH_A_WARNING * largest(k):
        at = int(np.argmax(errors.max(axis=1)))
        drawn = np.max(chords) > 0.5 * errors.max()
        _log.warning(
            "stress intensity factors are uncertain by %.1f %% at tip %d: %s",
            100 * errors.max() / max(largest(k), np.finfo(float).tiny),
            at,
            "draw the curved crack with shorter chords at its tips" if drawn else "set a smaller target_error",
        )


def floor(body: CrackedBody) -> float:
    """Relative error of K because grading stops at the limit of round-off (`grading.Grading.finest`). A finer solution
    has the same error, so the comparison does not show it. Only meshes for a target error are graded that far."""
    grading = Grading.of(body.settings)
    if grading.target is None:
        return 0.0
    network, edges, left = body.cracks, body.mesh.edges, 0.0
    faces, boundary = body.faces, body.boundary
    segment_lengths = network.lengths
    edge_lengths = np.hypot(*(edges[:, 1] - edges[:, 0]).T)
    for elements, spans in ((faces, segment_lengths), (boundary, edge_lengths)):
        for e in np.flatnonzero(elements.length <= 1e-6 * body._extent):
            span, length = spans[elements.source[e]], elements.length[e]
            for point in (elements.start[e], elements.end[e]):
                if length <= grading.finest(point, span, body._extent) / grading.ratio:
                    left = max(left, _left_at(body, point, length / span))
    return left


def _left_at(body: CrackedBody, point: np.ndarray, part: float) -> float:
    """Error due to an ungraded element at ``point`` with length ``part`` relative to its side or segment; 0 if the
    point is not a node of the geometry."""
    network, left = body.cracks, 0.0
    for node in np.flatnonzero((network.nodes == point).all(axis=1) & (network.valence > 0)).tolist():
        where = "mouth" if network.surface[node] else "crack"
        for angle in wedges(network, node, body.sides):
            error, power = ungraded(float(angle), where)
            left = max(left, error * part**power)
    for loop in body.loops:
        for corner in np.flatnonzero((loop == point).all(axis=1)):
            error, power = ungraded(float(interior_angles(loop)[corner]), "outline")
            left = max(left, error * part**power)
    return left
