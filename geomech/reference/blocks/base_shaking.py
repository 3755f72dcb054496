"""Rigid blocks on a shaken base: Newmark's (1965) sliding block and Housner's (1963) rocking block.

SI units, angles rad; base accelerations are those of the ground, horizontal, positive in x.
"""

from __future__ import annotations

import math

import numpy as np


def sliding_block(
    times: np.ndarray, base: np.ndarray, incline: float, friction_angle: float, gravity: float = 9.81
) -> np.ndarray:
    """(n,) displacement (m) of a block relative to its plane, positive down the plane, at ``times`` (n,) s.

    The ground accelerates by ``base`` (n,) m/s², linear between the times and positive towards the uphill side of a
    plane of ``incline``, so that positive values throw the block downhill. Newmark (1965), "Effects of earthquakes on
    dams and embankments", Géotechnique 15, 139-160: ẍ = T − sign(ẋ) N tan φ with T = g sin α + a cos α and N = g cos α
    − a sin α per unit of mass; at rest it sticks while |T| ≤ N tan φ. Uphill slip is included. Between two times, T
    and N are linear, so every stop and start is a root of a polynomial: the solution is exact to round-off.
    """
    slope = math.tan(friction_angle)
    pull = gravity * math.sin(incline) + np.asarray(base, dtype=float) * math.cos(incline)
    hold = slope * np.maximum(0.0, gravity * math.cos(incline) - np.asarray(base, dtype=float) * math.sin(incline))
    place, speed, sense = 0.0, 0.0, 0
    out = np.zeros(len(times))
    for k in range(len(times) - 1):
        span = float(times[k + 1] - times[k])
        at = 0.0
        rate = ((pull[k + 1] - pull[k]) / span, (hold[k + 1] - hold[k]) / span)
        while at < span:
            t0, h0 = pull[k] + rate[0] * at, hold[k] + rate[1] * at
            if sense == 0:
                start = None
                for sign in (1, -1):
                    # sign T − N tan φ, linear: zero now or later.
                    excess, growth = sign * t0 - h0, sign * rate[0] - rate[1]
                    if excess > 0 or (excess == 0 and growth > 0):
                        start = (at, sign)
                        break
                    if growth > 0:
                        when = at - excess / growth
                        if when < span and (start is None or when < start[0]):
                            start = (when, sign)
                if start is None:
                    break
                at, sense = start
                continue
            a0, a1 = t0 - sense * h0, rate[0] - sense * rate[1]
            left = span - at
            # Stops where v + a₀ τ + a₁ τ²/2 is zero again.
            stops = [
                float(r.real)
                for r in np.roots([0.5 * a1, a0, speed] if a1 else [a0, speed])
                if abs(r.imag) < 1e-12 and 1e-12 * max(span, 1.0) < r.real < left
            ]
            tau = min(stops, default=left)
            place += speed * tau + 0.5 * a0 * tau**2 + a1 * tau**3 / 6.0
            speed += a0 * tau + 0.5 * a1 * tau**2
            at += tau
            if stops:
                speed, sense = 0.0, 0
        out[k + 1] = place
    return out


def rocking_parameter(half_diagonal: float, gravity: float = 9.81) -> float:
    """p = √(3g/4R), rad/s, of a rectangular block: θ̈ = −p² sin(α − θ) about a corner (Housner 1963)."""
    return math.sqrt(0.75 * gravity / half_diagonal)


def rocking_period(amplitude: float, slenderness: float, half_diagonal: float, gravity: float = 9.81) -> float:
    """Period (s) of free rocking of ``amplitude`` θ₀ < α, no loss at impact; ``slenderness`` α, tan α = b/h.

    Four times the time from θ₀ to 0 by energy, ∫ dθ / √(2p² [cos(α−θ) − cos(α−θ₀)]); for slender blocks it is Housner's
    (1963, "The behavior of inverted pendulum structures during earthquakes", Bulletin of the Seismological Society of
    America 53, 403-417, eq. 4) T = (4/p) arcosh 1/(1 − θ₀/α). Substitution θ = θ₀(1 − s²), Gauss–Legendre.
    """
    nodes, weights = np.polynomial.legendre.leggauss(60)
    s = 0.5 * (nodes + 1.0)
    theta = amplitude * (1.0 - s**2)
    # cos A − cos B as a product, exact near the turning point.
    fall = 2.0 * np.sin(slenderness - 0.5 * (theta + amplitude)) * np.sin(0.5 * (amplitude - theta))
    p = rocking_parameter(half_diagonal, gravity)
    quarter = np.sum(0.5 * weights * 2.0 * amplitude * s / np.sqrt(2.0 * p**2 * fall))
    return 4.0 * float(quarter)


