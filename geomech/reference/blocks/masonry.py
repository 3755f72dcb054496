"""Masonry statics: the thinnest semicircular arch, of stone of infinite and of finite strength, and thrust, crushing and
snap-through of voussoir beams.

Lengths m, forces N per metre of thickness, densities kg/m³, angles rad unless a name says degrees.
"""

from __future__ import annotations

import itertools
import math

import numpy as np

#: Thinnest semicircular arch with radial joints, thickness over mean radius, and its haunch hinge from the crown,
#: degrees: Milankovitch (1907), "Theorie der Druckkurven", Zeitschrift für Mathematik und Physik 55, 1-27, confirmed by
#: Ochsendorf (2006), "The masonry arch on spreading supports", The Structural Engineer 84, 29-36, and Cocchetti,
#: Colasante & Rizzi (2011), "On the analysis of minimum thickness in circular masonry arches", Applied Mechanics
#: Reviews 64, 050802.
MILANKOVITCH_RATIO, MILANKOVITCH_HINGE_DEG = 0.1075, 54.5


def voussoirs(n: int, ratio: float, radius: float = 1.0) -> list[np.ndarray]:
    """Outlines (4, 2) of ``n`` equal voussoirs of a semicircular arch of mean ``radius`` and thickness ``ratio`` times
    it, from the right springing to the left; centre at the origin."""
    inner, outer = radius * (1 - 0.5 * ratio), radius * (1 + 0.5 * ratio)
    angle = np.linspace(0.0, np.pi, n + 1)
    rays = np.column_stack([np.cos(angle), np.sin(angle)])
    rays[-1], rays[0] = (-1.0, 0.0), (1.0, 0.0)
    return [np.array([inner * a, outer * a, outer * b, inner * b]) for a, b in itertools.pairwise(rays)]


def _weights(corners: np.ndarray) -> np.ndarray:
    """(n, 3) right-hand sides of the equilibrium of voussoirs with ``corners`` (n, 4, 2): 0, weight, and its moment."""
    x, y = corners[:, :, 0], corners[:, :, 1]
    u, v = np.roll(x, -1, axis=1), np.roll(y, -1, axis=1)
    cross = x * v - u * y
    right = np.zeros((len(corners), 3))
    right[:, 1], right[:, 2] = 0.5 * cross.sum(axis=1), np.sum((x + u) * cross, axis=1) / 6.0
    return right


def least_pull(n: int, ratio: float) -> float:
    """Smallest tension, over all equilibria of ``n`` rigid voussoirs under their own weight, that a corner of a joint
    must carry.

    In units of the weight per area times R²; a negative value means that the arch is stable, with all corners
    compressed by as much. Heyman's (1966) safe theorem as a linear programme (Livesley 1978, "Limit analysis of
    structures formed from rigid blocks", International Journal for Numerical Methods in Engineering 12, 1853-1871): at
    each joint two corner forces N and an unlimited shear force, three equations of equilibrium per voussoir; the
    smallest s with all N ≥ −s.
    """
    from scipy.optimize import linprog
    from scipy.sparse import csr_array

    corners = np.array(voussoirs(n, ratio))
    right = _weights(corners)
    equations = np.zeros((n, 3, 3 * (n + 1) + 1))
    voussoir = np.arange(n)
    for sign, joint, inner, outer in (
        (1.0, voussoir, corners[:, 0], corners[:, 1]),
        (-1.0, voussoir + 1, corners[:, 3], corners[:, 2]),
    ):
        radial = sign * (outer - inner) / np.hypot(*(outer - inner).T)[:, None]
        push = np.stack([-radial[:, 1], radial[:, 0]], axis=1)
        for column, (at, force) in enumerate(((inner, push), (outer, push), (inner, radial))):
            moment = at[:, 0] * force[:, 1] - at[:, 1] * force[:, 0]
            equations[voussoir, :, 3 * joint + column] = np.column_stack([force, moment])
            if column < 2:
                # N + s ≥ 0 is the unknown: the −s of all corners goes into the last column.
                equations[:, :, -1] -= np.column_stack([force, moment])
    bounds = [(0, None), (0, None), (None, None)] * (n + 1) + [(None, None)]
    cost = np.zeros(3 * (n + 1) + 1)
    cost[-1] = 1.0
    found = linprog(
        cost, A_eq=csr_array(equations.reshape(3 * n, -1)), b_eq=right.ravel(), bounds=bounds, method="highs"
    )
    return float(found.x[-1])


