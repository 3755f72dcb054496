"""Straight cracks by distributed dislocations: a method independent of the crack solver.

A crack is an unknown density a(t) of edge dislocations, each of which has Muskhelishvili's potentials

    Φ = a/(z − t),   Ψ = ā/(z − t) + a t̄/(z − t)²          (Muskhelishvili 1953; Erdogan, Gupta & Cook 1973)

plus images that make a straight or a circular boundary free of traction. Tractions on the faces are collocated half-way
between the quadrature points (Erdogan & Gupta 1972), which are Gauss–Chebyshev points on an arm that ends in two tips.
An arm that begins at a corner, a junction or a boundary is parametrised by the power `GRADING` of the same variable,
which makes the weak singularity there smooth; the error then decreases as n^(−2·GRADING) or faster. The method has
neither unknowns, nor shape functions, nor quadrature in common with displacement discontinuity elements. It is slow but
converges to ten digits.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

#: Exponent of the grading of points towards the start of an arm that is not a tip.
GRADING = 4


@dataclass(frozen=True)
class Arm:
    """A straight piece of crack from ``start`` to ``end`` (complex). ``end`` is a tip; ``start`` is a tip, a junction
    or a mouth. Arms of one ``crack`` form one crack, which is ``open`` if it has a mouth."""

    start: complex
    end: complex
    start_is_tip: bool = True
    crack: int = 0
    open: bool = False

    @property
    def grading(self) -> int:
        return 1 if self.start_is_tip else GRADING

    def at(self, theta: np.ndarray) -> np.ndarray:
        return self.start + (self.end - self.start) * np.sin(theta / 2) ** (2 * self.grading)


def _plane(z, t, a):
    d = 1 / (z - t)
    return a * d, -a * d**2, np.conj(a) * d + a * np.conj(t) * d**2


def _half_plane(z, t, a):
    """Below the free line y = 0."""
    phi, dphi, psi = _plane(z, t, a)
    b, d = np.conj(a), 1 / (z - np.conj(t))
    image = -((a + b) * d + b * (t - z) * d**2)
    d_image = (a + 2 * b) * d**2 + 2 * b * (t - z) * d**3
    return phi + image, dphi + d_image, psi - image - b * d - z * d_image


def _hole(z, t, a):
    """Outside the traction-free circle |z| = 1, which contains the opposite dislocation, so that the sum is zero."""
    phi, dphi, psi = _plane(z, t, a)
    b, s = np.conj(a), np.conj(t)
    e = 1 / (1 - s * z)
    g = e * z
    image = -b * g * (1 + e) + a * e / z + b * t * e**2
    d_image = -b * (e**2 * (1 + e) + g * s * e**2) + a * (s * e**2 / z - e / z**2) + 2 * b * t * s * e**3
    far = b / s
    rest = (image - far - np.conj(far) + b * g - z * d_image) / z**2
    return phi + image - far - a / z, dphi + d_image + a / z**2, psi + rest - b / z - 2 * a / z**3


def _disc(z, t, a):
    """Inside the traction-free circle |z| = 1."""
    phi, dphi, psi = _plane(z, t, a)
    b, s = np.conj(a), np.conj(t)
    e = 1 / (1 - s * z)
    g = e * z
    image = -b * g * (1 + e) + a * s * e + b * t * e**2
    d_image = -b * (e**2 * (1 + e) + g * s * e**2) + a * s**2 * e**2 + 2 * b * t * s * e**3
    weighted = a * s + b * t
    rest = (image - weighted + b * g - z * d_image - b * z) / z**2
    return phi + image - weighted / 2, dphi + d_image, psi + rest


def stack(period: float):
    """The plane with everything repeated every ``period`` in y."""

    def potentials(z, t, a):
        q = np.pi / period
        one, two = q / np.tanh(q * (z - t)), (q / np.sinh(q * (z - t))) ** 2
        # z̄Φ' + Ψ summed over the images, minus the z̄Φ' that is added to Ψ where they are used.
        return a * one, -a * two, np.conj(a) * one + a * one - 2 * a * (z - t).real * two + np.conj(z) * a * two

    return potentials


DOMAINS = {"plane": _plane, "half-plane": _half_plane, "hole": _hole, "disc": _disc}


def stress_intensity(arms: list[Arm], stress, domain="plane", n: int = 65) -> np.ndarray:
    """(n_tips, 2) K_I, K_II at the ends of all ``arms``, each preceded by those at its start if that is a tip.

    ``stress(points (m, 2)) → (m, 3)`` is the field without cracks. ``domain``: a key of `DOMAINS` ("half-plane": y < 0,
    "hole": |z| > 1, "disc": the disc |z| < 1) or a function of (z, t, a) that returns Φ, Φ', Ψ. ``n``, odd: number of
    points per arm.
    """
    potentials = DOMAINS[domain] if isinstance(domain, str) else domain
    theta = (np.arange(n) + 0.5) * np.pi / n
    between = np.arange(1, n) * np.pi / n
    t = np.concatenate([arm.at(theta) for arm in arms])
    z = np.concatenate([arm.at(between) for arm in arms])
    way = np.array([(arm.end - arm.start) / abs(arm.end - arm.start) for arm in arms])
    turn = np.repeat(way, n - 1)
    columns = []
    for a in (1.0, 1j):
        phi, dphi, psi = potentials(z[:, None], t[None, :], a)
        columns.append(2 * phi.real + turn[:, None] ** 2 * (np.conj(z)[:, None] * dphi + psi))
    s = stress(np.column_stack([z.real, z.imag]))
    xx, yy, xy = s.T
    right = -((xx + yy) / 2 + turn**2 * ((yy - xx) / 2 + 1j * xy))
    rows = [np.hstack([part.real for part in columns]), np.hstack([part.imag for part in columns])]
    sides = [right.real, right.imag]
    m = len(t)
    extra = []
    crack = np.array([arm.crack for arm in arms])
    for k in np.unique(crack):
        here = np.flatnonzero(crack == k)
        if not arms[here[0]].open:
            # The crack closes at both ends: the net dislocation is zero.
            extra.append(np.repeat(crack == k, n).astype(float))
        # An arm has one more point than equations; after closure, the remaining density vanishes at junctions and
        # mouths.
        for arm in here if arms[here[0]].open else here[1:]:
            unit = np.zeros(m)
            unit[arm * n] = 1.0
            extra.append(unit)
    for line in extra:
        rows += [np.r_[line, 0 * line][None], np.r_[0 * line, line][None]]
        sides += [np.zeros(1), np.zeros(1)]
    x = np.linalg.solve(np.vstack(rows) * np.pi / n, np.concatenate(sides))
    density = (x[:m] + 1j * x[m:]).reshape(len(arms), n)
    modes = np.cos(np.outer(np.arange(n), theta))
    modes[1:] *= 2
    out = []
    for arm, h, direction in zip(arms, density, way):
        size = 2 * np.pi * np.sqrt(2 * np.pi) / np.sqrt(abs(arm.end - arm.start) * arm.grading)
        signs = (-1.0) ** np.arange(n)
        if arm.start_is_tip:
            out.append(-size * (modes @ h).mean() / direction)
        out.append(size * (signs @ modes @ h) / n / direction)
    k = np.array(out)
    return np.column_stack([k.real, -k.imag])