def housner_period(amplitude: float, slenderness: float, half_diagonal: float, gravity: float = 9.81) -> float:
    """Housner's (1963, eq. 4) period for slender blocks: (4/p) arcosh 1/(1 − θ₀/α)."""
    return 4.0 / rocking_parameter(half_diagonal, gravity) * math.acosh(1.0 / (1.0 - amplitude / slenderness))


def rocking_restitution(slenderness: float) -> float:
    """Angular velocity after an impact over that before: 1 − (3/2) sin²α.

    Angular momentum about the landing corner is conserved and the other corner lifts off (Housner 1963, eq. 9, whose r
    is the square).
    """
    return 1.0 - 1.5 * math.sin(slenderness) ** 2


def uplift_acceleration(slenderness: float, gravity: float = 9.81) -> float:
    """g tan α, m/s²: the least horizontal acceleration that lifts a corner (Milne & Omori 1893; Housner
    1963)."""
    return gravity * math.tan(slenderness)


def overturning_pulse(duration: float, slenderness: float, half_diagonal: float, gravity: float = 9.81) -> float:
    """Smallest constant acceleration (m/s²) of the base that overturns a slender block if it lasts for ``duration`` s
    and then stops.

    Housner (1963, eq. 13): cosh(p t₁) = 1 + ½ /[(a/gα)(a/gα − 1)], from θ̈ = p²(θ − α + a/g) and then the energy needed
    to pass the upright position; linear in the angles. ``duration`` → ∞: g α.
    """
    p = rocking_parameter(half_diagonal, gravity)
    product = 0.5 / (math.cosh(p * duration) - 1.0)
    return gravity * slenderness * 0.5 * (1.0 + math.sqrt(1.0 + 4.0 * product))


def rocking(
    times: np.ndarray,
    base: np.ndarray,
    slenderness: float,
    half_diagonal: float,
    gravity: float = 9.81,
    start: float = 0.0,
    restitution: float | None = None,
) -> np.ndarray:
    """(n,) tilt θ (rad, positive towards −x, counter-clockwise) of a rocking block on a base accelerated by ``base``
    (n,) m/s².

    θ̈ = −p² [s sin(α − |θ|) − (a/g) cos(α − |θ|)] about the corner of side s = sign θ, θ̇ multiplied by ``restitution``
    (None: `rocking_restitution`) at each impact (Housner 1963; Yim, Chopra & Penzien 1980, Earthquake Engineering and
    Structural Dynamics 8, 565-587). Runge–Kutta of fourth order between the times, impacts at a root of a cubic.
    """
    p2 = rocking_parameter(half_diagonal, gravity) ** 2
    bounce = rocking_restitution(slenderness) if restitution is None else restitution
    theta, omega = start, 0.0
    side = math.copysign(1.0, start) if start else 0.0
    out = np.full(len(times), start, dtype=float)

    def acceleration(angle: float, sign: float, shake: float) -> float:
        lean = slenderness - sign * angle
        return -p2 * (sign * math.sin(lean) - shake / gravity * math.cos(lean))

    for k in range(len(times) - 1):
        left, a0 = float(times[k + 1] - times[k]), float(base[k])
        rate = (float(base[k + 1]) - a0) / left
        while left > 0:
            if side == 0.0:
                side = math.copysign(1.0, a0 + rate * left)
                if acceleration(0.0, side, a0 + rate * left) * side <= 0:
                    side = 0.0
                    break
            h = left
            for _ in range(2):
                mid, end = a0 + 0.5 * rate * h, a0 + rate * h
                k1 = acceleration(theta, side, a0)
                k2 = acceleration(theta + 0.5 * h * omega, side, mid)
                k3 = acceleration(theta + 0.5 * h * (omega + 0.5 * h * k1), side, mid)
                k4 = acceleration(theta + h * (omega + 0.5 * h * k2), side, end)
                after = theta + h * omega + h * h / 6.0 * (k1 + k2 + k3)
                speed = omega + h / 6.0 * (k1 + 2 * k2 + 2 * k3 + k4)
                if side * after >= 0 or h < left:
                    break
                # Impact inside: the cubic through both ends' angles and rates.
                low, high = 0.0, 1.0
                for _ in range(60):
                    s = 0.5 * (low + high)
                    value = (
                        (1 + 2 * s) * (1 - s) ** 2 * theta
                        + s * (1 - s) ** 2 * h * omega
                        + s * s * (3 - 2 * s) * after
                        + s * s * (s - 1) * h * speed
                    )
                    low, high = (s, high) if side * value > 0 else (low, s)
                h = max(high, 1e-9) * h
            theta, omega = after, speed
            if h < left or side * theta < 0:
                theta, side, omega = 0.0, -side, bounce * omega
                if abs(omega) < 1e-9:
                    omega, side = 0.0, 0.0
            a0 += rate * h
            left -= h
        out[k + 1] = theta
    return out
