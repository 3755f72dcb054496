"""Problems on which crack solvers are timed: geometry, load, and reference stress intensity factors."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from ...ddm.fracture.sif_error_estimate import factors
from ...model import Cracks, DdmSettings, Material
from ...reference.cracks import crack_arrays, fracture
from ...reference.specimens import two_cracks

if TYPE_CHECKING:
    from ...ddm import BodyLoad, Solution

ROCK = Material("rock", 17e9, 0.21)


@dataclass(frozen=True, eq=False)
class CrackProblem:
    """Open cracks ``polylines``, in the infinite plane or in a rectangle.

    ``mouths``: which of their ends lie on the outline. Load: a remote ``stress``, or ``stress[1]`` on the two ends of a
    rectangular ``outline``. ``reference`` (n_tips, 2) K_I, K_II, or None: computed with high order on a finer mesh.
    """

    name: str
    polylines: Sequence[np.ndarray]
    stress: tuple[float, float, float]
    outline: np.ndarray | None = None
    mouths: Sequence[tuple[bool, bool]] = ()
    reference: np.ndarray | None = None

    def __post_init__(self) -> None:
        if not self.mouths:
            object.__setattr__(self, "mouths", [(False, False)] * len(self.polylines))

    @cached_property
    def cracks(self) -> Cracks:
        return Cracks.from_polylines(self.polylines, aperture=math.inf, surface=self.mouths)

    @cached_property
    def load(self) -> BodyLoad:
        from ...ddm import BodyLoad

        if self.outline is None:
            return BodyLoad(remote_stress=np.array(self.stress))
        a, b, c, d = self.outline
        pull = np.array([0.0, self.stress[1]])
        return BodyLoad(np.array([[a, b], [c, d]]), np.array([[-pull, -pull], [pull, pull]]))

    def traction(self, points: np.ndarray, tangent: np.ndarray, on_boundary: np.ndarray) -> np.ndarray:
        """(n, 2) tractions to be compensated by elements, along them and along the normal left of them: the load on the
        outline, the negative of the plane's stress on cracks."""
        t, n = tangent, np.column_stack([-tangent[:, 1], tangent[:, 0]])
        if self.outline is None:
            xx, yy, xy = self.stress
            force = -np.column_stack([xx * n[:, 0] + xy * n[:, 1], xy * n[:, 0] + yy * n[:, 1]])
        else:
            force = np.zeros_like(points)
            force[on_boundary, 1] = self.stress[1] * n[on_boundary, 1]
        return np.column_stack([np.sum(force * t, axis=1), np.sum(force * n, axis=1)])

    def solve(self, settings: DdmSettings) -> Solution:
        """Assembly and solution from scratch."""
        from ...ddm import Body

        solution = Body([] if self.outline is None else [self.outline], self.cracks, ROCK, settings).solve(self.load)
        _ = solution.tips
        return solution

    def error(self, found: np.ndarray) -> float:
        """Largest error of a K, relative to the largest K."""
        return float(np.abs(found - self.reference).max() / np.abs(self.reference).max())


def rectangle(half_width: float, half_height: float) -> np.ndarray:
    """(4, 2) a plate around the origin, counter-clockwise."""
    w, h = half_width, half_height
    return np.array([[-w, -h], [w, -h], [w, h], [-w, h]])


def griffith() -> CrackProblem:
    """A crack normal to tension in the infinite plane (Griffith)."""
    exact = np.array([[fracture.griffith(1.0, 1.0), 0.0]] * 2)
    return CrackProblem("Griffith crack", [np.array([[-1.0, 0.0], [1.0, 0.0]])], (0.0, 1.0, 0.0), reference=exact)


def _arc(line: np.ndarray) -> CrackProblem:
    k_i, k_ii = fracture.circular_arc(1.0, 1.0, math.pi / 4)
    return CrackProblem("arc", [line], (1.0, 1.0, 0.0), reference=np.array([[k_i, -k_ii], [k_i, k_ii]]))


def arc_of_chords(segments: int) -> CrackProblem:
    """A quarter circle in equal biaxial tension as equal chords, as used by codes with equal elements."""
    q = np.linspace(math.pi / 4, 3 * math.pi / 4, segments + 1)
    return _arc(np.column_stack([np.cos(q), np.sin(q)]))


def arc_of_tangents(segments: int) -> CrackProblem:
    """The same as a polygon of tangents at Chebyshev points, including the tips.

    A chord has the wrong direction at a tip; here the arc is approximated best where it matters.
    """
    touching = math.pi / 2 - math.pi / 4 * np.cos(np.linspace(0, math.pi, segments))
    between, half = 0.5 * (touching[1:] + touching[:-1]), 0.5 * np.diff(touching)
    corners = np.column_stack([np.cos(between), np.sin(between)]) / np.cos(half)[:, None]
    ends = np.column_stack([np.cos(touching[[0, -1]]), np.sin(touching[[0, -1]])])
    return _arc(np.concatenate([ends[:1], corners, ends[1:]]))


def edge_crack() -> CrackProblem:
    """A crack from the side of a strip in tension."""
    return CrackProblem(
        "edge crack in a strip", [np.array([[-0.5, 0.0], [0.0, 0.0]])], (0.0, 1.0, 0.0), rectangle(0.5, 1.5),
        [(True, False)],
        reference=None,
    )  # fmt: skip


def specimen() -> CrackProblem:
    """The specimen with two cracks of Haeri et al. (2014), φ = 0, in compression."""
    return CrackProblem("two-crack specimen", two_cracks.crack_ends(0), (0.0, -1.0, 0.0), rectangle(0.03, 0.06))


def random_cracks() -> CrackProblem:
    """Fifty cracks that do not touch, in the infinite plane."""
    return CrackProblem("50 random cracks", crack_arrays.random_cracks(50), (0.3, 1.0, 0.2))


def with_reference(problem: CrackProblem, quick: bool = False) -> CrackProblem:
    """``problem`` with a reference by order 10 on 1.5 times as many elements, finely graded; ``quick``: order 8 on the
    usual mesh, within 1e-7 of it."""
    if problem.reference is not None:
        return problem
    order, elements, sides, layers = (8, 4, 6, 6) if quick else (10, 6, 9, 8)
    fine = DdmSettings(order=order, elements_per_crack=elements, elements_per_side=sides, grading_layers=layers)
    return CrackProblem(
        problem.name, problem.polylines, problem.stress, problem.outline, problem.mouths, factors(problem.solve(fine))
    )
