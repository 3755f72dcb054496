"""Method for comparison: the usual constant-element code (Crouch 1976), with a collocation point at the centre of each
element.

Boundary and cracks are elements of constant displacement discontinuity; tractions are collocated at the element centres
and the dense system is solved by LU. There is no tip element. Two ways to a stress intensity factor:

    fit          D = d√r + e r√r fitted to the elements within two fifths of the half crack
    calibrated   from the tip element alone, D_1 times √(2/π): on equal elements behind a straight tip the discrete
                 solution is D_j ∝ Γ(j+½)/Γ(j), so D_1 is √(π/2) times the value of √r there (0.806 is often used, after
                 Olson 1991)
"""

from __future__ import annotations

import numpy as np

from ..accuracy.crack_problems import ROCK, CrackProblem


def stress_intensity(problem: CrackProblem, n_crack: int, n_side: int) -> tuple[np.ndarray, np.ndarray, int]:
    """(n_tips, 2) K_I, K_II by the fit and by calibration, tips in the order of the cracks, and the number of unknowns.

    ``n_crack`` elements per crack; about ``n_side`` along the shortest side of the outline.
    """
    from ...ddm.system.influence_matrix import ElementSet, influence

    start, end, length = [], [], []
    outline = problem.outline
    if outline is not None:
        sides = np.stack([outline, np.roll(outline, -1, axis=0)], axis=1)
        size = np.hypot(*(sides[:, 1] - sides[:, 0]).T)
        for (a, b), side in zip(sides, size):
            _cut(a, b, max(1, round(n_side * side / size.min())), start, end)
    n_boundary = sum(map(len, start))
    mouths = []
    for line, (at_start, _) in zip(problem.polylines, problem.mouths):
        pieces = np.hypot(*np.diff(line, axis=0).T)
        first = sum(map(len, start))
        for a, b, piece in zip(line[:-1], line[1:], pieces):
            _cut(a, b, max(1, round(n_crack * piece / pieces.sum())), start, end)
        mouths.append((first, sum(map(len, start)), at_start))
        length.append(pieces.sum())
    start, end = np.concatenate(start), np.concatenate(end)
    n = len(start)
    elements = ElementSet(start, end, np.zeros(n, np.int64), np.arange(n), 0, "chebyshev")
    matrix = influence(elements, elements, ROCK.poissons_ratio, 0.0)
    right = problem.traction(0.5 * (start + end), elements.tangent, np.arange(n) < n_boundary).ravel()
    if n_boundary:
        # Translation of the whole outline is free of stress (rotation nearly so): three directions are deflated.
        midpoint = 0.5 * (start + end)[:n_boundary]
        t, m = elements.tangent[:n_boundary], elements.normal[:n_boundary]
        arm = (midpoint - midpoint.mean(axis=0)) / np.ptp(midpoint)
        rigid = np.zeros((2 * n, 3))
        for k, motion in enumerate(
            (
                np.tile([1.0, 0], (n_boundary, 1)),
                np.tile([0, 1.0], (n_boundary, 1)),
                np.column_stack([-arm[:, 1], arm[:, 0]]),
            )
        ):
            rigid[: 2 * n_boundary : 2, k] = np.sum(motion * t, axis=1)
            rigid[1 : 2 * n_boundary : 2, k] = np.sum(motion * m, axis=1)
        matrix += rigid @ rigid.T / (n_boundary * elements.length.mean())
    # Jumps times 2μ; in-plane K from D = (4(1−ν)/μ) K √(r/2π).
    jumps = np.linalg.solve(matrix, right).reshape(n, 2)
    size = np.sqrt(2 * np.pi) / (8 * (1 - ROCK.poissons_ratio))
    fitted, calibrated = [], []
    for (first, last, mouth), whole in zip(mouths, length):
        for ahead in (False, True):
            if not ahead and mouth:
                continue
            rows = np.arange(first, last)[:: -1 if ahead else 1]
            r = np.cumsum(elements.length[rows]) - 0.5 * elements.length[rows]
            near = (r < 0.2 * whole) | (np.arange(len(r)) < 3)
            powers = np.column_stack([r[near] ** 0.5, r[near] ** 1.5])
            line = np.linalg.lstsq(powers, jumps[rows[near]], rcond=None)[0][0]
            # Slip and opening; also at the start of a crack, K_II > 0 corresponds to positive slip.
            fitted.append(size * line[::-1])
            calibrated.append(size * np.sqrt(2 / np.pi) * jumps[rows[0], ::-1] / np.sqrt(r[0]))
    return np.array(fitted), np.array(calibrated), 2 * n


def _cut(a: np.ndarray, b: np.ndarray, n: int, start: list, end: list) -> None:
    f = np.linspace(0, 1, n + 1)[:, None]
    line = (1 - f) * a + f * b
    start.append(line[:-1])
    end.append(line[1:])
