"""Stress and displacement around a crack: Westergaard's full field, Williams' tip field, and a circular arc crack."""

from __future__ import annotations

import numpy as np


def griffith_field(
    points: np.ndarray, half_length: float, remote: np.ndarray, shear_modulus: float, poissons_ratio: float
) -> tuple[np.ndarray, np.ndarray]:
    """(n, 3) stress and (n, 2) displacement around an open crack |x| < a, y = 0 in a ``remote`` stress (Westergaard
    1939; Muskhelishvili's potentials for the field parallel to the crack, which Westergaard's lack, Sih 1966). Plane
    strain.

    With T = σ_yy − iσ_xy of the remote field, the crack adds Φ = T (z/√(z²−a²) − 1)/2, and the same with the conjugate
    of T to Ω. Its displacement vanishes at infinity, that of the uniform strain at the origin. On the crack: values of
    the upper face.
    """
    points = np.asarray(points, dtype=float)
    z = points[:, 0] + 1j * points[:, 1]
    # On the crack itself, including y = −0, the root is that of the upper side.
    z[points[:, 1] == 0] = points[points[:, 1] == 0, 0]
    xx, yy, xy = np.asarray(remote, dtype=float)
    a, t = half_length, yy - 1j * xy
    with np.errstate(divide="ignore", invalid="ignore"):
        root = np.sqrt(z - a) * np.sqrt(z + a)
        # Contribution of the crack: Φ = Ω = T (z/√ − 1)/2, its integral φ = ω = T (√ − z)/2.
        phi = 0.5 * t * (z / root - 1)
        d_phi = -0.5 * t * a**2 / root**3
        omega = 0.5 * t * np.conj(z / root - 1)
    # σ_xx + σ_yy = 4 Re Φ;  σ_yy − iσ_xy = Φ(z) + Ω(z̄) + (z − z̄) conj Φ'(z).
    pulled = phi + omega + (z - np.conj(z)) * np.conj(d_phi)
    total = 4 * phi.real
    stress = np.column_stack([xx + total - pulled.real, yy + pulled.real, xy - pulled.imag])
    kappa = 3 - 4 * poissons_ratio
    moved = 0.5 * t * (root - z)
    moved_back = 0.5 * t * np.conj(root - z)
    # 2μ(u + iv) = κφ(z) − ω(z̄) − (z − z̄) conj Φ(z).
    crack = (kappa * moved - moved_back - (z - np.conj(z)) * np.conj(phi)) / (2 * shear_modulus)
    nu = poissons_ratio
    strain = np.array([(1 - nu) * xx - nu * yy, (1 - nu) * yy - nu * xx, 2 * xy]) / (2 * shear_modulus)
    x, y = points.T
    u = crack.real + strain[0] * x + 0.5 * strain[2] * y
    v = crack.imag + strain[1] * y + 0.5 * strain[2] * x
    return stress, np.column_stack([u, v])


def tip_stress(r: np.ndarray, angle: np.ndarray, k_i: float, k_ii: float) -> np.ndarray:
    """(n, 3) singular stress at distance ``r`` and ``angle`` (rad) from the crack's own direction, in the crack's frame
    (Williams 1957; Irwin 1957)."""
    r, q = np.asarray(r, dtype=float), np.asarray(angle, dtype=float)
    c, s, c3, s3 = np.cos(q / 2), np.sin(q / 2), np.cos(1.5 * q), np.sin(1.5 * q)
    size = 1 / np.sqrt(2 * np.pi * r)
    return np.column_stack(
        [
            size * (k_i * c * (1 - s * s3) - k_ii * s * (2 + c * c3)),
            size * (k_i * c * (1 + s * s3) + k_ii * s * c * c3),
            size * (k_i * s * c * c3 + k_ii * c * (1 - s * s3)),
        ]
    )


def arc_field(
    points: np.ndarray, tension: float, half_angle: float, shear_modulus: float, poissons_ratio: float
) -> tuple[np.ndarray, np.ndarray]:
    """(n, 3) stress and (n, 2) displacement around an open crack along the unit circle, ``half_angle`` (rad) to either
    side of the y axis, in equal biaxial ``tension`` (Muskhelishvili 1953, §124). Plane strain; not for points on the
    crack or at the centre.

    With X = √((z − a)(z − b)), cut along the arc between its ends a and b, and m = (a + b)/2: Φ + Ω = d (z − m)/X and Φ
    − Ω = T − d, where Ω(z) = conj Φ(1/z̄) − … replaces Ψ. The condition that Ψ is finite at the centre of the circle
    gives d = 2T/(3 − cos α). Displacements are those of the whole field, without rotation at infinity.
    """
    points = np.asarray(points, dtype=float)
    z = points[:, 0] + 1j * points[:, 1]
    a, b = 1j * np.exp(-1j * half_angle), 1j * np.exp(1j * half_angle)
    midpoint, d = 0.5 * (a + b), 2 * tension / (3 - np.cos(half_angle))
    # (z − a)/(z − b) has the same argument along the whole arc: the cut of the root is rotated onto it.
    cut = -(1j - a) / (1j - b)

    def root(w: np.ndarray) -> np.ndarray:
        return (w - b) * np.sqrt((w - a) / (w - b) / cut) / np.sqrt(1 / cut)

    x, mirrored = root(z), 1 / np.conj(z)
    phi, omega_mirrored = 0.5 * (d * x + (tension - d) * z), 0.5 * (d * root(mirrored) - (tension - d) * mirrored)
    big_phi = 0.5 * (d * (z - midpoint) / x + tension - d)
    d_big_phi = 0.5 * d * (1 / x - (z - midpoint) ** 2 / x**3)
    # Ψ = (Φ − zΦ' − conj Ω(1/z̄))/z²;  2μ(u + iv) = κφ − ω(1/z̄) − (z − 1/z̄) conj Φ.
    big_omega = 0.5 * (d * (mirrored - midpoint) / root(mirrored) - tension + d)
    big_psi = (big_phi - z * d_big_phi - np.conj(big_omega)) / z**2
    total, deviator = 4 * big_phi.real, 2 * (np.conj(z) * d_big_phi + big_psi)
    stress = np.column_stack([0.5 * (total - deviator.real), 0.5 * (total + deviator.real), 0.5 * deviator.imag])
    kappa = 3 - 4 * poissons_ratio
    u = (kappa * phi - omega_mirrored - (z - mirrored) * np.conj(big_phi)) / (2 * shear_modulus)
    return stress, np.column_stack([u.real, u.imag])
