"""Residual of the equations of a step, and unbalanced force ratio of its blocks."""

from __future__ import annotations

import numpy as np

from ..compiled import kept


@kept(fastmath=False, error_model="numpy", nogil=True)
def imbalance(own, contacts, unknowns, forces, acceleration, mass, loads, largest):
    """(residual, unbalanced force ratio).

    The residual is the largest residual of the equations of motion with the reported contact forces, over the largest
    force in them: round-off. The unbalanced force ratio of a block is |m a| over the sum of the magnitudes of its
    weight, loads and contact forces (for rotation, moments over √area); the largest of all blocks counts. It is 0 at
    rest, 1 in free flight.

    ``own`` (`BlockEquations`), ``contacts`` (`ContactMotion`) and ``unknowns`` (n, 6) are those of the solution;
    ``forces``: normal and shear (n_contacts,); ``acceleration`` (n_blocks, 6); ``mass`` (`BlockMass`); ``loads``
    (`BlockLoads`), all as plain tuples. ``largest`` N: of forces on the right-hand side that may cancel there.
    """
    matrix, right = own
    block, other, order, vectors = contacts
    density, moments, _ = mass
    gravity, load = loads
    normal_force, shear_force = forces
    n = right.shape[0]
    rest = np.empty((n, 6))
    size = np.zeros(n)
    scale = largest
    for i in range(n):
        for k in range(6):
            own = 0.0
            for m in range(6):
                own += matrix[i, k, m] * unknowns[i, m]
            rest[i, k] = right[i, k] - own
            scale = max(scale, abs(own), abs(right[i, k]))
    for c in range(block.shape[0]):
        force = np.sqrt(normal_force[c] * normal_force[c] + shear_force[c] * shear_force[c])
        if force == 0.0:
            continue
        for side in range(2):
            i = order[block[c]] if side == 0 else order[other[c]]
            if i < 0:
                continue
            size[i] += force
            for k in range(6):
                at = 6 * side + k
                push = normal_force[c] * vectors[c, 0, at] + shear_force[c] * vectors[c, 1, at]
                rest[i, k] += push
                scale = max(scale, abs(push))
    worst = 0.0
    for i in range(n):
        for k in range(6):
            worst = max(worst, abs(rest[i, k]))
    ratio = 0.0
    for b in range(order.shape[0]):
        i = order[b]
        if i < 0:
            continue
        area = moments[b, 0]
        own_mass = density[b] * area
        a, spin = acceleration[b], acceleration[b, 2]
        turning = density[b] * (moments[b, 3] + moments[b, 4]) * spin / np.sqrt(area)
        moving = max(own_mass * np.sqrt(a[0] * a[0] + a[1] * a[1]), abs(turning))
        pulled = size[i] + own_mass * np.sqrt(gravity[0] * gravity[0] + gravity[1] * gravity[1])
        pulled += np.sqrt(load[b, 0] * load[b, 0] + load[b, 1] * load[b, 1])
        if pulled > 0.0 and moving > ratio * pulled:
            ratio = moving / pulled
    return worst / scale if scale > 0.0 else 0.0, ratio
