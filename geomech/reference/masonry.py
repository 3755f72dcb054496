"""Masonry that stands by its shape: the thinnest semicircular arch, and the thrust of voussoir beams.

Lengths m, forces N per metre of thickness, densities kg/m³, angles rad unless a name says degrees.
"""

from __future__ import annotations

import itertools
import math

import numpy as np

#: Thinnest semicircular arch with radial joints, thickness over mean radius, and its haunch hinge from the crown, degrees:
#: Milankovitch (1907), "Theorie der Druckkurven", Zeitschrift für Mathematik und Physik 55, 1-27, confirmed by Ochsendorf
#: (2006), "The masonry arch on spreading supports", The Structural Engineer 84, 29-36, and Cocchetti, Colasante & Rizzi (2011),
#: "On the analysis of minimum thickness in circular masonry arches", Applied Mechanics Reviews 64, 050802.
MILANKOVITCH_RATIO, MILANKOVITCH_HINGE_DEG = 0.1075, 54.5


def voussoirs(n: int, ratio: float, radius: float = 1.0) -> list[np.ndarray]:
    """Outlines (4, 2) of ``n`` equal voussoirs of a semicircular arch of mean ``radius`` and thickness ``ratio`` times it,
    from the right springing to the left; centre at the origin."""
    inner, outer = radius * (1 - 0.5 * ratio), radius * (1 + 0.5 * ratio)
    angle = np.linspace(0.0, np.pi, n + 1)
    rays = np.column_stack([np.cos(angle), np.sin(angle)])
    rays[-1], rays[0] = (-1.0, 0.0), (1.0, 0.0)
    return [np.array([inner * a, outer * a, outer * b, inner * b]) for a, b in itertools.pairwise(rays)]


def arch_stands(n: int, ratio: float) -> bool:
    """Whether ``n`` rigid voussoirs that neither slide nor pull can be in equilibrium under their own weight.

    Heyman's (1966) safe theorem as a linear program (Livesley 1978, "Limit analysis of structures formed from rigid
    blocks", International Journal for Numerical Methods in Engineering 12, 1853-1871): at each joint two corner forces
    N ≥ 0 and a shear of any size, three equations of equilibrium a voussoir.
    """
    from scipy.optimize import linprog

    equations, right = np.zeros((3 * n, 3 * (n + 1))), np.zeros(3 * n)
    for k, corners in enumerate(voussoirs(n, ratio)):
        x, y = corners.T
        u, v = np.roll(x, -1), np.roll(y, -1)
        cross = x * v - u * y
        area = 0.5 * cross.sum()
        rows = slice(3 * k, 3 * k + 3)
        right[rows] = 0.0, area, np.sum((x + u) * cross) / 6.0  # weight ρg = 1 carried, and its moment
        for joint, sign, inner, outer in ((k, 1.0, corners[0], corners[1]), (k + 1, -1.0, corners[3], corners[2])):
            radial = (outer - inner) / np.hypot(*(outer - inner))
            push = sign * np.array([-radial[1], radial[0]])
            for column, (at, force) in enumerate(((inner, push), (outer, push), (inner, sign * radial))):
                moment = at[0] * force[1] - at[1] * force[0]
                equations[rows, 3 * joint + column] += (*force, moment)
    bounds = [(0, None), (0, None), (None, None)] * (n + 1)
    return linprog(np.zeros(3 * (n + 1)), A_eq=equations, b_eq=right, bounds=bounds, method="highs").status == 0


def thinnest_arch(n: int) -> float:
    """t/R below which an arch of ``n`` voussoirs falls, by bisection of `arch_stands`.

    Hinges form at joints only, so few voussoirs stand at less: 0.1041 (6), 0.1015 (9), 0.1049 (12), 0.1070 (25), 0.1074 (50);
    Milankovitch's 0.1075 is the limit of many.
    """
    low, high = 0.02, 0.2
    while high - low > 1e-7:
        middle = 0.5 * (low + high)
        low, high = (low, middle) if arch_stands(n, middle) else (middle, high)
    return 0.5 * (low + high)


