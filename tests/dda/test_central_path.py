"""Where the central path of a step's contacts begins."""

from __future__ import annotations

import numpy as np
import pytest

from geomech.dda.central_path import CentralPath

STIFFNESS, FRICTION = 4e11, 0.7


def centred(gap: np.ndarray, sheared: np.ndarray, epsilon: float) -> CentralPath:
    """A path centred on contacts (n,) of this gap and stretch of the shear spring (m), where all products are ``epsilon`` J."""
    path, n = object.__new__(CentralPath), len(gap)
    path._g, path._s, path._kn, path._ks = gap, sheared, np.full(n, STIFFNESS), np.full(n, STIFFNESS)
    path._mu, path._base, path._rough = np.full(n, FRICTION), np.zeros(n), np.ones(n, bool)
    with np.errstate(all="raise"):
        path._centre(np.full(n, epsilon))
    return path


@pytest.mark.parametrize("epsilon", [1e-2, 1e-12, 1e-22])
def test_the_start_is_central_however_far_off_a_contact_is(epsilon):
    # Far apart or deep inside, w and N/kₙ differ by all digits there are; sheared far, S is its strength to the last one.
    far = np.array([-1e-1, -1e-6, -1e-13, 0.0, 1e-13, 1e-6, 1e-1])
    gap, sheared = (grid.ravel() for grid in np.meshgrid(far, far))
    path = centred(gap, sheared, epsilon)
    assert (path._normal > 0).all() and (path._width > 0).all() and (path._slip > 0).all()
    assert path._normal * path._width == pytest.approx(epsilon, rel=1e-12)
    assert path._width - path._normal / STIFFNESS == pytest.approx(gap, rel=1e-9, abs=1e-16)
    assert (np.abs(path._shear) <= FRICTION * path._normal).all()