def thinnest_arch(n: int) -> float:
    """Limit thickness t/R below which an arch of ``n`` voussoirs collapses: the root of `least_pull`.

    Hinges form at joints only, so few voussoirs are stable at a smaller thickness: 0.1041 (6), 0.1015 (9), 0.1049 (12),
    0.1070 (25), 0.1074 (50); Milankovitch's 0.1075 is the limit for many.
    """
    from scipy.optimize import brentq

    return float(brentq(lambda ratio: least_pull(n, ratio), 0.05, 0.2, xtol=1e-9))


def moment_reserve(n: int, ratio: float, strength: float) -> float:
    """Smallest reserve of moment, over all joints of the best equilibrium of ``n`` rigid voussoirs whose joints crush at
    ``strength``; negative if there is no equilibrium.

    Units: of the weight per area γ times R³; ``strength`` in units of γ R. A joint bears the thrust N with |M| ≤ N t/2
    − N²/(2 f), a stress block of depth N/f at its edge. The largest s with |M| + s below that at every joint, as a linear
    programme with 200 tangents of the parabola (exact to 1e-5 of it).
    """
    from scipy.optimize import linprog
    from scipy.sparse import csr_array

    corners = np.array(voussoirs(n, ratio))
    right = _weights(corners)
    equations, voussoir, joints = np.zeros((n, 3, 3 * (n + 1) + 1)), np.arange(n), np.arange(n + 1)
    for sign, joint, inner, outer in (
        (1.0, voussoir, corners[:, 0], corners[:, 1]),
        (-1.0, voussoir + 1, corners[:, 3], corners[:, 2]),
    ):
        radial = sign * (outer - inner) / np.hypot(*(outer - inner).T)[:, None]
        push, middle = np.stack([-radial[:, 1], radial[:, 0]], axis=1), 0.5 * (inner + outer)
        for column, force in enumerate((push, radial)):
            moment = middle[:, 0] * force[:, 1] - middle[:, 1] * force[:, 0]
            equations[voussoir, :, 3 * joint + column] = np.column_stack([force, moment])
        equations[voussoir, 2, 3 * joint + 2] = sign
    rows, bounds = [], []
    for thrust in np.linspace(0.0, strength * ratio, 200):
        for sign in (1.0, -1.0):
            row = np.zeros((n + 1, 3 * (n + 1) + 1))
            row[joints, 3 * joints + 2], row[:, -1] = sign, 1.0
            row[joints, 3 * joints] = thrust / strength - 0.5 * ratio
            rows.append(row)
            bounds.append(np.full(n + 1, 0.5 * thrust**2 / strength))
    cost = np.zeros(3 * (n + 1) + 1)
    cost[-1] = -1.0
    found = linprog(
        cost, A_ub=csr_array(np.concatenate(rows)), b_ub=np.concatenate(bounds),
        A_eq=csr_array(equations.reshape(3 * n, -1)), b_eq=right.ravel(),
        bounds=[(0, None), (None, None), (None, None)] * (n + 1) + [(None, None)], method="highs",
    )  # fmt: skip
    return float(found.x[-1]) if found.status == 0 else -1.0


