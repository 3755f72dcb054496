"""Pressure on a joint face with given resultant and moment, and without tension.

A resultant in the middle third of the face is a linear pressure on the whole length. Closer to an end, a linear
pressure would be tensile at the other end; the pressure is then a triangle on part of the length (no-tension rule),

    reach = 3 × distance of the resultant from the end,

given as the weighted sum of two triangles of fixed lengths, so that a body meets only a few different loads. At the
very end the pressure becomes a force at that end. All transitions are continuous; a jump could leave blocks and cracks
without a consistent state.
"""

from __future__ import annotations

from .piecewise_traction import jit

#: Triangles have lengths of 1/n, 2/n … of the face.
TRIANGLES = 8

#: A piece without length.
NOTHING = (0.0, 0.0, 0.0, 0.0)


@jit
def no_pull(length, force, moment):
    """Two pieces (start, end, p_start, p_end) of a linear pressure on [0, length], which add up (one may be empty), and
    forces at the start and the end, with resultant ``force`` and ``moment`` about 0.

    Nothing is tensile if the force is positive and its line of action meets the face. A resultant outside the face
    cannot be balanced without tension; the pressure then stays linear, since force and moment come first.
    """
    arm = moment / force if force > 0 else -1.0
    if 0 <= arm < length / 3:
        near, peak, far, high, lone = _near_end(length, force, arm)
        return ((0.0, near, peak, 0.0), (0.0, far, high, 0.0)), lone, 0.0
    if 0 <= length - arm < length / 3:
        near, peak, far, high, lone = _near_end(length, force, length - arm)
        return ((length - near, length, 0.0, peak), (length - far, length, 0.0, high)), 0.0, lone
    return (linear(length, force, moment), NOTHING), 0.0, 0.0


@jit
def linear(length, force, moment):
    """The pressure linear on [0, length] with resultant ``force`` and ``moment`` about 0."""
    return 0.0, length, (4 * force * length - 6 * moment) / length**2, (6 * moment - 2 * force * length) / length**2


@jit
def _near_end(length, force, arm):
    """Reach and peak of the two triangles at the near end whose resultant is at ``arm`` from it, and the force at that
    end."""
    # The resultant of a triangle is at a third of its reach from its peak.
    place = 3 * arm / length * TRIANGLES
    below = min(int(place), TRIANGLES - 1)
    more = place - below
    near, far = length * below / TRIANGLES, length * (below + 1) / TRIANGLES
    high = 2 * more * force / far
    if below == 0:
        return 0.0, 0.0, far, high, (1 - more) * force
    return near, 2 * (1 - more) * force / near, far, high, 0.0