def three_hinge_thrust(span: float, thickness: float, unit_weight: float) -> float:
    """Thrust (N) of a beam of two rigid halves that lean on each other: w S²/(8 T), hinges at the corners; w = γ T."""
    return unit_weight * thickness * span**2 / (8.0 * thickness)


def two_block_beam(
    span: float, thickness: float, unit_weight: float, compliance: np.ndarray, spring: float
) -> tuple[float, float]:
    """(thrust N, sag of the crown m) of a beam of two halves, each of them strained uniformly by its own forces.

    Three-hinge statics on the deformed halves: mean stress σ̄ = (1/A) Σ sym(x ⊗ f) of the corner forces, plane compliance
    (3, 3) 1/Pa, and a ``spring`` N/m in each corner contact. Fixed-point iteration on the rotation of a half.
    """
    half = 0.5 * span
    weight = unit_weight * half * thickness
    lower, upper = np.array([-0.5 * half, -0.5 * thickness]), np.array([0.5 * half, 0.5 * thickness])
    thrust, turn = three_hinge_thrust(span, thickness, unit_weight), 0.0
    for _ in range(200):
        rotation = np.array([[math.cos(turn), -math.sin(turn)], [math.sin(turn), math.cos(turn)]])
        # Forces in the axes of the half, at the abutment's corner and at the crown.
        abutment, crown = rotation.T @ [thrust, weight], rotation.T @ [-thrust, 0.0]
        dyad = np.outer(lower, abutment) + np.outer(upper, crown)
        stress = np.array([dyad[0, 0], dyad[1, 1], 0.5 * (dyad[0, 1] + dyad[1, 0])]) / (half * thickness)
        exx, eyy, gxy = compliance @ stress
        stretch = np.array([[1 + exx, 0.5 * gxy], [0.5 * gxy, 1 + eyy]])
        a, b = stretch @ lower, stretch @ upper
        # Between the faces of the abutment and of the other half, each pressed in by its spring.
        gap = half + 1.5 * thrust / spring
        across = b - a
        turn = math.acos(gap / math.hypot(*across)) - math.atan2(across[1], across[0])
        rise = math.hypot(*across) * math.sin(turn + math.atan2(across[1], across[0]))
        arm = -(math.cos(turn) * a[0] - math.sin(turn) * a[1])
        thrust = weight * arm / rise
    return thrust, thickness - rise


def voussoir_beam(
    span: float, thickness: float, unit_weight: float, youngs_modulus: float
) -> tuple[float, float, float]:
    """(greatest compression Pa, sag of the middle m, part of the thickness that the arch takes) of a jointed beam.

    Elastic compression arch in a beam without tensile strength: Evans (1941), Beer & Meek (1982), iteration of
    Diederichs & Kaiser (1999), "Stability of large excavations in laminated hard rock masses: the voussoir analogue
    revisited", International Journal of Rock Mechanics and Mining Sciences 36, 97-117. Raises ValueError when it buckles.
    """
    best: tuple[float, float, float] | None = None
    for part in np.linspace(0.01, 1.0, 991):
        start = thickness * (1.0 - 2.0 * part / 3.0)
        length = span + 8.0 * start**2 / (3.0 * span)
        arm = start
        for _ in range(1000):
            compression = unit_weight * span**2 / (4.0 * part * arm)
            shortening = compression / 3.0 * (2.0 / 3.0 + part) * length / youngs_modulus
            square = start**2 - 3.0 * span * shortening / 8.0
            if square <= 0:
                break
            before, arm = arm, math.sqrt(square)
            if abs(arm - before) < 1e-12 * thickness:
                if best is None or compression < best[0]:
                    best = compression, start - arm, float(part)
                break
    if best is None:
        raise ValueError(f"a beam of {span:g} m span and {thickness:g} m thickness buckles under its weight")
    return best
