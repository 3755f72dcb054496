"""A body solved on successively finer meshes until its stress intensity factors reach a target error."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..model import Cracks, DdmSettings, Material
from ..model.former_names import folded_argument
from .adaptivity import HIGHEST, check_target, finer, of_order, order_for
from .body import Body
from .fracture.chord_error import chord_errors
from .fracture.sif_error_estimate import floor, warn
from .fracture.target_error import TargetMissed
from .fracture.tip_factors import factors, largest, negligible
from .iterative.gmres import NotSolved
from .kernels import shape_functions
from .loads.body_loads import BodyLoad
from .mesh.half_plane import HalfPlane, without_outline
from .solution import Solution


@folded_argument("half_plane", "loops", without_outline)
def solve_to(
    loops: Sequence[np.ndarray] | HalfPlane,
    cracks: Cracks,
    material: Material,
    load: BodyLoad,
    target_error: float = 1e-6,
    nodes: str = "chebyshev",
    **body,
) -> Solution:
    """The body under ``load`` with stress intensity factors to ``target_error``, relative to the largest K.

    Solves on meshes of increasing order, at least two, until K of the last two differ by no more than the target. The
    result is the last solution; its ``tip_errors`` are the differences from the one before, usually ten times the true
    error. Raises `TargetMissed`, with the last solution, if the highest order that can be solved does not reach the target. ``body``:
    further arguments of `Body`.

    >>> rock = Material("rock", 17e9, 0.21)
    >>> crack = Cracks.from_polylines([np.array([[-1.0, 0.0], [1.0, 0.0]])])
    >>> solution = ddm.solve_to([], crack, rock, ddm.BodyLoad(remote_stress=[0.0, 1e6, 0.0]), 1e-8)
    >>> bool(abs(solution.tips["k_i"] / (1e6 * np.sqrt(np.pi)) - 1).max() < 1e-8)
    True
    """
    check_target(target_error)
    # Begin with a tenfold target; the next mesh is graded more finely.
    order = order_for(min(10 * target_error, 0.5))
    settings = of_order(DdmSettings(nodes=nodes), min(order, HIGHEST - 2), min(2 * target_error, 0.5))
    rock = Body(loops, cracks, material, settings, **body)
    before = rock.solve(load)
    while settings.order < shape_functions.MAX_ORDER:
        settings = finer(settings)
        try:
            rock = rock.remeshed(settings)
            solution = rock.solve(load)
        except NotSolved as failure:
            # Too many unknowns to factor, and round-off beyond what the iteration needs.
            raise TargetMissed(before, target_error) from failure
        k = factors(solution)
        errors = np.abs(k - factors(before)) + floor(solution.body) * largest(k)
        if errors.max(initial=0.0) <= target_error * largest(k) + negligible(solution):
            solution.tip_errors = errors = errors + chord_errors(solution)
            if errors.max(initial=0.0) > target_error * largest(k) + negligible(solution):
                raise TargetMissed(solution, target_error)
            warn(errors, k)
            return solution
        before = solution
    solution.tip_errors = errors
    raise TargetMissed(solution, target_error)
