"""Fast multipole method for the contribution of a free surface to the influence of many elements on many others.

Points in the rock see the mirror images of the sources (`half_plane_images`) or, equivalently, their own images see the
sources: the series of `fast_multipole` are translated to clusters of the targets' mirror images m = conj z, and only
their evaluation differs. With φ' = −Φ/2 and ψ' = Ψ + ½ conj(z₀) Φ' for Ψ about z₀,

    conj φ₁' = K = ½ Φ + ½ (m − conj z₀) Φ' − Ψ,   conj φ₁'' = K',   conj φ̄₀' = −½ Φ.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..system.influence_matrix import ElementSet, image_influence
from .fast_multipole import Compressed, _leaf_of, _powers


class Mirrored(Compressed):
    """Contribution of the half-plane's surface to the influence of ``sources`` on ``targets``; otherwise as
    `Compressed`."""

    def __init__(self, targets: ElementSet, sources: ElementSet, nu: float, tol: float, error: float = 1e-10):
        self._whole_targets, self._whole_sources = targets, sources
        rock = targets.half_plane
        assert rock is not None
        self._rock_targets, below = (
            replace(s, start=rock.frame(s.start), end=rock.frame(s.end), half_plane=None) for s in (targets, sources)
        )
        flip = np.array([1.0, -1.0])
        above = replace(self._rock_targets, start=self._rock_targets.start * flip, end=self._rock_targets.end * flip)
        # The second derivative and its arm need more powers than tractions in the infinite plane.
        super().__init__(above, below, nu, tol, 0.01 * error)

    def _near(self, rows: np.ndarray, columns: np.ndarray, nu: float, tol: float) -> np.ndarray:
        return image_influence(self._whole_targets.take(rows), self._whole_sources.take(columns), nu, tol)

    def _incoming(self) -> np.ndarray:
        """(n, 2(p+1), 4P) real: tractions at the nodes, in the rock, from the leaf's series of Φ and Ψ about their
        images."""
        n, tree, rock = self.terms, self.target_tree, self._rock_targets
        leaf = _leaf_of(tree)
        radius, centre = tree.radius[leaf][:, None], tree.centre[leaf][:, None]
        image = self.targets.nodes @ np.array([1.0, 1j])
        value = _powers((image - centre) / radius, n)
        degree = np.arange(1, n)
        slope, bend = np.zeros_like(value), np.zeros_like(value)
        slope[..., 1:] = value[..., :-1] * degree / radius[..., None]
        bend[..., 2:] = value[..., :-2] * (degree[1:] * degree[:-1]) / radius[..., None] ** 2
        arm = 0.5 * (image - np.conj(centre))[..., None]
        # K and K' from the coefficients of Φ, then of Ψ.
        first = np.concatenate([0.5 * value + arm * slope, -value], axis=2)
        second = np.concatenate([slope + arm * bend, -slope], axis=2)
        own = np.concatenate([0.5 * value, np.zeros_like(value)], axis=2)
        turn = np.conj(rock.tangent @ np.array([1.0, 1j]))[:, None, None] ** 2
        height = rock.nodes[..., 1][..., None]
        along = turn * (2j * height * second - first + own)
        across = along + 2 * first
        parts = [[-along.imag, -along.real], [across.real, -across.imag]]
        return np.ascontiguousarray(
            np.concatenate([np.concatenate(part, axis=2) for part in parts], axis=1)[tree.order]
        )


class BelowSurface:
    """Influence of ``elements`` on themselves in their half-plane, as an operator (see `Compressed`)."""

    def __init__(self, elements: ElementSet, nu: float, tol: float):
        self.targets = elements
        self._plane = Compressed(replace(elements, half_plane=None), replace(elements, half_plane=None), nu, tol)
        self._added = Mirrored(elements, elements, nu, tol)
        self.shape = self._plane.shape

    def __matmul__(self, x: np.ndarray) -> np.ndarray:
        return self._plane @ x + self._added @ x

    def transposed_times(self, y: np.ndarray) -> np.ndarray:
        """The transposed operator on ``y`` (n,)."""
        return self._plane.transposed_times(y) + self._added.transposed_times(y)