def thinnest_crushing_arch(n: int, strength: float) -> float:
    """Limit thickness t/R below which an arch of ``n`` voussoirs collapses whose joints crush at ``strength``, in units
    of γ R: the root of `moment_reserve`. For 12 voussoirs 0.1402 (5), 0.1200 (10), 0.1119 (20), 0.1049 (infinite)."""
    from scipy.optimize import brentq

    return float(brentq(lambda ratio: moment_reserve(n, ratio, strength), 0.05, 0.5, xtol=1e-9))


def crushing_voussoir_thrust(span: float, thickness: float, unit_weight: float, strength: float) -> float:
    """Thrust (N) of a beam of two rigid halves whose joints crush at ``strength`` Pa; nan where it falls.

    Stress blocks of depth N/f at crown and abutments leave the arm z = T − N/f, and N z = w S²/8, so that
    N = f T/2 (1 − √(1 − w S²/(2 f T²))): the beam bears w ≤ 2 f T²/S².
    """
    used = unit_weight * thickness * span**2 / (2.0 * strength * thickness**2)
    return 0.5 * strength * thickness * (1.0 - math.sqrt(1.0 - used)) if used <= 1.0 else math.nan


def three_hinge_thrust(span: float, thickness: float, unit_weight: float) -> float:
    """Thrust (N) of a three-hinge beam of two rigid halves with hinges at the corners: w S²/(8 T), w = γ T."""
    return unit_weight * thickness * span**2 / (8.0 * thickness)


def voussoir_contact(span: float, thickness: float) -> float:
    """Fraction n of its end faces on which a beam of two elastic halves bears at the crown and the abutments: n =
    1/(0.22 S/T + 2.7).

    Fitted to finite elements by Sofianos (1996), "Analysis and design of an underground hard rock voussoir beam roof",
    International Journal of Rock Mechanics 33, 153-166, for values of 0.12 to 0.30; quoted in Brady & Brown (2004),
    "Rock mechanics for underground mining", eq. 8.15. Diederichs & Kaiser (1999), Int. J. Rock Mech. 36, 97-117, take n
    near 0.75, which minimises the largest stress but is not confirmed by any continuum analysis (ibid.).
    """
    return 1.0 / (0.22 * span / thickness + 2.7)


def voussoir_thrust(span: float, thickness: float, unit_weight: float, sag: float = 0.0) -> float:
    """Thrust (N) of that beam: w S²/(8 z), z = T (1 − 2 n/3) − ``sag`` (m), with triangular pressure at both ends of
    the arch."""
    arm = thickness * (1.0 - 2.0 / 3.0 * voussoir_contact(span, thickness)) - sag
    return unit_weight * thickness * span**2 / (8.0 * arm)


#: Sag at snap-through, relative to the initial lever arm: w ∝ z (z₀² − z²) is largest at z = z₀/√3 (Sofianos 1996;
#: Brady & Brown 2004, eqs. 8.37 and 8.38).
SNAP_THROUGH_SAG = 1.0 - 1.0 / math.sqrt(3.0)


def two_block_beam(
    span: float, thickness: float, unit_weight: float, compliance: np.ndarray, spring: float
) -> tuple[float, float]:
    """(thrust N, sag of the crown m) of a beam of two halves, each with the uniform strain caused by its own forces.

    Three-hinge statics on the deformed halves: mean stress σ̄ = (1/A) Σ sym(x ⊗ f) of the corner forces, plane
    compliance (3, 3) 1/Pa, and a ``spring`` N/m in each corner contact. Fixed-point iteration on the rotation of a
    half.
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
        # Distance between the faces of the abutment and of the other half, each displaced by the compression of its
        # spring.
        gap = half + 1.5 * thrust / spring
        across = b - a
        turn = math.acos(gap / math.hypot(*across)) - math.atan2(across[1], across[0])
        rise = math.hypot(*across) * math.sin(turn + math.atan2(across[1], across[0]))
        arm = -(math.cos(turn) * a[0] - math.sin(turn) * a[1])
        thrust = weight * arm / rise
    return thrust, thickness - rise
