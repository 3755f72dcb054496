"""Tractions that are functions of position, as piecewise polynomials on straight pieces of the boundary."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ..system.influence_matrix import ElementSet, line_forces, project_total

#: Degree of the polynomials. They interpolate at Gauss points, so force and moment are those of Gauss quadrature.
DEGREE = 6
#: Pieces are halved until the polynomial deviates from the function by less than this, relative to its largest value.
TOLERANCE = 1e-9
#: Largest number of halvings: a jump of the function is located to 2^−20 of an element.
_HALVINGS = 20
#: Number of pieces whose influence is in memory at one time.
_AT_ONCE = 100


@dataclass(frozen=True, eq=False)
class LineForces:
    """``start``, ``end`` (k, 2), m, and monomials (k, 2, DEGREE + 1) of the traction along and across, Pa."""

    start: np.ndarray
    end: np.ndarray
    density: np.ndarray

    @classmethod
    def join(cls, given: Sequence[LineForces | None]) -> LineForces | None:
        """The parts ``given`` as one; None if there are none."""
        parts = [part for part in given if part is not None]
        if not parts:
            return None
        return cls(*(np.concatenate([getattr(p, name) for p in parts]) for name in ("start", "end", "density")))

    def on(self, targets: ElementSet, on_boundary: bool, nu: float, tol: float) -> np.ndarray:
        """(n_unknowns,) traction at the collocation nodes of ``targets``; on the boundary, on its outer side."""
        out = np.zeros(targets.n_unknowns)
        if not len(out):
            return out
        for first in range(0, len(self.start), _AT_ONCE):
            part = slice(first, first + _AT_ONCE)
            unit = line_forces(targets, self.start[part], self.end[part], DEGREE, nu, tol, -1.0)
            out += unit.reshape(len(out), -1) @ self.density[part].ravel()
        if on_boundary:
            project_total(out, targets, self.start, self.end, self.density, nu, tol, -1.0)
        return out

    def resultants(self, about: np.ndarray) -> tuple[np.ndarray, float, float]:
        """(force (2,), moment, sum of the sizes of the forces), as `loads.resultants`."""
        x, w = np.polynomial.legendre.leggauss(DEGREE + 2)
        d = self.end - self.start
        c = 0.5 * np.hypot(*d.T)
        t = d / (2 * c)[:, None]
        local = self.density @ np.vander(x, DEGREE + 1, increasing=True).T
        value = local[:, 0, :, None] * t[:, None] + local[:, 1, :, None] * np.column_stack([-t[:, 1], t[:, 0]])[:, None]
        arm = 0.5 * (self.start + self.end)[:, None] + 0.5 * x[:, None] * d[:, None] - about
        weighted = w[None, :] * c[:, None]
        force = np.einsum("kq,kqc->c", weighted, value)
        moment = np.sum(weighted * (arm[..., 0] * value[..., 1] - arm[..., 1] * value[..., 0]))
        return force, float(moment), float(np.sum(weighted * np.hypot(value[..., 0], value[..., 1])))


def pieces(boundary: ElementSet, edge: int, segment: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
    """(k, 2), (k, 2) starts and ends of the parts of the boundary's elements on ``edge`` that lie on ``segment`` (2,
    2)."""
    here = np.flatnonzero(boundary.source == edge)
    start, end = boundary.start[here], boundary.end[here]
    if segment is None:
        return start, end
    a, d = segment[0], segment[1] - segment[0]
    s = np.stack([(start - a) @ d, (end - a) @ d]) / (d @ d)
    lo, hi = np.clip(s, 0.0, 1.0)
    # Uncut elements keep their coordinates exactly.
    new_start = np.where((lo == s[0])[:, None], start, a + lo[:, None] * d)
    new_end = np.where((hi == s[1])[:, None], end, a + hi[:, None] * d)
    keep = hi - lo > 1e-12
    return new_start[keep], new_end[keep]


def approximate(
    function: Callable[[np.ndarray], np.ndarray], start: np.ndarray, end: np.ndarray, name: str
) -> LineForces:
    """``function`` of points (n, 2) to tractions (n, 2), Pa, on straight pieces. Raises ValueError with ``name``."""
    x = np.polynomial.legendre.leggauss(DEGREE + 1)[0]
    between = np.concatenate([[-0.999], 0.5 * (x[1:] + x[:-1]), [0.999]])
    inverse = np.linalg.inv(np.vander(x, DEGREE + 1, increasing=True))
    guess = np.vander(between, DEGREE + 1, increasing=True) @ inverse

    def at(a: np.ndarray, b: np.ndarray, t: np.ndarray) -> np.ndarray:
        points = 0.5 * (a + b)[:, None] + 0.5 * t[:, None] * (b - a)[:, None]
        values = np.asarray(function(points.reshape(-1, 2)), dtype=float)
        if values.shape != (len(a) * len(t), 2):
            raise ValueError(f"{name}: the function returned shape {values.shape} for points ({len(a) * len(t)}, 2)")
        if not np.isfinite(values).all():
            raise ValueError(f"{name}: the function is not finite there")
        return values.reshape(len(a), len(t), 2)

    done: list[LineForces] = []
    scale, before = 0.0, None
    for level in range(_HALVINGS + 1):
        values = at(start, end, x)
        scale = max(scale, float(np.abs(values).max(initial=0.0)))
        off = np.abs(at(start, end, between) - np.einsum("ij,njc->nic", guess, values)).max(axis=(1, 2), initial=0.0)
        good = (off <= TOLERANCE * scale) | (level == _HALVINGS)
        if before is not None:
            # If neither half is better than the whole, the error is round-off of the coordinates.
            noise = (off.reshape(2, -1) > 0.5 * before).all(axis=0)
            good |= np.concatenate([noise, noise])
        t = (end - start)[good] / np.hypot(*(end - start)[good].T)[:, None]
        frame = np.stack([t, np.column_stack([-t[:, 1], t[:, 0]])], axis=1)
        done.append(LineForces(start[good], end[good], np.einsum("kj,njc,nic->nik", inverse, values[good], frame)))
        if good.all():
            break
        a, b, before = start[~good], end[~good], off[~good]
        midpoint = 0.5 * (a + b)
        start, end = np.concatenate([a, midpoint]), np.concatenate([midpoint, b])
    joined = LineForces.join([*done])
    assert joined is not None
    return joined
