"""Method for comparison: finite elements (scikit-fem), with quarter-point elements at the tips and K by interaction
integrals (`quarter_point`).

Bodies are meshed as a whole. For cracks in the infinite plane a window is meshed, whose rim has the displacement of the
plane: in closed form (Griffith crack, arc; the arc is meshed straight, by angle and logarithm of the radius, and
mapped), or from this solver's reference (many cracks). There is no truncation error then, which favours the finite
elements, as does the fact that SuperLU is told that the matrix is symmetric. Times are those of mesh, assembly,
solution and integrals.
"""

from __future__ import annotations

import importlib.util
import math
from collections.abc import Callable, Sequence

import numpy as np

from ...model import Cracks
from ...model.blocks.polygon import distance_to_edges
from ...reference.cracks import crack_fields
from ..accuracy.crack_problems import ROCK, CrackProblem, rectangle
from ..figures import stopwatch
from .quarter_point import Plate, Sizes

#: Sides of triangles, in half cracks: away from cracks and at tips, and their growth rate with distance.
REFINEMENTS = (
    (1.0, 0.25, 0.8),
    (0.5, 0.1, 0.5),
    (0.5, 0.03, 0.35),
    (0.4, 0.01, 0.25),
    (0.3, 0.003, 0.18),
    (0.2, 0.001, 0.125),
)
#: The disc of a tip extends to this part of the distance from the next feature.
DISC = 0.9
#: Half-angle of the arc, and extent of its window in the logarithm of the radius.
QUARTER, REACH = math.pi / 4, 1.2


def available() -> bool:
    """Whether scikit-fem is installed: ``pip install 'geomech[bench]'``."""
    return importlib.util.find_spec("skfem") is not None


def solver(problem: CrackProblem | None) -> Callable[[int], tuple[np.ndarray, int, float]]:
    """For ``problem`` (None: the arc), a function refinement (0 … 5) → (n_tips, 2) K_I, K_II, number of unknowns and
    seconds."""
    if problem is None:
        return _arc
    if problem.outline is not None:
        return lambda refinement: _straight(problem, problem.outline, refinement, None)
    return _window(problem)


def tips_of(
    polylines: Sequence[np.ndarray], mouths: Sequence[tuple[bool, bool]]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(n, 2) tips, (n, 2) unit directions of their advance and (n,) lengths of their last segments."""
    points, ways = [], []
    for line, at_mouth in zip(polylines, mouths):
        for ends, mouth in zip(((line[0], line[1]), (line[-1], line[-2])), at_mouth):
            if not mouth:
                points.append(ends[0])
                ways.append(ends[0] - ends[1])
    points, ways = np.array(points), np.array(ways)
    length = np.hypot(*ways.T)
    return points, ways / length[:, None], length


def disc_radii(
    points: np.ndarray, length: np.ndarray, outline: np.ndarray, polylines: Sequence[np.ndarray]
) -> np.ndarray:
    """(n,) radii of discs around the tips ``points`` that contain only the straight crack end of ``length`` (n,)."""
    lines = [np.vstack([outline, outline[:1]]), *polylines]
    away = np.array([[distance_to_edges(p, line[:-1], line[1:]) for line in lines] for p in points])
    # Its own crack is an obstacle beyond its straight end only.
    away[away < 1e-9 * np.ptp(outline)] = np.inf
    return DISC * np.minimum(away.min(axis=1), length)


def _straight(
    problem: CrackProblem, outline: np.ndarray, refinement: int, rim: Callable[[np.ndarray], np.ndarray] | None
) -> tuple[np.ndarray, int, float]:
    spent_on = stopwatch()
    points, ways, length = tips_of(problem.polylines, problem.mouths)
    # A crack with a mouth is half of one.
    free = 2 - np.sum(problem.mouths, axis=1)
    half = min(np.hypot(*(line[-1] - line[0])) / n for line, n in zip(problem.polylines, free))
    plate = Plate(outline, problem.cracks, Sizes(*(half * np.array(REFINEMENTS[refinement]) * [1, 1, 1 / half])))
    u = plate.pulled(problem.stress[1]) if rim is None else plate.moved(rim)
    k = plate.factors(u, points, ways, disc_radii(points, length, outline, problem.polylines))
    return k, plate.n_unknowns, spent_on()


def _window(problem: CrackProblem) -> Callable[[int], tuple[np.ndarray, int, float]]:
    every = np.concatenate(problem.polylines)
    centre, half = 0.5 * (every.min(axis=0) + every.max(axis=0)), 0.5 * np.ptp(every, axis=0).max()
    mu, nu = ROCK.shear_modulus, ROCK.effective_poissons_ratio
    if len(problem.polylines) == 1:
        size = 2.5 * half

        def rim(x: np.ndarray) -> np.ndarray:
            return crack_fields.griffith_field(x, half, np.array(problem.stress), mu, nu)[1]
    else:
        from ...model import DdmSettings

        size = half + 0.5 * np.hypot(*np.diff(problem.polylines[0], axis=0)[0])
        rim = problem.solve(DdmSettings(order=8, elements_per_crack=4, grading_layers=6)).displacement
    return lambda refinement: _straight(problem, rectangle(size, size) + centre, refinement, rim)


def _arc(refinement: int, disc: float = 0.5) -> tuple[np.ndarray, int, float]:
    """The crack r = 1 from 45° to 135° in equal biaxial tension, tips in the order of `crack_problems.arc_of_chords`.

    ``disc``: the radius of their discs.
    """
    spent_on = stopwatch()
    first, last = np.array([QUARTER, 0.0]), np.array([3 * QUARTER, 0.0])
    window = rectangle(3 * QUARTER, REACH) + 0.5 * (first + last)
    plate = Plate(
        window,
        Cracks.from_polylines([np.array([first, last])], aperture=math.inf),
        Sizes(*(QUARTER * np.array(REFINEMENTS[refinement]) * [1, 1, 1 / QUARTER])),
        lambda x: np.exp(x[:, 1:]) * np.column_stack([np.cos(x[:, 0]), np.sin(x[:, 0])]),
    )
    mu, nu = ROCK.shear_modulus, ROCK.effective_poissons_ratio
    u = plate.moved(lambda x: crack_fields.arc_field(x, 1.0, QUARTER, mu, nu)[1])
    c = math.sqrt(0.5)
    k = plate.factors(
        u,
        np.array([[c, c], [-c, c]]),
        np.array([[c, -c], [-c, -c]]),
        np.array([disc, disc]),
        [lambda x: np.hypot(*x) - 1, lambda x: 1 - np.hypot(*x)],
    )
    return k, plate.n_unknowns, spent_on()
