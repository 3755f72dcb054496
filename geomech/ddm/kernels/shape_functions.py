"""Shape functions of crack and boundary elements: polynomials times the square root of a crack tip.

An element has, on its own coordinate t ∈ [−1, 1], the density

    N(t) = w(t) Σ_k c_k t^k,   k = 0 … p,

where the weight w is the behaviour at a crack tip (Crouch & Starfield 1983, §5.5, there with one term):

    ORDINARY    1
    TIP_START   √((1+t)/2)      D ~ √r at the start
    TIP_END     √((1−t)/2)      D ~ √r at the end
    TIP_BOTH    √(1−t²)         a crack of one element

Unknowns are the values at the p+1 collocation nodes; `to_monomials` turns them into the c_k that the kernels use. With
p = 2 and nodes "equal" these are the quadratic element of Crouch & Starfield and its three-term tip element.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from ...model.problem import HIGHEST_ORDER as MAX_ORDER

ORDINARY, TIP_START, TIP_END, TIP_BOTH = 0, 1, 2, 3

#: Terms of the moment tables: those of the far series of `full_plane` at its inner radius, plus twice the highest
#: order.
N_MOMENTS = 140


@lru_cache
def nodes(family: str, order: int) -> np.ndarray:
    """(p+1,) collocation nodes on (−1, 1), ascending: "chebyshev" (zeros of T), "gauss" (zeros of P) or "equal"
    (centres of p+1 equal sub-elements). Raises ValueError for another family or an order outside 0 … 12."""
    if not (isinstance(order, (int, np.integer)) and 0 <= order <= MAX_ORDER):
        raise ValueError(
            f"the order of an element must be an integer from 0 to {MAX_ORDER}, got {order!r} (beyond, round-off grows "
            "faster than the error falls: take more elements, or grade them)"
        )
    n = order + 1
    if family == "chebyshev":
        t = -np.cos((2 * np.arange(n) + 1) * np.pi / (2 * n))
    elif family == "gauss":
        t = np.polynomial.legendre.leggauss(n)[0]
    elif family == "equal":
        t = -1 + (2 * np.arange(n) + 1) / n
    else:
        raise ValueError(f'collocation nodes must be "chebyshev", "gauss" or "equal", got {family!r}')
    # Exact symmetry, so that mirrored bodies give mirrored results.
    return 0.5 * (t - t[::-1])


def weight(kind: int, t: np.ndarray) -> np.ndarray:
    """w(t) of an element ``kind``, t (...,) in [−1, 1]."""
    t = np.asarray(t, dtype=float)
    if kind == ORDINARY:
        return np.ones_like(t)
    if kind == TIP_START:
        return np.sqrt(0.5 * (1 + t))
    if kind == TIP_END:
        return np.sqrt(0.5 * (1 - t))
    return np.sqrt((1 - t) * (1 + t))


@lru_cache
def to_monomials(family: str, order: int, kind: int) -> np.ndarray:
    """(p+1, p+1) matrix from nodal values to the coefficients c_k."""
    t = nodes(family, order)
    return np.linalg.inv(np.vander(t, increasing=True)) / weight(kind, t)


def at(family: str, order: int, kind: int, t: np.ndarray) -> np.ndarray:
    """(n, p+1) nodal shape functions at ``t`` (n,)."""
    t = np.asarray(t, dtype=float)
    return weight(kind, t)[:, None] * np.vander(t, order + 1, increasing=True) @ to_monomials(family, order, kind)


@lru_cache
def leading(family: str, order: int, kind: int, at_end: bool) -> np.ndarray:
    """(p+1,) weights of the nodal values in the tip coefficient d·√L of D ≈ d √r, with L the length of the element."""
    sign = 1.0 if at_end else -1.0
    value = sign ** np.arange(order + 1) @ to_monomials(family, order, kind)
    # √(1−t²) → √(4 r/L) at either end, where the one-sided weights give √(r/L).
    return 2.0 * value if kind == TIP_BOTH else value


@lru_cache
def integrals(family: str, order: int, kind: int) -> np.ndarray:
    """(p+1,) ∫ N_j dt over [−1, 1]; times half the length, the integral of a nodal shape function."""
    return moments()[kind, : order + 1] @ to_monomials(family, order, kind)


@lru_cache
def moments() -> np.ndarray:
    """(4, N_MOMENTS): m_j = ∫ w t^j dt over [−1, 1], a row for every kind of element."""
    j = np.arange(N_MOMENTS)
    m = np.empty((4, N_MOMENTS))
    m[ORDINARY] = np.where(j % 2 == 0, 2.0 / (j + 1), 0.0)
    # Integrating the derivative of (1+t)^{3/2} t^j; the recurrence damps its own error.
    m[TIP_START, 0] = 4 / 3
    for k in range(1, N_MOMENTS):
        m[TIP_START, k] = (2 - k * m[TIP_START, k - 1]) / (k + 1.5)
    m[TIP_END] = (-1.0) ** j * m[TIP_START]
    m[TIP_BOTH] = 0.0
    m[TIP_BOTH, 0] = np.pi / 2
    for k in range(2, N_MOMENTS, 2):
        m[TIP_BOTH, k] = m[TIP_BOTH, k - 2] * (k - 1) / (k + 2)
    return m
